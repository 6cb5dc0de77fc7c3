//! A projector that is a monitor of an X server. It shows exact levels on chosen pixels, and the server confirms each frame.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | choose | finds the monitor by name or number, and checks that the monitor shows pixels unchanged | `monitor` |
//! | draw | converts levels to the screen's pixel format; each pattern pixel becomes a square | `canvas` |
//! | show | presents a frame, waits for the confirmation, and reads the frame back | `screen`, `canvas` |
//! | watch | notices a window that is closed, covered or moved, and a lost server | `watch` |
//! | isolate | keeps the window in a helper process, which is connected by a pipe | `helper`, `projector` |
//!
//! Reading back shows the contents of the server's framebuffer. The monitor may change the picture afterwards (sharpening, its own gamma, a
//! colour wheel). Only the camera sees such changes; calibration and audit find them.
//!
//! Without the feature `x11`, as on macOS and Windows, a rig file can still be read and described, but every request to show a frame
//! returns an error that names the missing feature.

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

use super::{ProjectorInfo, number};
use crate::error::Error;
use crate::image::Resolution;

fn fault(fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::rig("projector", fault).help(help)
}

/// The error of a server that failed or refused a request.
#[cfg(feature = "x11")]
fn lost(doing: &str, why: &dyn std::fmt::Display) -> Error {
    fault(format!("the X server is gone, or refused to {doing}: {why}"), "start it again")
}

#[cfg(not(feature = "x11"))]
fn not_built() -> Error {
    fault("this krylux was built without projectors on X11", "build it with --features x11, on Linux")
}

/// Fails with [`Error::Rig`], because this krylux was built without X11.
#[cfg(not(feature = "x11"))]
pub fn monitors(_: Option<&str>) -> crate::Result<Vec<MonitorInfo>> {
    Err(not_built())
}

#[cfg(not(feature = "x11"))]
impl X11Spec {
    /// Fails with [`Error::Rig`], because this krylux was built without X11.
    pub fn monitor(&self) -> crate::Result<MonitorInfo> {
        Err(not_built())
    }
}

/// A description of a projector that is a monitor of an X server.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct X11Spec {
    /// The kind of projector.
    pub kind: ProjectorKind,
    /// The server, for example `:0`. `None`: the server in the environment variable `DISPLAY`.
    pub display: Option<String>,
    /// The monitor.
    #[serde(default)]
    pub monitor: X11Monitor,
    /// Width and height of patterns, in pattern pixels.
    pub size: [usize; 2],
    /// The side, in monitor pixels, of the square that shows one pattern pixel. The pattern is in the monitor's centre, and the monitor is
    /// black around it.
    #[serde(default = "number::<1, _>")]
    pub magnify: usize,
    /// Width and height in pixels that the monitor must have. A projector scales any other size, which blurs patterns. `None`: any size.
    pub monitor_size: Option<[usize; 2]>,
    /// 1 (gray) or 3.
    #[serde(default = "number::<1, _>")]
    pub channels: usize,
    /// Seconds from one refresh to the next.
    #[serde(default = "sixty_hertz")]
    pub frame_time: f64,
    /// The number of refreshes to wait after the server's confirmation before a frame counts as shown.
    #[serde(default = "number::<1, _>")]
    pub settle_frames: u64,
}

/// The kinds of projectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ProjectorKind {
    /// A monitor of an X server.
    X11,
}

/// The way in which a rig file names a monitor of an X server.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum X11Monitor {
    /// The number in the server's order, from 0.
    Number(usize),
    /// The name, for example `HDMI-1`.
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
            Self::Number(number) => number.fmt(f),
            Self::Name(name) => name.fmt(f),
        }
    }
}

/// A monitor of an X server.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MonitorInfo {
    /// The server's name for the monitor, for example `HDMI-1`.
    pub name: String,
    /// The size in pixels.
    pub resolution: Resolution,
    /// The position of the top left pixel on the server's screen, to the right and down, in pixels.
    pub place: [i16; 2],
    /// Whether the monitor is the desktop's primary monitor.
    #[serde(rename = "primary")]
    pub is_primary: bool,
    /// Seconds from one refresh to the next, if the server reports it.
    pub frame_time: Option<f64>,
    /// Whether the server reports the monitor's gamma ramp. A reported ramp is a straight line. A server without a real display reports no
    /// ramp, or uninitialized memory.
    #[serde(skip)]
    pub knows_ramp: bool,
    /// The display controllers (CRTCs) that drive the monitor, by the server's numbers.
    #[serde(skip)]
    #[cfg(feature = "x11")]
    pub(crate) crtcs: Vec<u32>,
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

    #[cfg(feature = "x11")]
    pub(crate) fn shown(&self) -> Resolution {
        Resolution::new(self.size[0] * self.magnify, self.size[1] * self.magnify)
    }
}
