//! The black photo: what the camera sees of the room, of the projector's black level, and of its own dark current
//! (section 8.2). It is subtracted from every photo at that photo's exposure. Nothing is clipped: where there is no
//! light, half of the differences are negative, and so they stay.

use std::sync::Arc;

use super::averaging::{Exposed, average};
use super::frame_source::FrameSource;
use super::response::CameraCurve;
use crate::error::Result;
use crate::rig::Frame;

/// The black photo at each exposure, and the variance of its rate there.
#[derive(Clone, Debug, Default)]
pub(super) struct Blacks {
    /// Shortest exposure first; none where ambient light stays in.
    pub(super) exposed: Vec<Exposed>,
    /// Of the rate (linear DN per second), for each exposure and sample.
    pub(super) variance: Vec<Vec<f64>>,
}

impl Blacks {
    /// Takes `black` `takes` times at each exposure.
    pub(super) fn take(
        shots: &mut dyn FrameSource,
        curve: &CameraCurve,
        black: &Arc<Frame>,
        exposures: &[f64],
        takes: u32,
    ) -> Result<Self> {
        let mut blacks = Self::default();
        for &exposure in exposures {
            let exposed = average(shots, curve, black, exposure, 0..takes)?;
            let square = exposed.exposure * exposed.exposure;
            let variance = |(sample, &mean): (usize, &f64)| exposed.variance(curve, sample, mean) / square;
            blacks.variance.push(exposed.mean.iter().enumerate().map(variance).collect());
            blacks.exposed.push(exposed);
        }
        Ok(blacks)
    }
}
