//! Faults of the projector's window, the server and the helper process are noticed and named.

use std::time::{Duration, Instant};

use krylux::image::Resolution;
use krylux::rig::{Frame, Helper, Projector, WallClock, X11Monitor, X11Projector, X11Spec};

use super::{helper, on, open, refused, spec};
use crate::x_server::XServer;

fn gray(level: u16) -> Frame {
    Frame::filled(Resolution::new(16, 12), 1, level)
}

/// A server, and a projector on it that shows a frame.
fn showing() -> (XServer, X11Projector) {
    let server = XServer::start(64, 48);
    let mut projector = open(&spec(&server, [16, 12])).expect("the server is there");
    projector.show(&gray(100)).expect("it is on screen");
    projector.confirm().expect("nothing happened");
    (server, projector)
}

fn send(signal: &str, projector: &X11Projector) {
    let id = projector.helper_id().expect("it lives").to_string();
    let sent = std::process::Command::new("sh").args(["-c", &format!("kill -{signal} {id}")]).status();
    assert!(sent.expect("a shell").success());
}

#[test]
fn a_monitor_that_is_missing_or_does_not_fit_is_named() {
    let server = XServer::start(640, 240);
    server.add_monitor("beamer", [0, 0, 320, 240]);
    server.add_monitor("desk", [320, 0, 320, 240]);
    let spec = X11Spec { monitor: on("baemer"), ..spec(&server, [16, 12]) };
    let message = refused(open(&spec));
    assert!(message.contains("no monitor \"baemer\"; did you mean \"beamer\"?"), "{message}");
    assert!(message.contains("(desk)"), "{message}");
    let message = refused(open(&X11Spec { monitor: X11Monitor::Number(9), ..spec.clone() }));
    assert!(message.contains("no monitor \"9\""), "{message}");
    let beamer = X11Spec { monitor: on("beamer"), ..spec };
    let message = refused(open(&X11Spec { size: [321, 12], ..beamer.clone() }));
    assert!(message.contains("monitor beamer has 320x240 pixels, fewer than the 321x12"), "{message}");
    let message = refused(open(&X11Spec { monitor_size: Some([1920, 1080]), ..beamer.clone() }));
    assert!(message.contains("320x240 pixels, but the rig file says 1920x1080"), "{message}");
    assert!(open(&X11Spec { monitor_size: Some([320, 240]), ..beamer }).is_ok());
}

#[test]
fn a_gamma_ramp_is_refused_only_where_somebody_has_set_one() {
    let server = XServer::start(64, 48);
    let spec = spec(&server, [16, 12]);
    let ramp = |gamma: f64| -> Vec<u16> {
        (0..256).map(|at| (65535.0 * (f64::from(at) / 255.0).powf(gamma)).round() as u16).collect()
    };
    assert!(!spec.monitor().expect("this server has no display").knows_ramp);
    let [straight, bent, off] = [ramp(1.0), ramp(1.1), vec![0; 256]];
    for blue in [&bent, &off] {
        server.set_gamma([&straight, &straight, blue]);
        let message = refused(spec.monitor());
        assert!(message.contains("has a gamma ramp") && message.contains("--gamma 1:1:1"), "{message}");
    }
    server.set_gamma([&straight; 3].map(Vec::as_slice));
    assert!(spec.monitor().expect("it is straight").knows_ramp);
}

/// Such a server starts anew whenever its last client leaves, and then answers with memory that nobody has written.
#[test]
fn a_server_that_resets_has_no_gamma_ramp() {
    let (mut process, display) = XServer::process(&["-screen", "0", "64x48x24"]);
    let spec = X11Spec { display: Some(display), ..X11Spec::new(16, 12) };
    // Who comes in the middle of a new start is sent away.
    let asked = || loop {
        match spec.monitor() {
            Err(why) if why.to_string().contains("cannot be reached") => {
                std::thread::sleep(Duration::from_millis(20));
            }
            answer => break answer.map(|monitor| monitor.knows_ramp),
        }
    };
    let found: Vec<_> = (0..6).map(|_| asked()).collect();
    process.kill().and_then(|()| process.wait()).expect("it lives");
    assert!(found.iter().all(|found| matches!(found, Ok(false))), "{found:?}");
}

#[test]
fn a_server_that_is_missing_or_has_too_few_bits_is_named() {
    let nowhere = X11Spec { display: Some(":4095".into()), ..X11Spec::new(16, 12) };
    let message = refused(open(&nowhere));
    assert!(message.contains("the X server \":4095\" cannot be reached"), "{message}");
    let coarse = XServer::of_depth(64, 48, 16);
    let message = refused(open(&spec(&coarse, [16, 12])));
    assert!(message.contains("depth 16, does not show 8 bits for each colour"), "{message}");
}

