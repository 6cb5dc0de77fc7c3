//! A camera that speaks GigE Vision, over the loopback interface: what comes, when, and what goes wrong on the way.

#![cfg(feature = "gige")]
#![allow(clippy::panic, reason = "a failed test panics")]

#[path = "../gige_camera/mod.rs"]
mod gige_camera;

mod faults;
mod frames;
mod product;
mod session;
mod support;
