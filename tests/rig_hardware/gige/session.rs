//! The control of a camera by one program, and the camera's limits.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

use krylux::rig::{Camera, GenicamSpec, GigeVision, PixelFormat, WallClock, gige_camera_abilities};

use super::support::{Lamp, address, camera, refused, scene, spec};
use crate::gige_camera::GigeCamera;

fn open(spec: &GenicamSpec) -> krylux::Result<GigeVision> {
    GigeVision::open(spec, WallClock::starting_at(0.0), 0)
}

/// Takes control of the camera, by this value of its privilege, and sends no heartbeat, as a program that crashed.
fn seize(last: u8, privilege: u8) -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port is free");
    let command = [0x42, 1, 0, 0x82, 0, 8, 0, 1, 0, 0, 0x0A, 0, 0, 0, 0, privilege];
    socket.send_to(&command, (address(last), 3956)).expect("it is there");
    let mut answer = [0; 64];
    let length = socket.recv(&mut answer).expect("it answers");
    assert_eq!(answer[..2], [0, 0], "control is given: {:?}", &answer[..length]);
    socket
}

#[test]
fn a_released_camera_is_free_at_once() {
    let lamp = Lamp::new(WallClock::starting_at(0.0));
    let _device = camera(40, &lamp);
    drop(open(&spec(40)).expect("it is free"));
    let began = Instant::now();
    let mut again = open(&spec(40)).expect("it is free again");
    assert!(
        began.elapsed() < Duration::from_millis(2500),
        "no heartbeat has to run out: {:?}",
        began.elapsed()
    );
    assert!(again.capture().expect("it is there").is_some());
}

#[test]
fn a_held_camera_is_named_and_a_crashed_owners_heartbeat_is_awaited() {
    let lamp = Lamp::new(WallClock::starting_at(0.0));
    let _device = camera(41, &lamp);
    let mut first = open(&spec(41)).expect("it is free");
    let message = refused(open(&spec(41)));
    assert!(message.contains(&format!("{} is in use by another program", address(41))), "{message}");
    assert!(first.capture().expect("it is still the first one's").is_some());
    drop(first);
    let _dead = seize(41, 2);
    let mut next = open(&spec(41)).expect("a heartbeat of three seconds ran out");
    assert!(next.capture().expect("it is there").is_some());
}

/// Such a camera refuses to be read as well: its description, which is read before it is opened, says nothing.
#[test]
fn a_camera_that_is_held_exclusively_is_in_use() {
    let lamp = Lamp::new(WallClock::starting_at(0.0));
    let _device = camera(44, &lamp);
    let _owner = seize(44, 1);
    let message = refused(gige_camera_abilities(address(44)));
    let expected = format!("the camera at {} is in use by another program", address(44));
    assert!(message.contains(&expected) && message.contains("end that program"), "{message}");
}

#[test]
fn unsupported_settings_are_named_when_the_camera_is_opened() {
    let lamp = Lamp::new(WallClock::starting_at(0.0));
    let _device = GigeCamera::start(address(42), scene(12), lamp.look());
    let with = |change: fn(&mut GenicamSpec)| {
        let mut spec = spec(42);
        change(&mut spec);
        refused(open(&spec))
    };
    let message = with(|spec| spec.pixel_format = PixelFormat::Mono14);
    for part in ["has no pixel format Mono14", "it has Mono8, Mono10,", "Mono12p, Mono16, BayerRG8"] {
        assert!(message.contains(part), "{message}");
    }
    for (size, offset, part) in [
        (
            [64, 20],
            [0, 0],
            "camera.size[0] is 64, but Width of the camera at ADDRESS is 4 to 48 in steps of 4",
        ),
        (
            [18, 20],
            [0, 0],
            "camera.size[0] is 18, but Width of the camera at ADDRESS is 4 to 48 in steps of 4",
        ),
        ([48, 21], [0, 0], "camera.size[1] is 21, but Height of the camera at ADDRESS is 1 to 20"),
        (
            [16, 8],
            [34, 0],
            "camera.offset[0] is 34, but OffsetX of the camera at ADDRESS is 0 to 32 in steps of 2",
        ),
        (
            [16, 8],
            [3, 0],
            "camera.offset[0] is 3, but OffsetX of the camera at ADDRESS is 0 to 32 in steps of 2",
        ),
        ([16, 8], [0, 13], "camera.offset[1] is 13, but OffsetY of the camera at ADDRESS is 0 to 12"),
    ] {
        let message = refused(open(&GenicamSpec { size, offset, ..spec(42) }));
        let part = part.replace("ADDRESS", &address(42).to_string());
        assert!(message.contains(&part), "{message}");
    }
    let message = with(|spec| spec.exposures = [1e-6, 0.1]);
    assert!(
        message.contains("does exposures from 0.00002 to 2 s, but the rig file says 0.000001"),
        "{message}"
    );
    let message = with(|spec| spec.gain = Some(100.0));
    let limits = format!("camera.gain is 100, but Gain of the camera at {} is 0 to 24", address(42));
    assert!(message.contains(&limits), "{message}");
    // The settings of one session do not disturb the next.
    drop(open(&GenicamSpec { size: [16, 8], offset: [32, 12], ..spec(42) }).expect("it can do that"));
    let mut opened = open(&spec(42)).expect("it can do that");
    let message = refused(opened.configure(0.6));
    assert!(
        message.contains("an exposure of 0.6 s cannot be set") && message.contains("to 0.5 s"),
        "{message}"
    );
}

#[test]
fn an_address_without_a_camera_is_named() {
    let message = refused(open(&spec(43)));
    assert!(message.contains(&format!("no GigE Vision camera answers at {}", address(43))), "{message}");
}
