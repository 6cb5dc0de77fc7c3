//! A GigE Vision camera on the loopback interface: its frames, their times, and faults on the way.

#![allow(clippy::panic, reason = "a failed test panics")]

mod faults;
mod frames;
mod product;
mod session;
mod support;
