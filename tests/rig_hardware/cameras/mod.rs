//! Cameras whose real protocol is not tested: their descriptions in rig files, and a still camera whose programs are replaced by
//! scripts.

#![allow(clippy::panic, reason = "a failed test panics")]

mod files;
#[cfg(unix)]
#[cfg(feature = "x11")]
mod program;
#[cfg(unix)]
mod stills;
#[cfg(unix)]
mod studio;
#[cfg(unix)]
mod troubles;
