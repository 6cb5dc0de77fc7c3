//! Figure 13: a sinusoid from a one-bit projector, as a binary threshold and as bit planes, and the noise that bit planes add.

use super::bench::{Bench, Set, Stage, one_bit};
use super::figure::{Check, Content, Figure, Panel, Plot, Points, Reproduced, Rig};
use super::vectors::minus;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::krylov::norm;
use crate::lab::Lab;
use crate::measure::{
    Calibration, MeasureOptions, RigFile, RigKind, bit_plane_amplification, bit_plane_weights,
};
use crate::rig::VirtualRig;

const SIDE: usize = 100;
/// The number of bit planes of the displayed result.
const PLANES: u32 = 8;
/// The largest number of bit planes in the curves. The smallest is 1.
const MOST: u32 = 10;
const PERIODS: f64 = 4.0;
/// Total exposures in seconds. White fills most of the sensor's well in `BRIGHT`, and only 1 % of the well in `DIM`.
const BRIGHT: f64 = 0.02;
const DIM: f64 = 2e-4;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let side = bench.side(SIDE);
    let stage = bench.stage(Set::Corner, side)?;
    let (file, mut noisy) = one_bit(stage.resolution)?;
    // Any exposure time is allowed, because the figure compares photos at equal total exposure.
    noisy.camera.exposure_step = 0.0;
    noisy.camera.exposures = [1e-7, 10.0];
    let mut exact = noisy.clone();
    exact.camera.shot_noise = false;
    exact.camera.read_noise = 0.0;
    // Quantization is not the subject of this figure. The exact camera has no noise that would dither it, so its quantization is made fine.
    exact.camera.bits = 16;
    exact.projector.black_level = 0.0;
    let rig = if bench.rig() == Rig::Ideal { &exact } else { &noisy };

    let pattern = sinusoid(side);
    let truth = stage.photo(&pattern);
    let lab = &*bench.lab(&stage)?;
    let take = |rig: &VirtualRig, planes: u32, seconds: f64| -> Result<Vec<f64>> {
        let (counts, _) = photo(lab, &file, rig, &pattern, (planes, seconds))?;
        // The unit is the number of counts per second for 1 W/(m² sr). The noise-free white photo determines the gain of the sensor.
        let unit = counts_per_light(rig, &stage);
        Ok(counts.into_iter().map(|count| count / unit).collect())
    };
    let off = |photo: &[f64]| error(photo, &truth) / norm(&truth);

    let plain = take(rig, 1, BRIGHT)?;
    let decomposed = take(rig, PLANES, BRIGHT)?;
    let frames = photo(lab, &file, rig, &pattern, (PLANES, BRIGHT))?.1;
    let (mut bright, mut dim) = (Vec::new(), Vec::new());
    for planes in 1..=MOST {
        bright.push((f64::from(planes), off(&take(rig, planes, BRIGHT)?)));
        dim.push((f64::from(planes), off(&take(&noisy, planes, DIM)?)));
    }
    // The frames with and without read noise are otherwise equal, so their difference is the noise.
    let mut read_only = noisy.clone();
    read_only.camera.shot_noise = false;
    read_only.camera.bits = 16;
    let mut silent = read_only.clone();
    silent.camera.read_noise = 0.0;
    let noise = |planes: u32| -> Result<f64> {
        Ok(error(&take(&read_only, planes, DIM)?, &take(&silent, planes, DIM)?))
    };
    let grown = noise(PLANES)? / noise(1)?;
    let predicted = bit_plane_amplification(&bit_plane_weights(PLANES, 1.0));
    let least = |curve: &[(f64, f64)]| {
        curve.iter().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(f64::NAN, |&(planes, _)| planes)
    };
    let checks = vec![
        Check::of("error of the photo by 8 bit planes over that of plain one bit")
            .at_most(off(&decomposed) / off(&plain), 0.05),
        Check::of("error of plain one bit, %").stated(100.0 * off(&plain)),
        Check::of("error by 8 bit planes, %").stated(100.0 * off(&decomposed)),
        Check::of("best number of bit planes in dim light, at equal light in total")
            .at_most(least(&dim), f64::from(MOST) - 1.0),
        Check::of("read noise of 8 bit planes over that of one photo, over what is predicted")
            .at_least(grown / predicted, 0.8),
        Check::of("the same, from above").at_most(grown / predicted, 1.25),
        Check::of("read noise of 8 bit planes over that of one photo, predicted").stated(predicted),
        Check::of("frames of the photo in 8 bit planes, black and white counted").stated(frames as f64),
    ];
    Ok(Reproduced {
        setting: format!("corner, {}, a projector of one bit and a camera of 12", stage.resolution),
        checks,
        panels: panels(&stage, &pattern, &truth, &plain, &decomposed),
        plots: vec![curves(bright, dim)],
        photos: 1 + PLANES as usize,
        frames: if bench.rig() == Rig::Virtual { frames } else { 0 },
        ..Reproduced::of(Figure::Fig13, bench.rig())
    })
}

