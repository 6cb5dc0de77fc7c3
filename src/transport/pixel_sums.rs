//! Sums per pixel over its samples.

use super::noise::Halves;
use crate::render::Batch;

/// Means and errors (`e` of [`super::Noise`]) per camera pixel and channel, always added up in path order: the same bits
/// however the paths were batched.
pub(super) struct PixelSums<const C: usize> {
    halves: Halves,
    pub(super) estimates: Vec<[[f64; 2]; C]>,
}

impl<const C: usize> PixelSums<C> {
    pub(super) fn new(pixels: usize, samples: u32) -> Self {
        Self { halves: Halves::new(samples, samples), estimates: vec![[[0.0; 2]; C]; pixels] }
    }

    /// Adds what `sample` finds on each path of the batch; zeros do not count.
    pub(super) fn add(&mut self, batch: &Batch<'_>, sample: impl Fn(usize) -> [f32; C]) {
        for run in batch.runs() {
            let estimates = &mut self.estimates[run.pixel as usize];
            for path in run.paths {
                let value = sample(path);
                if value.iter().all(|&value| value == 0.0) {
                    continue;
                }
                for (estimate, value) in estimates.iter_mut().zip(value) {
                    self.halves.add(estimate, run.half, f64::from(value));
                }
            }
        }
    }
}
