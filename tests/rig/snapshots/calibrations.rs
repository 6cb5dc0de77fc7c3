//! Calibrations, with everything that they measure.

use std::fmt::Write;

use krylux::bench::preview::LivePreview;
use krylux::calibrate::{CalibrateOptions, CalibrationReport, MapBy, StructuredLight, map_check};
use krylux::image::{Image, Resolution};
use krylux::measure::Calibration;
use krylux::rig::VirtualRig;

use super::bench::{SIZE, calibrated, coloured, frames, quick, realistic};
use super::{compare, digits};
use crate::rig::calibration::{self, scene::Folded};

/// A calibration and its report, and the lines that a person reads.
fn compare_calibration(name: &str, rig: &VirtualRig, options: &CalibrateOptions) {
    compare_calibrated(name, calibrated(rig, options));
}

fn compare_calibrated(name: &str, (calibration, report): (Calibration, CalibrationReport)) {
    let mut text = String::new();
    for [what, said] in report.lines() {
        writeln!(text, "{what}: {said}").expect("a string takes everything");
    }
    text += &digits::text(&report);
    text += &digits::text(&calibration);
    compare(name, &text);
}

#[test]
fn by_gray_codes() {
    compare_calibration("calibration_gray_codes", &realistic(), &quick());
}

#[test]
fn by_all_levels_and_two_takes() {
    let mut rig = realistic();
    rig.camera.gamma = None;
    compare_calibration("calibration_all_levels", &rig, &CalibrateOptions::default());
}

#[test]
fn by_a_checkerboard() {
    // Its crosses are too few on a projector of 32×28 pixels.
    let scene = Folded::new(Resolution::new(64, 64), 0.3);
    let mut rig = calibration::realistic(&scene);
    rig.camera.size = Some([48, 48]);
    let options = CalibrateOptions { map: Some(MapBy::Checkerboard), ..quick() };
    compare_calibrated("calibration_checkerboard", calibration::calibrated(&rig, &scene, &options));
}

#[test]
fn of_three_channels() {
    compare_calibration("calibration_three_channels", &coloured(), &quick());
}

#[test]
fn of_devices_that_are_apart_and_tilted() {
    let mut rig = realistic();
    rig.camera.homography = Some([[0.97, 0.02, 0.5], [-0.01, 1.02, 0.3], [2e-4, 1e-4, 1.0]]);
    compare_calibration("calibration_apart", &rig, &CalibrateOptions { coaxial: false, ..quick() });
}

#[test]
fn a_map_that_has_moved_since() {
    let rig = realistic();
    let (calibration, report) = calibrated(&rig, &quick());
    let mut moved = rig.clone();
    moved.camera.shift = [0.8, -0.1];
    let mut frames = frames(&moved, calibration.stability.settle);
    let found =
        map_check(&mut frames, &calibration, 0.5 * report.camera.exposure).expect("it can be checked");
    compare("map_check", &digits::text(&found));
}

#[test]
fn structured_light_and_a_preview() {
    let rig = realistic();
    let mut live = frames(&rig, 0.03);
    let mut text = digits::text(&StructuredLight::white_exposure(None, &mut live).expect("white is seen"));
    let ramp = (0..SIZE.pixels()).map(|pixel| (pixel % 32) as f32 / 31.0).collect();
    let image = Image::new(SIZE, 1, ramp).expect("a sample for each pixel");
    let (mut preview, _) = LivePreview::new(Box::new(live), None, &image, None).expect("white is seen");
    let range = *preview.range();
    text += &digits::text(&range);
    for _ in 0..3 {
        let figures = preview.capture().expect("a frame is taken");
        text += &digits::text(&figures);
        text += &format!("{}\n{}\n", figures.line(&range), figures.short_line(&range));
    }
    compare("preview", &text);
}
