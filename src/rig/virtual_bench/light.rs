//! The ends of the light path: a virtual projector's screen converts levels to light, and a virtual camera's sensor converts light to
//! counts.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::optics::{Optics, vignette};
use super::spec::{Response, VirtualCamera, VirtualProjector};
use super::world::generator;
use crate::image::{Blur, Image, Resolution};
use crate::rig::Frame;

pub(crate) struct VirtualScreen {
    /// The light of each level, relative to white.
    light: Vec<f64>,
    /// The light that the white segment adds, as a fraction of the least light among a pixel's colours.
    white_segment: f64,
    /// The part of the frame that each pixel shows. `None`: each pixel shows the frame's pixel at the same place.
    overscan: Option<Optics>,
    vignette: Vec<f64>,
    blur: Option<Blur>,
    resolution: Resolution,
}

impl VirtualScreen {
    pub(crate) fn new(spec: &VirtualProjector, resolution: Resolution) -> Self {
        let highest = (1_u32 << spec.bits) - 1;
        let response: Response = spec.response();
        let light = (0..=highest)
            .map(|level| {
                let share = f64::from(level) / f64::from(highest);
                let light = response.at(if spec.limited_range { video(share) } else { share });
                spec.black_level + (1.0 - spec.black_level) * light
            })
            .collect();
        let vignette = vignette(resolution, spec.vignetting);
        let centre = [resolution.width as f64 / 2.0, resolution.height as f64 / 2.0];
        let shown = |at: [f64; 2]| [0, 1].map(|i| centre[i] + (at[i] - centre[i]) * (1.0 - spec.overscan));
        let overscan = (spec.overscan > 0.0).then(|| Optics::new(resolution, resolution, &shown));
        let (white_segment, blur) = (spec.white_segment, Blur::new(resolution, spec.blur));
        Self { light, white_segment, overscan, vignette, blur, resolution }
    }

    /// The light of each of a frame's samples, relative to white.
    fn light(&self, frame: &Frame) -> Vec<f64> {
        let mut light: Vec<f64> =
            frame.levels().iter().map(|&level| self.light[usize::from(level)]).collect();
        if self.white_segment > 0.0 {
            for pixel in light.chunks_exact_mut(frame.channels()) {
                let gray = pixel.iter().copied().fold(f64::INFINITY, f64::min);
                for light in pixel {
                    *light = (*light + self.white_segment * gray) / (1.0 + self.white_segment);
                }
            }
        }
        light
    }

    pub(crate) fn mean(&self, frame: &Frame) -> f64 {
        self.light(frame).iter().sum::<f64>() / frame.levels().len() as f64
    }

    /// The light of a frame as a pattern. The frame must fit the screen.
    pub(crate) fn emit(&self, frame: &Frame) -> Image {
        let (channels, all) = (frame.channels(), self.light(frame));
        let mut pattern = Image::filled(self.resolution, channels, 0.0);
        for channel in 0..channels {
            let light: Vec<f64> = all.iter().skip(channel).step_by(channels).copied().collect();
            let light = match &self.overscan {
                Some(overscan) => overscan.resample(|pixel| light[pixel]),
                None => light,
            };
            let light = match &self.blur {
                Some(blur) => blur.apply(&light),
                None => light,
            };
            let samples = pattern.samples_mut().iter_mut().skip(channel).step_by(channels);
            for ((sample, light), vignette) in samples.zip(light).zip(&self.vignette) {
                *sample = (light * vignette) as f32;
            }
        }
        pattern
    }
}

/// The limited-range video value of a level, both from 0 to 1. Level 16 of 255 is black, and level 235 is white.
fn video(share: f64) -> f64 {
    ((255.0 * share - 16.0) / 219.0).clamp(0.0, 1.0)
}

pub(crate) struct VirtualSensor {
    spec: VirtualCamera,
    resolution: Resolution,
    response: Response,
    /// Electrons per second for a light of 1, at each pixel.
    sensitivity: Vec<f64>,
    seed: u64,
}

impl VirtualSensor {
    /// The sensor of this camera. `white` is the light of the white photo on the sensor, with the channels one after another. This light
    /// determines the sensitivity. `None`: the white photo is dark.
    pub(crate) fn new(
        spec: &VirtualCamera,
        resolution: Resolution,
        seed: u64,
        white: &[f64],
    ) -> Option<Self> {
        let mut sensitivity = vignette(resolution, spec.vignetting);
        let mut seen: Vec<f64> = white
            .iter()
            .enumerate()
            .map(|(index, light)| light * sensitivity[index % resolution.pixels()])
            .collect();
        seen.sort_by(f64::total_cmp);
        // The 99th percentile prevents a glint from setting the scale.
        let bright = seen[(seen.len() - 1) * 99 / 100];
        if bright <= 0.0 {
            return None;
        }
        let scale = spec.white_fill * spec.full_well / (spec.white_exposure * bright);
        sensitivity.iter_mut().for_each(|value| *value *= scale);
        Some(Self { spec: spec.clone(), resolution, response: spec.response(), sensitivity, seed })
    }

