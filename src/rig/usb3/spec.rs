//! What is written about a USB3 Vision camera.

use serde::Deserialize;

use crate::rig::CameraInfo;
use crate::rig::cameras::{CameraKind, exposures, timeout};
use crate::rig::genicam::Settings;
use crate::rig::pixels::{Colour, PixelFormat, Sensor};

/// A USB3 Vision camera.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Usb3Spec {
    /// What it is.
    pub kind: CameraKind,
    /// Its serial number; none: the only one there is.
    #[serde(default)]
    pub serial: Option<String>,
    /// Width and height of the part of its sensor that is read, in photosites.
    pub size: [usize; 2],
    /// Where that part begins, to the right and down.
    #[serde(default)]
    pub offset: [usize; 2],
    /// How it hands out counts.
    #[serde(default)]
    pub pixel_format: PixelFormat,
    /// What becomes of a colour sensor's cells.
    #[serde(default)]
    pub colour: Colour,
    /// A photosite that counts so much is full; none: with all bits set.
    #[serde(default)]
    pub saturation: Option<u16>,
    /// Its gain, in the camera's own unit (mostly decibels); none: as it is set.
    #[serde(default)]
    pub gain: Option<f64>,
    /// The shortest and the longest exposure that are used, in seconds.
    #[serde(default = "exposures")]
    pub exposures: [f64; 2],
    /// Seconds beyond the exposure after which a frame that does not come is given up.
    #[serde(default = "timeout")]
    pub timeout: f64,
}

impl Usb3Spec {
    /// The only camera there is, with 12 bits and so many pixels.
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

    /// The camera, as it presents itself.
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
