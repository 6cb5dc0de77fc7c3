//! From levels to the light on the sensor.

use krylux::Error;
use krylux::image::Resolution;
use krylux::measure::FrameSource;
use krylux::rig::{Ambient, Drift, Frame, VirtualRig};

use super::support::{Sheet, counts, diagonal, flat, live, open, rig, shot, show};

/// What white counts in 0.1 s on a rig without fault.
const WHITE: f64 = 0.5 * 65535.0;

/// The count of pixel 0 with this level on screen for 0.1 s, relative to white's.
fn relative(rig: &VirtualRig, level: u16) -> f64 {
    counts(&mut show(open(rig), rig, level, 0.1))[0] / WHITE
}

#[track_caller]
fn assert_close(found: f64, expected: f64) {
    // A count is rounded to half a unit, of 32768.
    assert!((found - expected).abs() <= 0.51 / WHITE, "{found} for {expected}");
}

#[test]
fn an_ideal_rig_counts_the_light_of_each_level() {
    let rig = rig(5, 4);
    let mut live = live(&rig, 0.0, 1);
    for level in [0, 1, 100, 255] {
        let frame = live.capture(&shot(&rig, level, 0.1, 0)).expect("nothing goes wrong");
        for count in &frame.counts {
            assert_close(f64::from(*count) / WHITE, f64::from(level) / 255.0);
        }
        assert_eq!((frame.resolution, frame.exposure), (rig.scene.size(), 0.1));
    }
}

#[test]
fn gamma_and_black_level_shape_the_light_of_a_level() {
    let mut rig = rig(3, 3);
    rig.projector.gamma = Some(2.2);
    rig.projector.black_level = 0.01;
    for level in [0, 1, 128, 254, 255] {
        let expected = 0.01 + 0.99 * (f64::from(level) / 255.0).powf(2.2);
        assert_close(relative(&rig, level), expected);
    }
    rig.projector.gamma = None;
    rig.projector.curve = Some(vec![0.0, 0.1, 1.0]);
    assert_close(relative(&rig, 51), 0.01 + 0.99 * 0.04);
}

#[test]
fn a_projector_of_few_bits_has_few_levels() {
    for bits in 1..=12 {
        let mut rig = rig(2, 2);
        rig.projector.bits = bits;
        let highest = ((1_u32 << bits) - 1) as u16;
        assert_close(relative(&rig, highest), 1.0);
        assert_close(relative(&rig, highest / 2), f64::from(highest / 2) / f64::from(highest));
        let mut bench = open(&rig);
        let fault = bench.projector.show(&flat(&rig, highest + 1));
        assert!(matches!(fault, Err(Error::Rig { .. })), "there is no level beyond the highest");
    }
    let mut bench = open(&rig(2, 2));
    assert!(bench.projector.show(&Frame::filled(Resolution::new(3, 2), 1, 0)).is_err(), "another size");
    assert!(bench.projector.show(&Frame::filled(Resolution::new(2, 2), 3, 0)).is_err(), "another colour");
}

#[test]
fn vignetting_of_both_devices_multiplies() {
    let mut rig = rig(41, 41);
    (rig.projector.vignetting, rig.camera.vignetting) = (0.2, 0.3);
    let counts = counts(&mut show(open(&rig), &rig, 255, 0.1));
    let corner = (20.0_f64 / 20.5).powi(2);
    let expected = (1.0 - 0.2 * corner) * (1.0 - 0.3 * corner);
    // Two counts of about 32768 and 18000, each rounded to half a unit.
    assert!((counts[0] / counts[20 * 41 + 20] - expected).abs() < 4e-5);
}

#[test]
fn ambient_light_is_relative_to_white_and_swings() {
    let mut rig = rig(3, 3);
    rig.ambient = Ambient { level: 0.1, variation: 0.5, period: 4.0 };
    let mut bench = show(open(&rig), &rig, 0, 0.1);
    for expected in [1.0, 1.5, 1.0, 0.5] {
        // The exposure's middle lies 0.05 s after its beginning.
        let phase = std::f64::consts::TAU * 0.05 / 4.0;
        let bound = 0.1 * 0.5 * phase + 0.51 / WHITE;
        let found = counts(&mut bench)[0] / WHITE;
        assert!((found - 0.1 * expected).abs() <= bound, "{found} for {expected}");
        bench.clock.sleep(0.9);
    }
}

#[test]
fn over_an_exposure_of_whole_periods_a_swing_averages_out() {
    let mut rig = rig(2, 2);
    rig.ambient = Ambient { level: 0.2, variation: 1.0, period: 0.02 };
    let mut bench = show(open(&rig), &rig, 0, 0.1);
    bench.clock.sleep(0.0123);
    assert_close(counts(&mut bench)[0] / WHITE, 0.2);
    bench.camera.configure(0.005).expect("within the range");
    let found = counts(&mut bench)[0] / WHITE / 0.05;
    assert!((found - 0.2).abs() > 0.05, "within a quarter of it, it does not: {found}");
}

