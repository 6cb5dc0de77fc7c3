//! The signed stage: a signed vector is written as a linear combination of patterns in `[0, 1]` (O'Toole and Kutulakos, section 7.1).
//!
//! ```text
//! affine   g = (x − a)/(b − a) ∈ [0, 1],   A x = (b − a) A g + a A 1
//! split    A x = p A(x⁺/p) − q A(x⁻/q),    p = max x⁺,  q = max x⁻
//! ```
//!
//! Here `a` and `b` are the least and the largest value of `x`, and `x⁺` and `x⁻` are its positive and negative part. `A 1` is the white
//! photo, which is taken only once. The affine form costs one photo. The split form costs two, or one when `x` has only one sign. A
//! constant `x` costs none.

use super::options::{MeasureOptions, SignedBy};
use super::photo_pipeline::ReferencePhotos;
use super::response::CameraCurve;

/// `x` as a linear combination of the white pattern and patterns in `[0, 1]`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Signed {
    /// The white pattern's coefficient.
    pub(crate) white: f64,
    /// The other coefficients and their patterns.
    pub(crate) parts: Vec<(f64, Vec<f64>)>,
}

impl Signed {
    /// The affine form `(x − a)/(b − a)`, where `a` is the least and `b` the largest value of `x` over the pixels that are not masked. At
    /// the masked pixels, the form is 0, like the white pattern.
    pub(crate) fn affine(x: &[f64], seen: &[bool]) -> Self {
        let [a, b] = range(x, seen);
        if a == b {
            return Self { white: a, parts: Vec::new() };
        }
        let one = |(&x, &seen): (&f64, &bool)| if seen { (x - a) / (b - a) } else { 0.0 };
        Self { white: a, parts: vec![(b - a, x.iter().zip(seen).map(one).collect())] }
    }

    /// The split form: the positive and the negative part.
    pub(crate) fn split(x: &[f64], seen: &[bool]) -> Self {
        let [a, b] = range(x, seen);
        if a == b {
            return Self { white: a, parts: Vec::new() };
        }
        let part = |peak: f64| -> Vec<f64> {
            x.iter().zip(seen).map(|(&x, &seen)| if seen { (x / peak).max(0.0) } else { 0.0 }).collect()
        };
        let peaks = [b, a].into_iter().zip([1.0, -1.0]);
        let parts =
            peaks.filter(|(peak, sign)| peak * sign > 0.0).map(|(peak, _)| (peak, part(peak))).collect();
        Self { white: 0.0, parts }
    }

    /// The form that `by` selects. [`SignedBy::Auto`] selects the form with the smaller predicted variance.
    pub(crate) fn choose(x: &[f64], seen: &[bool], by: SignedBy, noise: &NoisePrediction<'_>) -> Self {
        match by {
            SignedBy::Affine => Self::affine(x, seen),
            SignedBy::Split => Self::split(x, seen),
            SignedBy::Auto => {
                let (affine, split) = (Self::affine(x, seen), Self::split(x, seen));
                if affine.variance(noise) <= split.variance(noise) { affine } else { split }
            }
        }
    }

    /// The predicted total variance of `A x` over all pixels.
    pub(crate) fn variance(&self, noise: &NoisePrediction<'_>) -> f64 {
        let patterns: f64 =
            self.parts.iter().map(|(factor, pattern)| factor * factor * noise.of_pattern(pattern)).sum();
        let black = self.white + self.parts.iter().map(|(factor, _)| factor).sum::<f64>();
        patterns + self.white * self.white * noise.of_white() + black * black * noise.of_black()
    }
}

/// The least and the largest value over the pixels that are not masked. Both are zero when all pixels are masked.
fn range(x: &[f64], seen: &[bool]) -> [f64; 2] {
    let each = || x.iter().zip(seen).filter(|&(_, &seen)| seen).map(|(&x, _)| x);
    let (least, largest) = (each().fold(f64::INFINITY, f64::min), each().fold(f64::NEG_INFINITY, f64::max));
    if least <= largest { [least, largest] } else { [0.0, 0.0] }
}