#[test]
fn a_covered_window_is_named_and_shows_again_when_it_is_free() {
    let (server, mut projector) = showing();
    let above = server.cover([0, 0, 8, 8]);
    // The other window does not cover the pattern, but its light reaches the scene.
    let message = refused(projector.confirm());
    assert!(message.contains("the projector's window is covered by another one"), "{message}");
    assert!(refused(projector.show(&gray(7))).contains("is covered"));
    server.close(above);
    let freed = Instant::now();
    while projector.show(&gray(7)).is_err() {
        assert!(freed.elapsed() < Duration::from_secs(5), "it is free");
    }
    projector.confirm().expect("nothing is above it");
}

#[test]
fn a_window_that_was_covered_for_a_moment_is_named() {
    let (server, mut projector) = showing();
    let above = server.cover([20, 20, 8, 8]);
    server.close(above);
    let message = refused(projector.confirm());
    assert!(message.contains("covered") || message.contains("not what was drawn"), "{message}");
}

#[test]
fn drawing_by_another_program_is_noticed() {
    let (server, mut projector) = showing();
    let window = *server.windows().last().expect("the projector's");
    server.scribble(window);
    let message = refused(projector.confirm());
    assert!(message.contains("is not what was drawn, at 192 pixels"), "{message}");
    assert!(message.contains("has levels [18, 52, 86], not [100, 100, 100]"), "{message}");
    projector.show(&gray(8)).expect("the next frame covers it");
}

#[test]
fn a_closed_window_is_named_each_time() {
    let (server, mut projector) = showing();
    server.close(*server.windows().last().expect("the projector's"));
    for _ in 0..2 {
        let message = refused(projector.show(&gray(1)));
        assert!(message.contains("the projector's window was closed"), "{message}");
    }
}

#[test]
fn a_server_that_ended_is_named() {
    let (mut server, mut projector) = showing();
    server.kill();
    let message = refused(projector.show(&gray(1)));
    assert!(message.contains("the X server is gone"), "{message}");
}

#[test]
fn a_helper_that_was_killed_or_hangs_is_replaced() {
    let server = XServer::start(64, 48);
    let quick = Helper { patience: Duration::from_secs(4), ..helper() };
    let mut projector = X11Projector::open(&spec(&server, [16, 12]), &quick, WallClock::starting_at(0.0))
        .expect("it is there");
    for (signal, restarts) in [("KILL", 1), ("STOP", 2)] {
        send(signal, &projector);
        projector.show(&gray(9)).expect("another helper shows it");
        assert_eq!(projector.restarts(), restarts, "{signal}");
        assert_eq!(server.pixels([24, 18, 16, 12]), [[9; 3]; 192]);
    }
    projector.confirm().expect("the new window shows it");
}

#[test]
fn a_photo_during_which_the_helper_ended_is_refused() {
    let (server, mut projector) = showing();
    send("KILL", &projector);
    // The picture on screen meanwhile is unknown, also to another helper.
    let message = refused(projector.confirm());
    assert!(
        message.contains("the helper process with its window") && message.contains("it ended"),
        "{message}"
    );
    projector.show(&gray(9)).expect("another helper shows it");
    assert_eq!((projector.restarts(), server.pixels([24, 18, 1, 1])[0]), (1, [9; 3]));
}

#[test]
fn a_helper_that_cannot_be_started_is_named() {
    let server = XServer::start(64, 48);
    let missing = Helper::at("/nonexistent/krylux");
    let message = refused(
        X11Projector::open(&spec(&server, [16, 12]), &missing, WallClock::starting_at(0.0)).map(drop),
    );
    assert!(message.contains("/nonexistent/krylux projector) failed"), "{message}");
    let other = Helper::at("/bin/true");
    let message =
        refused(X11Projector::open(&spec(&server, [16, 12]), &other, WallClock::starting_at(0.0)).map(drop));
    assert!(message.contains("it ended (exit status: 0"), "{message}");
}

#[test]
fn a_frame_that_does_not_fit_is_refused() {
    let (_server, mut projector) = showing();
    assert!(refused(projector.show(&gray(256))).contains("levels up to 256"));
    let large = Frame::filled(Resolution::new(17, 12), 1, 0);
    assert!(refused(projector.show(&large)).contains("17x12"));
}