#[test]
fn brightness_drifts_with_time() {
    let mut rig = rig(2, 2);
    rig.drift = Drift { per_hour: -0.1, ..Drift::default() };
    let mut bench = show(open(&rig), &rig, 255, 0.1);
    bench.clock.sleep(7200.0);
    let found = counts(&mut bench)[0] / WHITE;
    // 0.05 s of the exposure go by as well.
    assert!((found - 0.8).abs() < 0.51 / WHITE + 0.1 * 0.05 / 3600.0, "{found}");
    rig.drift = Drift { per_hour: 0.0, swing: 0.25, period: 40.0 };
    let mut bench = show(open(&rig), &rig, 255, 0.1);
    bench.clock.sleep(10.0 - 0.05);
    assert_close(counts(&mut bench)[0] / WHITE, 1.25);
}

#[test]
fn while_the_frame_changes_a_photo_is_a_mix_of_both() {
    let mut rig = rig(2, 2);
    (rig.projector.latency, rig.projector.frame_time) = (0.03, 0.02);
    let mut bench = show(open(&rig), &rig, 0, 0.1);
    let asked = bench.clock.now();
    let shown = bench.projector.show(&flat(&rig, 255)).expect("it fits");
    assert_eq!(shown.at, asked + 0.02, "a frame is confirmed at the next refresh");
    // Of 0.1 s, the old frame's light has the first 0.03, then, 0.02 s later, the rest of it.
    assert_close(counts(&mut bench)[0] / WHITE, 0.7);
    assert_close(counts(&mut bench)[0] / WHITE, 1.0);
    // Three frames within one exposure.
    bench.projector.show(&flat(&rig, 0)).expect("it fits");
    bench.projector.show(&flat(&rig, 51)).expect("it fits");
    // 0.01 s of white, 0.02 s of black, 0.07 s of a fifth.
    assert_close(counts(&mut bench)[0] / WHITE, 0.1 + 0.7 * 0.2);
}

#[test]
fn colours_meet_in_the_cameras_channels() {
    let mut rig = rig(2, 2);
    let size = rig.scene.size();
    let sheet = |glow| Box::new(Sheet { size, colour: [0.25, 1.0, 0.5], glow });
    rig.camera.channels = 3;
    let mut bench = show(rig.open(sheet([0.0; 3]), None).expect("it fits"), &rig, 255, 0.1);
    counts(&mut bench).chunks(3).for_each(|rgb| {
        rgb.iter().zip([0.25, 1.0, 0.5]).for_each(|(count, colour)| assert_close(count / WHITE, colour));
    });
    rig.projector.channels = 3;
    let mut bench = show(rig.open(sheet([0.0, 0.0, 0.125]), None).expect("it fits"), &rig, 0, 0.1);
    let red: Vec<u16> = [255, 0, 0].repeat(4);
    bench.projector.show(&Frame::new(size, 3, red).expect("as many levels")).expect("it fits");
    // The scene's own light is there whatever is shown.
    counts(&mut bench).chunks(3).for_each(|rgb| {
        rgb.iter().zip([0.25, 0.0, 0.125]).for_each(|(count, colour)| assert_close(count / WHITE, colour));
    });
    // A gray camera weighs them by luminance, and is as sensitive as its own white photo asks for.
    (rig.projector.channels, rig.camera.channels) = (3, 1);
    let mut bench = show(rig.open(sheet([0.0; 3]), None).expect("it fits"), &rig, 0, 0.1);
    let green: Vec<u16> = [0, 255, 0].repeat(4);
    bench.projector.show(&Frame::new(size, 3, green).expect("as many levels")).expect("it fits");
    let share = 0.7152 / (0.2126 * 0.25 + 0.7152 + 0.0722 * 0.5);
    assert_close(counts(&mut bench)[0] / WHITE, share);
    let fault = rig.open(diagonal(size, |_| 1.0), None).err().map(|error| error.to_string());
    assert!(fault.is_some_and(|fault| fault.contains("its scene is gray")));
}

#[test]
fn a_scene_that_does_not_fit_or_is_dark_is_refused() {
    let mut rig = rig(4, 3);
    assert!(matches!(rig.open(diagonal(Resolution::new(3, 4), |_| 1.0), None), Err(Error::Rig { .. })));
    let dark = rig.open(diagonal(rig.scene.size(), |_| 0.0), None).err().map(|error| error.to_string());
    assert!(dark.is_some_and(|fault| fault.contains("sees nothing")));
    rig.camera.shift = [10.0, 0.0];
    assert!(rig.open(diagonal(rig.scene.size(), |_| 1.0), None).is_err(), "it looks past the scene");
}
