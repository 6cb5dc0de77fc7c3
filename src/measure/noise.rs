//! What a photo's noise will be, before it is taken.

use super::options::MeasureOptions;
use super::photographer::Basics;
use super::response::CameraCurve;
use super::signed::PredictNoise;

/// Predicts the variance of photos, all projector pixels together, from the white photo and the camera's noise model.
///
/// The light of all pixels together is `⟨1, A g⟩ = ⟨A 1, g⟩`, as `A = Aᵀ`: the white photo knows it for every pattern. How it spreads over the
/// pixels only matters where exposures are merged; it is taken to spread as white does.
pub(super) struct NoiseAhead<'a> {
    pub(super) curve: &'a CameraCurve,
    pub(super) options: &'a MeasureOptions,
    pub(super) basics: &'a Basics,
    /// What each camera pixel's variance counts.
    pub(super) importance: &'a [f64],
    /// The camera's channels that are read, with their weights, and how many there are.
    pub(super) reading: &'a [(usize, f64)],
    pub(super) channels: usize,
    /// The white photo on the projector's pixels.
    pub(super) white: &'a [f64],
}

impl NoiseAhead<'_> {
    /// `Σ importance · weight² · of(sample)`
    fn total(&self, of: impl Fn(usize) -> f64) -> f64 {
        let mut total = 0.0;
        for (pixel, &importance) in
            self.importance.iter().enumerate().filter(|&(_, &importance)| importance > 0.0)
        {
            for &(channel, weight) in self.reading {
                total += importance * weight * weight * of(pixel * self.channels + channel);
            }
        }
        total
    }

    /// The variance of one sample's rate, `share` of white's light given.
    fn of_sample(&self, sample: usize, share: f64) -> f64 {
        let rate = share * self.basics.white.values[sample].max(0.0);
        let mut precision = 0.0;
        let mut least = f64::INFINITY;
        for (exposure, seconds) in self.basics.exposures.iter().enumerate() {
            let black =
                self.basics.blacks.exposed.get(exposure).map_or(self.curve.zero, |black| black.mean[sample]);
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

impl PredictNoise for NoiseAhead<'_> {
    fn of_pattern(&self, pattern: &[f64]) -> f64 {
        let sum: f64 = self.white.iter().sum();
        let light: f64 = self.white.iter().zip(pattern).map(|(white, pattern)| white * pattern).sum();
        let share = if sum > 0.0 { (light / sum).clamp(0.0, 1.0) } else { 0.0 };
        self.total(|sample| self.of_sample(sample, share))
    }

    fn of_white(&self) -> f64 {
        self.total(|sample| self.basics.white.variance[sample])
    }

    fn of_black(&self) -> f64 {
        // The longest exposure's: nearly all that is dim has its weight there.
        self.basics.blacks.variance.last().map_or(0.0, |black| self.total(|sample| black[sample]))
    }
}
