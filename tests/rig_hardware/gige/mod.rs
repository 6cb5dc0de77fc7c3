//! A camera that speaks GigE Vision, over the loopback interface: what comes, when, and what goes wrong on the way.

#![allow(clippy::panic, reason = "a failed test panics")]

mod faults;
mod frames;
mod product;
mod session;
mod support;
