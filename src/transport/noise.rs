//! The noise of the frozen matrix, estimated from the difference between two independent halves of the samples.

use crate::error::Result;
use crate::image::{Blur, Image};

/// The standard deviation in pixels of the Gaussian neighbourhood that estimates a pixel's standard error. It averages about 28 squares.
const POOLED: f64 = 1.5;

/// The noise of an estimate `Â = (n₁ Â₁ + n₂ Â₂)/N` from `N` samples per pixel in two independent halves.
///
/// `e = (Â₁ − Â₂) √(n₁ n₂)/N` has mean 0 and the variance of `Â`, entry by entry and in every linear function
/// of the entries. It does not contain errors that both halves share, such as those of a photon map.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// The standard error of the photo under an all-ones pattern, pixel by pixel, in W/(m² sr), without ambient light. Each value is `|e|`
    /// of a single draw; only the mean square over many pixels is accurate.
    pub white: Image,
    /// The root mean square of these errors over the pixels, relative to that of the photo.
    pub white_relative: f64,
    /// `‖e‖_F/‖Â‖_F`: the relative error of the whole matrix.
    pub operator: f64,
    /// The relative error of the light of two or more bounces.
    pub global: f64,
}

impl From<&Noise> for crate::io::manifest::Noise {
    fn from(noise: &Noise) -> Self {
        Self { operator: noise.operator, global: noise.global, white: noise.white_relative }
    }
}

/// A mean and its error (`e` of [`Noise`]) in each of `C` channels.
pub(super) type Estimates<const C: usize> = [[f64; 2]; C];

/// The weights with which the samples of the two halves add up to a mean and its error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Halves {
    mean: f64,
    error: [f64; 2],
}

impl Halves {
    /// The weights if `from_each_pixel` paths start from each pixel and sums are divided by `samples`.
    pub(super) fn new(samples: u32, from_each_pixel: u32) -> Self {
        let [first, second] = [from_each_pixel.div_ceil(2), from_each_pixel / 2].map(f64::from);
        let mean = 1.0 / f64::from(samples);
        let error = if second == 0.0 {
            [0.0; 2]
        } else {
            [(second / first).sqrt() * mean, -(first / second).sqrt() * mean]
        };
        Self { mean, error }
    }

    /// The weight of a sample in the mean, and the weights of samples of the two halves in the error.
    pub(super) fn weights(self) -> [f64; 3] {
        [self.mean, self.error[0], self.error[1]]
    }

    pub(super) fn share(self, value: f64) -> f64 {
        value * self.mean
    }

    pub(super) fn error_share(self, half: usize, value: f64) -> f64 {
        value * self.error[half]
    }

    /// The mean and its error from the sums over the samples of both halves.
    pub(super) fn estimate(self, [first, second]: [f64; 2]) -> [f64; 2] {
        [self.share(first) + self.share(second), self.error_share(0, first) + self.error_share(1, second)]
    }

    pub(super) fn add(self, to: &mut [f64; 2], half: usize, value: f64) {
        to[0] += self.share(value);
        to[1] += self.error_share(half, value);
    }
}

/// The standard errors of the pixels of a photo from one draw of their errors. One draw says little about a single pixel. The result is
/// therefore the root of the mean square over the surrounding pixels, weighted by a Gaussian of 1.5 pixels.
pub fn pooled(errors: &Image) -> Result<Image> {
    let blur = Blur::new(errors.resolution(), POOLED);
    let plane = |plane: Vec<f64>| -> Vec<f64> {
        let squares: Vec<f64> = plane.iter().map(|error| error * error).collect();
        let means = match &blur {
            Some(blur) => blur.apply(&squares),
            None => squares,
        };
        means.into_iter().map(f64::sqrt).collect()
    };
    let planes: Vec<Vec<f64>> = errors.planes().into_iter().map(plane).collect();
    Image::from_planes(errors.resolution(), &planes)
}

/// `‖error‖/‖value‖` from the squares of both norms; 0 where both are 0.
pub(super) fn relative(error_squares: f64, value_squares: f64) -> f64 {
    if error_squares == 0.0 { 0.0 } else { (error_squares / value_squares).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(halves: Halves, samples: [&[f64]; 2]) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for (half, samples) in samples.iter().enumerate() {
            samples.iter().for_each(|&sample| halves.add(&mut sums, half, sample));
        }
        sums
    }

    #[test]
    fn the_error_of_a_mean_of_two_is_half_their_difference() {
        assert_eq!(estimate(Halves::new(2, 2), [&[3.0], &[5.0]]), [4.0, -1.0]);
        assert_eq!(estimate(Halves::new(1, 1), [&[3.0], &[]]), [3.0, 0.0], "one sample tells no error");
    }

    #[test]
    fn unequal_halves_weigh_by_their_counts() {
        let [mean, error] = estimate(Halves::new(3, 3), [&[1.0, 3.0], &[0.0]]);
        // Var(mean of 3) = σ²/3; the halves' means differ with variance σ²/2 + σ².
        let scale = ((1.0 / 3.0) / (1.0 / 2.0 + 1.0_f64)).sqrt();
        assert!((mean - 4.0 / 3.0).abs() < 1e-15 && (error - 2.0 * scale).abs() < 1e-15, "{mean}, {error}");
        let [_, error] = estimate(Halves::new(3, 3), [&[2.0, 2.0], &[2.0]]);
        assert!(error.abs() < 1e-15, "equal samples have no error: {error}");
    }

    #[test]
    fn a_projectors_paths_are_divided_by_the_cameras_samples() {
        // Sums over four paths are divided by the camera's eight samples, so mean and error are half as large.
        let [mean, error] = estimate(Halves::new(8, 4), [&[1.0, 3.0], &[0.0, 0.0]]);
        assert_eq!([mean, error], [0.5, 0.5]);
    }
}
