//! A pattern in `[0, 1]` as levels, and the light that is then *actually* shown.
//!
//! Light is linear, so nothing is lost when every product is booked on the pattern that was shown. What differs from the
//! wish is the error of rounding to levels; how it spreads over the pixels is for [`DitherBy`] to choose.
//!
//! Measured on 24×24 pixels of rank-one indirect light, 8 bits and gamma 2.2, as the relative error of a product (`tests/rig/stages/quantization.rs`):
//!
//! | vector | part | nearest | random | diffusion |
//! |---|---|---|---|---|
//! | smooth | full | 1.2e-3 | 1.6e-3 | 1.4e-3 |
//! | smooth | global | 2.8e-5 | 8.3e-5 | 2.7e-5 |
//! | random | full | 2.9e-3 | 4.1e-3 | 3.2e-3 |
//! | random | global | 2.9e-3 | 4.5e-3 | 1.6e-3 |
//!
//! Hence [`DitherBy::Auto`]: diffusion for the global part, else the nearest level.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::options::DitherBy;
use super::response::Levels;
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::{Frame, ProjectorInfo};
use crate::transport::Part;

/// The projector as patterns see it.
#[derive(Clone, Debug)]
pub(super) struct Display {
    resolution: Resolution,
    /// One curve for each channel.
    levels: Vec<Levels>,
    dither: DitherBy,
    /// The threshold of each pixel, for random dither.
    thresholds: Vec<f64>,
}

/// A frame, and the light of it.
#[derive(Clone, Debug)]
pub(super) struct Displayed {
    pub(super) frame: Arc<Frame>,
    /// The pattern shown, 0 to 1: a plane for each channel of the projector.
    pub(super) light: Vec<Vec<f64>>,
}

impl Display {
    /// Of a projector with these response curves. `dither` does not concern what can be shown exactly.
    pub(super) fn new(
        projector: &ProjectorInfo,
        curves: &[Vec<f64>],
        undo: bool,
        dither: DitherBy,
        seed: u64,
    ) -> Result<Self> {
        let levels =
            curves.iter().map(|curve| Levels::new(curve, projector.bits, undo)).collect::<Result<_>>()?;
        let mut random = Pcg64::seed_from_u64(seed);
        let thresholds = match dither {
            DitherBy::Random => (0..projector.resolution.pixels()).map(|_| random.random::<f64>()).collect(),
            DitherBy::Auto | DitherBy::None | DitherBy::Diffusion => Vec::new(),
        };
        Ok(Self { resolution: projector.resolution, levels, dither, thresholds })
    }

    /// The widest step from one level to the next, of all channels.
    pub(super) fn widest_step(&self) -> f64 {
        self.levels.iter().map(|levels| levels.widest).fold(0.0, f64::max)
    }

    /// Shows `wish`, one plane for all channels or one for each, as well as the levels allow, for a product with `part`.
    pub(super) fn show(&self, wish: &[Vec<f64>], part: Part) -> Result<Displayed> {
        let dither = match (self.dither, part) {
            (DitherBy::Auto, Part::Global) => DitherBy::Diffusion,
            (DitherBy::Auto, Part::Full | Part::Direct) => DitherBy::None,
            (chosen, _) => chosen,
        };
        self.shown(wish, |levels, plane| match dither {
            DitherBy::Auto | DitherBy::None => plane.iter().map(|&light| levels.nearest(light)).collect(),
            DitherBy::Random => self.random(levels, plane),
            DitherBy::Diffusion => self.diffused(levels, plane),
        })
    }

    /// Shows at each pixel the brightest level that is not brighter than `wish`.
    pub(super) fn show_below(&self, wish: &[Vec<f64>]) -> Result<Displayed> {
        self.shown(wish, |levels, plane| plane.iter().map(|&light| levels.below(light)).collect())
    }

    /// The light of a frame that was shown before.
    pub(super) fn of_frame(&self, frame: &Arc<Frame>) -> Displayed {
        let channels = self.levels.len();
        let plane = |(channel, levels): (usize, &Levels)| {
            frame.levels().iter().skip(channel).step_by(channels).map(|&level| levels.light(level)).collect()
        };
        Displayed { frame: Arc::clone(frame), light: self.levels.iter().enumerate().map(plane).collect() }
    }

    fn shown(&self, wish: &[Vec<f64>], quantize: impl Fn(&Levels, &[f64]) -> Vec<u16>) -> Result<Displayed> {
        let channels = self.levels.len();
        let mut interleaved = vec![0; self.resolution.pixels() * channels];
        let mut light = Vec::with_capacity(channels);
        for (channel, levels) in self.levels.iter().enumerate() {
            let plane = quantize(levels, &wish[channel.min(wish.len() - 1)]);
            for (pixel, &level) in plane.iter().enumerate() {
                interleaved[pixel * channels + channel] = level;
            }
            light.push(plane.into_iter().map(|level| levels.light(level)).collect());
        }
        let frame = Arc::new(Frame::new(self.resolution, channels, interleaved)?);
        Ok(Displayed { frame, light })
    }

    /// The level above with the probability of its nearness: the mean is right, whatever the pattern.
    fn random(&self, levels: &Levels, plane: &[f64]) -> Vec<u16> {
        let one = |(&light, &threshold): (&f64, &f64)| {
            let below = levels.below(light);
            let above = below.saturating_add(1).min(levels.top());
            let step = levels.light(above) - levels.light(below);
            if light - levels.light(below) > threshold * step { above } else { below }
        };
        plane.iter().zip(&self.thresholds).map(one).collect()
    }

    /// Each pixel's error goes to the neighbours that are still to come, in alternating directions: what stays is of high
    /// frequency, where indirect light does not see it. Floyd and Steinberg, *An adaptive algorithm for spatial
    /// greyscale* (1976).
    fn diffused(&self, levels: &Levels, plane: &[f64]) -> Vec<u16> {
        let (width, height) = (self.resolution.width, self.resolution.height);
        let mut wish = plane.to_vec();
        let mut shown = vec![0; plane.len()];
        for y in 0..height {
            let forward = y % 2 == 0;
            for step in 0..width {
                let x = if forward { step } else { width - 1 - step };
                let pixel = y * width + x;
                shown[pixel] = levels.nearest(wish[pixel]);
                // What no level can show is not for the neighbours to make up for.
                let error = wish[pixel].clamp(0.0, 1.0) - levels.light(shown[pixel]);
                let ahead =
                    |by: isize| x.checked_add_signed(if forward { by } else { -by }).filter(|&x| x < width);
                for (row, by, share) in [(y, 1, 7.0), (y + 1, -1, 3.0), (y + 1, 0, 5.0), (y + 1, 1, 1.0)] {
                    if let Some(x) = ahead(by).filter(|_| row < height) {
                        wish[row * width + x] += error * share / 16.0;
                    }
                }
            }
        }
        shown
    }
}

impl Displayed {
    /// The pattern that one of the camera's channels was lit with: its own where the projector has it, else the mean.
    pub(super) fn seen_by(&self, channel: usize, channels: usize) -> Vec<f64> {
        if self.light.len() == channels || self.light.len() == 1 {
            return self.light[channel.min(self.light.len() - 1)].clone();
        }
        let share = 1.0 / self.light.len() as f64;
        (0..self.light[0].len())
            .map(|pixel| self.light.iter().map(|plane| plane[pixel]).sum::<f64>() * share)
            .collect()
    }
}
