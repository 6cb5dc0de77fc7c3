//! Rigs of real protocols: windows of a real X server, cameras on the network, cameras behind programs; and a rig of the first two,
//! whose camera sees what the server shows.

#![allow(clippy::panic, reason = "a failed test panics")]

#[cfg(feature = "gige")]
#[path = "../gige_camera/mod.rs"]
mod gige_camera;
#[cfg(feature = "gige")]
#[path = "../program/mod.rs"]
mod program;
#[cfg(feature = "x11")]
#[path = "../x_server/mod.rs"]
mod x_server;

#[cfg(all(feature = "gige", feature = "x11"))]
mod bench;
#[cfg(all(feature = "gige", feature = "x11"))]
mod bench_verbs;
#[cfg(all(feature = "gige", feature = "x11"))]
mod calibration;
#[cfg(all(feature = "gige", feature = "x11"))]
mod faults;
#[cfg(all(feature = "gige", feature = "x11"))]
mod files;
#[cfg(all(feature = "gige", feature = "x11"))]
mod photos;
#[cfg(all(feature = "gige", feature = "x11"))]
mod verbs;

mod cameras;
#[cfg(all(feature = "gige", feature = "x11"))]
mod gige;
#[cfg(feature = "x11")]
mod x11;
