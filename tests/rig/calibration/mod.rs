//! Calibrations of virtual rigs, compared with the known properties of their devices.

mod audits;
mod folders;
pub mod imperfections;
pub mod scene;

use std::ops::ControlFlow;

use krylux::calibrate::{CalibrateOptions, CalibrationReport, MapBy, calibrate};
use krylux::image::Resolution;
use krylux::measure::{Calibration, LiveFrames};
use krylux::rig::VirtualRig;
use scene::Folded;

fn scene() -> Folded {
    Folded::new(Resolution::new(64, 64), 0.3)
}

/// A rig with every imperfection.
pub fn realistic(scene: &Folded) -> VirtualRig {
    let mut rig = scene.rig();
    rig.projector.bits = 8;
    rig.projector.gamma = Some(2.2);
    rig.projector.black_level = 0.004;
    rig.projector.latency = 0.02;
    rig.camera.bits = 14;
    rig.camera.size = Some([96, 90]);
    rig.camera.black_level = 64.0;
    rig.camera.full_well = 60_000.0;
    rig.camera.shot_noise = true;
    rig.camera.read_noise = 5.0;
    rig.camera.shift = [0.5, -0.4];
    rig.camera.rotation = 0.4;
    rig.camera.distortion = 0.01;
    rig.ambient.level = 0.1;
    rig.seed = 7;
    rig
}

pub fn calibrated(
    rig: &VirtualRig,
    scene: &Folded,
    options: &CalibrateOptions,
) -> (Calibration, CalibrationReport) {
    let bench = rig.open(Box::new(scene.clone()), None).expect("the scene fits its rig");
    calibrated_from(LiveFrames::new(bench, 0.0, 5), options)
}

pub fn calibrated_from(
    mut frames: LiveFrames,
    options: &CalibrateOptions,
) -> (Calibration, CalibrationReport) {
    calibrate(&mut frames, options, &mut |_| ControlFlow::Continue(())).expect("the bench can be calibrated")
}

/// The distance of the measured map from the true one, root mean square over the camera's pixels, in
/// projector pixels.
fn map_error(rig: &VirtualRig, report: &CalibrationReport) -> f64 {
    let map = report.map.lens.as_ref().expect("a coaxial rig has a map");
    let truth = &rig.camera;
    let (camera, projector) = (map.camera, map.projector);
    let squares = (0..camera.pixels()).map(|pixel| {
        let at = [(pixel % camera.width) as f64 + 0.5, (pixel / camera.width) as f64 + 0.5];
        let scaled = [
            at[0] * projector.width as f64 / camera.width as f64,
            at[1] * projector.height as f64 / camera.height as f64,
        ];
        let (found, truth) = (map.to_projector(at), truth.sees(projector, scaled));
        (found[0] - truth[0]).powi(2) + (found[1] - truth[1]).powi(2)
    });
    (squares.sum::<f64>() / camera.pixels() as f64).sqrt()
}

#[test]
fn every_imperfection_is_measured_while_all_of_them_are_present() {
    let scene = scene();
    let rig = realistic(&scene);
    let (calibration, report) = calibrated(&rig, &scene, &CalibrateOptions::default());
    let off = map_error(&rig, &report);
    let (gamma, camera) = (report.projector[0].gamma, &report.camera);
    println!("gamma {gamma}, map {off:.4} px (said {:.4}), black {}", report.map.error, camera.black);
    println!("gain {}, read noise {}, settle {}", camera.gain, camera.read_noise, report.stability.settle);
    // The documented accuracy.
    assert!((gamma.value / 2.2 - 1.0).abs() < 0.005, "gamma {gamma}");
    assert!(off < 0.1, "the map is off by {off} pixels");
    assert!((camera.black.value - 64.0).abs() < 1.0, "black level {}", camera.black);
    // The values lie within four standard errors, as the calibration states them. The errors themselves are
    // bounded.
    let counts_per_electron = (16383.0 - 64.0) / 60_000.0;
    for (name, found, truth, most) in [
        ("gain", camera.gain, 1.0 / counts_per_electron, 0.01),
        ("read noise", camera.read_noise, 5.0 * counts_per_electron, 0.01),
        ("black level", camera.black, 64.0, 0.001),
    ] {
        assert!((found.value - truth).abs() < 4.0 * found.error, "{name}: {found}, but it is {truth}");
        assert!(found.error < most * truth, "{name}: {found} says too little");
    }
    // The map leaves out those of 4096 pixels that the camera does not see.
    assert!(off < 3.0 * report.map.error && report.map.masked < 0.02, "{:?}", report.map);
    assert!(camera.linear && calibration.camera.curve.is_none() && camera.plateau_reached);
    let settle = report.stability.settle.value;
    assert!((0.0199..0.0205).contains(&settle), "the light is there after 20 ms, not {settle} s");
    // Ambient light is 10 % of white, and the projector's black level 0.4 %.
    let black = report.projector[0].black.value;
    assert!((black - 0.104).abs() < 0.003, "{black} of white is there without a pattern");
    let curve = &calibration.projector[0];
    let worst =
        (0..256).map(|level| (curve[level] - (level as f64 / 255.0).powf(2.2)).abs()).fold(0.0, f64::max);
    // The tolerance is half a level where levels are nearest to each other in light, and noise of 5e-5.
    assert!(worst < 3e-4, "the projector's curve is off by {worst}");
}

