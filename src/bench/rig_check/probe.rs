//! The check's photos of black and white, and photos of patterns as light above black.

use std::sync::Arc;

use crate::error::Result;
use crate::image;
use crate::image::Resolution;
use crate::measure::{Calibration, CaptureRequest, Effort, FrameSource};
use crate::rig::{Frame, RawFrame};

/// The number of the first take of a pattern. It distinguishes these takes from the takes of black and white.
const FIRST_TAKE: u32 = 1000;

/// Takes photos at one exposure, and compares them with white.
pub(crate) struct Probe<'a> {
    pub(crate) frames: &'a mut dyn FrameSource,
    pub(crate) exposure: f64,
    pub(crate) is_known: bool,
    pub(crate) white: Vec<f64>,
    /// The largest relative difference between repeated photos of white.
    pub(crate) scatter: f64,
    /// The light of each count, if the camera's response is not linear.
    curve: Option<Vec<f64>>,
    black: Vec<f64>,
    /// The mean of each channel in a photo without light, and in a photo of black at the exposure.
    pub(crate) unlit: [Vec<f64>; 2],
    /// Whether the first photo of a frame still contains light of the previous frame.
    is_hasty: bool,
    take: u32,
}

impl<'a> Probe<'a> {
    /// Continues from photos of black and white at this exposure. Where light has not `settled` in the first photo, the second one is used.
    pub(crate) fn new(
        frames: &'a mut dyn FrameSource,
        known: Option<&Calibration>,
        photos: &Photos,
        exposure: f64,
        settled: bool,
    ) -> Self {
        let means: Vec<f64> = photos.whites.iter().map(|[_, again]| mean(again)).collect();
        let (least, most) =
            means.iter().fold((f64::MAX, 0.0_f64), |(low, high), &mean| (low.min(mean), high.max(mean)));
        let mut probe = Self {
            frames,
            exposure,
            is_known: known.is_some(),
            white: Vec::new(),
            scatter: 0.0,
            curve: known.and_then(|known| known.camera.curve.clone()),
            black: Vec::new(),
            unlit: [Vec::new(), Vec::new()],
            is_hasty: !settled,
            take: FIRST_TAKE,
        };
        probe.scatter = (most - least) / (most - photos.dark_count).max(1.0);
        probe.unlit = [&photos.dark, &photos.black].map(|photo| probe.channels(photo));
        probe.black = probe.light(&photos.black);
        let whites: Vec<Vec<f64>> = photos.whites.iter().map(|[_, again]| probe.light(again)).collect();
        let count = whites.len() as f64;
        probe.white = (0..probe.black.len())
            .map(|pixel| whites.iter().map(|white| white[pixel]).sum::<f64>() / count - probe.black[pixel])
            .collect();
        probe
    }

    pub(crate) fn camera(&self) -> Resolution {
        self.frames.camera().resolution
    }

    pub(crate) fn projector(&self) -> Resolution {
        self.frames.projector().resolution
    }

    /// The light above black of a frame that is white in each column and row for which `is_lit` is true, and black elsewhere.
    pub(crate) fn pattern(&mut self, is_lit: impl Fn(usize, usize) -> bool) -> Result<Vec<f64>> {
        let (info, size) = (self.frames.projector(), self.projector());
        let level = |pixel: usize| {
            if is_lit(pixel % size.width, pixel / size.width) { info.highest() } else { 0 }
        };
        let samples = (0..size.pixels() * info.channels).map(|sample| level(sample / info.channels));
        let frame = Frame::new(size, info.channels, samples.collect())?;
        self.above_black(frame)
    }

    /// The light above black of a frame of one level, given as a share of the highest level.
    pub(crate) fn gray(&mut self, share: f64) -> Result<Vec<f64>> {
        let info = self.frames.projector();
        let level = (share * f64::from(info.highest())).round() as u16;
        let frame = Frame::filled(info.resolution, info.channels, level);
        self.above_black(frame)
    }

    /// The light above black of a frame with only one of the projector's three colours, at a share of its highest level.
    pub(crate) fn colour(&mut self, colour: usize, share: f64) -> Result<Vec<f64>> {
        let info = self.frames.projector();
        let level = (share * f64::from(info.highest())).round() as u16;
        let samples =
            (0..3 * info.resolution.pixels()).map(|sample| if sample % 3 == colour { level } else { 0 });
        let frame = Frame::new(info.resolution, 3, samples.collect())?;
        self.above_black(frame)
    }

