//! The live preview of a rig: one pattern photographed again and again while a person sets up projector and
//! camera.
//!
//! Frames are not converted to light: their figures are those of the camera's counts.

mod figures;

use std::sync::Arc;

pub use figures::FrameFigures;

use crate::calibrate::{StructuredLight, WhiteExposure};
use crate::error::Result;
use crate::image::Image;
use crate::measure::{CameraResponse, CaptureRequest, FrameSource, focus};
use crate::rig::{Frame, ProjectorInfo, RawFrame};

/// What the counts of a camera mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CountRange {
    /// The count without light.
    pub black: f64,
    /// Counts from here on are saturated.
    pub limit: f64,
    /// The largest count.
    pub full: f64,
}

impl CountRange {
    /// The range that a calibration knows. Without one, a frame of the black projector at the shortest
    /// exposure is taken: its median is the count without light, and only the largest count is saturated.
    ///
    /// # Errors
    /// Those of [`FrameSource::capture`].
    pub fn measure(known: Option<&CameraResponse>, frames: &mut dyn FrameSource) -> Result<Self> {
        let camera = frames.camera();
        let full = f64::from((1_u32 << camera.bits) - 1);
        if let Some(known) = known {
            return Ok(Self { black: known.black, limit: known.saturation, full });
        }
        let (shortest, projector) = (camera.exposures[0], frames.projector());
        let dark = Frame::filled(projector.resolution, projector.channels, 0);
        let raw = frames.capture(&CaptureRequest { frame: Arc::new(dark), exposure: shortest, take: 0 })?;
        let mut counts = raw.counts;
        let middle = counts.len() / 2;
        let black = f64::from(*counts.select_nth_unstable(middle).1);
        Ok(Self { black, limit: full, full })
    }
}

/// The frame that shows an image as levels: 0 is level 0, and 1 the brightest level. Values outside of that
/// are clamped, and the projector's response is not corrected.
///
/// # Errors
/// [`Error::Dimension`](crate::Error::Dimension) when the image does not have the projector's pixels.
pub fn level_frame(image: &Image, projector: &ProjectorInfo) -> Result<Frame> {
    let (size, channels, top) = (projector.resolution, projector.channels, f32::from(projector.highest()));
    if image.resolution() != size {
        return Err(crate::Error::Dimension {
            what: "pixels of the pattern",
            expected: size.to_string(),
            found: image.resolution().to_string(),
        });
    }
    let level = |sample: usize| {
        let channel = (sample % channels).min(image.channels() - 1);
        let value = image.samples()[sample / channels * image.channels() + channel];
        (value.clamp(0.0, 1.0) * top).round() as u16
    };
    Frame::new(size, channels, (0..size.pixels() * channels).map(level).collect())
}

/// A running preview. Each call is handed the same source of frames.
pub struct Preview {
    frame: Arc<Frame>,
    exposure: f64,
    range: CountRange,
    /// The time on the rig's clock when the preview began, in seconds.
    began: f64,
    /// Frames taken.
    taken: u64,
    last: Option<RawFrame>,
    best_focus: Option<f64>,
}

impl Preview {
    /// Starts a preview of `frame` with exposures of so many seconds.
    pub fn new(frames: &dyn FrameSource, frame: Arc<Frame>, exposure: f64, range: CountRange) -> Self {
        let began = frames.effort().seconds;
        Self { frame, exposure, range, began, taken: 0, last: None, best_focus: None }
    }

    /// The exposure, in seconds, at which white fills about 70 % of the camera's range, and whether the
    /// camera has one.
    ///
    /// # Errors
    /// Those of [`FrameSource::capture`].
    pub fn white_exposure(frames: &mut dyn FrameSource) -> Result<(f64, WhiteExposure)> {
        StructuredLight::white_exposure(frames)
    }

    /// Takes the next frame.
    ///
    /// # Errors
    /// Those of [`FrameSource::capture`].
    pub fn capture(&mut self, frames: &mut dyn FrameSource) -> Result<FrameFigures> {
        let request = CaptureRequest {
            frame: Arc::clone(&self.frame),
            exposure: self.exposure,
            take: self.taken as u32,
        };
        let raw = frames.capture(&request)?;
        self.taken += 1;
        let last = self.last.as_ref();
        let score = last.and_then(|last| focus(last, &raw, self.range.black, self.range.limit));
        self.best_focus = self.best_focus.into_iter().chain(score).reduce(f64::max);
        let seconds = frames.effort().seconds - self.began;
        let per_second = self.taken as f64 / seconds.max(f64::MIN_POSITIVE);
        let figures = FrameFigures::of(&raw, &self.range, (self.taken, per_second), [score, self.best_focus]);
        self.last = Some(raw);
        Ok(figures)
    }

    /// How many frames were taken.
    pub fn taken(&self) -> u64 {
        self.taken
    }

    /// The frame that was taken last.
    pub fn last(&self) -> Option<&RawFrame> {
        self.last.as_ref()
    }

    /// What the counts mean.
    pub fn range(&self) -> &CountRange {
        &self.range
    }
}