/// Predicts the total variance of photos over all projector pixels, from the white photo and the camera's noise model.
///
/// The total light of the photo of a pattern `g` is `⟨1, A g⟩ = ⟨A 1, g⟩`, because `A = Aᵀ`. The white photo `A 1` thus gives the total
/// light for every pattern. The distribution of the light over the pixels matters only where exposures are merged. It is then assumed that
/// the light is distributed as under white.
pub(crate) struct NoisePrediction<'a> {
    pub(crate) curve: &'a CameraCurve,
    pub(crate) options: &'a MeasureOptions,
    pub(crate) references: &'a ReferencePhotos,
    /// The weight of each camera pixel's variance in the total variance.
    pub(crate) importance: &'a [f64],
    /// The camera's channels that make up the measured channel, and their weights.
    pub(crate) channel_weights: &'a [(usize, f64)],
    pub(crate) channels: usize,
    /// The white photo on the projector's pixels.
    pub(crate) white: &'a [f64],
}

impl NoisePrediction<'_> {
    /// The sum `Σ importance · weight² · of(sample)` over all samples.
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

    /// The variance of the rate of one sample, if the sample gets the fraction `share` of white's light.
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

    /// The variance of the photo of this pattern, without the contribution of the black photo.
    fn of_pattern(&self, pattern: &[f64]) -> f64 {
        let sum: f64 = self.white.iter().sum();
        let light: f64 = self.white.iter().zip(pattern).map(|(white, pattern)| white * pattern).sum();
        let share = if sum > 0.0 { (light / sum).clamp(0.0, 1.0) } else { 0.0 };
        self.total(|sample| self.of_sample(sample, share))
    }

    /// The variance of the white photo, which has already been taken.
    fn of_white(&self) -> f64 {
        self.total(|sample| self.references.white.variance[sample])
    }

    fn of_black(&self) -> f64 {
        // Only the longest exposure is considered, because dim pixels have nearly all of their weight there.
        self.references.blacks.variance.last().map_or(0.0, |black| self.total(|sample| black[sample]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(signed: &Signed, pixels: usize) -> Vec<f64> {
        (0..pixels).map(|i| signed.white + signed.parts.iter().map(|(c, g)| c * g[i]).sum::<f64>()).collect()
    }

    #[test]
    fn patterns_lie_between_0_and_1_and_add_up_to_the_vector() {
        let x = [-0.5, 2.0, 0.0, 0.25];
        for (signed, photos) in [(Signed::affine(&x, &[true; 4]), 1), (Signed::split(&x, &[true; 4]), 2)] {
            assert_eq!(signed.parts.len(), photos);
            assert!(signed.parts.iter().flat_map(|(_, g)| g).all(|g| (0.0..=1.0).contains(g)));
            for (found, expected) in sum(&signed, 4).iter().zip(x) {
                assert!((found - expected).abs() < 1e-15, "{found} {expected}");
            }
        }
    }

    #[test]
    fn a_constant_needs_no_photo_and_a_vector_of_one_sign_needs_one() {
        assert!(Signed::affine(&[-3.0; 5], &[true; 5]).parts.is_empty());
        assert!(Signed::split(&[0.0; 5], &[true; 5]).parts.is_empty());
        let negative = Signed::split(&[-1.0, -2.0, 0.0], &[true; 3]);
        assert_eq!(negative.parts, [(-2.0, vec![0.5, 1.0, 0.0])]);
    }

    #[test]
    fn masked_pixels_do_not_set_the_range_and_stay_dark() {
        let signed = Signed::affine(&[1.0, 3.0, 1e9], &[true, true, false]);
        assert_eq!(signed, Signed { white: 1.0, parts: vec![(2.0, vec![0.0, 1.0, 0.0])] });
    }
}
