//! The kinds of cameras, and the description of each kind in a rig file. The description of a still camera is beside its driver.

use std::net::Ipv4Addr;

use serde::Deserialize;

use super::sensor::{Sensor, Settings};
use super::{CameraInfo, Colour, Gphoto2Spec, PixelFormat};

/// The kinds of cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CameraKind {
    /// A GigE Vision camera.
    Gige,
    /// A USB3 Vision camera.
    Usb3,
    /// A camera of Linux's video interface.
    V4l,
    /// A still camera that the program `gphoto2` drives.
    Gphoto2,
}

/// The description of a camera of one of these kinds.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraSpec {
    /// See [`GigeSpec`].
    Gige(GigeSpec),
    /// See [`Usb3Spec`].
    Usb3(Usb3Spec),
    /// See [`V4lSpec`].
    V4l(V4lSpec),
    /// See [`Gphoto2Spec`].
    Gphoto2(Gphoto2Spec),
}

impl CameraSpec {
    /// The camera's properties.
    pub fn info(&self) -> CameraInfo {
        match self {
            Self::Gige(spec) => spec.info(),
            Self::Usb3(spec) => spec.info(),
            Self::V4l(spec) => spec.info(),
            Self::Gphoto2(spec) => spec.info(),
        }
    }
}

impl From<GigeSpec> for CameraSpec {
    fn from(spec: GigeSpec) -> Self {
        Self::Gige(spec)
    }
}

impl From<Usb3Spec> for CameraSpec {
    fn from(spec: Usb3Spec) -> Self {
        Self::Usb3(spec)
    }
}

impl From<V4lSpec> for CameraSpec {
    fn from(spec: V4lSpec) -> Self {
        Self::V4l(spec)
    }
}

impl From<Gphoto2Spec> for CameraSpec {
    fn from(spec: Gphoto2Spec) -> Self {
        Self::Gphoto2(spec)
    }
}

/// The default range of exposures in seconds. Most machine vision cameras have it.
pub(crate) fn exposures() -> [f64; 2] {
    [1e-4, 1.0]
}

/// The default number of seconds to wait for a frame beyond its exposure.
pub(crate) fn timeout() -> f64 {
    1.0
}

#[cfg(not(all(feature = "gige", feature = "usb3", feature = "v4l")))]
pub(crate) fn not_built(what: &str, feature: &str) -> crate::Error {
    crate::rig::camera_fault(
        format!("this krylux was built without {what}"),
        format!("build it with --features {feature}"),
    )
}

/// A description of a GigE Vision camera.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GigeSpec {
    /// The kind of camera.
    pub kind: CameraKind,
    /// The camera's address.
    pub address: Ipv4Addr,
    /// Width and height of the part of the sensor that is read, in photosites.
    pub size: [usize; 2],
    /// The offset of that part from the sensor's top left photosite, to the right and down.
    #[serde(default)]
    pub offset: [usize; 2],
    /// The format in which the camera sends counts.
    #[serde(default)]
    pub pixel_format: PixelFormat,
    /// How the cells of a colour sensor become pixels.
    #[serde(default)]
    pub colour: Colour,
    /// The count from which a photosite is saturated. `None`: `2^bits − 1`.
    #[serde(default)]
    pub saturation: Option<u16>,
    /// The gain in the camera's own unit (usually decibels). `None`: the camera's setting is left unchanged.
    #[serde(default)]
    pub gain: Option<f64>,
    /// The shortest and the longest exposure, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Seconds to wait for a frame beyond its exposure.
    #[serde(default = "timeout")]
    pub timeout: f64,
    /// The largest size of a packet in bytes. `None`: the largest that gets through the network.
    #[serde(default)]
    pub packet_size: Option<u32>,
}

impl GigeSpec {
    /// A description of the camera at this address, with counts of 12 bits and an image of `width` by `height` pixels.
    pub fn new(address: Ipv4Addr, width: usize, height: usize) -> Self {
        Self {
            kind: CameraKind::Gige,
            address,
            size: [width, height],
            offset: [0, 0],
            pixel_format: PixelFormat::default(),
            colour: Colour::default(),
            saturation: None,
            gain: None,
            exposures: exposures(),
            timeout: timeout(),
            packet_size: None,
        }
    }

    /// The camera's properties.
    pub fn info(&self) -> CameraInfo {
        self.settings().info(&format!("gige {}", self.address))
    }

    pub(crate) fn settings(&self) -> Settings {
        let Self { size, offset, pixel_format, colour, saturation, gain, exposures, timeout, .. } = *self;
        let (bits, tiles) = (pixel_format.bits(), pixel_format.tiles());
        let sensor = Sensor { size, offset, bits, tiles, colour, saturation };
        Settings { pixel_format, sensor, gain, exposures, timeout }
    }
}

/// A description of a USB3 Vision camera.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Usb3Spec {
    /// The kind of camera.
    pub kind: CameraKind,
    /// The camera's serial number. `None`: the only camera that is plugged in.
    #[serde(default)]
    pub serial: Option<String>,
    /// Width and height of the part of the sensor that is read, in photosites.
    pub size: [usize; 2],
    /// The offset of that part from the sensor's top left photosite, to the right and down.
    #[serde(default)]
    pub offset: [usize; 2],
    /// The format in which the camera sends counts.
    #[serde(default)]
    pub pixel_format: PixelFormat,
    /// How the cells of a colour sensor become pixels.
    #[serde(default)]
    pub colour: Colour,
    /// The count from which a photosite is saturated. `None`: `2^bits − 1`.
    #[serde(default)]
    pub saturation: Option<u16>,
    /// The gain in the camera's own unit (usually decibels). `None`: the camera's setting is left unchanged.
    #[serde(default)]
    pub gain: Option<f64>,
    /// The shortest and the longest exposure, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Seconds to wait for a frame beyond its exposure.
    #[serde(default = "timeout")]
    pub timeout: f64,
}

impl Usb3Spec {
    /// A description of the only camera that is plugged in, with counts of 12 bits and an image of `width` by `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        Self {
            kind: CameraKind::Usb3,
            serial: None,
            size: [width, height],
            offset: [0, 0],
            pixel_format: PixelFormat::default(),
            colour: Colour::default(),
            saturation: None,
            gain: None,
            exposures: exposures(),
            timeout: timeout(),
        }
    }

    /// The camera's properties.
    pub fn info(&self) -> CameraInfo {
        let serial = self.serial.as_deref().map_or_else(String::new, |serial| format!(" {serial}"));
        self.settings().info(&format!("usb3{serial}"))
    }

    pub(crate) fn settings(&self) -> Settings {
        let Self { size, offset, pixel_format, colour, saturation, gain, exposures, timeout, .. } = *self;
        let (bits, tiles) = (pixel_format.bits(), pixel_format.tiles());
        let sensor = Sensor { size, offset, bits, tiles, colour, saturation };
        Settings { pixel_format, sensor, gain, exposures, timeout }
    }
}

/// A description of a camera of Linux's video interface, for example a webcam. The camera runs freely, and krylux uses its gray counts.
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
    #[serde(default = "video_exposures")]
    pub exposures: [f64; 2],
    /// Seconds to wait for a frame beyond its exposure.
    #[serde(default = "timeout")]
    pub timeout: f64,
    /// The number of additional frames to discard before each photo, because the camera itself may have begun them too early. The
    /// frames that the driver buffers are discarded anyway.
    #[serde(default = "two")]
    pub skip: u32,
}

/// The supported pixel formats.
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
    /// Alternating luma and chroma of 8 bits each. Only luma is used.
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

fn video_exposures() -> [f64; 2] {
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
