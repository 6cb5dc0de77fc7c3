//! Faults that exist from the beginning: the program names them before it takes a photo.

use krylux::rig::{Camera, CameraSpec, GigeVision, WallClock};

use super::Run;
use crate::program::assert_error;

/// Asserts that the program refuses with a message that has these parts.
#[track_caller]
fn refused(run: &Run, parts: &[&str]) {
    let message = assert_error(&run.again(), parts);
    println!("{message}");
    assert_eq!(run.stage.camera.frames(), 0, "{message}");
}

#[test]
fn a_monitor_of_the_wrong_size_is_named_with_both_sizes() {
    let run = Run::new(50);
    run.replace("magnify", "monitor_size = [1920, 1080]\nmagnify");
    refused(
        &run,
        &[
            "projector",
            "monitor beamer has 200x200 pixels",
            "says 1920x1080",
            "--mode 1920x1080",
            "monitor_size",
        ],
    );
    run.replace("monitor_size = [1920, 1080]", "monitor_size = [200, 200]");
    run.replace("magnify = 7", "magnify = 17");
    refused(&run, &["projector", "fewer than the 204x204", "smaller size or magnify in [projector]"]);
}

#[test]
fn a_camera_that_another_program_holds_is_named_and_free_afterwards() {
    let run = Run::new(51);
    let CameraSpec::Genicam(spec) = &run.stage.hardware.camera else {
        unreachable!("the stage has a camera on the network")
    };
    let mut other = GigeVision::open(spec, WallClock::starting_at(0.0), 0).expect("it is free");
    let held = format!("camera at {} is in use by another program", run.address());
    refused(&run, &[&held, "end that program"]);
    // The first program still holds the camera.
    assert!(other.capture().expect("it is there").is_some());
    drop(other);
    let output = run.again();
    run.assert_went_on(&output);
}

#[test]
fn exposures_that_the_camera_cannot_do_are_named_with_those_that_it_can() {
    let run = Run::new(52);
    run.replace("exposures = [1e-4, 1.0]", "exposures = [1e-6, 1.0]");
    refused(
        &run,
        &[
            &format!("camera at {} does exposures from 0.00002 to 2 s", run.address()),
            "says 0.000001 to 1 s",
            "[camera]",
        ],
    );
    run.replace("exposures = [1e-6, 1.0]", "exposures = [1e-4, 1.0]");
    run.replace("direct_square", "exposures = [1.5]\ndirect_square");
    refused(&run, &["[measurement] exposures: 1.5 s", "camera's range", "from 0.0001 to 1"]);
}

#[test]
fn a_scene_that_is_too_bright_is_named_with_advice() {
    let run = Run::new(53);
    // White fills half of the counts in 4 ms.
    run.replace("exposures = [1e-4, 1.0]", "exposures = [0.012, 1.0]");
    let message = assert_error(
        &run.again(),
        &["camera", "a white frame saturates it even at its shortest exposure, 0.012 s", "close the lens"],
    );
    println!("{message}");
    // With given exposures none is searched for: then the photo itself fails.
    run.replace("exposures = [0.012, 1.0]", "exposures = [1e-4, 1.0]");
    run.replace("direct_square", "exposures = [0.05]\ndirect_square");
    let message =
        assert_error(&run.again(), &["camera", "saturated in every exposure", "shorter", "[measurement]"]);
    println!("{message}");
}
