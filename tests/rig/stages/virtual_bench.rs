//! The stages on a virtual rig, whose code is independent of them.

use std::path::PathBuf;

use krylux::image::Resolution;
use krylux::measure::{Calibration, CameraResponse, LiveFrames, MeasureOptions, Measurement, Registration};
use krylux::rig::{Ambient, VirtualRig, VirtualScene};
use krylux::sparse::Csr;
use krylux::transport::{ExplicitMatrix, Part};

use super::support::{Dense, error, product, vector};

fn explicit(dense: &Dense) -> Box<ExplicitMatrix> {
    let n = dense.resolution.pixels();
    let weights = (0..n * n).map(|at| {
        let (row, column) = (at / n, at % n);
        dense.global[row][column] + if row == column { dense.direct[row] } else { 0.0 }
    });
    let matrix = Csr::new(
        n,
        (0..=n).map(|row| row * n).collect(),
        (0..n * n).map(|at| (at % n) as u32).collect(),
        weights.collect(),
    );
    Box::new(ExplicitMatrix::new(matrix.expect("all entries are there"), dense.resolution).expect("square"))
}

#[test]
fn products_of_a_virtual_rig_with_many_imperfections_are_those_of_its_matrix() {
    let dense = Dense::new(Resolution::new(12, 8), 1.0, 5);
    let size = dense.resolution;
    let mut rig = VirtualRig::ideal(VirtualScene::Matrix { path: PathBuf::from("dense.npz"), size });
    rig.projector.gamma = Some(2.2);
    rig.projector.black_level = 0.002;
    rig.camera.bits = 14;
    rig.camera.black_level = 256.0;
    rig.camera.shot_noise = true;
    rig.camera.read_noise = 5.0;
    // The camera is shifted by one pixel to the right and does not see the leftmost column.
    rig.camera.shift = [1.0, 0.0];
    rig.ambient = Ambient { level: 0.1, ..Ambient::default() };
    let bench = rig.open(explicit(&dense), None).expect("the matrix fits the rig");
    let mut calibration = Calibration::ideal(bench.projector.info(), bench.camera.info());
    calibration.projector = vec![(0..256).map(|level| (f64::from(level) / 255.0).powf(2.2)).collect()];
    let gain = rig.camera.full_well / (16_383.0 - 256.0);
    calibration.camera =
        CameraResponse { black: 256.0, saturation: 16_383.0, gain, read_noise: 5.0 / gain, curve: None };
    let seen: Vec<usize> = (0..size.pixels()).filter(|pixel| pixel % size.width > 0).collect();
    calibration.registration = Registration {
        camera: size,
        projector: size,
        starts: (0..=size.pixels()).map(|end| seen.iter().filter(|&&pixel| pixel < end).count()).collect(),
        pixels: seen.iter().map(|&pixel| pixel as u32 - 1).collect(),
        weights: vec![1.0; seen.len()],
        lens: None,
    };
    let options = MeasureOptions { takes: 4, ..MeasureOptions::default() };
    let frames = Box::new(LiveFrames::new(bench, 0.0, 5));
    let mut measurement =
        Measurement::new(frames, calibration, options).expect("the calibration is the rig's");
    let only_seen = |x: &[f64]| -> Vec<f64> {
        x.iter().enumerate().map(|(i, x)| if i % size.width > 0 { *x } else { 0.0 }).collect()
    };
    let apply = |x: &[f64]| only_seen(&dense.apply(Part::Full, &only_seen(x)));
    let white = measurement.white().expect("no fault keeps it from being taken").planes.remove(0);
    let truth = apply(&vec![1.0; size.pixels()]);
    // The sensitivity of the virtual camera is one unknown factor for all photos.
    let unit = white.values.iter().sum::<f64>() / truth.iter().sum::<f64>();
    let scaled = |truth: Vec<f64>| truth.into_iter().map(|value| value * unit).collect::<Vec<f64>>();
    let x = vector(size.pixels(), 3);
    let found = product(&mut measurement, Part::Full, &x);
    let white_error = error(&white.values, &scaled(truth));
    let product_error = error(&found, &scaled(apply(&x)));
    let noise = measurement.last_product().map_or(0.0, |plane| plane.standard_error());
    let predicted = noise / found.iter().map(|value| value * value).sum::<f64>().sqrt();
    println!(
        "white: relative error {white_error:.4}; product: {product_error:.4}, {predicted:.4} predicted of noise"
    );
    // Four takes of at least 10 000 electrons have a noise of half a per cent. A product with both signs has
    // less light and more noise, and the rounding error of 8 bits.
    assert!(white_error < 0.01 && product_error < 3.0 * predicted, "{white_error} {product_error}");
    assert_eq!(measurement.seen().iter().filter(|&&seen| seen).count(), seen.len());
}
