//! Calibration against the truth of virtual rigs: what a bench's captures tell must be what the bench was told to be.

mod scene;

use std::ops::ControlFlow;

use krylux::image::Resolution;
use krylux::measure::calibrate::{CalibrateOptions, CalibrationReport, calibrate};
use krylux::measure::{Calibration, Live};
use krylux::rig::VirtualRig;
use scene::Folded;

fn scene() -> Folded {
    Folded::new(Resolution::new(64, 64), 0.3)
}

/// The imperfections, all of them.
fn realistic(scene: &Folded) -> VirtualRig {
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

fn calibrated(
    rig: &VirtualRig,
    scene: &Folded,
    options: &CalibrateOptions,
) -> (Calibration, CalibrationReport) {
    let bench = rig.open(Box::new(scene.clone()), None).expect("the scene fits its rig");
    let mut shots = Live::new(bench, 0.0, 5);
    calibrate(&mut shots, options, &mut |_| ControlFlow::Continue(())).expect("the bench can be calibrated")
}

/// Distance of the map found from the true one, root mean square over the camera's pixels, in projector pixels.
fn map_error(rig: &VirtualRig, report: &CalibrationReport) -> f64 {
    let map = report.map.lens.as_ref().expect("a coaxial rig has a map");
    let truth = rig.camera.misregistration();
    let (camera, projector) = (map.camera, map.projector);
    let squares = (0..camera.pixels()).map(|pixel| {
        let at = [(pixel % camera.width) as f64 + 0.5, (pixel / camera.width) as f64 + 0.5];
        let scaled = [
            at[0] * projector.width as f64 / camera.width as f64,
            at[1] * projector.height as f64 / camera.height as f64,
        ];
        let (found, truth) = (map.to_projector(at), truth.apply(projector, scaled));
        (found[0] - truth[0]).powi(2) + (found[1] - truth[1]).powi(2)
    });
    (squares.sum::<f64>() / camera.pixels() as f64).sqrt()
}

#[test]
fn every_imperfection_at_once_is_told_apart_and_found() {
    let scene = scene();
    let rig = realistic(&scene);
    let (calibration, report) = calibrated(&rig, &scene, &CalibrateOptions::default());
    println!("{report:#?}");
    let off = map_error(&rig, &report);
    println!("map {off}");
    let gamma = report.projector[0].gamma;
    assert!((gamma.value / 2.2 - 1.0).abs() < 0.005, "gamma {gamma}");
    assert!(off < 0.1, "the map is off by {off} pixels");
    assert!((report.camera.black.value - 64.0).abs() < 1.0, "black level {}", report.camera.black);
    assert!(report.camera.linear && calibration.camera.curve.is_none());
}
