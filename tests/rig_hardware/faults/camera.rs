//! Faults of the camera and its frames.

use std::time::Duration;

use super::Run;

#[test]
fn a_camera_that_fails_and_comes_back_does_not_end_the_run() {
    let mut run = Run::new(40);
    let output = run.disturbed(|stage, _| {
        stage.camera.stop();
        std::thread::sleep(Duration::from_millis(300));
        stage.switch_camera_on();
    });
    let effort = run.assert_went_on(&output);
    assert_eq!(effort["restarts"], 1, "{effort}");
}

#[test]
fn a_camera_that_fails_ends_the_run_which_resumes_when_it_is_back() {
    let mut run = Run::new(41);
    let output = run.disturbed(|stage, _| stage.camera.stop());
    run.stage.switch_camera_on();
    let where_from = format!("no GigE Vision camera answers at {}", run.address());
    let message = run.assert_resumes(&output, &["camera", &where_from, "power"]);
    println!("{message}");
}

#[test]
fn every_photo_is_right_when_two_packets_in_a_hundred_are_lost() {
    let mut run = Run::new(42);
    // Small packets, so that there are enough to lose some; a fixed seed selects them.
    run.replace("pixel_format", "packet_size = 576\npixel_format");
    run.stage.camera.lose(0.02);
    let output = run.disturbed(|_, _| {});
    let effort = run.assert_went_on(&output);
    println!("{} packets lost: {effort}", run.stage.camera.lost());
    assert!(run.stage.camera.lost() > 0, "the test needs a loss");
    assert!(effort["resent"].as_u64().is_some_and(|resent| resent > 0), "{effort}");
}

#[test]
fn a_frame_that_was_exposed_before_the_pattern_was_shown_is_refused() {
    let mut run = Run::new(43);
    let output = run.disturbed(|stage, _| stage.camera.be_late(2));
    let effort = run.assert_went_on(&output);
    assert_eq!(effort["late"], 2, "{effort}");
}
