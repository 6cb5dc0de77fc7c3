//! A projector that is a monitor of an X server: exact levels on chosen pixels, confirmed by the server before anything is
//! photographed.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | which monitor | by name or number, at its own pixels, without a gamma ramp | `monitor` |
//! | levels → pixels | of the screen's own visual; each pattern pixel a square | `canvas` |
//! | on screen | presented, confirmed, read back | `window`, `screen`, `reader` |
//! | watched | closed, covered and moved windows, a server that is gone | `watch` |
//! | apart | the window lives in a helper process, reached by a pipe | `helper`, `serve`, `wire`, `projector` |
//!
//! What is read back is what the server's picture holds. What a monitor makes of it (sharpening, its own gamma, a colour wheel)
//! only a camera sees: that is for calibration and audit.

mod canvas;
mod helper;
mod monitor;
mod projector;
mod reader;
mod screen;
mod serve;
mod spec;
mod watch;
mod window;
mod wire;

pub use helper::Helper;
pub use monitor::{MonitorInfo, monitors};
pub use projector::X11Projector;
pub use serve::serve as serve_projector;
pub use spec::{ProjectorKind, X11Monitor, X11Spec};
pub use wire::ShowTimes;

use crate::error::Error;

/// What the error is about.
const DEVICE: &str = "projector";

/// An error of the projector.
fn fault(fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::Rig { device: DEVICE.into(), fault: fault.into(), help: help.into() }
}

/// A request that the server did not answer as it should.
fn lost(doing: &str, why: &dyn std::fmt::Display) -> Error {
    fault(
        format!("the X server is gone, or refused to {doing}: {why}"),
        "start it again and go on with --resume; photos taken so far are kept",
    )
}
