//! A calibration session: it takes frames, each with a new take number, and computes their means.

use std::collections::HashMap;
use std::sync::Arc;

use crate::error::Result;
use crate::image::Resolution;
use crate::measure::{CaptureRequest, Effort, FrameSource};
use crate::rig::{CameraInfo, Frame, ProjectorInfo, RawFrame};

/// Takes frames. Repeated frames of the same pattern and exposure have successive take numbers, so that none
/// is taken twice. The order of the frames depends only on what was measured before, so that a journal can
/// replay a calibration.
pub(crate) struct CalibrationSession<'a> {
    frames: &'a mut dyn FrameSource,
    takes: HashMap<(Arc<Frame>, u64), u32>,
}

/// The mean of several frames of the same pattern and exposure.
#[derive(Clone, Debug)]
pub(crate) struct Mean {
    /// The mean count of each sample (interleaved channels).
    pub(crate) counts: Vec<f64>,
    /// The largest count of each sample.
    pub(crate) peaks: Vec<u16>,
    /// The exposure in seconds, as the camera reports it.
    pub(crate) exposure: f64,
    /// The middle of the exposures, in seconds on the rig's clock.
    pub(crate) time: f64,
    /// Frames averaged.
    pub(crate) takes: u32,
}

impl<'a> CalibrationSession<'a> {
    pub(crate) fn new(frames: &'a mut dyn FrameSource) -> Self {
        Self { frames, takes: HashMap::new() }
    }

    pub(crate) fn projector(&self) -> &ProjectorInfo {
        self.frames.projector()
    }

    pub(crate) fn camera(&self) -> &CameraInfo {
        self.frames.camera()
    }

    pub(crate) fn effort(&self) -> Effort {
        self.frames.effort()
    }

    pub(crate) fn set_settle(&mut self, seconds: f64) {
        self.frames.set_settle(seconds);
    }

    /// The brightest level.
    pub(crate) fn top(&self) -> u16 {
        ((1_u32 << self.projector().bits) - 1) as u16
    }

    /// The largest count.
    pub(crate) fn full(&self) -> f64 {
        ((1_u32 << self.camera().bits) - 1).into()
    }

    /// A frame with this level in all channels.
    pub(crate) fn filled(&self, level: u16) -> Arc<Frame> {
        let ProjectorInfo { resolution, channels, .. } = *self.projector();
        Arc::new(Frame::filled(resolution, channels, level))
    }

    /// A frame with this level in one channel, and level 0 in the others.
    pub(crate) fn filled_channel(&self, channel: usize, level: u16) -> Result<Arc<Frame>> {
        let ProjectorInfo { resolution, channels, .. } = *self.projector();
        let of = |sample: usize| if sample % channels == channel { level } else { 0 };
        Ok(Arc::new(Frame::new(resolution, channels, (0..resolution.pixels() * channels).map(of).collect())?))
    }

    /// A frame with the brightest level at the pixels (column, row) that are `lit`, and level 0 elsewhere.
    pub(crate) fn drawn(&self, lit: impl Fn(usize, usize) -> bool) -> Result<Arc<Frame>> {
        let ProjectorInfo { resolution, channels, .. } = *self.projector();
        let Resolution { width, .. } = resolution;
        let top = self.top();
        let level = |sample: usize| {
            let pixel = sample / channels;
            if lit(pixel % width, pixel / width) { top } else { 0 }
        };
        Ok(Arc::new(Frame::new(
            resolution,
            channels,
            (0..resolution.pixels() * channels).map(level).collect(),
        )?))
    }

    /// The next take of this frame and exposure.
    pub(crate) fn capture(&mut self, frame: &Arc<Frame>, exposure: f64) -> Result<RawFrame> {
        let take = self.takes.entry((Arc::clone(frame), exposure.to_bits())).or_insert(0);
        let request = CaptureRequest { frame: Arc::clone(frame), exposure, take: *take };
        *take += 1;
        let raw = self.frames.capture(&request)?;
        raw.check()?;
        Ok(raw)
    }

    /// The mean of `takes` new frames, and of at least one.
    pub(crate) fn mean(&mut self, frame: &Arc<Frame>, exposure: f64, takes: u32) -> Result<Mean> {
        let mut mean: Option<Mean> = None;
        for _ in 0..takes.max(1) {
            let raw = self.capture(frame, exposure)?;
            let middle = raw.started + 0.5 * raw.exposure;
            match &mut mean {
                None => {
                    mean = Some(Mean {
                        counts: raw.counts.iter().map(|&count| count.into()).collect(),
                        peaks: raw.counts,
                        exposure: raw.exposure,
                        time: middle,
                        takes: 1,
                    });
                }
                Some(mean) => {
                    let share = 1.0 / f64::from(mean.takes + 1);
                    for ((value, peak), &count) in
                        mean.counts.iter_mut().zip(&mut mean.peaks).zip(&raw.counts)
                    {
                        *value += (f64::from(count) - *value) * share;
                        *peak = count.max(*peak);
                    }
                    mean.time += (middle - mean.time) * share;
                    mean.takes += 1;
                }
            }
        }
        mean.ok_or_else(|| crate::Error::Numerical("a mean of no frames".into()))
    }

    /// The nearest exposure that the camera can set. When it is longer than the projector's refresh, it is a
    /// whole multiple of that.
    pub(crate) fn allowed(&self, exposure: f64) -> f64 {
        let [shortest, longest] = self.camera().exposures;
        let frame_time = self.projector().frame_time;
        let wanted = if frame_time > 0.0 && exposure > frame_time {
            (exposure / frame_time).round() * frame_time
        } else {
            exposure
        };
        wanted.clamp(shortest, longest)
    }
}
