//! The description of a camera of Linux's video interface, as a rig file has it.

use serde::Deserialize;

use crate::rig::CameraInfo;
use crate::rig::cameras::{CameraKind, timeout};
use crate::rig::pixels::{Colour, Sensor};

/// A description of a camera of Linux's video interface, e.g. a webcam. It runs freely, and its gray counts are used.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct V4lSpec {
    /// The kind of camera.
    pub kind: CameraKind,
    /// The device file, e.g. `/dev/video0`.
    pub device: String,
    /// Width and height of a frame in pixels.
    pub size: [usize; 2],
    /// The format in which the camera sends counts.
    #[serde(default)]
    pub pixel_format: V4lFormat,
    /// The count from which a pixel is saturated. `None`: `2^bits − 1`.
    #[serde(default)]
    pub saturation: Option<u16>,
    /// The gain in the driver's own unit. `None`: the camera's setting is left unchanged.
    #[serde(default)]
    pub gain: Option<i64>,
    /// The shortest and the longest exposure, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Seconds to wait for a frame beyond its exposure.
    #[serde(default = "timeout")]
    pub timeout: f64,
    /// The number of frames that are discarded before each photo, in addition to those that the driver buffers: those that the camera
    /// itself may have begun too early.
    #[serde(default = "two")]
    pub skip: u32,
}

/// The pixel formats that are supported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum V4lFormat {
    /// 8 bits of gray.
    Grey,
    /// 10 bits of gray in 16.
    Y10,
    /// 12 bits of gray in 16.
    Y12,
    /// 16 bits of gray.
    #[default]
    Y16,
    /// Luma and chroma alternately, 8 bits each; only luma is used.
    Yuyv,
}

impl V4lFormat {
    /// All formats.
    pub const ALL: [Self; 5] = [Self::Grey, Self::Y10, Self::Y12, Self::Y16, Self::Yuyv];

    /// The name in rig files.
    pub fn key(self) -> &'static str {
        match self {
            Self::Grey => "grey",
            Self::Y10 => "y10",
            Self::Y12 => "y12",
            Self::Y16 => "y16",
            Self::Yuyv => "yuyv",
        }
    }

    /// The four-character code of the video interface.
    pub fn code(self) -> [u8; 4] {
        *match self {
            Self::Grey => b"GREY",
            Self::Y10 => b"Y10 ",
            Self::Y12 => b"Y12 ",
            Self::Y16 => b"Y16 ",
            Self::Yuyv => b"YUYV",
        }
    }

    /// Bits of a count.
    pub fn bits(self) -> u32 {
        match self {
            Self::Grey | Self::Yuyv => 8,
            Self::Y10 => 10,
            Self::Y12 => 12,
            Self::Y16 => 16,
        }
    }
}

fn exposures() -> [f64; 2] {
    [1e-3, 0.1]
}

fn two() -> u32 {
    2
}

impl V4lSpec {
    /// The camera's properties. The name contains every setting that changes counts.
    pub fn info(&self) -> CameraInfo {
        let code = String::from_utf8_lossy(&self.pixel_format.code()).trim_end().to_owned();
        let mut info = self.sensor().info(&format!("v4l {} {code}", self.device), self.exposures);
        if let Some(gain) = self.gain {
            info.name.push_str(&format!(" gain {gain}"));
        }
        info
    }

    pub(crate) fn sensor(&self) -> Sensor {
        let (size, saturation, bits) = (self.size, self.saturation, self.pixel_format.bits());
        Sensor { size, offset: [0, 0], bits, tiles: None, colour: Colour::default(), saturation }
    }
}
