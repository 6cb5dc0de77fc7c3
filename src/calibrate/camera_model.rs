//! The camera's response and noise, as far as they are known in the course of a calibration.

use super::linear::Linear;

/// How photos are taken and converted to light: exposure, takes, response and noise.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraModel<'a> {
    /// The response: linear DN of a count.
    pub(crate) linear: &'a Linear,
    /// Electrons per linear DN.
    pub(crate) gain: f64,
    /// The read noise, in DN.
    pub(crate) read_noise: f64,
    /// Counts from here on may be saturated.
    pub(crate) limit: f64,
    /// The exposure at which white fills the range, in seconds.
    pub(crate) exposure: f64,
    /// Frames averaged for each photo.
    pub(crate) takes: u32,
}

impl CameraModel<'_> {
    /// The variance of the mean of so many takes of a sample with this light, in linear DN above black.
    pub(crate) fn variance(&self, light: f64, takes: u32) -> f64 {
        (light.max(0.0) / self.gain + self.read_noise.powi(2)) / f64::from(takes)
    }
}
