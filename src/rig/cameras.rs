//! The kinds of cameras, and the description of each kind in a rig file. The description of a still camera is in the module of its driver.

use std::net::Ipv4Addr;

use serde::Deserialize;

use super::sensor::Sensor;
use super::{CameraInfo, Colour, Gphoto2Spec, PixelFormat, camera_fault, number};

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

/// The description of a camera.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraSpec {
    /// See [`GenicamSpec`].
    Genicam(GenicamSpec),
    /// See [`V4lSpec`].
    V4l(V4lSpec),
    /// See [`Gphoto2Spec`].
    Gphoto2(Gphoto2Spec),
}

impl CameraSpec {
    /// The camera's properties.
    pub fn info(&self) -> CameraInfo {
        match self {
            Self::Genicam(spec) => spec.info(),
            Self::V4l(spec) => spec.info(),
            Self::Gphoto2(spec) => spec.info(),
        }
    }
}

impl CameraKind {
    /// The kind's name in rig files, which is also the name of the feature that the kind needs.
    pub fn key(self) -> &'static str {
        match self {
            Self::Gige => "gige",
            Self::Usb3 => "usb3",
            Self::V4l => "v4l",
            Self::Gphoto2 => "gphoto2",
        }
    }

    /// Whether this program has the feature that the kind of camera needs.
    pub(crate) fn is_built(self) -> bool {
        match self {
            Self::Gige => cfg!(feature = "gige"),
            Self::Usb3 => cfg!(feature = "usb3"),
            Self::V4l => cfg!(feature = "v4l"),
            Self::Gphoto2 => true,
        }
    }

    /// The error of a kind of camera whose feature is missing from this program.
    pub(crate) fn not_built(self) -> crate::Error {
        let what = match self {
            Self::Gige => "GigE Vision",
            Self::Usb3 => "USB3 Vision",
            Self::V4l => "cameras of Linux's video interface",
            Self::Gphoto2 => "still cameras",
        };
        camera_fault(
            format!("this krylux was built without {what}"),
            format!("build it with --features {}", self.key()),
        )
    }
}

/// The default range of exposures in seconds, which most machine vision cameras support.
fn exposures() -> [f64; 2] {
    [1e-4, 1.0]
}

/// A description of a GigE Vision or USB3 Vision camera. Such a camera describes its features by GenICam.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GenicamSpec {
    /// The kind of camera: [`CameraKind::Gige`] or [`CameraKind::Usb3`].
    pub kind: CameraKind,
    /// The address of a GigE Vision camera. Other cameras have none.
    pub address: Option<Ipv4Addr>,
    /// The serial number of a USB3 Vision camera. `None`: the only camera that is plugged in.
    pub serial: Option<String>,
    /// Width and height of the part of the sensor that is read, in photosites.
    pub size: [usize; 2],
    /// The position of the top left photosite that is read, to the right and down from the sensor's top left photosite.
    #[serde(default)]
    pub offset: [usize; 2],
    /// The format in which the camera sends counts.
    #[serde(default)]
    pub pixel_format: PixelFormat,
    /// The conversion of a colour sensor's cells to pixels.
    #[serde(default)]
    pub colour: Colour,
    /// The count from which a photosite is saturated. `None`: `2^bits − 1`.
    pub saturation: Option<u16>,
    /// The gain in the camera's own unit (usually decibels). `None`: the camera's setting is left unchanged.
    pub gain: Option<f64>,
    /// The shortest and the longest exposure, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Seconds to wait for a frame beyond its exposure.
    #[serde(default = "number::<1, _>")]
    pub timeout: f64,
    /// The largest size of a GigE Vision camera's packets in bytes. `None`: the largest packet size that the network passes.
    pub packet_size: Option<u32>,
}

impl GenicamSpec {
    /// A description of the GigE Vision camera at this address, with counts of 12 bits and an image of `width` by `height` pixels.
    pub fn gige(address: Ipv4Addr, width: usize, height: usize) -> Self {
        Self { kind: CameraKind::Gige, address: Some(address), ..Self::usb3(width, height) }
    }

