//! Effects of a virtual rig's iris, pulses, rolling shutter and beam splitter on the counts.

use krylux::image::Resolution;
use krylux::rig::{Devices, Frame, Iris, Pulse, RawFrame, Splitter, VirtualRig};

use super::support::{Sheet, diagonal, flat, open, rig};

/// The count of white after 0.1 s on a rig without imperfections.
const WHITE: f64 = 0.5 * 65535.0;

/// The light of a pixel of a photo, relative to white.
fn light(photo: &RawFrame, pixel: usize) -> f64 {
    f64::from(photo.counts[pixel]) / WHITE * (0.1 / photo.exposure)
}

fn photo(devices: &mut Devices, exposure: f64) -> RawFrame {
    devices.camera.configure(exposure).expect("within its range");
    devices.camera.capture().expect("it works").expect("no frame is lost")
}

#[track_caller]
fn close(found: f64, expected: f64) {
    // Rounding changes a count of thousands by at most half a unit.
    assert!((found - expected).abs() < 1e-3, "{found} for {expected}");
}

#[test]
fn the_iris_follows_the_mean_of_the_frame_with_its_time_constant() {
    let mut rig = rig(8, 8);
    rig.projector.iris = Iris { dimming: 0.4, time: 0.5 };
    let half =
        Frame::new(rig.scene.size(), 1, (0..64).map(|pixel| if pixel < 32 { 255 } else { 0 }).collect());
    let mut devices = open(&rig);
    devices.projector.show(&flat(&rig, 255)).expect("it fits");
    devices.clock.sleep(60.0);
    close(light(&photo(&mut devices, 0.1), 0), 1.0);
    devices.projector.show(&half.expect("as many levels")).expect("it fits");
    let at_once = light(&photo(&mut devices, 0.1), 0);
    // From 1 to 0.8, over the first fifth of the time constant.
    close(at_once, 0.8 + 0.2 * 5.0 * (1.0 - (-0.2_f64).exp()));
    devices.clock.sleep(60.0);
    close(light(&photo(&mut devices, 0.1), 0), 0.8);
}

#[test]
fn pulses_are_seen_by_exposures_that_are_not_whole_periods() {
    let mut rig = rig(4, 4);
    rig.projector.pulse = Pulse { period: 0.1, duty: 0.5, wheel: false };
    let mut devices = open(&rig);
    devices.projector.show(&flat(&rig, 255)).expect("it fits");
    // The exposures follow each other from time 0 on: whole, lit, dark.
    for (exposure, expected) in [(0.1, 1.0), (0.05, 2.0), (0.05, 0.0), (0.025, 2.0), (0.1, 1.0)] {
        close(light(&photo(&mut devices, exposure), 0), expected);
    }
}

#[test]
fn a_colour_wheel_shows_one_colour_after_another() {
    let mut rig: VirtualRig = rig(4, 4);
    (rig.projector.channels, rig.camera.channels) = (3, 3);
    rig.camera.white_fill = 0.2;
    rig.projector.pulse = Pulse { period: 0.3, duty: 1.0, wheel: true };
    let sheet = Sheet { size: rig.scene.size(), colour: [1.0; 3], glow: [0.0; 3] };
    let mut devices = rig.open(Box::new(sheet), None).expect("the sheet fits");
    devices.projector.show(&flat(&rig, 255)).expect("it fits");
    for colour in 0..3 {
        let seen = photo(&mut devices, 0.1);
        let light: Vec<f64> =
            seen.counts[..3].iter().map(|&count| f64::from(count) / (0.2 * 65535.0)).collect();
        for (channel, light) in light.into_iter().enumerate() {
            close(light, if channel == colour { 3.0 } else { 0.0 });
        }
    }
}

#[test]
fn the_rows_of_a_rolling_shutter_see_different_shares_of_a_new_frame() {
    let mut rig = rig(4, 5);
    rig.projector.latency = 0.05;
    rig.camera.rolling_shutter = 0.04;
    let mut devices = open(&rig);
    devices.projector.show(&flat(&rig, 255)).expect("it fits");
    let seen = photo(&mut devices, 0.1);
    for row in 0..5 {
        // A row begins 10 ms after the one before, and white appears after 50 ms.
        close(light(&seen, 4 * row), 0.5 + 0.1 * row as f64);
    }
    close(devices.clock.now(), 0.14);
}

#[test]
fn a_ghost_is_displaced_and_stray_light_is_even_and_in_proportion_to_the_mean() {
    let mut rig = rig(8, 8);
    rig.splitter = Splitter { ghost: 0.1, ghost_shift: [3.0, 1.0], stray: 0.32 };
    let mut levels = vec![0; 64];
    levels[8 * 2 + 1] = 255;
    let size: Resolution = rig.scene.size();
    let mut devices = rig.open(diagonal(size, |_| 1.0), None).expect("the scene fits");
    let one = Frame::new(size, 1, levels).expect("as many levels");
    let seen: Vec<f64> = {
        devices.projector.show(&one).expect("it fits");
        let photo = photo(&mut devices, 0.1);
        photo.counts.iter().map(|&count| f64::from(count)).collect()
    };
    let unit = seen[8 * 2 + 1] - seen[0];
    close((seen[8 * 3 + 4] - seen[0]) / unit, 0.1);
    // White has the ghost's light in all but the first three columns and the first row: 35 of 64 pixels.
    close(seen[0] / unit, 0.32 * (1.0 + 0.1 * 35.0 / 64.0) / 64.0);
    let others = (0..64).filter(|pixel| ![17, 28].contains(pixel));
    assert!(others.into_iter().all(|pixel| seen[pixel] == seen[0]), "it is even: {seen:?}");
}
