//! From captures to an operator on real protocols.

use std::ops::ControlFlow;
use std::path::Path;

use krylux::calibrate::{CalibrateOptions, calibrate};
use krylux::measure::{LiveFrames, MeasureOptions, Measurement};
use krylux::operator::Operator;
use krylux::rig::Helper;
use krylux::transport::Part;

use crate::bench::{SIDE, noisy, rooms, stage};

#[test]
fn a_product_calibrated_from_captures_alone_is_that_of_the_scenes_matrix() {
    let began = std::time::Instant::now();
    let mut rig = noisy(Path::new("rooms.npz"));
    rig.projector.gamma = Some(2.2);
    let stage = stage(4, &rig);
    let helper = Helper::at(env!("CARGO_BIN_EXE_krylux"));
    let mut live = LiveFrames::new(stage.hardware.open(&helper, None).expect("both are there"), 0.0, 5);
    let mut go_on = |_| ControlFlow::Continue(());
    // The curve is smooth: 33 levels tell it as well as 256, in an eighth of the time.
    let options = CalibrateOptions { levels: Some(33), ..CalibrateOptions::default() };
    let (found, report) = calibrate(&mut live, &options, &mut go_on).expect("it can be calibrated");
    println!("calibrated in {:?}: {:?}, settle {}", began.elapsed(), report.effort, report.stability.settle);
    println!("gamma {}, pixel map within {:.3}", report.projector[0].gamma, report.map.error);
    assert!((report.projector[0].gamma.value - 2.2).abs() < 0.02);
    let options = MeasureOptions { direct_square: Some(1), ..MeasureOptions::default() };
    let mut measurement = Measurement::new(Box::new(live), found, options).expect("they belong together");
    let pixels = SIDE * SIDE;
    let x: Vec<f64> = (0..pixels).map(|pixel| (pixel as f64 * 0.37).sin() + 0.2).collect();
    let (mut y, mut truth) = (vec![0.0; pixels], vec![0.0; pixels]);
    measurement.operator(Part::Full, 0).apply(&x, &mut y).expect("no frame is lost");
    rooms().entries().for_each(|(row, column, weight)| truth[row] += weight * x[column]);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let error = (1.0 - dot(&y, &truth).powi(2) / (dot(&y, &y) * dot(&truth, &truth))).max(0.0).sqrt();
    println!("relative error of a product {error:.5}, after {:?}", began.elapsed());
    // Rounding to 8 bits through a gamma of 2.2 alone is an error of 3e-3.
    assert!(error < 0.01, "{error}");
}
