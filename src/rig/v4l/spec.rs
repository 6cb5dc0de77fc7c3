//! What is written about a camera behind Linux's video interface.

use serde::Deserialize;

use crate::rig::CameraInfo;
use crate::rig::cameras::{CameraKind, timeout};
use crate::rig::pixels::{Colour, Sensor};

/// A camera behind Linux's video interface: a webcam, mostly. It runs free, its gray counts are used.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct V4lSpec {
    /// What it is.
    pub kind: CameraKind,
    /// Its device, e.g. `/dev/video0`.
    pub device: String,
    /// Width and height of its picture.
    pub size: [usize; 2],
    /// How it hands out counts.
    #[serde(default)]
    pub pixel_format: V4lFormat,
    /// A pixel that counts so much is full; none: with all bits set.
    #[serde(default)]
    pub saturation: Option<u16>,
    /// Its gain, in the driver's own unit; none: as it is set.
    #[serde(default)]
    pub gain: Option<i64>,
    /// The shortest and the longest exposure that are used, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Seconds beyond the exposure after which a frame that does not come is given up.
    #[serde(default = "timeout")]
    pub timeout: f64,
    /// Frames that are thrown away before each photo, beyond those that wait in the driver: as many as the camera itself may have
    /// begun before.
    #[serde(default = "two")]
    pub skip: u32,
}

/// How counts are packed.
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
    /// Luma and halved chroma in turn, 8 bits each: luma alone is used.
    Yuyv,
}

impl V4lFormat {
    /// All there are.
    pub const ALL: [Self; 5] = [Self::Grey, Self::Y10, Self::Y12, Self::Y16, Self::Yuyv];

    /// As rig files call it.
    pub fn key(self) -> &'static str {
        match self {
            Self::Grey => "grey",
            Self::Y10 => "y10",
            Self::Y12 => "y12",
            Self::Y16 => "y16",
            Self::Yuyv => "yuyv",
        }
    }

    /// The four letters by which the video interface calls it.
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
    /// The camera, as it presents itself. Its name says all that changes the numbers.
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
