//! A GigE Vision camera on the loopback interface: its frames, their times, and faults on the way.

#![cfg(feature = "gige")]
#![allow(clippy::panic, reason = "a failed test panics")]

#[path = "../gige_camera/mod.rs"]
mod gige_camera;

mod faults;
mod frames;
mod product;
mod session;
mod support;