fn curves(bright: Points, dim: Points) -> Plot {
    Plot::logarithmic(
        "Relative error of the photo of a sinusoid. In dim light (1 % of the other) each photo adds its read noise: more bit planes are worse \
         than fewer.",
        ["bit planes", "relative error"],
        [("bright", bright), ("dim, with noise", dim)],
    )
}

/// `½ + ½ sin` along the rows.
fn sinusoid(side: usize) -> Vec<f64> {
    let value = |pixel: usize| {
        let x = ((pixel % side) as f64 + 0.5) / side as f64;
        0.5 + 0.5 * (std::f64::consts::TAU * PERIODS * x).sin()
    };
    (0..side * side).map(value).collect()
}

/// The photo of `pattern` in counts per second, from `planes` bit planes with a total exposure of `seconds`, and its number of frames.
fn photo(
    lab: &Lab,
    file: &RigFile,
    rig: &VirtualRig,
    pattern: &[f64],
    (planes, seconds): (u32, f64),
) -> Result<(Vec<f64>, u64)> {
    let measurement = MeasureOptions {
        bit_planes: planes,
        exposures: vec![seconds / f64::from(planes)],
        sentinel_every: 0,
        black_takes: 16,
        ..file.measurement.clone()
    };
    let file = RigFile { measurement, kind: RigKind::Virtual(rig.clone()), ..file.clone() };
    let mut lab = lab.through_rig(file)?;
    // In dim light, the checks of the rig would fail, because noise hides even the white pattern at most pixels. The figure shows this.
    lab.unexamined();
    let pattern = Image::from_planes(lab.resolution(), &[pattern.to_vec()])?;
    // The source is a virtual rig, so its devices exist, and its photos are measured.
    let calibration = known(lab.rig().ok_or(Error::Interrupted)?.devices()?);
    lab.set_calibration(calibration)?;
    let taken = lab.with_measurement(|measurement| {
        let photo = measurement.photograph(&pattern)?;
        Ok((photo, measurement.effort().taken))
    })?;
    let (mut photo, frames) = taken.ok_or(Error::Interrupted)?;
    Ok((photo.planes.swap_remove(0).values, frames))
}

/// The calibration that follows from the rig's own description. A calibration from captures would add little for two levels.
fn known(rig: &VirtualRig) -> Calibration {
    let mut calibration = Calibration::ideal(&rig.projector_info(), &rig.camera_info());
    let camera = &mut calibration.camera;
    camera.black = rig.camera.black_level;
    camera.gain = rig.camera.full_well / (camera.saturation - camera.black);
    camera.read_noise = rig.camera.read_noise / camera.gain;
    calibration
}

/// The gain at which the white photo's 99th percentile fills `white_fill` of the sensor's well within `white_exposure`.
fn counts_per_light(rig: &VirtualRig, stage: &Stage) -> f64 {
    let mut white = stage.white();
    white.sort_by(f64::total_cmp);
    let brightest = white[((white.len() as f64 * 0.99).ceil() as usize).saturating_sub(1)];
    let range = f64::from((1_u32 << rig.camera.bits) - 1) - rig.camera.black_level;
    rig.camera.white_fill * range / rig.camera.white_exposure / brightest
}

fn error(a: &[f64], b: &[f64]) -> f64 {
    norm(&minus(a, b))
}

fn panels(stage: &Stage, pattern: &[f64], truth: &[f64], plain: &[f64], decomposed: &[f64]) -> Vec<Panel> {
    let white = truth.iter().copied().fold(0.0, f64::max);
    let shown = Content::Light { values: pattern.to_vec(), white: Some(1.0) };
    let light = |values: &[f64]| Content::Light { values: values.to_vec(), white: Some(white) };
    let less = |photo: &[f64]| Content::Signed(minus(photo, truth));
    vec![
        stage.panel("pattern", "What is to be projected, 0 to 1", shown),
        stage.panel("truth", "Its photo, W/(m² sr)", light(truth)),
        stage.panel("plain", "By a projector of one bit", light(plain)),
        stage.panel("decomposed", "In 8 bit planes", light(decomposed)),
        stage.panel("error-plain", "One bit less truth, W/(m² sr)", less(plain)),
        stage.panel("error-decomposed", "8 bit planes less truth, W/(m² sr)", less(decomposed)),
    ]
}
