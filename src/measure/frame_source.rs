//! The source of raw frames (open devices, or a journal in front of them), and the time that a session spends.

use std::fmt;
use std::ops::Add;
use std::sync::Arc;

use crate::error::Result;
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame};

/// A photo to be taken. Equal requests to one rig with one calibration stand for the same photo, which a journal never takes twice.
#[derive(Clone, Debug, PartialEq)]
pub struct CaptureRequest {
    /// The frame that is shown.
    pub frame: Arc<Frame>,
    /// The exposure to set, in seconds.
    pub exposure: f64,
    /// The number of the repetition, from 0. It distinguishes repeated photos of the same frame: photos that are averaged, and photos of
    /// white that measure drift.
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
    /// Frames that the camera delivered a second time. These frames are refused.
    pub repeated: u64,
    /// Frames whose exposure began before the pattern had settled. These frames are refused.
    pub late: u64,
    /// Restarts of the camera.
    pub restarts: u64,
    /// Packets of frames that were lost on the network and sent again on request.
    #[serde(default)]
    pub resent: u64,
    /// Frames that came without some of their packets, although the missing packets were requested again. These frames are refused.
    #[serde(default)]
    pub incomplete: u64,
    /// Packets of these incomplete frames that never came.
    #[serde(default)]
    pub missing: u64,
    /// Duration in seconds on the rig's clock.
    pub seconds: f64,
    /// The use of the time since this session opened the rig.
    #[serde(default)]
    pub times: Times,
}

impl Effort {
    /// The number of used frames: frames that were taken, and frames from the journal.
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

    /// Takes the requested photo, or returns the earlier photo of an equal request. The photo was exposed with the requested frame on
    /// screen, and was never returned for another request.
    ///
    /// # Errors
    /// [`Error::Rig`](crate::Error::Rig) when the rig does not recover; [`Error::Interrupted`](crate::Error::Interrupted) when the user
    /// stops.
    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame>;

    /// Continues after the last photo of an interrupted session: shows the frame of `request` again, whose photo was `frame`. A journal
    /// calls this once, before the first photo that it lacks. A virtual rig that was opened with the [`Stamp`](crate::rig::Stamp) of
    /// `frame` then continues as if there had been no interruption.
    fn follow(&mut self, request: &CaptureRequest, frame: &RawFrame) -> Result<()> {
        let _ = (request, frame);
        Ok(())
    }

    /// Sets how many seconds pass between the confirmation of a frame and its exposure. This time is not part of a [`CaptureRequest`], so
    /// photos of one frame after different times must differ in `take`. A journal without a rig ignores this setting.
    fn set_settle(&mut self, seconds: f64);

    /// The costs of the session so far.
    fn effort(&self) -> Effort;
}

/// The time that one photo or many photos take, in seconds on the rig's clock. The sum over a session is
/// [`Effort::seconds`](crate::measure::Effort::seconds). `refresh` and `settle` depend on the projector, `expose` depends on the light, and
/// the other parts depend on this program and its connections.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Times {
    /// Drawing frames, sending them to the projector, and reading them back before and after the photo.
    pub show: f64,
    /// Waiting for the confirmation that a refresh of the projector showed the frame.
    pub refresh: f64,
    /// Waiting for further refreshes, and for the settle time of the calibration.
    pub settle: f64,
    /// Exposures of accepted frames.
    pub expose: f64,
    /// Setting and triggering the camera, transferring frames, and refused tries.
    pub transfer: f64,
    /// All other work: processing photos and writing the journal.
    pub process: f64,
}

impl Times {
    /// The parts with their names.
    fn parts(&self) -> [(&'static str, f64); 6] {
        let Self { show, refresh, settle, expose, transfer, process } = *self;
        [
            ("show", show),
            ("refresh", refresh),
            ("settle", settle),
            ("expose", expose),
            ("transfer", transfer),
            ("process", process),
        ]
    }

    /// Combines each part with the same part of `other`.
    fn zip(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            show: of(self.show, other.show),
            refresh: of(self.refresh, other.refresh),
            settle: of(self.settle, other.settle),
            expose: of(self.expose, other.expose),
            transfer: of(self.transfer, other.transfer),
            process: of(self.process, other.process),
        }
    }

