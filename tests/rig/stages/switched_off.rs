//! Each stage reduces the error: without it, the error that it removes is back.

use krylux::image::Resolution;
use krylux::measure::{MeasureOptions, Registration, SignedBy};
use krylux::transport::Part;

use super::support::{Dense, Rig, error, plain, product, vector};

fn scene() -> Dense {
    Dense::new(Resolution::new(9, 6), 1000.0, 5)
}

/// Compares the errors of a product with the stage on and off.
fn compare(what: &str, rig: &Rig, on: &MeasureOptions, off: &MeasureOptions, ratio: f64) {
    let x: Vec<f64> = vector(54, 4).iter().map(|x| x + 0.3).collect();
    let truth = rig.matrix.apply(Part::Full, &x);
    let [with, without] =
        [on, off].map(|options| error(&product(&mut rig.measure(options), Part::Full, &x), &truth));
    println!("{what}: relative error {without:.4} without, {with:.5} with: {:.0} times less", without / with);
    assert!(without > ratio * with, "{what}: {without} {with}");
}

#[test]
fn without_the_ambient_stage_the_light_of_the_room_is_an_error() {
    let rig = Rig { ambient: 250.0, ..Rig::new(scene()).noisy() };
    let on = MeasureOptions { signed: SignedBy::Affine, ..plain() };
    compare("ambient", &rig, &on, &MeasureOptions { ambient: false, ..on.clone() }, 5.0);
}

#[test]
fn without_the_response_stage_the_curves_of_the_devices_are_an_error() {
    let rig = Rig { gamma: 2.2, ..Rig::new(scene()).noisy() };
    compare("response", &rig, &plain(), &MeasureOptions { response: false, ..plain() }, 20.0);
    let camera = Rig { response: 1.4, ..Rig::new(scene()).noisy() };
    compare("camera response", &camera, &plain(), &MeasureOptions { response: false, ..plain() }, 5.0);
}

#[test]
fn without_the_registration_stage_a_rotated_camera_is_an_error() {
    let mut rig = Rig::new(scene()).noisy();
    let size = rig.matrix.resolution;
    // The camera is upside down.
    let n = size.pixels();
    rig.optics = Some((0..n).map(|pixel| vec![(n - 1 - pixel, 1.0)]).collect());
    rig.registration = Some(Registration {
        camera: size,
        projector: size,
        starts: (0..=n).collect(),
        pixels: (0..n as u32).rev().collect(),
        weights: vec![1.0; n],
        lens: None,
    });
    compare("registration", &rig, &plain(), &MeasureOptions { registration: false, ..plain() }, 20.0);
}

#[test]
fn averaging_reduces_noise() {
    let rig = Rig::new(scene()).noisy();
    let few = MeasureOptions { exposures: vec![0.02], black_takes: 64, ..plain() };
    // 16 takes have four times less noise, known to ±10 % from 54 pixels.
    compare("averaging", &rig, &MeasureOptions { takes: 16, ..few.clone() }, &few, 3.0);
}

#[test]
fn without_the_sentinel_drift_is_an_error() {
    // The drift is 1 % in 50 seconds. The light of the white photo is the unit: four takes of a second after
    // four of black.
    let rig = Rig { lamp: |t| 1.0 - 0.0002 * (t - 6.5), ..Rig::new(scene()) };
    let x = vector(54, 4);
    let truth = rig.matrix.apply(Part::Full, &x);
    let of = |sentinel_every| {
        let mut measurement =
            rig.measure(&MeasureOptions { sentinel_every, takes: 4, exposures: vec![1.0], ..plain() });
        for seed in 10..50 {
            product(&mut measurement, Part::Full, &vector(54, seed));
        }
        let found = error(&product(&mut measurement, Part::Full, &x), &truth);
        (found, measurement.drift().expect("white is there").largest)
    };
    let ((without, nothing), (with, seen)) = (of(0), of(4));
    println!(
        "drift: relative error {without:.4} without the sentinel, {with:.4} with; {:.1} % seen",
        100.0 * seen
    );
    assert!(without > 20.0 * with && nothing == 0.0 && seen > 0.04);
}