    /// The counts of frame `id`, interleaved. `light` is the mean over the exposure of `exposure` seconds, with one plane for each channel.
    pub(crate) fn expose(&self, light: &[Vec<f64>], exposure: f64, id: u64) -> Vec<u16> {
        let (width, channels) = (self.resolution.width, light.len());
        let mut counts = vec![0; self.resolution.pixels() * channels];
        counts.par_chunks_mut(width * channels).enumerate().for_each(|(row, counts)| {
            // Each row has a separate generator, so that the counts do not depend on the threads that compute them.
            let mut random = generator(self.seed, id, row as u64);
            for (index, count) in counts.iter_mut().enumerate() {
                let pixel = row * width + index / channels;
                let mean = exposure
                    * (self.sensitivity[pixel] * light[index % channels][pixel] + self.spec.dark_current);
                *count = self.count(mean, &mut random);
            }
        });
        counts
    }

    fn count(&self, mean: f64, random: &mut Pcg64) -> u16 {
        let spec = &self.spec;
        let electrons = if spec.shot_noise { poisson(mean, random) } else { mean };
        let full = electrons / spec.full_well;
        let mut signal = if full < 1.0 { self.response.at(full) } else { full };
        if spec.read_noise > 0.0 {
            signal += random.sample::<f64, _>(StandardNormal) * spec.read_noise / spec.full_well;
        }
        let all_bits = f64::from((1_u32 << spec.bits) - 1);
        let count = spec.black_level + (all_bits - spec.black_level) * signal;
        // Both bounds are integers of 16 bits.
        count.round().clamp(0.0, f64::from(spec.highest())) as u16
    }
}

