//! The ambient stage: the black photo is subtracted from every photo (O'Toole and Kutulakos, section 8.2).
//!
//! The black photo shows the light of the room, the projector's black level, and the camera's dark current.
//! It is taken at each exposure, because all three grow with it. The differences are not clipped: where there
//! is no light, half of them are negative.

use std::sync::Arc;

use super::averaging::{AveragedExposure, average};
use super::frame_source::FrameSource;
use super::response::CameraCurve;
use crate::error::Result;
use crate::rig::Frame;

/// The black photo at each exposure, and the variance of its rate.
#[derive(Clone, Debug, Default)]
pub(crate) struct BlackPhotos {
    /// The photos, the shortest exposure first. There are none when ambient light is not subtracted.
    pub(crate) exposed: Vec<AveragedExposure>,
    /// The variance of the rate, in (linear DN per second)², for each exposure and sample.
    pub(crate) variance: Vec<Vec<f64>>,
}

impl BlackPhotos {
    /// Takes the frame `black` `takes` times at each exposure.
    pub(crate) fn take(
        frames: &mut dyn FrameSource,
        curve: &CameraCurve,
        black: &Arc<Frame>,
        exposures: &[f64],
        takes: u32,
    ) -> Result<Self> {
        let mut blacks = Self::default();
        for &exposure in exposures {
            let exposed = average(frames, curve, black, exposure, 0..takes)?;
            let square = exposed.exposure * exposed.exposure;
            let variance = |(sample, &mean): (usize, &f64)| exposed.variance(curve, sample, mean) / square;
            blacks.variance.push(exposed.mean.iter().enumerate().map(variance).collect());
            blacks.exposed.push(exposed);
        }
        Ok(blacks)
    }
}