    /// The sum of all parts.
    pub fn sum(&self) -> f64 {
        self.parts().iter().map(|(_, seconds)| seconds).sum()
    }

    /// The mean time of one of `photos` photos.
    pub fn each(self, photos: u64) -> Self {
        let share = 1.0 / photos.max(1) as f64;
        self.zip(self, |part, _| share * part)
    }
}

impl Add for Times {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.zip(other, f64::add)
    }
}

/// Writes the times in milliseconds, with their names.
impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = self.parts().map(|(name, seconds)| format!("{name} {:.1}", 1e3 * seconds));
        write!(f, "{:.1} ms: {}", 1e3 * self.sum(), parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_add_up_and_are_written_per_photo_in_milliseconds() {
        let one =
            Times { show: 0.002, refresh: 0.01, settle: 0.016, expose: 0.004, transfer: 0.001, process: 0.0 };
        let both = one + Times { process: 0.007, ..one };
        assert!((both.sum() - 0.073).abs() < 1e-12);
        let text = both.each(2).to_string();
        assert_eq!(
            text,
            "36.5 ms: show 2.0, refresh 10.0, settle 16.0, expose 4.0, transfer 1.0, process 3.5"
        );
        assert_eq!(Times::default().each(0), Times::default());
    }
}

#[cfg(test)]
pub(crate) mod simulated {
    use super::{CameraInfo, CaptureRequest, Effort, FrameSource, ProjectorInfo, RawFrame, Result};
    use crate::image::Resolution;

    /// A simulated rig. `photo` computes the counts of a frame from the request and the waiting time in seconds. The clock advances by one
    /// for each photo.
    pub(crate) struct Simulated<F> {
        /// A gray projector of 8 bits. It has no refresh time unless a test sets one.
        pub(crate) projector: ProjectorInfo,
        /// A gray camera. Its exposures go from 1 ms to 100 s unless a test sets others.
        pub(crate) camera: CameraInfo,
        pub(crate) photo: F,
        /// Seconds between the confirmation of a frame and its exposure.
        pub(crate) settle: f64,
        pub(crate) asked: Vec<CaptureRequest>,
    }

    impl<F> Simulated<F> {
        pub(crate) fn new(projector: Resolution, camera: Resolution, bits: u32, photo: F) -> Self {
            Self {
                projector: ProjectorInfo {
                    name: "projector".into(),
                    resolution: projector,
                    channels: 1,
                    bits: 8,
                    frame_time: 0.0,
                },
                camera: CameraInfo {
                    name: "camera".into(),
                    resolution: camera,
                    channels: 1,
                    bits,
                    exposures: [1e-3, 100.0],
                },
                photo,
                settle: 0.0,
                asked: Vec::new(),
            }
        }
    }

    impl<F: FnMut(&CaptureRequest, f64) -> Vec<u16> + Send> FrameSource for Simulated<F> {
        fn projector(&self) -> &ProjectorInfo {
            &self.projector
        }

        fn camera(&self) -> &CameraInfo {
            &self.camera
        }

        fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
            self.asked.push(request.clone());
            Ok(RawFrame {
                resolution: self.camera.resolution,
                channels: self.camera.channels,
                counts: (self.photo)(request, self.settle),
                exposure: request.exposure,
                id: self.asked.len() as u64,
                started: self.asked.len() as f64,
            })
        }

        fn set_settle(&mut self, seconds: f64) {
            self.settle = seconds;
        }

        fn effort(&self) -> Effort {
            Effort { taken: self.asked.len() as u64, ..Effort::default() }
        }
    }
}
