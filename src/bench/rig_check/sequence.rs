//! The sequence of photos that the check takes of black and white, and numbers of one photo.

use std::sync::Arc;

use crate::error::Result;
use crate::image;
use crate::measure::{CaptureRequest, Effort, FrameSource};
use crate::rig::{Frame, RawFrame};

/// The number of rounds. In each, white is shown after black and photographed twice.
const ROUNDS: u32 = 4;

/// The photos of the check.
pub(crate) struct Photos {
    /// Black at the exposure of white.
    pub(crate) black: RawFrame,
    /// Black, photographed right after white, of each round.
    pub(crate) blacks: Vec<RawFrame>,
    /// White: the first photo after black, and the next one, of each round.
    pub(crate) whites: Vec<[RawFrame; 2]>,
    /// The count without light: the median of black at the shortest exposure.
    pub(crate) dark_count: f64,
    /// Black at the shortest exposure.
    pub(crate) dark: RawFrame,
    /// What these photos have cost.
    pub(crate) effort: Effort,
}

/// Takes the photos, those of white at `exposure` seconds.
pub(crate) fn take(frames: &mut dyn FrameSource, exposure: f64) -> Result<Photos> {
    let before = frames.effort();
    let info = frames.projector().clone();
    let frame = |level| Arc::new(Frame::filled(info.resolution, info.channels, level));
    let [black, white] = [frame(0), frame(info.highest())];
    let shortest = frames.camera().exposures[0];
    let mut capture = |frame: &Arc<Frame>, exposure: f64, take: u32| {
        frames.capture(&CaptureRequest { frame: Arc::clone(frame), exposure, take })
    };
    let dark = capture(&black, shortest, 0)?;
    let dark_count = percentile(&dark, 0.5);
    let (mut blacks, mut whites) = (Vec::new(), Vec::new());
    for round in 0..ROUNDS {
        blacks.push(capture(&black, exposure, round)?);
        whites.push([capture(&white, exposure, 2 * round)?, capture(&white, exposure, 2 * round + 1)?]);
    }
    // After a wait that is too short some of white's light is left in the first photo of black. That is not
    // ambient light.
    capture(&black, exposure, ROUNDS)?;
    let black = capture(&black, exposure, ROUNDS + 1)?;
    let after = frames.effort();
    let effort = Effort {
        taken: after.taken - before.taken,
        dropped: after.dropped - before.dropped,
        repeated: after.repeated - before.repeated,
        late: after.late - before.late,
        restarts: after.restarts - before.restarts,
        resent: after.resent - before.resent,
        incomplete: after.incomplete - before.incomplete,
        missing: after.missing - before.missing,
        ..after
    };
    Ok(Photos { black, blacks, whites, dark_count, dark, effort })
}

/// The mean count of a frame.
pub(crate) fn mean(frame: &RawFrame) -> f64 {
    frame.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / frame.counts.len() as f64
}

/// The count at this quantile of a frame, from 0 to 1.
pub(crate) fn percentile(frame: &RawFrame, quantile: f64) -> f64 {
    image::percentile(frame.counts.iter().map(|&count| f64::from(count)), quantile)
}
