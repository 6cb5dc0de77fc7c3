//! A rig on real protocols: the projector is a window of a real X server, and a GigE Vision camera on the loopback interface sees what
//! the server shows.

#![cfg(feature = "gige")]
#![allow(clippy::panic, reason = "a failed test panics")]

#[path = "../gige_camera/mod.rs"]
mod gige_camera;
#[path = "../program/mod.rs"]
mod program;
#[path = "../x_server/mod.rs"]
mod x_server;

mod bench;
mod bench_verbs;
mod calibration;
mod faults;
mod files;
mod photos;
mod verbs;
