//! Cameras of the kinds that are not proven by their real protocol: what rig files say of them, and a still camera that is driven
//! by programs, which are played here.

#![allow(clippy::panic, reason = "a failed test panics")]

mod files;
#[cfg(unix)]
mod program;
#[cfg(unix)]
mod stills;
#[cfg(unix)]
mod studio;
#[cfg(unix)]
mod troubles;
