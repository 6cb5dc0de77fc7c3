//! What is wanted of a machine vision camera.

use crate::rig::CameraInfo;
use crate::rig::pixels::{PixelFormat, Sensor};

/// What a rig file says of the camera, but for where it is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    pub(crate) pixel_format: PixelFormat,
    pub(crate) sensor: Sensor,
    /// In the camera's own unit; none: as it is set.
    pub(crate) gain: Option<f64>,
    /// Seconds.
    pub(crate) exposures: [f64; 2],
    /// Seconds beyond the exposure after which a frame that does not come is given up.
    pub(crate) timeout: f64,
}

impl Settings {
    /// The camera at `place`, as it presents itself.
    pub(crate) fn info(&self, place: &str) -> CameraInfo {
        let mut info = self.sensor.info(&format!("{place} {}", self.pixel_format.name()), self.exposures);
        if let Some(gain) = self.gain {
            info.name.push_str(&format!(" gain {gain}"));
        }
        info
    }
}
