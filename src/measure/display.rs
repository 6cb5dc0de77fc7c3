//! The display stage: a pattern in `[0, 1]` is rounded to the projector's levels, and the light that is *actually* shown becomes known.
//!
//! Each photo is assigned to the pattern that was shown, not to the target. Light is linear, so the difference between the shown pattern
//! and the target is the only remaining error. [`DitherBy`] selects how this rounding error is spread over the pixels.
//!
//! The table shows the relative error of a product, measured on 24×24 pixels of rank-one indirect light with 8 bits and gamma 2.2
//! (`tests/rig/stages/quantization.rs`):
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

#[derive(Clone, Debug)]
pub(crate) struct PatternDisplay {
    resolution: Resolution,
    curves: Vec<ProjectorCurve>,
    dither: DitherBy,
    /// The threshold of each pixel. It is empty unless the dither is random.
    thresholds: Vec<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct Displayed {
    pub(crate) frame: Arc<Frame>,
    /// The pattern that is shown, from 0 to 1, in one plane per channel of the projector.
    pub(crate) light: Vec<Vec<f64>>,
}

impl PatternDisplay {
    /// The display of a projector with these response curves. With `undo`, the response is corrected. `seed` starts the random dither.
    pub(crate) fn new(
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
    pub(crate) fn widest_step(&self) -> f64 {
        self.curves.iter().map(|curve| curve.widest).fold(0.0, f64::max)
    }

    /// The frame that approximates `target` for a product with `part`. `target` has one plane for all channels, or one plane per channel.
    pub(crate) fn show(&self, target: &[Vec<f64>], part: Part) -> Result<Displayed> {
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

    /// The frame that shows at each pixel the brightest level that does not exceed `target`.
    pub(crate) fn show_below(&self, target: &[Vec<f64>]) -> Result<Displayed> {
        self.quantize(target, |curve, plane| plane.iter().map(|&light| curve.below(light)).collect())
    }

    pub(crate) fn of_frame(&self, frame: &Arc<Frame>) -> Displayed {
        let channels = self.curves.len();
        let plane = |(channel, curve): (usize, &ProjectorCurve)| {
            frame.levels().iter().skip(channel).step_by(channels).map(|&level| curve.light(level)).collect()
        };
        Displayed { frame: Arc::clone(frame), light: self.curves.iter().enumerate().map(plane).collect() }
    }

    /// Lets `levels` choose the levels of each channel. Returns the frame with these levels and the light that the frame shows.
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

    /// Random dither: each pixel shows the level below or above its target, with probabilities for which the mean light is the target.
    fn random(&self, curve: &ProjectorCurve, plane: &[f64]) -> Vec<u16> {
        let one = |(&light, &threshold): (&f64, &f64)| {
            let below = curve.below(light);
            let above = below.saturating_add(1).min(curve.top());
            let step = curve.light(above) - curve.light(below);
            if light - curve.light(below) > threshold * step { above } else { below }
        };
        plane.iter().zip(&self.thresholds).map(one).collect()
    }

    /// Error diffusion: the rounding error of each pixel is added to the neighbours that come after it. Rows are processed in alternating
    /// directions. The remaining error has high spatial frequencies, to which global light is insensitive (Floyd and Steinberg, *An
    /// adaptive algorithm for spatial greyscale*, 1976).
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
                // No level can show light outside [0, 1]. The part of the error outside this range is not passed on.
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
    /// The pattern that lit one of the camera's `channels`: the projector's channel of the same index, or the mean of the projector's
    /// channels if the numbers of channels differ.
    pub(crate) fn seen_by(&self, channel: usize, channels: usize) -> Vec<f64> {
        if self.light.len() == channels || self.light.len() == 1 {
            return self.light[channel.min(self.light.len() - 1)].clone();
        }
        let share = 1.0 / self.light.len() as f64;
        (0..self.light[0].len())
            .map(|pixel| self.light.iter().map(|plane| plane[pixel]).sum::<f64>() * share)
            .collect()
    }
}

// The bit-plane stage: a weighted sum of frames shows more levels than the projector has (O'Toole and Kutulakos, section 7.2).
//
// Each frame shows the quantization error of the frames before it. Let `δ` be the widest step between levels. The first of `K` frames has
// weight `w = 1/(1+δ)` and shows the level below `x / w` for the pattern `x`. The remainder is at most `w δ` at every pixel. The next frame
// shows the remainder in the same way, as a pattern with the range `w δ`. The last frame shows the nearest level. For a projector of one
// bit, the frames are binary digits with weights ½, ¼, …. Each frame reduces the error by the factor `δ/(1+δ)`.
//
// The result has the noise of `Σ w_k photo_k`. Each photo has the full read noise of the camera, independent of its weight. With `K`
// exposures of `t/K` seconds instead of one exposure of `t` seconds, the standard deviation due to read noise grows by the factor
// `K √Σ w_k²` ([`bit_plane_amplification`]). In little light, more frames can therefore be worse than fewer.

/// The weights of `count` frames on a projector whose widest step between levels is `step` (levels from 0 to 1).
pub fn bit_plane_weights(count: u32, step: f64) -> Vec<f64> {
    let mut range = 1.0;
    let mut bit_plane_weights: Vec<f64> = (1..count)
        .map(|_| {
            let weight = range / (1.0 + step);
            range = weight * step;
            weight
        })
        .collect();
    bit_plane_weights.push(range);
    bit_plane_weights
}

/// The factor by which the standard deviation grows when frames of these weights replace one photo, at equal total exposure and with read
/// noise alone.
pub fn bit_plane_amplification(bit_plane_weights: &[f64]) -> f64 {
    bit_plane_weights.len() as f64
        * bit_plane_weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt()
}

/// Decomposes `target`, with one plane for all channels or one plane per channel, into `count` weighted frames. Dark frames are left out.
pub(crate) fn decompose(
    display: &PatternDisplay,
    target: &[Vec<f64>],
    part: Part,
    count: u32,
) -> Result<Vec<(f64, Displayed)>> {
    let mut left = target.to_vec();
    let bit_plane_weights = bit_plane_weights(count, display.widest_step());
    let mut planes = Vec::with_capacity(bit_plane_weights.len());
    for (index, &weight) in bit_plane_weights.iter().enumerate() {
        let scaled: Vec<Vec<f64>> =
            left.iter().map(|plane| plane.iter().map(|light| light / weight).collect()).collect();
        let last = index + 1 == bit_plane_weights.len();
        let displayed = if last { display.show(&scaled, part)? } else { display.show_below(&scaled)? };
        if !last {
            // Channels with different response curves leave different remainders.
            left = displayed
                .light
                .iter()
                .enumerate()
                .map(|(channel, shown)| {
                    let target = &left[channel.min(left.len() - 1)];
                    target.iter().zip(shown).map(|(target, shown)| target - weight * shown).collect()
                })
                .collect();
        }
        if displayed.frame.levels().iter().any(|&level| level > 0) {
            planes.push((weight, displayed));
        }
    }
    Ok(planes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn projector(width: usize, height: usize, channels: usize, bits: u32) -> ProjectorInfo {
        let resolution = Resolution::new(width, height);
        ProjectorInfo { name: "projector".into(), resolution, channels, bits, frame_time: 0.0 }
    }

    fn display(width: usize, height: usize, light: &[f64], dither: DitherBy) -> PatternDisplay {
        let info = projector(width, height, 1, light.len().ilog2());
        PatternDisplay::new(&info, &[light.to_vec()], true, dither, 7).expect("it ascends from 0 to 1")
    }

    fn levels(display: &PatternDisplay, target: &[f64], part: Part) -> Vec<u16> {
        display.show(&[target.to_vec()], part).expect("as many values as pixels").frame.levels().to_vec()
    }

    /// One pixel of light 0.4 is shown dark, and its error of 0.4 is passed on. A second pixel turns bright as soon as it gets its
    /// Floyd–Steinberg share of this error. The targets of all other pixels are far below 0. Such pixels are shown dark and pass on no
    /// error.
    #[test]
    fn diffusion_gives_sixteenths_of_an_error_to_four_neighbours_in_the_direction_of_the_row() {
        let display = display(5, 3, &[0.0, 1.0], DitherBy::Diffusion);
        let shown = |source: usize, neighbour: usize, light: f64| {
            let mut target = vec![-10.0; 15];
            (target[source], target[neighbour]) = (0.4, light);
            levels(&display, &target, Part::Full)
        };
        for (y, ahead) in [(0, 1), (1, -1)] {
            for (down, along, share) in [(0, 1, 7.0), (1, -1, 3.0), (1, 0, 5.0), (1, 1, 1.0)] {
                let source: isize = 5 * y + 2;
                let neighbour = (5 * (y + down) + 2 + ahead * along) as usize;
                let needed = 0.5 - 0.4 * share / 16.0;
                for (light, level) in [(needed - 1e-6, 0), (needed + 1e-6, 1)] {
                    let shown = shown(source as usize, neighbour, light);
                    assert_eq!(shown[neighbour], level, "row {y}, {along} along, {down} down, {light}");
                    assert_eq!(shown.iter().sum::<u16>(), level, "no other pixel becomes bright");
                }
            }
        }
        // No error is passed around the end of a row or past the last row.
        for (source, elsewhere) in [(4, 5), (4, 10), (5, 4), (5, 14), (12, 2)] {
            assert_eq!(shown(source, elsewhere, 0.5 - 1e-6).iter().sum::<u16>(), 0, "{source} {elsewhere}");
        }
    }

    #[test]
    fn diffusion_of_too_bright_a_pixel_darkens_its_neighbours_and_of_one_beyond_white_does_not() {
        let display = display(2, 1, &[0.0, 1.0], DitherBy::Diffusion);
        // The first pixel is shown as 1, which is 0.4 too bright, so the next pixel gets 0.175 less.
        assert_eq!(levels(&display, &[0.6, 0.67], Part::Full), [1, 0]);
        assert_eq!(levels(&display, &[0.6, 0.68], Part::Full), [1, 1]);
        assert_eq!(levels(&display, &[7.0, 0.49], Part::Full), [1, 0]);
    }

    #[test]
    fn random_dither_shows_the_target_on_average_by_the_levels_on_both_sides_of_it() {
        let curve = [0.0, 0.2, 0.7, 1.0];
        let display = display(64, 64, &curve, DitherBy::Random);
        for (target, below, share) in [(0.3, 1, 0.2), (0.66, 1, 0.92), (0.9, 2, 2.0 / 3.0)] {
            let shown = levels(&display, &vec![target; 4096], Part::Full);
            assert!(shown.iter().all(|&level| level == below || level == below + 1), "{target}");
            let above = shown.iter().filter(|&&level| level == below + 1).count() as f64 / 4096.0;
            // The bound is five standard deviations of a fraction that is observed in 4096 pixels.
            let deviation = (share * (1.0 - share) / 4096.0_f64).sqrt();
            assert!((above - share).abs() < 5.0 * deviation, "{target}: {above} against {share}");
        }
        assert_eq!(levels(&display, &vec![1.0; 4096], Part::Full), vec![3; 4096]);
        assert_eq!(levels(&display, &vec![0.2; 4096], Part::Full), vec![1; 4096], "a level needs no dither");
    }

    #[test]
    fn without_a_choice_the_error_is_diffused_for_global_light_alone() {
        let target: Vec<f64> = (0..12).map(|pixel| f64::from(pixel) / 13.0).collect();
        let shown = |dither, part| levels(&display(4, 3, &[0.0, 0.3, 0.6, 1.0], dither), &target, part);
        let [nearest, diffused] =
            [DitherBy::None, DitherBy::Diffusion].map(|dither| shown(dither, Part::Full));
        assert_ne!(nearest, diffused);
        assert_eq!(nearest, [0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 2, 3]);
        let auto = [Part::Full, Part::Direct, Part::Global].map(|part| shown(DitherBy::Auto, part));
        assert_eq!(auto, [nearest.clone(), nearest, diffused]);
    }

    #[test]
    fn each_channel_has_its_curve_and_its_target_and_what_is_shown_is_known() {
        let curves = [vec![0.0, 0.1, 0.4, 1.0], vec![0.0, 0.3, 0.6, 1.0], vec![0.0, 0.5, 0.9, 1.0]];
        let display = PatternDisplay::new(&projector(2, 1, 3, 2), &curves, true, DitherBy::None, 0)
            .expect("they ascend");
        assert_eq!(display.widest_step(), 0.6);
        let gray = display.show(&[vec![0.44, 0.95]], Part::Full).expect("one plane for all channels");
        assert_eq!(gray.frame.levels(), [2, 1, 1, 3, 3, 2]);
        assert_eq!(gray.light, [[0.4, 1.0], [0.3, 1.0], [0.5, 0.9]]);
        let target = [vec![0.1, 0.0], vec![0.6, 0.0], vec![1.0, 0.5]];
        let colored = display.show(&target, Part::Full).expect("a plane for each channel");
        assert_eq!(colored.frame.levels(), [1, 2, 3, 0, 0, 1]);
        assert_eq!(display.of_frame(&colored.frame).light, target);
        let below = display.show_below(&[vec![0.99, 0.39]]).expect("one plane for all channels");
        assert_eq!(below.frame.levels(), [2, 2, 2, 1, 1, 0]);
        assert_eq!(colored.seen_by(1, 3), target[1]);
        let mean = colored.seen_by(0, 1);
        assert!((mean[0] - 1.7 / 3.0).abs() < 1e-15 && (mean[1] - 0.5 / 3.0).abs() < 1e-15, "{mean:?}");
        let gray = Displayed { frame: colored.frame, light: vec![vec![0.25, 0.75]] };
        assert_eq!(gray.seen_by(2, 3), [0.25, 0.75]);
    }
}
