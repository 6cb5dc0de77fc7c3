//! Segmentation and compensation on a rig with every imperfection, and the gain of each measuring stage: without the stage, the result
//! is worse.
//!
//! The rig is that of `assets/rigs/realistic.toml`; the scenes are zigzag and the 90° corner, at 64x64 pixels.

use crate::rig_support::{self, Stage, known, realistic, target};
use krylux::analysis::plan::{Planner, Twin};
use krylux::analysis::{CompensateOptions, SegmentOptions};
use krylux::image::Resolution;
use krylux::measure::MeasureOptions;
use krylux::operator::Operator;
use krylux::rig::{VirtualRig, VirtualScene};
use krylux::sparse::Csr;
use krylux::transport::{ExplicitMatrix, Part};

/// The seeds of the noise, which differ from the seed of calibration.
const SEEDS: [u64; 3] = [101, 102, 103];

/// The segmentation of the tests on zigzag.
fn two_groups() -> SegmentOptions {
    let resolution = Some(Resolution::new(rig_support::SIDE, rig_support::SIDE));
    SegmentOptions { photos: 40, groups: vec![2], eigenvectors: 4, resolution, ..SegmentOptions::default() }
}

/// The adjusted Rand index against the true labels, and the number of patterns shown.
fn segmented(
    stage: &Stage,
    rig: &VirtualRig,
    measurement: &MeasureOptions,
    part: Part,
    seed: u64,
) -> (f64, u64) {
    let planner = stage.planner(rig, measurement);
    let ideal = planner.ideal_segmentation(part, &two_groups()).expect("a symmetric matrix with light in it");
    let trial = planner.segmentation(part, &two_groups(), &ideal, Some(&stage.labels), seed);
    let trial = trial.expect("no frame is lost");
    (trial.truth[0].1, trial.cost.patterns)
}

/// The share by which the residual of the compensation exceeds that of the optimum.
fn compensated(stage: &Stage, rig: &VirtualRig, measurement: &MeasureOptions, seed: u64) -> f64 {
    let options = CompensateOptions { photos: 20, ..CompensateOptions::default() };
    let planner = stage.planner(rig, measurement);
    let ideal = planner.ideal_compensation(&target(), &options).expect("a target of the right size");
    planner.compensation(&ideal, &options, seed).expect("no frame is lost").excess
}

#[test]
fn zigzag_is_segmented_within_100_patterns_with_every_imperfection_on() {
    let stage = realistic("zigzag");
    for seed in SEEDS {
        let (score, patterns) = segmented(stage, &stage.rig, &stage.measurement, Part::Global, seed);
        println!("seed {seed}: adjusted Rand index {score:.4}, {patterns} patterns");
        assert!(score >= 0.98, "seed {seed}: {score}");
        assert!(patterns <= 100, "seed {seed}: {patterns} patterns");
    }
}

#[test]
fn the_corner_is_compensated_within_a_tenth_of_the_optimum_with_every_imperfection_on() {
    let stage = realistic("corner");
    for seed in SEEDS {
        let excess = compensated(stage, &stage.rig, &stage.measurement, seed);
        println!("seed {seed}: residual {:+.1} % above the optimum's", 100.0 * excess);
        assert!(excess <= 0.10, "seed {seed}: {excess}");
    }
}

/// The product of a part's operator, measured with the rig, and a smooth signed vector.
fn product(stage: &Stage, rig: &VirtualRig, measurement: &MeasureOptions, part: Part, seed: u64) -> Vec<f64> {
    let calibration = known(rig);
    let planner = Planner { calibration: &calibration, ..stage.planner(rig, measurement) };
    let mut rig = planner.measure(seed).expect("it fits its scene");
    let mut y = vec![0.0; rig_support::SIDE * rig_support::SIDE];
    rig.operator(part, 0).apply(&waves(), &mut y).expect("no frame is lost");
    y
}

/// A vector with three waves along x and two along y: signed and smooth, like the eigenvectors of scenes.
fn waves() -> Vec<f64> {
    let side = rig_support::SIDE;
    let turn = |at: usize, waves: f64| std::f64::consts::TAU * waves * at as f64 / side as f64;
    (0..side * side)
        .map(|pixel| turn(pixel % side, 3.0).sin() + turn(pixel / side, 2.0).cos() - 0.3)
        .collect()
}

