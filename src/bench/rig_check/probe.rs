//! The photos of black and white of a rig check, and photos of patterns as light above black.

use std::sync::Arc;

use crate::calibrate::CalibrationSession;
use crate::error::Result;
use crate::image::Resolution;
use crate::measure::{Calibration, Effort, FrameSource};
use crate::rig::{Frame, RawFrame};

/// The first take number of a probe. The photos of black and white before it have far fewer takes.
const FIRST_TAKE: u32 = 1000;

/// Takes photos at one exposure, and compares them with white.
pub(crate) struct Probe<'a> {
    pub(crate) session: CalibrationSession<'a>,
    pub(crate) exposure: f64,
    pub(crate) is_known: bool,
    pub(crate) white: Vec<f64>,
    /// The largest relative difference between repeated photos of white.
    pub(crate) scatter: f64,
    /// The light of each count, if the camera's response is not linear.
    curve: Option<Vec<f64>>,
    black: Vec<f64>,
    /// The mean of each channel in a photo of black at the shortest exposure, and in a photo of black at the probe's exposure.
    pub(crate) unlit: [Vec<f64>; 2],
    /// Whether the first photo of a frame still contains light of the previous frame.
    is_hasty: bool,
}

impl<'a> Probe<'a> {
    /// Starts from photos of black and white at this exposure. If light has not `settled` in the first photo, the second photo is used.
    pub(crate) fn new(
        frames: &'a mut dyn FrameSource,
        known: Option<&Calibration>,
        photos: &Photos,
        exposure: f64,
        settled: bool,
    ) -> Self {
        let means: Vec<f64> = photos.whites.iter().map(|[_, again]| again.mean()).collect();
        let (least, most) =
            means.iter().fold((f64::MAX, 0.0_f64), |(low, high), &mean| (low.min(mean), high.max(mean)));
        let mut probe = Self {
            session: CalibrationSession::starting_at(frames, FIRST_TAKE),
            exposure,
            is_known: known.is_some(),
            white: Vec::new(),
            scatter: 0.0,
            curve: known.and_then(|known| known.camera.curve.clone()),
            black: Vec::new(),
            unlit: [Vec::new(), Vec::new()],
            is_hasty: !settled,
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
        self.session.camera().resolution
    }

    pub(crate) fn projector(&self) -> Resolution {
        self.session.projector().resolution
    }

    /// Photographs a frame that is white at the pixels (column, row) for which `is_lit` is true. Returns the light above black.
    pub(crate) fn pattern(&mut self, is_lit: impl Fn(usize, usize) -> bool) -> Result<Vec<f64>> {
        self.above_black(self.session.drawn(is_lit)?)
    }

    /// Photographs a frame of one level, given as a fraction of the highest level. Returns the light above black.
    pub(crate) fn gray(&mut self, share: f64) -> Result<Vec<f64>> {
        self.above_black(self.session.filled(self.level(share)))
    }

    /// Photographs a frame with one of the projector's three colours, at a fraction of its highest level. Returns the light above black.
    pub(crate) fn colour(&mut self, colour: usize, share: f64) -> Result<Vec<f64>> {
        self.above_black(self.session.filled_channel(colour, self.level(share))?)
    }

    fn level(&self, share: f64) -> u16 {
        (share * f64::from(self.session.top())).round() as u16
    }

    fn above_black(&mut self, frame: Arc<Frame>) -> Result<Vec<f64>> {
        let mut photo = self.session.capture(&frame, self.exposure)?;
        if self.is_hasty {
            photo = self.session.capture(&frame, self.exposure)?;
        }
        let light = self.light(&photo);
        Ok(light.iter().zip(&self.black).map(|(light, black)| light - black).collect())
    }

    /// The light of a photo, including black: the mean over the channels of each pixel.
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

/// The means over squares of `side` pixels, and the resolution of the result. Incomplete squares at the right and at the bottom are
/// dropped.
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
    /// For each round, a photo of black right after white.
    pub(crate) blacks: Vec<RawFrame>,
    /// For each round, the first photo of white after black, and the next photo of white.
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
    let mut session = CalibrationSession::new(frames);
    let [black, white] = [session.filled(0), session.filled(session.top())];
    let dark = session.capture(&black, session.camera().exposures[0])?;
    let dark_count = dark.percentile(0.5);
    let (mut blacks, mut whites) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        blacks.push(session.capture(&black, exposure)?);
        whites.push([session.capture(&white, exposure)?, session.capture(&white, exposure)?]);
    }
    // If the wait is too short, the first photo of black still contains some of white's light. This light must not count as ambient light.
    session.capture(&black, exposure)?;
    let black = session.capture(&black, exposure)?;
    let after = session.effort();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::percentile;

    #[test]
    fn squares_are_averaged_and_what_is_left_over_is_dropped() {
        let light: Vec<f64> = (0..35).map(f64::from).collect();
        // Squares of two pixels do not cover the last column and row of seven by five pixels.
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