/// A Poisson variate with this mean, or 0 if the mean is not positive.
///
/// Below a mean of 12, `rand_distr` counts products of uniform variates. For larger means, the crate uses the rejection method of Ahrens
/// and Dieter, *Computer generation of Poisson deviates from modified normal distributions* (1982), doi:10.1145/355993.355997. Both methods
/// are exact, so that dim pixels have the skew of true photon counts.
pub fn poisson(mean: f64, random: &mut impl Rng) -> f64 {
    match Poisson::new(mean) {
        Ok(distribution) => distribution.sample(random),
        // With a mean above 10¹⁹, a variate differs from the mean only from the tenth digit on.
        Err(_) => mean.max(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn levels_become_light_by_the_response_above_the_black_level() {
        let spec =
            VirtualProjector { bits: 2, gamma: Some(2.0), black_level: 0.1, ..VirtualProjector::default() };
        let resolution = Resolution::new(4, 1);
        let frame = Frame::new(resolution, 1, vec![0, 1, 2, 3]).expect("four levels");
        let light = VirtualScreen::new(&spec, resolution).emit(&frame);
        for (found, expected) in light.samples().iter().zip([0.1, 0.2, 0.5, 1.0]) {
            assert!((found - expected).abs() < 1e-7, "{found} for {expected}");
        }
    }

    #[test]
    fn a_white_segment_brightens_what_colours_have_in_common() {
        let resolution = Resolution::new(4, 1);
        let spec = VirtualProjector { channels: 3, white_segment: 1.0, ..VirtualProjector::default() };
        let levels = vec![255, 255, 255, 255, 0, 0, 51, 51, 51, 255, 51, 0];
        let frame = Frame::new(resolution, 3, levels).expect("three levels for each pixel");
        let light = VirtualScreen::new(&spec, resolution).emit(&frame);
        // White is 1, grays are in proportion to white, and red alone is half of white's red.
        let expected = [1.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.2, 0.2, 0.2, 0.5, 0.1, 0.0];
        for (found, expected) in light.samples().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{:?}", light.samples());
        }
    }

    #[test]
    fn blur_keeps_the_light_and_spreads_it_by_its_deviation() {
        let (resolution, spec) =
            (Resolution::new(31, 31), VirtualProjector { blur: 1.3, ..VirtualProjector::default() });
        let mut levels = vec![0; 31 * 31];
        levels[15 * 31 + 15] = 255;
        let frame = Frame::new(resolution, 1, levels).expect("as many levels");
        let light = VirtualScreen::new(&spec, resolution).emit(&frame).plane(0);
        let moment = |power: i32| -> f64 {
            light
                .iter()
                .enumerate()
                .map(|(pixel, light)| light * ((pixel % 31) as f64 - 15.0).powi(power))
                .sum()
        };
        assert!((moment(0) - 1.0).abs() < 1e-6 && moment(1).abs() < 1e-6);
        // The Gaussian is cut off at four deviations. The part that is cut off has 6e-5 of the light and 1e-3 of the variance.
        assert!((moment(2).sqrt() - 1.3).abs() < 2e-3, "{}", moment(2).sqrt());
        let corner = Frame::new(resolution, 1, {
            let mut levels = vec![0; 31 * 31];
            levels[0] = 255;
            levels
        });
        let light = VirtualScreen::new(&spec, resolution).emit(&corner.expect("as many levels")).plane(0);
        assert!((light.iter().sum::<f64>() - 1.0).abs() < 1e-6, "no light is lost at the border");
    }

    #[test]
    fn limited_range_clips_both_ends_and_overscan_cuts_off_the_border() {
        let resolution = Resolution::new(32, 32);
        let spec = VirtualProjector { limited_range: true, ..VirtualProjector::default() };
        let screen = VirtualScreen::new(&spec, resolution);
        let light = |level| screen.emit(&Frame::filled(resolution, 1, level)).samples()[0];
        assert_eq!([0, 16, 235, 255].map(light), [0.0, 0.0, 1.0, 1.0]);
        assert!((light(126) - 110.0 / 219.0).abs() < 1e-6);
        // A quarter of 32 pixels is eight pixels, so four pixels are cut off at each end.
        let spec = VirtualProjector { overscan: 0.25, ..VirtualProjector::default() };
        let screen = VirtualScreen::new(&spec, resolution);
        let columns = |lit: fn(usize) -> bool| {
            let levels = (0..32 * 32).map(|pixel| if lit(pixel % 32) { 255 } else { 0 }).collect();
            screen.emit(&Frame::new(resolution, 1, levels).expect("as many levels")).plane(0)
        };
        assert!(columns(|x| !(4..28).contains(&x)).iter().all(|&light| light < 1e-6));
        assert!(columns(|x| (4..28).contains(&x)).iter().all(|&light| (light - 1.0).abs() < 1e-6));
        let half = columns(|x| x < 16);
        assert!((half[15] - 1.0).abs() < 1e-6 && half[16].abs() < 1e-6, "the centre stays");
    }

    #[test]
    fn vignetting_darkens_the_corner_by_its_share() {
        let spec = VirtualProjector { vignetting: 0.2, ..VirtualProjector::default() };
        let resolution = Resolution::new(401, 301);
        let light = VirtualScreen::new(&spec, resolution).emit(&Frame::filled(resolution, 1, 255)).plane(0);
        // The centre of the corner pixel lies half a pixel inside the corner. This lowers its distance from the middle by less than 1 in
        // 200, and the square by less than 1 in 100.
        assert!((light[0] - 0.8).abs() < 0.2 * 0.012 && light[150 * 401 + 200] == 1.0);
    }

    /// Pearson's statistic of `draws` variates compared with the Poisson probabilities, and its degrees of freedom. Counts that are
    /// expected fewer than 10 times are merged with their neighbours.
    fn chi_square(
        mean: f64,
        draws: usize,
        seed: u64,
        draw: &mut dyn FnMut(f64, &mut Pcg64) -> f64,
    ) -> [f64; 2] {
        let mut random = Pcg64::seed_from_u64(seed);
        let limit = (mean + 12.0 * mean.sqrt() + 12.0) as usize;
        let mut found = vec![0.0; limit + 1];
        for _ in 0..draws {
            found[(draw(mean, &mut random) as usize).min(limit)] += 1.0;
        }
        let (mut statistic, mut cells) = (0.0, 0.0);
        let (mut expected_sum, mut found_sum, mut expected_left) = (0.0, 0.0, draws as f64);
        let mut log_probability = -mean;
        for (count, &found) in found.iter().enumerate() {
            if count > 0 {
                log_probability += (mean / count as f64).ln();
            }
            let expected = draws as f64 * log_probability.exp();
            expected_sum += expected;
            found_sum += found;
            if expected_sum >= 10.0 && expected_left - expected_sum >= 10.0 {
                statistic += (found_sum - expected_sum) * (found_sum - expected_sum) / expected_sum;
                cells += 1.0;
                expected_left -= expected_sum;
                (expected_sum, found_sum) = (0.0, 0.0);
            }
        }
        // The tail contains all remaining counts.
        statistic += (found_sum - expected_left) * (found_sum - expected_left) / expected_left;
        [statistic, cells]
    }

    /// The statistic as a standard normal variate (Wilson and Hilferty 1931).
    fn z([statistic, freedom]: [f64; 2]) -> f64 {
        let spread = 2.0 / (9.0 * freedom);
        ((statistic / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
    }

    #[test]
    fn counts_are_distributed_as_poisson_says_at_every_mean() {
        for (seed, mean) in [0.05, 0.7, 3.0, 9.99, 10.0, 12.5, 40.0, 333.3, 6e4].into_iter().enumerate() {
            let z = z(chi_square(mean, 200_000, seed as u64, &mut |mean, random| poisson(mean, random)));
            // There are nine one-sided tests at 4 standard deviations: one in 3,500 seeds would fail.
            assert!(z < 4.0, "mean {mean}: z = {z}");
        }
    }

    #[test]
    fn a_rounded_normal_variate_would_not_pass() {
        let rounded = &mut |mean: f64, random: &mut Pcg64| {
            let normal: f64 = StandardNormal.sample(random);
            (mean + mean.sqrt() * normal).round().max(0.0)
        };
        let z = z(chi_square(12.5, 200_000, 1, rounded));
        assert!(z > 20.0, "the test tells them apart: z = {z}");
    }
}
