//! The source of raw frames: open devices, or a journal in front of them.

use std::sync::Arc;

use super::Times;
use crate::error::Result;
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame};

/// A photo to be taken. Equal requests, for one rig and one calibration, are one photo: a journal never takes
/// it twice.
#[derive(Clone, Debug, PartialEq)]
pub struct CaptureRequest {
    /// The frame that is shown.
    pub frame: Arc<Frame>,
    /// The exposure to set, in seconds.
    pub exposure: f64,
    /// The number of the repetition, from 0. It distinguishes repeated photos of the same frame: takes that
    /// are averaged, and the drift sentinels.
    pub take: u32,
}

/// The costs of a session with a rig: frames and time.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Effort {
    /// Frames shown on the projector.
    pub shown: u64,
    /// Frames taken and accepted.
    pub taken: u64,
    /// Frames read from the journal, at no cost.
    pub replayed: u64,
    /// Frames that did not arrive in time.
    pub dropped: u64,
    /// Frames that the camera delivered a second time. They are refused.
    pub repeated: u64,
    /// Frames whose exposure began before the pattern had settled. They are refused.
    pub late: u64,
    /// Restarts of the camera.
    pub restarts: u64,
    /// Packets of frames that were lost on the network and sent again on request.
    #[serde(default)]
    pub resent: u64,
    /// Frames that came without some of their packets, although these were asked for again. They are refused.
    #[serde(default)]
    pub incomplete: u64,
    /// The packets of these frames that never came.
    #[serde(default)]
    pub missing: u64,
    /// Duration in seconds on the rig's clock.
    pub seconds: f64,
    /// How these seconds were spent, since this session opened the rig.
    #[serde(default)]
    pub times: Times,
}

impl Effort {
    /// The frames that were used: those taken, and those from the journal.
    pub fn frames(&self) -> u64 {
        self.taken + self.replayed
    }
}

/// A source of raw frames.
pub trait FrameSource: Send {
    /// The projector.
    fn projector(&self) -> &ProjectorInfo;

    /// The camera.
    fn camera(&self) -> &CameraInfo;

    /// Takes the requested photo, or returns the one that was taken before. The returned frame was exposed
    /// while the requested frame was on screen, and was never returned for another request.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the rig fails and does not recover;
    /// [`Error::Interrupted`](crate::Error::Interrupted) when the user asks to stop.
    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame>;

    /// Continues after the last photo of an interrupted session: the frame of `request` is put on screen
    /// again, and `frame` was the camera's last. A journal calls this once, before the first photo that it
    /// does not hold. A virtual rig that was opened with that frame's [`Stamp`](crate::rig::Stamp) then
    /// continues as if there had been no interruption.
    ///
    /// # Errors
    /// Those of [`Self::capture`].
    fn follow(&mut self, request: &CaptureRequest, frame: &RawFrame) -> Result<()> {
        let _ = (request, frame);
        Ok(())
    }

    /// Sets how many seconds pass between the confirmation of a frame and its exposure. This time is not part
    /// of a [`CaptureRequest`], so photos of one frame after different times must differ in `take`. A journal
    /// without a rig ignores it.
    fn set_settle(&mut self, seconds: f64);

    /// The costs so far.
    fn effort(&self) -> Effort;
}
