//! Faults of the projector's window, its server and the helper process.

use std::path::Path;
use std::process::Command;

use super::Run;
use crate::bench::{devices, monitors, stage_at};
use crate::program::text;
use crate::x_server::XServer;

#[test]
fn a_covered_window_ends_the_run_which_resumes_when_it_is_free() {
    let mut run = Run::new(30);
    let mut above = None;
    // The other window does not cover the pattern, but its light reaches the scene.
    let output = run.disturbed(|stage, _| above = Some(stage.server.cover([210, 10, 20, 20])));
    run.stage.server.close(above.expect("it was covered"));
    let message = run.assert_resumes(&output, &["projector", "covered by another one", "notifications"]);
    println!("{message}");
}

#[test]
fn a_closed_window_ends_the_run_which_resumes_with_a_new_one() {
    let mut run = Run::new(31);
    let output = run.disturbed(|stage, _| {
        stage.server.close(*stage.server.windows().last().expect("the projector's is the uppermost"));
    });
    let message = run.assert_resumes(&output, &["projector", "window was closed", "leave it alone"]);
    println!("{message}");
}

#[test]
fn a_server_that_ends_ends_the_run_which_resumes_when_it_is_back() {
    // A separate range of displays, because another test may take the lowest free one before this server comes back.
    let display = format!(":{}", 3000 + std::process::id() % 20_000);
    let mut run = Run::on(stage_at(32, &devices(Path::new("rooms.npz")), Some(&display)));
    let output = run.disturbed(|stage, _| stage.server.kill());
    // Resuming too early loses nothing, either.
    let without = run.resumed();
    let message =
        crate::program::assert_error(&without, &["projector", &display, "cannot be reached", "DISPLAY"]);
    println!("{message}");
    run.stage.server = XServer::at(&display, 400, 200);
    monitors(&run.stage.server);
    let message = run.assert_resumes(&output, &["projector", "the X server is gone", "start it again"]);
    println!("{message}");
}

#[test]
fn a_monitor_that_was_off_ends_the_run_which_resumes_when_it_is_on() {
    let mut run = Run::new(34);
    let output = run.disturbed(|stage, _| stage.server.interrupt());
    let message = run.assert_resumes(&output, &["projector", "monitors were changed", "leave them alone"]);
    println!("{message}");
}

#[test]
fn a_killed_helper_process_loses_no_photo() {
    let mut run = Run::new(33);
    let mut killed = 0;
    let output = run.disturbed(|_, program| {
        for helper in children(program) {
            assert!(Command::new("kill").args(["-KILL", &helper]).status().expect("it is there").success());
            killed += 1;
        }
    });
    assert_eq!(killed, 1, "the program has one helper");
    // If the helper was killed while it showed a frame, another helper shows it. If it was killed during an exposure, it is unknown what
    // was on screen, and the run fails.
    if output.status.success() {
        run.assert_went_on(&output);
    } else {
        println!("{}", run.assert_resumes(&output, &["projector", "helper process", "failed"]));
    }
}

/// The child processes of this process.
fn children(program: u32) -> Vec<String> {
    let processes = std::fs::read_dir("/proc").expect("a Linux system").filter_map(Result::ok);
    let names = processes.filter_map(|process| process.file_name().into_string().ok());
    let of_program = |name: &String| {
        // A process may end before its status is read.
        let status = std::fs::read(format!("/proc/{name}/status")).unwrap_or_default();
        text(&status).contains(&format!("\nPPid:\t{program}\n"))
    };
    names.filter(of_program).collect()
}
