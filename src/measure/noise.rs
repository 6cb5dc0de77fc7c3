//! The predicted noise of a photo that has not been taken yet.

use super::options::MeasureOptions;
use super::photo_pipeline::ReferencePhotos;
use super::response::CameraCurve;
use super::signed::PredictNoise;

/// Predicts the total variance of photos over all projector pixels, from the white photo and the camera's
/// noise model.
///
/// The total light of the photo of a pattern `g` is `⟨1, A g⟩ = ⟨A 1, g⟩`, because `A = Aᵀ`. It follows from
/// the white photo `A 1` for every pattern. The distribution of the light over the pixels matters only where
/// exposures are merged; it is assumed to be that of white.
pub(crate) struct NoisePrediction<'a> {
    pub(crate) curve: &'a CameraCurve,
    pub(crate) options: &'a MeasureOptions,
    pub(crate) references: &'a ReferencePhotos,
    /// The weight of each camera pixel's variance in the total.
    pub(crate) importance: &'a [f64],
    /// The camera's channels that make up the measured channel, and their weights.
    pub(crate) channel_weights: &'a [(usize, f64)],
    /// The number of the camera's channels.
    pub(crate) channels: usize,
    /// The white photo on the projector's pixels.
    pub(crate) white: &'a [f64],
}

impl NoisePrediction<'_> {
    /// `Σ importance · weight² · of(sample)` over all samples.
    fn total(&self, of: impl Fn(usize) -> f64) -> f64 {
        let mut total = 0.0;
        for (pixel, &importance) in
            self.importance.iter().enumerate().filter(|&(_, &importance)| importance > 0.0)
        {
            for &(channel, weight) in self.channel_weights {
                total += importance * weight * weight * of(pixel * self.channels + channel);
            }
        }
        total
    }

    /// The variance of the rate of one sample that receives this `share` of white's light.
    fn of_sample(&self, sample: usize, share: f64) -> f64 {
        let rate = share * self.references.white.values[sample].max(0.0);
        let mut precision = 0.0;
        let mut least = f64::INFINITY;
        for (exposure, seconds) in self.references.exposures.iter().enumerate() {
            let black = self
                .references
                .blacks
                .exposed
                .get(exposure)
                .map_or(self.curve.zero, |black| black.mean[sample]);
            let expected = black + rate * seconds;
            let variance =
                self.curve.variance_of(expected) / (seconds * seconds * f64::from(self.options.takes));
            least = if exposure == 0 { variance } else { least };
            if expected < self.curve.brightest() {
                precision += 1.0 / variance.max(f64::MIN_POSITIVE);
            }
        }
        if precision > 0.0 { 1.0 / precision } else { least }
    }
}

impl PredictNoise for NoisePrediction<'_> {
    fn of_pattern(&self, pattern: &[f64]) -> f64 {
        let sum: f64 = self.white.iter().sum();
        let light: f64 = self.white.iter().zip(pattern).map(|(white, pattern)| white * pattern).sum();
        let share = if sum > 0.0 { (light / sum).clamp(0.0, 1.0) } else { 0.0 };
        self.total(|sample| self.of_sample(sample, share))
    }

    fn of_white(&self) -> f64 {
        self.total(|sample| self.references.white.variance[sample])
    }

    fn of_black(&self) -> f64 {
        // Dim pixels have nearly all of their weight at the longest exposure.
        self.references.blacks.variance.last().map_or(0.0, |black| self.total(|sample| black[sample]))
    }
}
