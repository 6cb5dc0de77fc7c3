//! What is written about a GigE Vision camera.

use std::net::Ipv4Addr;

use serde::Deserialize;

use crate::rig::CameraInfo;
use crate::rig::cameras::{CameraKind, exposures, timeout};
use crate::rig::genicam::Settings;
use crate::rig::pixels::{Colour, PixelFormat, Sensor};

/// A GigE Vision camera.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GigeSpec {
    /// What it is.
    pub kind: CameraKind,
    /// Its address.
    pub address: Ipv4Addr,
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
    /// Bytes of a packet at most; none: as many as get through.
    #[serde(default)]
    pub packet_size: Option<u32>,
}

impl GigeSpec {
    /// The camera at an address, with 12 bits and so many pixels.
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

    /// The camera, as it presents itself.
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