    fn above_black(&mut self, frame: Frame) -> Result<Vec<f64>> {
        let frame = Arc::new(frame);
        let mut photo = self.capture(&frame, self.exposure)?;
        if self.is_hasty {
            photo = self.capture(&frame, self.exposure)?;
        }
        let light = self.light(&photo);
        Ok(light.iter().zip(&self.black).map(|(light, black)| light - black).collect())
    }

    pub(crate) fn capture(&mut self, frame: &Arc<Frame>, exposure: f64) -> Result<RawFrame> {
        self.take += 1;
        self.frames.capture(&CaptureRequest { frame: Arc::clone(frame), exposure, take: self.take })
    }

    pub(crate) fn filled(&self, is_white: bool) -> Arc<Frame> {
        let info = self.frames.projector();
        let level = if is_white { info.highest() } else { 0 };
        Arc::new(Frame::filled(info.resolution, info.channels, level))
    }

    /// The light of a photo, including black: the mean of each pixel's channels.
    pub(crate) fn light(&self, photo: &RawFrame) -> Vec<f64> {
        let linear = |&count: &u16| match &self.curve {
            Some(curve) => curve[usize::from(count).min(curve.len() - 1)],
            None => f64::from(count),
        };
        let pixels = photo.counts.chunks_exact(photo.channels);
        pixels.map(|counts| counts.iter().map(linear).sum::<f64>() / photo.channels as f64).collect()
    }

    /// The mean light of each channel of a photo, including black.
    pub(crate) fn channels(&self, photo: &RawFrame) -> Vec<f64> {
        let one = |channel: usize| RawFrame {
            channels: 1,
            counts: photo.counts.iter().skip(channel).step_by(photo.channels).copied().collect(),
            ..photo.clone()
        };
        (0..photo.channels).map(|channel| average(&self.light(&one(channel)))).collect()
    }
}

pub(crate) fn average(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The means over squares of `side` pixels, and the picture's resolution. Remaining pixels at the right and at the bottom are dropped.
pub(crate) fn binned(light: &[f64], size: Resolution, side: usize) -> (Vec<f64>, Resolution) {
    let small = Resolution::new(size.width / side, size.height / side);
    let value = |pixel: usize| {
        let [x, y] = [pixel % small.width * side, pixel / small.width * side];
        let rows = (y..y + side).map(|row| &light[row * size.width + x..row * size.width + x + side]);
        rows.flatten().sum::<f64>() / (side * side) as f64
    };
    ((0..small.pixels()).map(value).collect(), small)
}

/// The number of rounds. In each round, white is shown after black and photographed twice.
const ROUNDS: u32 = 4;

pub(crate) struct Photos {
    pub(crate) black: RawFrame,
    /// For each round, black photographed right after white.
    pub(crate) blacks: Vec<RawFrame>,
    /// For each round, the first photo of white after black, and the next one.
    pub(crate) whites: Vec<[RawFrame; 2]>,
    /// The count without light, which is the median of black at the shortest exposure.
    pub(crate) dark_count: f64,
    /// Black at the shortest exposure.
    pub(crate) dark: RawFrame,
    pub(crate) effort: Effort,
}

/// Takes the photos. White is exposed for `exposure` seconds.
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
    // If the wait is too short, the first photo of black contains some of white's light, which is not ambient light.
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

pub(crate) fn mean(frame: &RawFrame) -> f64 {
    frame.counts.iter().map(|&count| f64::from(count)).sum::<f64>() / frame.counts.len() as f64
}

pub(crate) fn percentile(frame: &RawFrame, quantile: f64) -> f64 {
    image::percentile(frame.counts.iter().map(|&count| f64::from(count)), quantile)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::percentile;

    #[test]
    fn squares_are_averaged_and_what_is_left_over_is_dropped() {
        let light: Vec<f64> = (0..35).map(f64::from).collect();
        // Squares of two leave over the last column and row of seven by five pixels.
        let (small, size) = binned(&light, Resolution::new(7, 5), 2);
        assert_eq!(size, Resolution::new(3, 2));
        assert_eq!(small, [4.0, 6.0, 8.0, 18.0, 20.0, 22.0]);
        assert_eq!(binned(&light, Resolution::new(7, 5), 3).0, [8.0, 11.0]);
    }

    #[test]
    fn averages_and_quantiles_are_those_of_the_sorted_values() {
        assert_eq!((average(&[1.0, 2.0, 6.0]), average(&[])), (3.0, 0.0));
        let values = [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!([0.0, 0.25, 0.5, 0.7, 1.0].map(|at| percentile(values, at)), [1.0, 2.0, 3.0, 4.0, 5.0]);
    }
}