    /// A description of the only USB3 Vision camera that is plugged in, with counts of 12 bits and an image of `width` by `height` pixels.
    pub fn usb3(width: usize, height: usize) -> Self {
        Self {
            kind: CameraKind::Usb3,
            address: None,
            serial: None,
            size: [width, height],
            offset: [0, 0],
            pixel_format: PixelFormat::default(),
            colour: Colour::default(),
            saturation: None,
            gain: None,
            exposures: exposures(),
            timeout: 1.0,
            packet_size: None,
        }
    }

    /// The address or the serial number, as text. `None`: the only camera that is plugged in.
    pub(crate) fn address_or_serial(&self) -> Option<String> {
        self.address.map(|address| address.to_string()).or_else(|| self.serial.clone())
    }

    /// The camera's properties. The name contains every setting that changes counts.
    pub fn info(&self) -> CameraInfo {
        let parts = [
            Some(self.kind.key().to_owned()),
            self.address_or_serial(),
            Some(self.pixel_format.name().to_owned()),
        ];
        let name = parts.into_iter().flatten().collect::<Vec<_>>().join(" ");
        self.sensor().info(&name, self.exposures).with_gain(self.gain)
    }

    pub(crate) fn sensor(&self) -> Sensor {
        let Self { size, offset, pixel_format, colour, saturation, .. } = *self;
        Sensor { size, offset, bits: pixel_format.bits(), tiles: pixel_format.tiles(), colour, saturation }
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
    pub saturation: Option<u16>,
    /// The gain in the driver's own unit. `None`: the camera's setting is left unchanged.
    pub gain: Option<i64>,
    /// The shortest and the longest exposure, in seconds.
    #[serde(default = "video_exposures")]
    pub exposures: [f64; 2],
    /// Seconds to wait for a frame beyond its exposure.
    #[serde(default = "number::<1, _>")]
    pub timeout: f64,
    /// The number of frames to discard before each photo, in addition to the frames that the driver buffers. The exposure of a discarded
    /// frame may have begun too early.
    #[serde(default = "number::<2, _>")]
    pub skip: u32,
}

/// The supported pixel formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum V4lFormat {
    /// 8 bits of gray.
    Grey,
    /// 10 bits of gray in 16 bits.
    Y10,
    /// 12 bits of gray in 16 bits.
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

    /// The name in rig files, the four-character code of the video interface, and the bits of a count.
    fn facts(self) -> (&'static str, &'static [u8; 4], u32) {
        match self {
            Self::Grey => ("grey", b"GREY", 8),
            Self::Y10 => ("y10", b"Y10 ", 10),
            Self::Y12 => ("y12", b"Y12 ", 12),
            Self::Y16 => ("y16", b"Y16 ", 16),
            Self::Yuyv => ("yuyv", b"YUYV", 8),
        }
    }

    /// The name in rig files.
    pub fn key(self) -> &'static str {
        self.facts().0
    }

    /// The four-character code of the video interface.
    pub fn code(self) -> [u8; 4] {
        *self.facts().1
    }

    /// Bits of a count.
    pub fn bits(self) -> u32 {
        self.facts().2
    }
}

fn video_exposures() -> [f64; 2] {
    [1e-3, 0.1]
}

impl V4lSpec {
    /// The camera's properties. The name contains every setting that changes counts.
    pub fn info(&self) -> CameraInfo {
        let code = String::from_utf8_lossy(&self.pixel_format.code()).trim_end().to_owned();
        self.sensor().info(&format!("v4l {} {code}", self.device), self.exposures).with_gain(self.gain)
    }

    pub(crate) fn sensor(&self) -> Sensor {
        let (size, saturation, bits) = (self.size, self.saturation, self.pixel_format.bits());
        Sensor { size, offset: [0, 0], bits, tiles: None, colour: Colour::default(), saturation }
    }
}
