//! Who holds a camera, and what it can do.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

use krylux::rig::{Camera, GigeSpec, GigeVision, PixelFormat, WallClock};

use crate::gige_camera::GigeCamera;
use crate::support::{Lamp, address, camera, refused, scene, spec};

fn open(spec: &GigeSpec) -> krylux::Result<GigeVision> {
    GigeVision::open(spec, WallClock::starting_at(0.0), 0)
}

/// Takes control by hand, and says nothing more: as a program does that crashed.
fn seize(last: u8) -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port is free");
    let command = [0x42, 1, 0, 0x82, 0, 8, 0, 1, 0, 0, 0x0A, 0, 0, 0, 0, 2];
    socket.send_to(&command, (address(last), 3956)).expect("it is there");
    let mut answer = [0; 64];
    let length = socket.recv(&mut answer).expect("it answers");
    assert_eq!(answer[..2], [0, 0], "control is given: {:?}", &answer[..length]);
    socket
}

#[test]
fn a_camera_that_is_let_go_is_free_at_once() {
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
fn a_second_program_is_told_who_holds_the_camera_and_a_dead_one_is_waited_for() {
    let lamp = Lamp::new(WallClock::starting_at(0.0));
    let _device = camera(41, &lamp);
    let mut first = open(&spec(41)).expect("it is free");
    let message = refused(open(&spec(41)));
    assert!(message.contains("127.0.7.41 is held by another program"), "{message}");
    assert!(first.capture().expect("it is still the first one's").is_some());
    drop(first);
    let _dead = seize(41);
    let mut next = open(&spec(41)).expect("a heartbeat of three seconds ran out");
    assert!(next.capture().expect("it is there").is_some());
}

#[test]
fn what_a_camera_cannot_do_is_named_when_it_is_opened() {
    let lamp = Lamp::new(WallClock::starting_at(0.0));
    let _device = GigeCamera::start(address(42), scene(12), lamp.look());
    let with = |change: fn(&mut GigeSpec)| {
        let mut spec = spec(42);
        change(&mut spec);
        refused(open(&spec))
    };
    let message = with(|spec| spec.pixel_format = PixelFormat::Mono14);
    assert!(
        message.contains("has no pixel format Mono14") && message.contains("Mono8, Mono12, Mono16"),
        "{message}"
    );
    let message = with(|spec| spec.size = [64, 20]);
    assert!(message.contains("no region of 64x20 pixels"), "{message}");
    let message = with(|spec| spec.exposures = [1e-6, 0.1]);
    assert!(
        message.contains("does exposures from 0.00002 to 2 s, but the rig file says 0.000001"),
        "{message}"
    );
    let message = with(|spec| spec.gain = Some(100.0));
    assert!(message.contains("did not set a gain of 100"), "{message}");
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
    assert!(message.contains("no GigE Vision camera answers at 127.0.7.43"), "{message}");
}
