//! A projector that is a monitor of an X server. It shows exact levels on chosen pixels, and the server confirms each frame before
//! a photo is taken.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | choose | finds the monitor by name or number; it must show its native pixels without a gamma ramp | `monitor` |
//! | draw | converts levels to the screen's pixel format; each pattern pixel becomes a square | `canvas` |
//! | show | presents a frame, waits for the confirmation, reads the frame back | `window`, `screen`, `reader` |
//! | watch | notices windows that are closed, covered or moved, and a server that is gone | `watch` |
//! | isolate | keeps the window in a helper process, which a pipe reaches | `helper`, `serve`, `wire`, `projector` |
//!
//! Reading back shows what the server's framebuffer holds. What the monitor does to it afterwards (sharpening, its own gamma, a
//! colour wheel) is seen by the camera only; calibration and audit find it.
//!
//! Without the feature `x11`, as on macOS and Windows, `absent` stands in for the server: a rig file is read and described, and
//! every request to show something is an error that says so.

#[cfg(not(feature = "x11"))]
mod absent;
#[cfg(feature = "x11")]
mod canvas;
mod helper;
#[cfg(feature = "x11")]
mod monitor;
mod projector;
#[cfg(feature = "x11")]
mod reader;
#[cfg(feature = "x11")]
mod screen;
mod serve;
mod spec;
#[cfg(feature = "x11")]
mod watch;
#[cfg(feature = "x11")]
mod window;
mod wire;

#[cfg(not(feature = "x11"))]
use absent::Screen;
#[cfg(not(feature = "x11"))]
pub use absent::monitors;
pub use helper::Helper;
#[cfg(feature = "x11")]
pub use monitor::monitors;
pub use projector::X11Projector;
#[cfg(feature = "x11")]
use screen::Screen;
pub use serve::serve as serve_projector;
pub use spec::{MonitorInfo, ProjectorKind, X11Monitor, X11Spec};
pub use wire::ShowTimes;

use crate::error::Error;

/// The device that errors name.
const DEVICE: &str = "projector";

/// An error of the projector; `help` says what to do.
fn fault(fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::Rig { device: DEVICE.into(), fault: fault.into(), help: help.into() }
}

/// The error where the server failed or refused a request.
#[cfg(feature = "x11")]
fn lost(doing: &str, why: &dyn std::fmt::Display) -> Error {
    fault(format!("the X server is gone, or refused to {doing}: {why}"), "start it again")
}
