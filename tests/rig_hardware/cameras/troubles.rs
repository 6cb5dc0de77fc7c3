//! Faults of a still camera, and their errors.

use std::path::Path;
use std::time::{Duration, Instant};

use krylux::rig::{Camera, Gphoto2Spec};

use super::studio::{SENSOR, Studio, counts};

/// The error of opening the camera.
#[track_caller]
fn refused(studio: &Studio, spec: &Gphoto2Spec) -> String {
    match studio.open(spec) {
        Ok(_) => panic!("it is refused"),
        Err(error) => error.to_string(),
    }
}

/// The error of taking a photo with an open camera.
#[track_caller]
fn failed(studio: &Studio, spec: &Gphoto2Spec) -> String {
    let mut camera = studio.open(spec).expect("it is there");
    camera.capture().expect_err("it cannot be taken").to_string()
}

#[track_caller]
fn says(message: &str, parts: &[&str]) {
    assert!(parts.iter().all(|part| message.contains(part)), "{message}");
}

#[test]
fn a_program_that_is_missing_is_named_with_its_package() {
    let studio = Studio::new();
    let spec = Gphoto2Spec { program: "/nonexistent/gphoto2".into(), ..studio.spec() };
    says(&refused(&studio, &spec), &["/nonexistent/gphoto2 is not installed", "apt install gphoto2"]);
    for (decoder, package) in [("dcraw", "apt install dcraw"), ("unprocessed_raw", "apt install libraw-bin")]
    {
        let spec = Gphoto2Spec { decoder: vec![format!("/nonexistent/{decoder}")], ..studio.spec() };
        says(&failed(&studio, &spec), &["is not installed", package]);
    }
}

#[test]
fn a_missing_camera_is_named_with_the_connected_ones() {
    let studio = Studio::new();
    let model = |model: &str| Gphoto2Spec { model: Some(model.into()), ..studio.spec() };
    says(&refused(&studio, &model("Other")), &["no camera \"Other\"", "it finds Krylux Still One"]);
    studio.cameras(&[("Krylux Still One", "usb:001,005"), ("Krylux Still Two", "usb:001,006")]);
    says(
        &refused(&studio, &studio.spec()),
        &["finds 2 cameras: Krylux Still One, Krylux Still Two", "give the model"],
    );
    assert!(studio.open(&model("Krylux Still Two")).is_ok());
    studio.cameras(&[]);
    says(&refused(&studio, &studio.spec()), &["gphoto2 finds no camera", "check that it is on"]);
}

#[test]
fn an_impossible_choice_is_named_with_the_possible_ones() {
    let studio = Studio::new();
    let spec = Gphoto2Spec { iso: Some("1000".into()), ..studio.spec() };
    says(
        &refused(&studio, &spec),
        &["iso has no choice \"1000\"; did you mean 100?", "choices are 100, 200, 400"],
    );
    let spec = Gphoto2Spec { aperture: Some("8".into()), ..studio.spec() };
    says(&refused(&studio, &spec), &["f-number has no choice \"8\"", "f/4, f/5.6, f/8"]);
    let mut spec = studio.spec();
    spec.settings.insert("isso".into(), "100".into());
    says(&refused(&studio, &spec), &["no setting isso; did you mean iso?", "--list-config"]);
    // Half a stop and a margin are accepted; 1/30 is a whole stop from both 1/60 and 1/15.
    let mut camera = studio.open(&studio.spec()).expect("it is there");
    assert!(camera.configure(1.0 / 75.0).is_ok());
    let message = camera.configure(1.0 / 30.0).expect_err("nothing is near").to_string();
    says(&message, &["no shutter speed near 0.033", "1/15, 1/60"]);
    let message = camera.configure(2.0).expect_err("the file says less").to_string();
    says(&message, &["an exposure of 2 s cannot be set", "from 0.001 to 1 s"]);
}

#[test]
fn errors_advise_to_turn_the_dial_to_m() {
    let studio = Studio::new();
    studio.write("settings/shutterspeed/fixed", "");
    says(&refused(&studio, &studio.spec()), &["cannot be set: it is 1/60", "dial to M"]);
    let studio = Studio::new();
    studio.write("settings/shutterspeed/stubborn", "");
    says(&refused(&studio, &studio.spec()), &["shutterspeed was set to 1/1000, but is 1/60", "dial to M"]);
    let studio = Studio::new();
    studio.write("settings/iso/fixed", "");
    says(&refused(&studio, &studio.spec()), &["iso cannot be set to 100: it is 400, and fixed"]);
}

