//! Sums per pixel over its samples.

use super::noise::Halves;
use crate::render::Batch;

/// Sums per camera pixel and half of the samples, always in path order: the same bits however the paths were batched.
pub(super) struct PixelSums<const C: usize> {
    sums: Vec<[[f64; 2]; C]>,
}

impl<const C: usize> PixelSums<C> {
    pub(super) fn new(pixels: usize) -> Self {
        Self { sums: vec![[[0.0; 2]; C]; pixels] }
    }

    /// Adds what `sample` finds on each path of the batch; zeros do not count.
    pub(super) fn add(&mut self, batch: &Batch<'_>, sample: impl Fn(usize) -> [f32; C]) {
        for path in 0..batch.len() {
            let value = sample(path);
            if value.iter().all(|&value| value == 0.0) {
                continue;
            }
            let half = batch.half(path);
            let sums = &mut self.sums[batch.pixel(path) as usize];
            for channel in 0..C {
                sums[channel][half] += f64::from(value[channel]);
            }
        }
    }

    /// Mean and error (`e` of [`super::Noise`]) of each pixel and channel.
    pub(super) fn estimates(&self, halves: Halves) -> Vec<[[f64; 2]; C]> {
        self.sums.iter().map(|sums| sums.map(|sums| [halves.mean(sums), halves.error(sums)])).collect()
    }
}
