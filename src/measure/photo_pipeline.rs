//! Takes the photo of a frame on the camera's pixels: averaging, HDR, ambient light, camera response and drift, in this order.

use std::collections::HashSet;
use std::hash::{BuildHasher, BuildHasherDefault, DefaultHasher};
use std::ops::Range;
use std::sync::Arc;

use super::exposure;
use super::frame_source::FrameSource;
use super::hdr::{AveragedExposure, BlackPhotos, RateFrame, average, merge};
use super::options::{MOST_TAKES, MeasureOptions};
use super::response::CameraCurve;
use crate::error::Result;
use crate::finding::Ratio;
use crate::rig::Frame;

/// Takes photos with drift correction. The captured frames depend only on the options, on the requested frames and on the content of
/// earlier frames, so that a journal can replay them.
pub(crate) struct PhotoPipeline {
    pub(crate) frames: Box<dyn FrameSource>,
    pub(crate) curve: CameraCurve,
    /// Whether each camera pixel is used by some projector pixel.
    pub(crate) used: Vec<bool>,
    /// The frame that lights every projector pixel that the camera sees.
    pub(crate) white: Arc<Frame>,
    pub(crate) black: Arc<Frame>,
    pub(crate) options: MeasureOptions,
    /// The hashes of the frames shown so far.
    pub(crate) shown: HashSet<u64>,
    /// The drift of the lamp since the white photo.
    pub(crate) drift: LampDrift,
    references: Option<Arc<ReferencePhotos>>,
    /// Patterns since the last photo of white.
    since_white: u32,
    /// The number of sentinels (repeated photos of white) between the run's patterns. The sentinels of [`Self::look_again`] do not count.
    sentinels: u32,
    /// The take number of the last sentinel of [`Self::look_again`].
    last: Option<u32>,
}

/// The exposures and the photos of black and white, which all other photos need. They are taken before any other photo.
pub(crate) struct ReferencePhotos {
    /// The exposures in seconds, the shortest first.
    pub(crate) exposures: Vec<f64>,
    pub(crate) blacks: BlackPhotos,
    pub(crate) white: Arc<RateFrame>,
    /// The fraction of the used samples that are saturated in at least one exposure of white.
    pub(crate) saturated: f64,
    /// The photo of white at the shortest exposure, with which sentinels are compared.
    reference: AveragedExposure,
}

impl PhotoPipeline {
    /// The pipeline of the frames of a rig. `used` tells for each camera pixel whether some projector pixel uses it, and `white` lights
    /// every projector pixel that the camera sees.
    pub(crate) fn new(
        frames: Box<dyn FrameSource>,
        curve: CameraCurve,
        used: Vec<bool>,
        white: Arc<Frame>,
        options: MeasureOptions,
    ) -> Self {
        Self {
            frames,
            curve,
            used,
            black: Arc::new(Frame::filled(white.resolution(), white.channels(), 0)),
            white,
            options,
            shown: HashSet::new(),
            drift: LampDrift::default(),
            references: None,
            since_white: 0,
            sentinels: 0,
            last: None,
        }
    }

    /// The photo of `frame`, corrected for the drift of the lamp since the first photo of white.
    pub(crate) fn photograph(&mut self, frame: &Arc<Frame>) -> Result<Arc<RateFrame>> {
        let references = self.references()?;
        if *frame == self.white {
            return Ok(Arc::clone(&references.white));
        }
        let due = self.options.sentinel_every;
        let sentinel_is_due = due > 0 && self.since_white >= due;
        if sentinel_is_due {
            self.take_sentinel(MOST_TAKES + self.sentinels)?;
            self.sentinels += 1;
        }
        let mut seen = self.see(frame, &references.exposures, &references.blacks)?.0;
        seen.scale(1.0 / self.drift.light(seen.started));
        self.since_white = if sentinel_is_due { 1 } else { self.since_white + 1 };
        Ok(Arc::new(seen))
    }

    /// Takes a sentinel at the end of a run's photos, unless no pattern was shown since the last photo of white. A run that continues with
    /// more patterns takes its other sentinels as if this sentinel had not been taken.
    pub(crate) fn look_again(&mut self) -> Result<()> {
        let take = 2 * MOST_TAKES + self.shown.len() as u32;
        if self.since_white > 0 && self.last != Some(take) {
            self.take_sentinel(take)?;
            self.last = Some(take);
        }
        Ok(())
    }

