//! The sensor of a virtual camera turns light into counts.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::optics::vignette;
use super::spec::{Response, VirtualCamera};
use super::world::generator;
use crate::image::Resolution;

pub(crate) struct VirtualSensor {
    spec: VirtualCamera,
    resolution: Resolution,
    response: Response,
    /// Electrons per second for a light of 1, at each pixel.
    sensitivity: Vec<f64>,
    seed: u64,
}

impl VirtualSensor {
    /// The sensor of this camera. `white` is the light of the white photo on the sensor, with the channels one after another. It determines
    /// the sensitivity. `None`: the white photo is dark.
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
/// Below a mean of 12, `rand_distr` counts products of uniform variates. Above it, the crate uses the rejection method of Ahrens and
/// Dieter, *Computer generation of Poisson deviates from modified normal distributions* (1982), doi:10.1145/355993.355997. Both methods are
/// exact, so that dim pixels have the skew of true photon counts.
pub fn poisson(mean: f64, random: &mut impl Rng) -> f64 {
    match Poisson::new(mean) {
        Ok(distribution) => distribution.sample(random),
        // With a mean above 10¹⁹, a variate differs from the mean in the tenth digit.
        Err(_) => mean.max(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

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
            // Nine one-sided tests at 4 standard deviations: one in 3,500 seeds would fail.
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
