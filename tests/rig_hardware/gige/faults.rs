//! Lost packets, late frames, and cameras that fail.

use std::time::Duration;

use krylux::measure::FrameSource;
use krylux::rig::WallClock;

use super::support::{Lamp, address, camera, expected, frame, live, refused, scene, shot, spec};

#[test]
fn every_photo_is_right_when_two_packets_in_a_hundred_are_lost() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let device = camera(20, &lamp);
    // Small packets, so that there are enough to lose some.
    let spec = krylux::rig::GenicamSpec { packet_size: Some(576), ..spec(20) };
    let mut shots = live(&spec, &lamp, clock).expect("it answers");
    device.lose(0.02);
    let scene = scene(12);
    for number in 0..150 {
        let found = shots.capture(&shot(number, 0.001)).expect("it comes");
        assert_eq!(found.counts, expected(&scene, &frame(number), 0.001), "pattern {number}");
    }
    let effort = shots.effort();
    println!("{} packets lost, {} resent, {} frames dropped", device.lost(), effort.resent, effort.dropped);
    // On average 150 frames of 6 packets lose 18 packets; the probability of fewer than 4 is 1e-5.
    assert!(device.lost() >= 4 && effort.resent > 0, "{effort:?}");
    assert_eq!(effort.taken, 150);
}

#[test]
fn frames_without_a_packet_are_counted_as_incomplete_and_not_as_missing() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let device = camera(24, &lamp);
    // Frames that are incomplete are waited for until the end: a busy machine may be slow to send them.
    let spec = krylux::rig::GenicamSpec { packet_size: Some(576), timeout: 1.0, ..spec(24) };
    let mut shots = live(&spec, &lamp, clock).expect("it answers");
    shots.capture(&shot(0, 0.001)).expect("it comes");
    device.always_lose(2);
    let message = refused(shots.capture(&shot(1, 0.001)));
    let effort = shots.effort();
    let [tries, missing] = [effort.incomplete + effort.dropped, effort.missing];
    assert!(effort.incomplete >= 4 && tries == 6 && missing >= effort.incomplete, "{effort:?}");
    let said =
        format!("{} came incomplete ({missing} packets were lost, and not sent again)", effort.incomplete);
    assert!(message.contains(&said) && message.contains("packet_size"), "{message}");
    device.always_lose(u32::MAX);
    assert_eq!(
        shots.capture(&shot(1, 0.001)).expect("it comes").counts,
        expected(&scene(12), &frame(1), 0.001)
    );
}

#[test]
fn a_camera_that_fails_and_comes_back_is_reopened() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let device = camera(21, &lamp);
    let mut shots = live(&spec(21), &lamp, clock).expect("it answers");
    let scene = scene(12);
    let before = shots.capture(&shot(1, 0.003)).expect("it comes");
    drop(device);
    let again = std::thread::spawn({
        let lamp = lamp.clone();
        move || {
            std::thread::sleep(Duration::from_millis(300));
            camera(21, &lamp)
        }
    });
    let after = shots.capture(&shot(2, 0.003)).expect("it came back");
    let _device = again.join().expect("it was switched on");
    assert_eq!(after.counts, expected(&scene, &frame(2), 0.003));
    assert!(after.id > before.id && after.started > before.started);
    assert_eq!(shots.effort().restarts, 1);
    // The exposure is unchanged.
    assert_eq!(after.exposure, before.exposure);
}

#[test]
fn a_camera_that_fails_for_good_is_named() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let device = camera(22, &lamp);
    let mut shots = live(&spec(22), &lamp, clock).expect("it answers");
    drop(device);
    let message = refused(shots.capture(&shot(1, 0.003)));
    assert!(message.contains(&format!("no GigE Vision camera answers at {}", address(22))), "{message}");
}

#[test]
fn a_frame_exposed_before_the_pattern_was_shown_is_refused() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let device = camera(23, &lamp);
    let mut shots = live(&spec(23), &lamp, clock).expect("it answers");
    let scene = scene(12);
    shots.capture(&shot(1, 0.002)).expect("it comes");
    device.be_late(2);
    let found = shots.capture(&shot(2, 0.002)).expect("it comes in the end");
    assert_eq!(shots.effort().late, 2, "both were refused");
    assert_eq!(found.counts, expected(&scene, &frame(2), 0.002));
    // Without the check, the photo would show the previous pattern.
    assert_ne!(found.counts, expected(&scene, &frame(1), 0.002));
}
