//! The display stage: a pattern in `[0, 1]` is rounded to the projector's levels, and the light that is
//! *actually* shown becomes known.
//!
//! Each photo is assigned to the pattern that was shown, not to the target. As light is linear, the only
//! remaining error is the difference between the two. [`DitherBy`] says how this rounding error is spread
//! over the pixels.
//!
//! The relative error of a product, measured on 24×24 pixels of rank-one indirect light with 8 bits and gamma
//! 2.2 (`tests/rig/stages/quantization.rs`):
//!
//! | vector | part | nearest | random | diffusion |
//! |---|---|---|---|---|
//! | smooth | full | 1.2e-3 | 1.6e-3 | 1.4e-3 |
//! | smooth | global | 2.8e-5 | 8.3e-5 | 2.7e-5 |
//! | random | full | 2.9e-3 | 4.1e-3 | 3.2e-3 |
//! | random | global | 2.9e-3 | 4.5e-3 | 1.6e-3 |
//!
//! Therefore [`DitherBy::Auto`] uses error diffusion for the global part, and the nearest level otherwise.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::options::DitherBy;
use super::response::ProjectorCurve;
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::{Frame, ProjectorInfo};
use crate::transport::Part;

/// The conversion of patterns to a projector's frames.
#[derive(Clone, Debug)]
pub(super) struct Display {
    resolution: Resolution,
    /// The response of each channel.
    curves: Vec<ProjectorCurve>,
    dither: DitherBy,
    /// The threshold of each pixel. It is empty unless the dither is random.
    thresholds: Vec<f64>,
}

/// A frame, and the pattern of light that it shows.
#[derive(Clone, Debug)]
pub(super) struct Displayed {
    pub(super) frame: Arc<Frame>,
    /// The pattern that is shown, from 0 to 1: one plane per channel of the projector.
    pub(super) light: Vec<Vec<f64>>,
}

impl Display {
    /// The display of a projector with these response curves. `undo` corrects the response; `seed` is that of
    /// random dither.
    pub(super) fn new(
        projector: &ProjectorInfo,
        curves: &[Vec<f64>],
        undo: bool,
        dither: DitherBy,
        seed: u64,
    ) -> Result<Self> {
        let curves = curves
            .iter()
            .map(|curve| ProjectorCurve::new(curve, projector.bits, undo))
            .collect::<Result<_>>()?;
        let mut random = Pcg64::seed_from_u64(seed);
        let thresholds = match dither {
            DitherBy::Random => (0..projector.resolution.pixels()).map(|_| random.random::<f64>()).collect(),
            DitherBy::Auto | DitherBy::None | DitherBy::Diffusion => Vec::new(),
        };
        Ok(Self { resolution: projector.resolution, curves, dither, thresholds })
    }

    /// The widest step between two successive levels in any channel.
    pub(super) fn widest_step(&self) -> f64 {
        self.curves.iter().map(|curve| curve.widest).fold(0.0, f64::max)
    }

    /// The frame that shows `target` as well as the levels allow, for a product with `part`. `target` has one
    /// plane for all channels, or one plane per channel.
    pub(super) fn show(&self, target: &[Vec<f64>], part: Part) -> Result<Displayed> {
        let dither = match (self.dither, part) {
            (DitherBy::Auto, Part::Global) => DitherBy::Diffusion,
            (DitherBy::Auto, Part::Full | Part::Direct) => DitherBy::None,
            (chosen, _) => chosen,
        };
        self.quantize(target, |curve, plane| match dither {
            DitherBy::Auto | DitherBy::None => plane.iter().map(|&light| curve.nearest(light)).collect(),
            DitherBy::Random => self.random(curve, plane),
            DitherBy::Diffusion => self.diffuse(curve, plane),
        })
    }

    /// The frame that shows at each pixel the brightest level that is not brighter than `target`.
    pub(super) fn show_below(&self, target: &[Vec<f64>]) -> Result<Displayed> {
        self.quantize(target, |curve, plane| plane.iter().map(|&light| curve.below(light)).collect())
    }

    /// A frame, and the light that it shows.
    pub(super) fn of_frame(&self, frame: &Arc<Frame>) -> Displayed {
        let channels = self.curves.len();
        let plane = |(channel, curve): (usize, &ProjectorCurve)| {
            frame.levels().iter().skip(channel).step_by(channels).map(|&level| curve.light(level)).collect()
        };
        Displayed { frame: Arc::clone(frame), light: self.curves.iter().enumerate().map(plane).collect() }
    }

    /// The frame of the levels that `levels` chooses for each channel, and the light that it shows.
    fn quantize(
        &self,
        target: &[Vec<f64>],
        levels: impl Fn(&ProjectorCurve, &[f64]) -> Vec<u16>,
    ) -> Result<Displayed> {
        let channels = self.curves.len();
        let mut interleaved = vec![0; self.resolution.pixels() * channels];
        let mut light = Vec::with_capacity(channels);
        for (channel, curve) in self.curves.iter().enumerate() {
            let plane = levels(curve, &target[channel.min(target.len() - 1)]);
            for (pixel, &level) in plane.iter().enumerate() {
                interleaved[pixel * channels + channel] = level;
            }
            light.push(plane.into_iter().map(|level| curve.light(level)).collect());
        }
        let frame = Arc::new(Frame::new(self.resolution, channels, interleaved)?);
        Ok(Displayed { frame, light })
    }

    /// Random dither: each pixel shows the level below or above, with probabilities whose mean is the target.
    fn random(&self, curve: &ProjectorCurve, plane: &[f64]) -> Vec<u16> {
        let one = |(&light, &threshold): (&f64, &f64)| {
            let below = curve.below(light);
            let above = below.saturating_add(1).min(curve.top());
            let step = curve.light(above) - curve.light(below);
            if light - curve.light(below) > threshold * step { above } else { below }
        };
        plane.iter().zip(&self.thresholds).map(one).collect()
    }

    /// Error diffusion: the rounding error of each pixel is added to the neighbours that come after it. Rows
    /// are processed in alternating directions. The remaining error has high spatial frequencies, to which
    /// global light is insensitive. Floyd and Steinberg, *An adaptive algorithm for spatial greyscale*
    /// (1976).
    fn diffuse(&self, curve: &ProjectorCurve, plane: &[f64]) -> Vec<u16> {
        let (width, height) = (self.resolution.width, self.resolution.height);
        let mut target = plane.to_vec();
        let mut shown = vec![0; plane.len()];
        for y in 0..height {
            let forward = y % 2 == 0;
            for step in 0..width {
                let x = if forward { step } else { width - 1 - step };
                let pixel = y * width + x;
                shown[pixel] = curve.nearest(target[pixel]);
                // The part outside of [0, 1] cannot be shown by any level, and is not passed on to the
                // neighbours.
                let error = target[pixel].clamp(0.0, 1.0) - curve.light(shown[pixel]);
                let neighbour =
                    |by: isize| x.checked_add_signed(if forward { by } else { -by }).filter(|&x| x < width);
                for (row, by, share) in [(y, 1, 7.0), (y + 1, -1, 3.0), (y + 1, 0, 5.0), (y + 1, 1, 1.0)] {
                    if let Some(x) = neighbour(by).filter(|_| row < height) {
                        target[row * width + x] += error * share / 16.0;
                    }
                }
            }
        }
        shown
    }
}

impl Displayed {
    /// The pattern that lit one of the camera's `channels`: the projector's channel of the same index, or the
    /// mean of the projector's channels where the numbers of channels differ.
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
