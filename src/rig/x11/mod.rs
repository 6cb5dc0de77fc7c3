//! A projector that is a monitor of an X server. It shows exact levels on chosen pixels, and the server confirms each frame before a photo is
//! taken.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | choose | finds the monitor by name or number; it must show its native pixels without a gamma ramp | `monitor` |
//! | draw | converts levels to the screen's pixel format; each pattern pixel becomes a square | `canvas` |
//! | show | presents a frame, waits for the confirmation, reads the frame back | `screen`, `canvas` |
//! | watch | notices windows that are closed, covered or moved, and a server that is gone | `watch` |
//! | isolate | keeps the window in a helper process, which a pipe reaches | `helper`, `projector` |
//!
//! Reading back shows what the server's framebuffer holds. The monitor may change it afterwards (sharpening, its own gamma, a colour wheel),
//! which only the camera sees; calibration and audit find it.
//!
//! Without the feature `x11`, as on macOS and Windows, `absent` stands in for the server: a rig file is read and described, and every request
//! to show something is an error that says so.

#[cfg(not(feature = "x11"))]
pub(crate) mod absent;
#[cfg(feature = "x11")]
mod canvas;
pub(crate) mod helper;
#[cfg(feature = "x11")]
pub(crate) mod monitor;
pub(crate) mod projector;
#[cfg(feature = "x11")]
mod screen;
#[cfg(feature = "x11")]
mod watch;

use serde::{Deserialize, Serialize};

use super::ProjectorInfo;
use crate::error::Error;
use crate::image::Resolution;

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

/// A description of a projector that is a monitor of an X server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct X11Spec {
    /// The kind of projector.
    pub kind: ProjectorKind,
    /// The server, e.g. `:0`. `None`: the one that the environment variable `DISPLAY` names.
    #[serde(default)]
    pub display: Option<String>,
    /// The monitor.
    #[serde(default)]
    pub monitor: X11Monitor,
    /// Width and height of patterns, in pattern pixels.
    pub size: [usize; 2],
    /// Monitor pixels on the side of the square that shows one pattern pixel. The pattern is in the monitor's centre; around it the
    /// monitor is black.
    #[serde(default = "one")]
    pub magnify: usize,
    /// Width and height in pixels that the monitor must have: a projector scales any other size, which blurs patterns. `None`: any.
    #[serde(default)]
    pub monitor_size: Option<[usize; 2]>,
    /// 1 (gray) or 3.
    #[serde(default = "one")]
    pub channels: usize,
    /// Seconds from one refresh to the next.
    #[serde(default = "sixty_hertz")]
    pub frame_time: f64,
    /// Refreshes to wait after the server's confirmation before a frame counts as shown.
    #[serde(default = "one_frame")]
    pub settle_frames: u64,
}

/// The kinds of projectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProjectorKind {
    /// A monitor of an X server.
    X11,
}

/// How a rig file names one of an X server's monitors.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum X11Monitor {
    /// Its number in the server's order, from 0.
    Number(usize),
    /// Its name, e.g. `HDMI-1`.
    Name(String),
}

impl Default for X11Monitor {
    fn default() -> Self {
        Self::Number(0)
    }
}

impl std::fmt::Display for X11Monitor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => write!(f, "{name}"),
        }
    }
}

/// One of an X server's monitors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MonitorInfo {
    /// The server's name of it, e.g. `HDMI-1`.
    pub name: String,
    /// Its size in pixels.
    pub resolution: Resolution,
    /// The position of its top left pixel on the server's screen, to the right and down, in pixels.
    pub place: [i16; 2],
    /// Whether it is the desktop's primary monitor.
    #[serde(rename = "primary")]
    pub is_primary: bool,
    /// Seconds from one refresh to the next, if the server knows.
    pub frame_time: Option<f64>,
    /// Whether the server says its gamma ramp, which is then a straight line. A server without a real display says none, or leaves memory there.
    #[serde(skip)]
    pub knows_ramp: bool,
    /// The display controllers (CRTCs) that drive it, by the server's numbers.
    #[serde(skip)]
    #[cfg(feature = "x11")]
    pub(crate) crtcs: Vec<u32>,
}

fn one() -> usize {
    1
}

fn one_frame() -> u64 {
    1
}

fn sixty_hertz() -> f64 {
    1.0 / 60.0
}

impl X11Spec {
    /// A projector on the first monitor of the default server, with gray patterns of this size.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            kind: ProjectorKind::X11,
            display: None,
            monitor: X11Monitor::default(),
            size: [width, height],
            magnify: 1,
            monitor_size: None,
            channels: 1,
            frame_time: sixty_hertz(),
            settle_frames: 1,
        }
    }

    /// The projector's properties.
    pub fn info(&self) -> ProjectorInfo {
        ProjectorInfo {
            name: format!("x11 monitor {}", self.monitor),
            resolution: Resolution::new(self.size[0], self.size[1]),
            channels: self.channels,
            bits: 8,
            frame_time: self.frame_time,
        }
    }

    /// The size of a pattern on the monitor, in monitor pixels.
    #[cfg(feature = "x11")]
    pub(crate) fn shown(&self) -> Resolution {
        Resolution::new(self.size[0] * self.magnify, self.size[1] * self.magnify)
    }
}
