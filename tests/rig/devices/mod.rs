//! Virtual devices do to light what their description says, and what goes wrong with them is noticed.

#![allow(clippy::panic, reason = "a failed test panics")]

mod faults;
mod files;
mod light;
mod policy;
mod resume;
mod sensor;
mod support;
