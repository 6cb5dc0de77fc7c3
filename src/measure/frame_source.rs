//! Where raw frames come from: a bench, or a journal before it.

use std::sync::Arc;

use super::Times;
use crate::error::Result;
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame};

/// One photo to be taken. Equal shots (of one rig and calibration) are one photo: a journal never takes it twice.
#[derive(Clone, Debug, PartialEq)]
pub struct CaptureRequest {
    /// What is shown.
    pub frame: Arc<Frame>,
    /// The exposure to set, in seconds.
    pub exposure: f64,
    /// Tells repeated shots of the same frame apart, from 0: takes that are averaged, and the drift sentinel's whites.
    pub take: u32,
}

/// What a session with a rig has cost so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Effort {
    /// Frames shown on the projector.
    pub shown: u64,
    /// Frames taken that were good.
    pub taken: u64,
    /// Frames that came from the journal, at no cost.
    pub replayed: u64,
    /// Frames that did not come in time.
    pub dropped: u64,
    /// Frames handed out a second time, and refused.
    pub repeated: u64,
    /// Frames whose exposure began before the pattern had settled, and refused.
    pub late: u64,
    /// Times that the camera was restarted.
    pub restarts: u64,
    /// Packets of frames that were lost on the way, and came when they were asked for again.
    #[serde(default)]
    pub resent: u64,
    /// Seconds on the rig's clock.
    pub seconds: f64,
    /// Where they went, since this session opened the rig.
    #[serde(default)]
    pub times: Times,
}

/// Takes raw frames.
pub trait FrameSource {
    /// The projector that shows.
    fn projector(&self) -> &ProjectorInfo;

    /// The camera that sees.
    fn camera(&self) -> &CameraInfo;

    /// Takes this photo, or hands out the one already taken. What comes back was exposed while the frame was on screen, and
    /// was never handed out for another shot.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the rig fails for good; [`Error::Interrupted`](crate::Error::Interrupted).
    fn capture(&mut self, shot: &CaptureRequest) -> Result<RawFrame>;

    /// Goes on after a photo that an interrupted session took: `shot` is put on screen again, and `frame` was the camera's
    /// last. A journal says so once, before the first photo that it does not have; then a virtual rig that was opened after
    /// that frame's [`Stamp`](crate::rig::Stamp) goes on as if there had been no interruption.
    ///
    /// # Errors
    /// As [`Self::shoot`].
    fn follow(&mut self, shot: &CaptureRequest, frame: &RawFrame) -> Result<()> {
        let _ = (shot, frame);
        Ok(())
    }

    /// How many seconds pass from now on between a frame's confirmation and the exposure. It is no part of a [`CaptureRequest`]: who
    /// compares one frame at several times tells them apart by `take`. A journal without a rig ignores it.
    fn set_settle(&mut self, seconds: f64);

    /// What it has cost so far.
    fn effort(&self) -> Effort;
}
