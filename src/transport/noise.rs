//! How far the frozen matrix is from the true one, told by the difference of two independent halves of the samples.

use crate::image::Image;

/// The noise of an estimate `Â = (n₁ Â₁ + n₂ Â₂)/N` from `N` samples per pixel in two independent halves.
///
/// `e = (Â₁ − Â₂) √(n₁ n₂)/N` has mean 0 and the variance of `Â`, entry by entry and in every linear function of the entries.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Standard error of the photo under an all-ones pattern, pixel by pixel, in W/(m² sr), without ambient light. Each is
    /// `|e|` of one draw: right on average over pixels, in the mean square.
    pub white: Image,
    /// Root mean square of that over the pixels, relative to the photo's.
    pub white_relative: f64,
    /// `‖e‖_F/‖Â‖_F`: the relative error of the whole matrix.
    pub operator: f64,
    /// The same of the light of two bounces and more.
    pub global: f64,
}

/// Sample counts of the two halves: what [`crate::render::Batch::half`] tells apart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Halves {
    samples: f64,
    counts: [f64; 2],
}

impl Halves {
    pub(super) fn of(samples: u32) -> Self {
        let counts = [samples.div_ceil(2), samples / 2].map(f64::from);
        Self { samples: f64::from(samples), counts }
    }

    /// Whether there is anything to compare.
    pub(super) fn are_two(self) -> bool {
        self.counts[1] > 0.0
    }

    /// The mean over all samples, from the sums over each half.
    pub(super) fn mean(self, sums: [f64; 2]) -> f64 {
        (sums[0] + sums[1]) / self.samples
    }

    /// `e` of [`Noise`]; 0 where there is only one half.
    pub(super) fn error(self, sums: [f64; 2]) -> f64 {
        let [first, second] = self.counts;
        if second == 0.0 {
            return 0.0;
        }
        (sums[0] / first - sums[1] / second) * (first * second).sqrt() / self.samples
    }
}

/// `‖error‖/‖value‖`; 0 where both vanish.
pub(super) fn relative(error_squares: f64, value_squares: f64) -> f64 {
    if error_squares == 0.0 { 0.0 } else { (error_squares / value_squares).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_mean_of_two_is_half_their_difference() {
        let halves = Halves::of(2);
        assert_eq!((halves.mean([3.0, 5.0]), halves.error([3.0, 5.0]).abs()), (4.0, 1.0));
        assert_eq!((Halves::of(1).mean([3.0, 0.0]), Halves::of(1).error([3.0, 0.0])), (3.0, 0.0));
        assert!(!Halves::of(1).are_two() && Halves::of(2).are_two());
    }

    #[test]
    fn unequal_halves_weigh_by_their_counts() {
        // Var(mean of 3) = σ²/3; the halves' means differ with variance σ²/2 + σ².
        let scale = Halves::of(3).error([2.0, 0.0]).powi(2);
        assert!((scale - (1.0 / 3.0) / (1.0 / 2.0 + 1.0)).abs() < 1e-15, "{scale}");
    }
}
