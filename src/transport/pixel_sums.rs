//! Sums over the samples of each pixel.

use std::ops::Range;

use super::noise::Halves;
use crate::render::Batch;

/// Means and errors (`e` of [`super::Noise`]) per camera pixel and channel. They are summed in path order, so
/// that the bits do not depend on the sizes of the batches.
pub(super) struct PixelSums<const C: usize> {
    halves: Halves,
    /// The first of the pixels.
    first: usize,
    /// `[pixel][channel]`: mean and error.
    pub(super) estimates: Vec<[[f64; 2]; C]>,
}

impl<const C: usize> PixelSums<C> {
    /// Zeros for these pixels with `samples` samples each.
    pub(super) fn new(pixels: &Range<usize>, samples: u32) -> Self {
        let estimates = vec![[[0.0; 2]; C]; pixels.len()];
        Self { halves: Halves::new(samples, samples), first: pixels.start, estimates }
    }

    /// Adds `sample(path)` for each path of the batch, which starts from one of the pixels. Zeros are skipped.
    pub(super) fn add(&mut self, batch: &Batch<'_>, sample: impl Fn(usize) -> [f32; C]) {
        for run in batch.runs() {
            let estimates = &mut self.estimates[run.pixel as usize - self.first];
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
