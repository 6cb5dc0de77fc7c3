//! The HDR stage: bracketed exposures.

use krylux::image::Resolution;
use krylux::measure::MeasureOptions;
use krylux::transport::Part;

use super::support::{Dense, Rig, error, plain};

/// A scene without global light, whose direct light covers five decades.
fn scene() -> Dense {
    let resolution = Resolution::new(20, 10);
    let n = resolution.pixels();
    let direct = (0..n).map(|i| 10.0 * 1e5_f64.powf(i as f64 / (n - 1) as f64)).collect();
    Dense { resolution, direct, global: vec![vec![0.0; n]; n] }
}

#[test]
fn five_decades_are_measured_to_one_per_cent() {
    let rig = Rig::new(scene()).noisy();
    let n = rig.matrix.resolution.pixels();
    let truth = rig.matrix.apply(Part::Full, &vec![1.0; n]);
    let white = |exposures: Vec<f64>| {
        let options = MeasureOptions { exposures, takes: 16, black_takes: 16, ..plain() };
        rig.measure(&options).white().expect("a dense rig never fails").planes.remove(0)
    };
    let merged = white((0..9).map(|k| 0.0125 * 4.0_f64.powi(k)).collect());
    let off = |white: &krylux::measure::Plane, i: usize| (white.values[i] / truth[i] - 1.0).abs();
    // A pixel is measured well when its stated error is at most 1/400, so that 1 % is four standard errors.
    let well: Vec<usize> = (0..n).filter(|&i| merged.variance[i].sqrt() < truth[i] / 400.0).collect();
    let worst = well.iter().map(|&i| off(&merged, i)).fold(0.0, f64::max);
    let single = white(vec![0.0125]);
    let without = (0..n).map(|i| off(&single, i)).fold(0.0, f64::max);
    println!(
        "{} of {n} pixels seen well, the worst off by {:.2} %; with one exposure {:.0} %",
        well.len(),
        100.0 * worst,
        100.0 * without
    );
    assert!(well.len() == n && worst < 0.01 && without > 0.5);
}

#[test]
fn exposures_are_added_until_the_darkest_pixel_is_well_exposed() {
    let rig = Rig::new(scene()).noisy();
    let exposures = |brackets| {
        rig.measure(&MeasureOptions { brackets, ..plain() }).exposures().expect("a dense rig never fails")
    };
    let chosen = exposures(12);
    println!("exposures {chosen:.3?}");
    // A ratio of 20 : 1 needs about 400 electrons and more for the read noise: 130 DN, while the darkest
    // pixel has 10 DN per second.
    assert!((11.0..60.0).contains(chosen.last().expect("there is one")), "{chosen:?}");
    assert_eq!(exposures(3), chosen[..3]);
}

#[test]
fn a_pixel_saturated_in_every_exposure_is_named() {
    let rig = Rig::new(scene()).noisy();
    let fault = |exposures: Vec<f64>| {
        rig.measure(&MeasureOptions { exposures, ..plain() }).white().map_err(|error| error.to_string())
    };
    let text = fault(vec![0.03, 0.12]).expect_err("10⁶ DN a second do not fit 14 bits in 0.03 seconds");
    for part in [
        "camera: 11 pixels are saturated in every exposure",
        "column 9, row 9",
        "shortest exposure is 0.03 s",
        "[measurement] exposures",
    ] {
        assert!(text.contains(part), "{text}");
    }
    assert!(fault(vec![0.01, 0.12]).is_ok());
}

#[test]
fn the_shortest_exposure_brings_the_brightest_pixel_near_saturation() {
    for brightness in [1.0, 1e2, 1e5, 1e7] {
        let rig = Rig::new(Dense::new(Resolution::new(6, 4), brightness, 3)).noisy();
        let mut measurement = rig.measure(&plain());
        let seconds = measurement.exposures().expect("a dense rig never fails")[0];
        let peak = rig.matrix.apply(Part::Full, &[1.0; 24]).into_iter().fold(0.0, f64::max) * seconds;
        let range = 16_383.0 - 256.0;
        assert!((0.75..0.85).contains(&(peak / range)), "{brightness}: {peak} in {seconds} s");
    }
}

#[test]
fn merged_exposures_are_less_noisy_than_a_single_one() {
    let rig = Rig::new(scene()).noisy();
    let truth = rig.matrix.apply(Part::Full, &vec![1.0; 200]);
    // Errors are relative to the light of each pixel.
    let by = |exposures: Vec<f64>| {
        let white =
            rig.measure(&MeasureOptions { exposures, ..plain() }).white().expect("a dense rig never fails");
        let relative: Vec<f64> =
            white.planes[0].values.iter().zip(&truth).map(|(found, truth)| found / truth).collect();
        error(&relative, &[1.0; 200])
    };
    let (merged, single) = (by(vec![0.01, 0.08, 0.64]), by(vec![0.01]));
    println!("relative error with one exposure {single:.3}, with three {merged:.4}");
    assert!(merged < single / 10.0);
}
