//! What happens to packets, frames and cameras, and what is left of it.

use std::time::Duration;

use krylux::measure::FrameSource;
use krylux::rig::WallClock;

use super::support::{Lamp, address, camera, expected, frame, live, refused, scene, shot, spec};

#[test]
fn with_two_packets_lost_in_a_hundred_every_photo_is_right() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let device = camera(20, &lamp);
    // Small packets, that there are some to lose.
    let spec = krylux::rig::GigeSpec { packet_size: Some(576), ..spec(20) };
    let mut shots = live(&spec, &lamp, clock).expect("it answers");
    device.lose(0.02);
    let scene = scene(12);
    for number in 0..150 {
        let found = shots.capture(&shot(number, 0.001)).expect("it comes");
        assert_eq!(found.counts, expected(&scene, &frame(number), 0.001), "pattern {number}");
    }
    let effort = shots.effort();
    println!("{} packets lost, {} resent, {} frames dropped", device.lost(), effort.resent, effort.dropped);
    // 150 frames of 6 packets: 18 on average, and a chance of 1e-5 for fewer than 4.
    assert!(device.lost() >= 4 && effort.resent > 0, "{effort:?}");
    assert_eq!(effort.taken, 150);
}

#[test]
fn a_camera_that_dies_and_comes_back_goes_on() {
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
    // Its exposure is what it was.
    assert_eq!(after.exposure, before.exposure);
}

#[test]
fn a_camera_that_dies_for_good_is_named() {
    let clock = WallClock::starting_at(0.0);
    let lamp = Lamp::new(clock);
    let device = camera(22, &lamp);
    let mut shots = live(&spec(22), &lamp, clock).expect("it answers");
    drop(device);
    let message = refused(shots.capture(&shot(1, 0.003)));
    assert!(message.contains(&format!("no GigE Vision camera answers at {}", address(22))), "{message}");
}

#[test]
fn a_frame_exposed_before_the_pattern_was_shown_is_caught() {
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
    // Without the check, this is what the photo would have been.
    assert_ne!(found.counts, expected(&scene, &frame(1), 0.002));
}
