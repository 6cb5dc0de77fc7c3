//! Photos and products by calibrated benches, with each of the options of a measurement.

use std::fmt::Write;

use krylux::image::Image;
use krylux::measure::{Calibration, DirectBy, DitherBy, MeasureOptions, Measurement, SignedBy};
use krylux::operator::Operator;
use krylux::rig::VirtualRig;
use krylux::transport::Part;

use super::bench::{SIZE, calibrated, coloured, measurement, quick, realistic};
use super::compare;
use super::digits::{summary, text};

/// A vector with both signs, and with large and small entries.
fn vector() -> Vec<f64> {
    let entry = |pixel: usize| {
        let [x, y] = [(pixel % SIZE.width) as f64, (pixel / SIZE.width) as f64];
        (0.3 * x).sin() * (0.2 * y).cos() + 0.2 * (1.7 * x - 0.9 * y).sin()
    };
    (0..SIZE.pixels()).map(entry).collect()
}

/// All that a measurement returns, as text: photos, products with their errors, direct light, drift, and what it took.
fn told(mut rig: Measurement) -> String {
    let mut said = String::new();
    let mut line =
        |what: &str, text: &str| writeln!(said, "{what}: {text}").expect("a string takes everything");
    line("exposures", &text(&rig.exposures().expect("white is seen")));
    line("saturated", &text(&rig.saturated().expect("white is seen")));
    line("white", &text(&rig.white().expect("white is seen")));
    line("ambient", &text(&rig.ambient().expect("black is seen")));
    let samples = vector().iter().map(|value| (0.5 + 0.4 * value).clamp(0.0, 1.0) as f32).collect();
    let pattern = Image::new(SIZE, 1, samples).expect("a sample for each pixel");
    line("photo", &text(&rig.photograph(&pattern).expect("a photo is taken")));
    line("proportional", &text(&rig.check_pattern(false).map(|_| ())));
    for channel in 0..rig.channels() {
        for part in [Part::Full, Part::Direct, Part::Global] {
            if part != Part::Full && rig.options().direct == DirectBy::None {
                continue;
            }
            let mut operator = rig.operator(part, channel);
            let mut product = vec![0.0; SIZE.pixels()];
            operator.apply(&vector(), &mut product).expect("photos are taken");
            line(&format!("{part:?} {channel}"), &summary(&product));
            line("standard error", &text(&operator.standard_errors()));
            line("common error", &text(&operator.common_error(&vector()).expect("it is known")));
            line("variance", &summary(&operator.last_product().expect("it was taken").variance));
        }
        if rig.options().direct != DirectBy::None {
            let rows = rig.direct_rows(channel).expect("photos are taken");
            let entries: Vec<f64> =
                rows.iter().flatten().flat_map(|&(at, weight)| [f64::from(at), weight]).collect();
            line("direct rows", &summary(&entries));
        }
    }
    if rig.options().direct != DirectBy::None {
        line("direct", &text(&rig.direct().expect("photos are taken")));
    }
    line("drift", &text(&rig.drift().expect("white is seen")));
    line("effort", &text(&rig.effort()));
    line("patterns", &rig.patterns().to_string());
    said
}

fn compare_options(name: &str, rig: &VirtualRig, calibration: &Calibration, options: MeasureOptions) {
    compare(&format!("photos_{name}"), &told(measurement(rig, calibration, options)));
}

#[test]
fn by_a_calibrated_bench() {
    let rig = realistic();
    let (calibration, _) = calibrated(&rig, &quick());
    let standard = MeasureOptions::default();
    let by = |name: &str, options| compare_options(name, &rig, &calibration, options);
    by("default", standard.clone());
    by(
        "affine",
        MeasureOptions { signed: SignedBy::Affine, takes: 2, sentinel_every: 3, ..standard.clone() },
    );
    by("split", MeasureOptions { signed: SignedBy::Split, bit_planes: 3, blur: 0.8, ..standard.clone() });
    by(
        "brackets",
        MeasureOptions { brackets: 3, black_takes: 2, compensate_rounding: true, ..standard.clone() },
    );
    by(
        "squares",
        MeasureOptions {
            direct_square: Some(3),
            dither: DitherBy::Random,
            dither_seed: 5,
            ..standard.clone()
        },
    );
    by("diffusion", MeasureOptions { dither: DitherBy::Diffusion, ambient: false, ..standard.clone() });
    by(
        "given",
        MeasureOptions {
            exposures: vec![0.02, 0.1],
            flat_field: false,
            dither: DitherBy::None,
            ..standard.clone()
        },
    );
    by("raw", MeasureOptions { response: false, registration: false, direct: DirectBy::None, ..standard });
}

#[test]
fn by_an_uncalibrated_bench() {
    let mut rig = realistic();
    rig.projector.gamma = None;
    rig.camera.gamma = None;
    let calibration = Calibration::ideal(&rig.projector_info(), &rig.camera_info());
    compare_options(
        "uncalibrated",
        &rig,
        &calibration,
        MeasureOptions { exposures: vec![0.05], ..MeasureOptions::default() },
    );
}

#[test]
fn in_colour_and_in_luminance() {
    let rig = coloured();
    let (calibration, _) = calibrated(&rig, &quick());
    compare_options("colour", &rig, &calibration, MeasureOptions::default());
    compare("photos_luminance", &told(measurement(&rig, &calibration, MeasureOptions::default()).in_luma()));
}