    /// The reference photos. They are taken now unless they have been taken before: the exposures are chosen, and black and white are
    /// photographed.
    pub(crate) fn references(&mut self) -> Result<Arc<ReferencePhotos>> {
        if let Some(references) = &self.references {
            return Ok(Arc::clone(references));
        }
        let white = Arc::clone(&self.white);
        let exposures = if self.options.exposures.is_empty() {
            exposure::choose(&mut *self.frames, &self.curve, &white, &self.used, self.options.brackets)?
        } else {
            self.options.exposures.clone()
        };
        let mut blacks = BlackPhotos::default();
        if self.options.ambient {
            self.note(&Arc::clone(&self.black));
            blacks = self.blacks(&exposures, self.options.black_takes)?;
        }
        let (seen, mut exposed) = self.see(&white, &exposures, &blacks)?;
        let saturated = self.saturated(&exposed);
        self.drift = LampDrift::new(seen.started);
        let (white, reference) = (Arc::new(seen), exposed.swap_remove(0));
        let references = Arc::new(ReferencePhotos { exposures, blacks, white, saturated, reference });
        Ok(Arc::clone(self.references.insert(references)))
    }

    /// Photographs black `takes` times at each exposure.
    pub(crate) fn blacks(&mut self, exposures: &[f64], takes: u32) -> Result<BlackPhotos> {
        let mut blacks = BlackPhotos::default();
        for &exposure in exposures {
            let exposed = self.average(&Arc::clone(&self.black), exposure, 0..takes)?;
            let square = exposed.exposure * exposed.exposure;
            let of = |(sample, &mean): (usize, &f64)| exposed.variance(&self.curve, sample, mean) / square;
            blacks.variance.push(exposed.mean.iter().enumerate().map(of).collect());
            blacks.exposed.push(exposed);
        }
        Ok(blacks)
    }

    fn average(&mut self, frame: &Arc<Frame>, exposure: f64, takes: Range<u32>) -> Result<AveragedExposure> {
        average(&mut *self.frames, &self.curve, frame, exposure, takes)
    }

    fn saturated(&self, exposed: &[AveragedExposure]) -> f64 {
        let channels = self.frames.camera().channels;
        let used = || (0..self.used.len() * channels).filter(|sample| self.used[sample / channels]);
        let lost = used().filter(|&sample| exposed.iter().any(|exposed| exposed.saturated[sample])).count();
        lost as f64 / used().count().max(1) as f64
    }

    /// Captures a frame at all exposures. Returns the merged photo and the single exposures.
    fn see(
        &mut self,
        frame: &Arc<Frame>,
        exposures: &[f64],
        blacks: &BlackPhotos,
    ) -> Result<(RateFrame, Vec<AveragedExposure>)> {
        self.note(frame);
        let takes = 0..self.options.takes;
        let exposed = exposures.iter().map(|&exposure| self.average(frame, exposure, takes.clone()));
        let exposed = exposed.collect::<Result<Vec<AveragedExposure>>>()?;
        let camera = self.frames.camera().resolution;
        Ok((merge(&exposed, &blacks.exposed, &self.curve, &self.used, camera)?, exposed))
    }

    /// Takes a sentinel, which is a photo of white with this take number, and adds the brightness of the lamp to the drift.
    fn take_sentinel(&mut self, take: u32) -> Result<()> {
        let references = self.references()?;
        let now = self.average(&Arc::clone(&self.white), references.exposures[0], take..take + 1)?;
        let black = references.blacks.exposed.first();
        let channels = self.frames.camera().channels;
        let [mut sum, mut reference, mut variance] = [0.0; 3];
        for sample in (0..now.mean.len()).filter(|sample| self.used[sample / channels]) {
            if !now.saturated[sample] {
                let black = black.map_or(self.curve.zero, |black| black.mean[sample]);
                sum += now.mean[sample] - black;
                reference += references.reference.mean[sample] - black;
                variance += now.variance(&self.curve, sample, now.mean[sample]);
            }
        }
        let light = Ratio::of(sum, reference, 0.0).value().unwrap_or(1.0);
        let error = Ratio::of(variance.sqrt(), reference, 0.0).value().unwrap_or(1.0);
        self.drift.add(now.started, [light, error]);
        Ok(())
    }