/// The relative error `min_s ‖y − s t‖ / ‖y‖` of `y` against the truth `t`, which does not depend on their units.
fn error(y: &[f64], truth: &[f64]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    (1.0 - dot(y, truth).powi(2) / (dot(y, y) * dot(truth, truth))).max(0.0).sqrt()
}

/// The true product.
fn truth(stage: &Stage, part: Part) -> Vec<f64> {
    let mut y = vec![0.0; rig_support::SIDE * rig_support::SIDE];
    stage.twin.operator(part, 0).expect("well formed").apply(&waves(), &mut y).expect("it cannot fail");
    y
}

/// Switches a stage off.
type Switch = fn(&mut MeasureOptions);

#[test]
fn results_are_worse_without_each_stage_that_they_need() {
    let off: [(&str, Switch); 3] = [
        ("ambient", |options| options.ambient = false),
        ("response", |options| options.response = false),
        ("registration", |options| options.registration = false),
    ];
    let (zigzag, corner) = (realistic("zigzag"), realistic("corner"));
    let score =
        |measurement: &MeasureOptions| segmented(zigzag, &zigzag.rig, measurement, Part::Global, SEEDS[0]).0;
    let excess = |measurement: &MeasureOptions| compensated(corner, &corner.rig, measurement, SEEDS[0]);
    let [all_score, all_excess] = [score(&zigzag.measurement), excess(&corner.measurement)];
    println!("{:<24} {:>18} {:>22}", "off", "Rand index, zigzag", "above optimum, corner");
    println!("{:<24} {all_score:>18.4} {:>21.1}%", "nothing", 100.0 * all_excess);
    for (name, switch) in off {
        let (mut one, mut other) = (zigzag.measurement.clone(), corner.measurement.clone());
        switch(&mut one);
        switch(&mut other);
        let [score, excess] = [score(&one), excess(&other)];
        println!("{name:<24} {score:>18.4} {:>21.1}%", 100.0 * excess);
        // Without each of these stages, the excess of the residual, which is below a tenth of the optimum, at least doubles.
        assert!(excess >= all_excess + 0.1, "{name}: {excess} without, {all_excess} with");
        // Ambient light does not disturb the segmentation, because it cancels in differences of photos.
        assert!(name == "ambient" || score <= all_score - 0.03, "{name}: {score} without, {all_score} with");
    }
}

#[test]
fn each_stage_lowers_the_error_that_its_imperfection_causes() {
    let stage = realistic("zigzag");
    // No stage corrects vignetting, whose error would hide all others.
    let mut plain = stage.rig.clone();
    (plain.projector.vignetting, plain.camera.vignetting) = (0.0, 0.0);
    let with = |change: fn(&mut VirtualRig)| {
        let mut rig = plain.clone();
        change(&mut rig);
        rig
    };
    let options = |change: fn(&mut MeasureOptions)| {
        let mut options = stage.measurement.clone();
        change(&mut options);
        options
    };
    let full = truth(stage, Part::Full);
    let global = truth(stage, Part::Global);
    let of = |rig: &VirtualRig, options: &MeasureOptions| {
        error(&product(stage, rig, options, Part::Full, SEEDS[0]), &full)
    };
    let drifting = with(|rig| rig.drift.per_hour = -20.0);
    let one_bit = with(|rig| rig.projector.bits = 1);
    let dim = with(|rig| rig.camera.white_fill = 1e-3);
    let fixed: fn(&mut MeasureOptions) = |options| options.exposures = vec![0.1];
    let rows = [
        (
            "direct (global light)",
            error(&product(stage, &plain, &stage.measurement, Part::Full, SEEDS[0]), &global),
            error(&product(stage, &plain, &stage.measurement, Part::Global, SEEDS[0]), &global),
            1.5,
        ),
        (
            "sentinel (drift)",
            late(stage, &drifting, &options(|o| o.sentinel_every = 0), &full),
            late(stage, &drifting, &options(|o| o.sentinel_every = 1), &full),
            2.0,
        ),
        (
            "bit planes (1 bit)",
            of(&one_bit, &options(|o| o.bit_planes = 1)),
            of(&one_bit, &options(|o| o.bit_planes = 8)),
            5.0,
        ),
        (
            "averaging (dim)",
            of(&dim, &options(fixed)),
            of(&dim, &options(|o| (o.exposures, o.takes, o.black_takes) = (vec![0.1], 16, 64))),
            2.0,
        ),
    ];
    println!("{:<24} {:>10} {:>10}", "stage", "off", "on");
    for (name, off, on, factor) in rows {
        println!("{name:<24} {off:>10.5} {on:>10.5}");
        assert!(off >= factor * on, "{name}: {off} off, {on} on");
    }
}

