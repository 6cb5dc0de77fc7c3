//! The sensor of a virtual camera: it turns light into counts.

use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::faults::generator;
use super::optics::vignette;
use super::poisson::poisson;
use super::{Response, VirtualCamera};
use crate::image::Resolution;

/// A virtual camera's sensor.
pub(super) struct Sensor {
    spec: VirtualCamera,
    resolution: Resolution,
    response: Response,
    /// Electrons per second for a light of 1, at each pixel.
    sensitivity: Vec<f64>,
    seed: u64,
}

impl Sensor {
    /// The sensor of this camera. `white` is the light of the white photo on the sensor, all channels one after the other; it sets
    /// the sensitivity. `None`: the white photo is dark.
    pub(super) fn new(
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
        // The 99th percentile, so that a glint does not set the scale.
        let bright = seen[(seen.len() - 1) * 99 / 100];
        if bright <= 0.0 {
            return None;
        }
        let scale = spec.white_fill * spec.full_well / (spec.white_exposure * bright);
        sensitivity.iter_mut().for_each(|value| *value *= scale);
        Some(Self { spec: spec.clone(), resolution, response: spec.response(), sensitivity, seed })
    }

    /// The counts of frame `id`, interleaved. `light` is the mean over the exposure of `exposure` seconds, one plane for each
    /// channel.
    pub(super) fn expose(&self, light: &[Vec<f64>], exposure: f64, id: u64) -> Vec<u16> {
        let (width, channels) = (self.resolution.width, light.len());
        let mut counts = vec![0; self.resolution.pixels() * channels];
        counts.par_chunks_mut(width * channels).enumerate().for_each(|(row, counts)| {
            // One generator for each row, so that the counts do not depend on the threads that compute them.
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

    /// A random count of a pixel whose expected number of electrons is `mean`.
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
