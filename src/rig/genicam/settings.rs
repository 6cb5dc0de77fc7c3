//! The settings of a machine vision camera.

use crate::rig::CameraInfo;
use crate::rig::pixels::{PixelFormat, Sensor};

/// The settings that a rig file asks for, without the camera's address.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    pub(crate) pixel_format: PixelFormat,
    pub(crate) sensor: Sensor,
    /// The gain in the camera's own unit. `None`: it is left unchanged.
    pub(crate) gain: Option<f64>,
    /// The shortest and the longest exposure, in seconds.
    pub(crate) exposures: [f64; 2],
    /// Seconds to wait for a frame beyond its exposure.
    pub(crate) timeout: f64,
}

impl Settings {
    /// The properties of the camera at `place`.
    pub(crate) fn info(&self, place: &str) -> CameraInfo {
        let mut info = self.sensor.info(&format!("{place} {}", self.pixel_format.name()), self.exposures);
        if let Some(gain) = self.gain {
            info.name.push_str(&format!(" gain {gain}"));
        }
        info
    }
}
