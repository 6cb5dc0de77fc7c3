//! Virtual devices: they change light as their description says, and their faults are noticed.

#![allow(clippy::panic, reason = "a failed test panics")]

mod faults;
mod files;
mod imperfect_light;
mod light;
mod policy;
mod program;
mod resume;
mod sensor;
mod support;