    fn note(&mut self, frame: &Arc<Frame>) {
        self.shown.insert(BuildHasherDefault::<DefaultHasher>::default().hash_one(frame));
    }
}

// The drift stage: photos are divided by the brightness of the lamp.
//
// A sentinel is a photo of white that is repeated after a fixed number of patterns. The brightness of the lamp is the sentinel's light
// relative to the first white photo. A photo is corrected as soon as it is taken, so the brightness at its time is extrapolated from the
// last two sentinels. For a replayed photo between two sentinels, the brightness is interpolated. The times are stored with the frames, so
// a replay makes the same corrections.

#[derive(Clone, Debug, Default)]
pub(crate) struct LampDrift {
    /// Times in seconds on the rig's clock, and brightnesses relative to the first white photo.
    sentinels: Vec<[f64; 2]>,
    /// The largest standard error of a brightness.
    error: f64,
}

/// The measured drift.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct DriftReport {
    /// The time of each sentinel in seconds on the rig's clock, and the brightness of the lamp relative to the first white photo.
    pub sentinels: Vec<[f64; 2]>,
    /// The largest relative change since the first white photo.
    pub largest: f64,
    /// The largest relative change from one photo of white to the next, and its standard error.
    pub step: [f64; 2],
}

impl LampDrift {
    /// The drift after the first white photo, which was taken at the time `started`.
    pub(crate) fn new(started: f64) -> Self {
        Self { sentinels: vec![[started, 1.0]], error: 0.0 }
    }

    /// Adds a sentinel: its time, the brightness of the lamp relative to the first white photo, and the standard error of this brightness.
    pub(crate) fn add(&mut self, started: f64, [light, error]: [f64; 2]) {
        self.error = self.error.max(error);
        let at = self.sentinels.partition_point(|&[time, _]| time <= started);
        self.sentinels.insert(at, [started, light]);
    }

    /// The brightness of the lamp at `time`, relative to the first white photo.
    pub(crate) fn light(&self, time: f64) -> f64 {
        let after = self.sentinels.partition_point(|&[at, _]| at <= time);
        let pair = match (self.sentinels.len(), after) {
            (0, _) => return 1.0,
            (1, _) => return self.sentinels[0][1],
            (_, 0) => return self.sentinels[0][1],
            (count, after) => after.min(count - 1),
        };
        let ([from, first], [to, second]) = (self.sentinels[pair - 1], self.sentinels[pair]);
        if to <= from {
            return second;
        }
        // The line is extrapolated by at most one interval.
        let share = ((time - from) / (to - from)).min(2.0);
        first + (second - first) * share
    }

    pub(crate) fn report(&self) -> DriftReport {
        let largest = self.sentinels.iter().map(|[_, light]| (light - 1.0).abs()).fold(0.0, f64::max);
        let changes = self.sentinels.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs());
        let step = [changes.fold(0.0, f64::max), std::f64::consts::SQRT_2 * self.error];
        DriftReport { sentinels: self.sentinels.clone(), largest, step }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_is_interpolated_between_sentinels_and_extrapolated_after_them() {
        let mut drift = LampDrift::new(10.0);
        assert_eq!(drift.light(99.0), 1.0);
        drift.add(20.0, [1.1, 0.01]);
        let close = |time: f64, light: f64| assert!((drift.light(time) - light).abs() < 1e-12, "{time}");
        close(5.0, 1.0);
        close(15.0, 1.05);
        close(25.0, 1.15);
        // The line ends one interval beyond the last sentinel.
        close(30.0, 1.2);
        close(80.0, 1.2);
        assert_eq!(drift.report().sentinels, [[10.0, 1.0], [20.0, 1.1]]);
        drift.add(30.0, [0.9, 0.02]);
        let [step, error] = drift.report().step;
        assert!((step - 0.2).abs() < 1e-12 && (error - 0.02 * 2.0_f64.sqrt()).abs() < 1e-12);
    }
}
