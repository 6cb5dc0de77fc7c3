//! What a still camera's photos are.

use std::process::Command;

use krylux::image::Resolution;
use krylux::rig::{Camera, Colour, Gphoto2, Gphoto2Spec, Tiles, WallClock};
use serde_json::Value;

use super::studio::{SENSOR, Studio, counts};

#[test]
fn a_photo_is_the_decoders_counts_at_the_speed_that_was_set() {
    let studio = Studio::new();
    let clock = WallClock::starting_at(5.0);
    let mut camera = Gphoto2::open(&studio.spec(), clock, 7).expect("it is there");
    assert_eq!((studio.current("iso"), studio.current("imageformat")), ("100".into(), "RAW".into()));
    assert_eq!(studio.current("capturetarget"), "Internal RAM");
    assert_eq!(studio.current("shutterspeed"), "1/1000", "the shortest, until another is asked for");
    // What is near is told as it is, not as it was asked for.
    assert_eq!(camera.configure(0.2).expect("within range"), 0.25);
    assert_eq!(studio.current("shutterspeed"), "1/4");
    for number in 8..11 {
        let before = clock.seconds();
        let found = camera.capture().expect("it is there").expect("it comes");
        assert_eq!((found.resolution, found.channels), (Resolution::new(SENSOR[0], SENSOR[1]), 1));
        assert_eq!((found.counts, found.exposure, found.id), (counts(), 0.25, number));
        assert!(found.started >= before && found.started <= clock.seconds());
    }
    // The port is the one that was found, in each question.
    assert!(
        studio.log().iter().skip(1).all(|line| line.starts_with("--port usb:001,005 ")),
        "{:?}",
        studio.log()
    );
}

#[test]
fn what_is_set_already_is_left_alone() {
    let studio = Studio::new();
    studio.setting("iso", "100", &["100", "200"]);
    studio.write("settings/iso/fixed", "");
    let camera = studio.open(&studio.spec()).expect("nothing has to be set");
    assert!(studio.log().iter().all(|line| !line.contains("--set-config-value iso")));
    assert_eq!(camera.info().bits, 14);
}

#[test]
fn a_part_of_the_sensor_becomes_pixels_of_its_cells() {
    let studio = Studio::new();
    let part = Gphoto2Spec { size: [4, 2], offset: [6, 4], tiles: Some(Tiles::Gbrg), ..studio.spec() };
    let site = |x: usize, y: usize| u32::from(counts()[(4 + y) * SENSOR[0] + 6 + x]);
    let mut camera = studio.open(&part).expect("it is there");
    assert_eq!(
        (camera.info().resolution, camera.info().channels, camera.info().bits),
        (Resolution::new(2, 1), 3, 15)
    );
    let found = camera.capture().expect("it is there").expect("it comes");
    let pixel = |x: usize| [2 * site(x, 1), site(x, 0) + site(x + 1, 1), 2 * site(x + 1, 0)];
    assert_eq!(
        found.counts.iter().map(|&count| u32::from(count)).collect::<Vec<_>>(),
        [pixel(0), pixel(2)].concat()
    );
    let mut camera = studio.open(&Gphoto2Spec { colour: Colour::Green, ..part }).expect("it is there");
    let found = camera.capture().expect("it is there").expect("it comes");
    assert_eq!(
        found.counts.iter().map(|&count| u32::from(count)).collect::<Vec<_>>(),
        [pixel(0)[1], pixel(2)[1]]
    );
}

#[test]
fn a_white_level_below_all_bits_is_full() {
    let studio = Studio::new();
    let most = *counts().iter().max().expect("there are some");
    let spec = Gphoto2Spec { saturation: Some(most), ..studio.spec() };
    let found = studio.open(&spec).expect("it is there").capture().expect("it is there").expect("it comes");
    assert_eq!(found.counts.iter().filter(|&&count| count == (1 << 14) - 1).count(), 1);
}

#[test]
fn speeds_are_powers_of_a_root_of_two_where_the_file_says_so() {
    let studio = Studio::new();
    let mut camera = studio.open(&Gphoto2Spec { stops: Some(3), ..studio.spec() }).expect("it is there");
    let set = camera.configure(1.0 / 60.0).expect("within range");
    assert!((set - 1.0 / 64.0).abs() < 1e-12, "{set}");
    assert_eq!(studio.current("shutterspeed"), "1/60");
    // 30 is 32, which is what was asked for, and more than the file says: it stays so over a restart.
    let spec = Gphoto2Spec { stops: Some(3), exposures: [1e-3, 30.0], ..studio.spec() };
    let mut camera = studio.open(&spec).expect("it is there");
    assert_eq!(camera.configure(30.0).expect("within range"), 32.0);
    camera.restart().expect("it is there");
    assert_eq!(camera.capture().expect("it is there").expect("it comes").exposure, 32.0);
}

#[test]
fn a_camera_that_was_switched_off_and_on_is_found_at_its_new_port() {
    let studio = Studio::new();
    let mut camera = studio.open(&studio.spec()).expect("it is there");
    let set = camera.configure(0.25).expect("within range");
    studio.cameras(&[("Krylux Still One", "usb:001,006")]);
    studio.setting("iso", "400", &["100", "200", "400"]);
    studio.setting("shutterspeed", "1/60", &["1", "1/4", "1/60", "1/1000"]);
    assert!(camera.capture().is_err(), "its port is gone");
    camera.restart().expect("it is back");
    assert_eq!([studio.current("iso"), studio.current("shutterspeed")], ["100", "1/4"]);
    assert_eq!(camera.capture().expect("it is there").expect("it comes").exposure, set);
}

#[test]
fn a_decoder_may_leave_its_picture_beside_the_file() {
    let studio = Studio::new();
    let mut spec = studio.spec();
    spec.decoder.push("--beside".into());
    let mut camera = studio.open(&spec).expect("it is there");
    assert_eq!(camera.capture().expect("it is there").expect("it comes").counts, counts());
}

#[test]
fn the_list_names_still_cameras_that_are_there() {
    let studio = Studio::new();
    studio.cameras(&[("Krylux Still One", "usb:001,005"), ("Nikon DSC D700 (PTP mode)", "usb:002,011")]);
    let list = |path: String| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_krylux"));
        command.args(["rig", "list", "--display", ":4094", "--json"]).env("PATH", path);
        let output = command.output().expect("the program is built with the tests");
        let said: Value = serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON");
        (said, String::from_utf8_lossy(&output.stderr).into_owned())
    };
    // The script itself needs programs of the system's.
    let path = std::env::var("PATH").expect("there is one");
    let (said, _) = list(format!("{}:{path}", studio.folder.path().display()));
    let stills: Vec<&Value> = said["cameras"]
        .as_array()
        .expect("an array")
        .iter()
        .filter(|camera| camera["kind"] == "gphoto2")
        .collect();
    assert_eq!(stills.len(), 2, "{said}");
    assert_eq!(
        (&stills[1]["model"], &stills[1]["port"]),
        (&"Nikon DSC D700 (PTP mode)".into(), &"usb:002,011".into())
    );
    let (said, notes) = list("/nonexistent".into());
    assert!(said["cameras"].as_array().expect("an array").iter().all(|camera| camera["kind"] != "gphoto2"));
    assert!(
        notes.contains("the program gphoto2 is not installed") && notes.contains("apt install gphoto2"),
        "{notes}"
    );
}