#[test]
fn a_program_that_hangs_is_killed_after_its_time_limit() {
    let studio = Studio::new();
    let spec = Gphoto2Spec { timeout: 0.5, ..studio.spec() };
    let mut camera = studio.open(&spec).expect("it is there");
    studio.write("hangs", "");
    let began = Instant::now();
    // On a busy machine the script may be killed before it has written its process number: try again.
    let pid = loop {
        let message = camera.capture().expect_err("it cannot be taken").to_string();
        says(&message, &["did not end within 0.5 s, and was ended", "switch the camera off and on"]);
        if let Ok(pid) = std::fs::read_to_string(studio.path("pid")) {
            break pid;
        }
        assert!(began.elapsed() < Duration::from_secs(60), "it never began");
    };
    assert!(began.elapsed() < Duration::from_secs(120), "it does not sleep its ten minutes");
    let process = format!("/proc/{}", pid.trim());
    assert!(!Path::new(&process).exists(), "it was ended, and waited for");
    // The decoder is killed, too.
    let studio = Studio::new();
    studio.write("decoder-hangs", "");
    // Enough time for the release of the shutter.
    let spec = Gphoto2Spec { timeout: 5.0, ..studio.spec() };
    says(&failed(&studio, &spec), &["dcraw did not end within 5.0 s"]);
}

#[test]
fn a_camera_that_another_program_has_is_in_use() {
    let studio = Studio::new();
    let mut camera = studio.open(&studio.spec()).expect("it is free");
    studio.write(
        "claimed",
        "*** Error ***\nAn error occurred in the io-library ('Could not claim the USB device'): Could not claim interface 0 (Device or resource busy).\n",
    );
    for message in [refused(&studio, &studio.spec()), camera.capture().expect_err("it is in use").to_string()]
    {
        says(&message, &["is in use by another program", "a desktop that has mounted the camera"]);
    }
}

#[test]
fn a_program_that_fails_is_quoted() {
    let studio = Studio::new();
    studio.write("fails", "*** Error ***\nCanon EOS Capture failed: Perhaps mirror up?\n");
    let message = failed(&studio, &studio.spec());
    says(&message, &["gphoto2 failed (exit status: 1)", "Perhaps mirror up?"]);
}

#[test]
fn unexpected_output_is_an_error() {
    let studio = Studio::new();
    studio.write("cameras", b"\xFF\xD8 what is this\n".as_slice());
    says(&refused(&studio, &studio.spec()), &["gphoto2 finds no camera", "what is this"]);
    let studio = Studio::new();
    studio.write("settings/iso/garbage", "Segmentation fault\n");
    says(&refused(&studio, &studio.spec()), &["did not tell iso: Segmentation fault"]);
    let studio = Studio::new();
    studio.write("taken/photo.cr2", b"RAW\x00\x01 not a picture".as_slice());
    says(&failed(&studio, &studio.spec()), &["gave no gray picture (PGM) but 16 bytes", "correct decoder"]);
    // A truncated picture.
    let studio = Studio::new();
    studio.takes("cr2", SENSOR, &counts()[1..]);
    says(&failed(&studio, &studio.spec()), &["gave no gray picture"]);
}

#[test]
fn files_that_are_not_raw_files_of_this_sensor_are_refused() {
    let studio = Studio::new();
    studio.takes("JPG", SENSOR, &counts());
    says(&failed(&studio, &studio.spec()), &["took a JPEG, which is not linear", "image_format"]);
    // If there are both, the RAW file is used.
    studio.takes("nef", SENSOR, &counts());
    studio.write("taken/photo.jpg", "lossy");
    let found = studio.open(&studio.spec()).expect("it is there").capture().expect("it is there");
    assert_eq!(found.expect("it comes").counts, counts());
    let studio = Studio::new();
    std::fs::remove_file(studio.path("taken/photo.cr2")).expect("it is there");
    studio.write("taken/.nothing", "");
    says(&failed(&studio, &studio.spec()), &["left 0 files where one RAW file was expected"]);
    let studio = Studio::new();
    studio.takes("cr2", [4, 2], &[0; 8]);
    says(
        &failed(&studio, &studio.spec()),
        &["has 4x2 photosites, fewer than 12x8 at (0, 0)", "correct size"],
    );
    let studio = Studio::new();
    studio.takes("cr2", SENSOR, &[16384; 96]);
    says(&failed(&studio, &studio.spec()), &["counts up to 16384, more than 14 bits hold", "correct bits"]);
}

#[test]
fn no_temporary_files_are_left() {
    let studio = Studio::new();
    let mut camera = studio.open(&studio.spec()).expect("it is there");
    camera.capture().expect("it is there").expect("it comes");
    studio.write("fails", "gone\n");
    camera.capture().expect_err("it fails");
    let places = std::fs::read_to_string(studio.path("places")).expect("it was run");
    assert!(places.lines().count() > 5, "{places}");
    assert!(places.lines().all(|place| !Path::new(place).exists()), "{places}");
}
