//! The description of a GigE Vision camera, as a rig file has it.

use std::net::Ipv4Addr;

use serde::Deserialize;

use crate::rig::CameraInfo;
use crate::rig::cameras::{CameraKind, exposures, timeout};
use crate::rig::genicam::Settings;
use crate::rig::pixels::{Colour, PixelFormat, Sensor};

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
    /// The camera at this address, with counts of 12 bits and an image of `width` by `height` pixels.
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