/// The error of a product that is measured after thirty others, when the lamp has changed.
fn late(stage: &Stage, rig: &VirtualRig, measurement: &MeasureOptions, truth: &[f64]) -> f64 {
    let calibration = known(rig);
    let planner = Planner { calibration: &calibration, ..stage.planner(rig, measurement) };
    let mut rig = planner.measure(SEEDS[0]).expect("it fits its scene");
    let mut y = vec![0.0; waves().len()];
    for turn in 0..30 {
        let x: Vec<f64> = waves().iter().map(|value| (value + f64::from(turn)).sin()).collect();
        rig.operator(Part::Full, 0).apply(&x, &mut y).expect("no frame is lost");
    }
    rig.operator(Part::Full, 0).apply(&waves(), &mut y).expect("no frame is lost");
    let white = rig.white().expect("it is there").planes.swap_remove(0).values;
    let mut full = vec![0.0; y.len()];
    let mut operator = stage.twin.operator(Part::Full, 0).expect("well formed");
    operator.apply(&vec![1.0; y.len()], &mut full).expect("it cannot fail");
    let norm = |a: &[f64]| a.iter().map(|a| a * a).sum::<f64>().sqrt();
    // The units are those of the first white photo, so that the lamp's change appears as an error.
    let scale = norm(&white) / norm(&full);
    let difference: Vec<f64> = y.iter().zip(truth).map(|(y, truth)| y - scale * truth).collect();
    norm(&difference) / norm(&y)
}

#[test]
fn bracketed_exposures_measure_dark_pixels_of_a_high_range_scene() {
    const PIXELS: usize = 256;
    let light = |pixel: usize| 10_f64.powf(-4.0 * pixel as f64 / PIXELS as f64);
    let matrix = Csr::new(
        PIXELS,
        (0..=PIXELS).collect(),
        (0..PIXELS as u32).collect(),
        (0..PIXELS).map(light).collect(),
    );
    let size = Resolution::new(16, 16);
    let twin = Twin::Explicit(ExplicitMatrix::new(matrix.expect("well formed"), size).expect("of its size"));
    let mut rig = VirtualRig::ideal(VirtualScene::Matrix { path: "range.npz".into(), size });
    (rig.camera.bits, rig.camera.shot_noise, rig.camera.read_noise) = (14, true, 5.0);
    let calibration = known(&rig);
    // The mean relative error of the quarter of pixels that is darkest in the white photo.
    let dark_error = |brackets: u32| {
        let measurement = MeasureOptions { brackets, ..MeasureOptions::default() };
        let planner = Planner {
            rig: &rig,
            twin: &twin,
            calibration: &calibration,
            measurement: &measurement,
            observer: &(),
        };
        let mut measured = planner.measure(SEEDS[0]).expect("it fits its scene");
        let white = measured.white().expect("no frame is lost").planes.swap_remove(0).values;
        let scale = white[0] / light(0);
        let dark = PIXELS * 3 / 4..PIXELS;
        dark.clone().map(|pixel| (white[pixel] / (scale * light(pixel)) - 1.0).abs()).sum::<f64>()
            / dark.len() as f64
    };
    let [off, on] = [dark_error(1), dark_error(8)];
    println!("HDR: dark pixels are off by {:.2} % without, {:.2} % with", 100.0 * off, 100.0 * on);
    assert!(off >= 10.0 * on, "{off} without, {on} with");
}