#[test]
fn a_slow_camera_is_shown_fewer_levels_and_knows_the_others() {
    let scene = scene();
    let rig = realistic(&scene);
    let by = |levels| {
        calibrated(&rig, &scene, &CalibrateOptions { takes: 1, levels, ..CalibrateOptions::default() })
    };
    let [(_, all), (few, report)] = [None, Some(33)].map(by);
    let worst = (0..256)
        .map(|level| (few.projector[0][level] - (level as f64 / 255.0).powf(2.2)).abs())
        .fold(0.0, f64::max);
    println!("{} frames in place of {}, off by {worst:.2e}", report.effort.taken, all.effort.taken);
    // The errors are noise, as with all levels, and the levels between add none.
    assert!(worst < 5e-4, "the projector's curve is off by {worst}");
    assert!(report.effort.taken + 200 < all.effort.taken, "{:?}", report.effort);
}

#[test]
fn a_compressive_camera_response_is_measured_and_corrected() {
    let scene = scene();
    let mut rig = realistic(&scene);
    rig.camera.gamma = Some(0.7);
    let (calibration, report) =
        calibrated(&rig, &scene, &CalibrateOptions { takes: 1, ..CalibrateOptions::default() });
    let curve = calibration.camera.curve.as_ref().expect("x^0.7 is no line");
    let truth = |count: f64| ((count - 64.0) / (16383.0 - 64.0)).max(0.0).powf(1.0 / 0.7);
    let scale = curve[12_000] / truth(12_000.0);
    let off = |count: usize| (curve[count] / scale - truth(count as f64)).abs();
    // White, at 0.99 of the plateau with shot noise above it, lets the fit see counts up to about 13 000.
    let worst = (1500..13_000).step_by(50).map(off).fold(0.0, f64::max);
    println!(
        "departure {}, worst {worst:.2e}, black {}, gamma {}",
        report.camera.departure, report.camera.black, report.projector[0].gamma
    );
    // A line would be off by 0.7^(0.7/0.3) − 0.7^(1/0.3) = 0.13.
    assert!(worst < 0.01, "off by {worst} of the range");
    assert!(
        (report.projector[0].gamma.value / 2.2 - 1.0).abs() < 0.02,
        "gamma {}",
        report.projector[0].gamma
    );
}

#[test]
fn a_camera_coarser_than_the_projector_is_registered_by_a_checkerboard() {
    let scene = scene();
    let mut rig = realistic(&scene);
    rig.camera.size = Some([48, 48]);
    let (_, report) = calibrated(&rig, &scene, &CalibrateOptions { takes: 1, ..CalibrateOptions::default() });
    assert_eq!(report.map.by, MapBy::Checkerboard);
    let off = map_error(&rig, &report);
    println!("checkerboard {off:.4} px of {} points, said {:.4}", report.map.points, report.map.error);
    assert!(off < 0.1, "off by {off} pixels");
}

#[test]
fn the_calibration_of_ideal_devices_is_ideal() {
    let scene = scene();
    let rig = scene.rig();
    let (calibration, report) =
        calibrated(&rig, &scene, &CalibrateOptions { takes: 1, ..CalibrateOptions::default() });
    println!("{:?} {:?}", report.camera, report.projector[0]);
    assert!((report.projector[0].gamma.value - 1.0).abs() < 1e-3, "gamma {}", report.projector[0].gamma);
    assert!(calibration.camera.curve.is_none() && report.camera.black.value.abs() < 0.5);
    assert_eq!(report.stability.settle.value, 0.0);
    let off = map_error(&rig, &report);
    println!("off by {off:.4} pixels");
    // The saddles of a checkerboard of as many camera pixels as projector pixels are found to a fiftieth of a pixel.
    assert!(off < 0.02, "off by {off} pixels");
}

#[test]
fn a_fading_lamp_does_not_distort_the_response() {
    let scene = scene();
    let mut rig = realistic(&scene);
    rig.drift.per_hour = -0.05;
    let (_, report) = calibrated(&rig, &scene, &CalibrateOptions { takes: 1, ..CalibrateOptions::default() });
    let (drift, gamma) = (report.stability.drift_per_hour, report.projector[0].gamma);
    println!("drift {drift}, gamma {gamma}");
    assert!((drift.value + 0.05).abs() < 4.0 * drift.error + 1e-3, "drift {drift} per hour");
    assert!((gamma.value / 2.2 - 1.0).abs() < 0.005, "gamma {gamma}");
}
