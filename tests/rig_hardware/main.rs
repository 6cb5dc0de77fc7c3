//! Rigs of real protocols: windows of a real X server, cameras on the network, cameras behind programs; and a rig of the first two,
//! whose camera sees what the server shows.

#![allow(clippy::panic, reason = "a failed test panics")]

#[cfg(feature = "gige")]
#[path = "../gige_camera/mod.rs"]
mod gige_camera;
#[cfg(feature = "gige")]
#[path = "../program/mod.rs"]
mod program;
#[path = "../x_server/mod.rs"]
mod x_server;

#[cfg(feature = "gige")]
mod bench;
#[cfg(feature = "gige")]
mod bench_verbs;
#[cfg(feature = "gige")]
mod calibration;
#[cfg(feature = "gige")]
mod faults;
#[cfg(feature = "gige")]
mod files;
#[cfg(feature = "gige")]
mod photos;
#[cfg(feature = "gige")]
mod verbs;

mod cameras;
#[cfg(feature = "gige")]
mod gige;
mod x11;
