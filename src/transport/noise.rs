//! The noise of the traced matrix, estimated from the difference between two independent halves of the samples.

use crate::error::Result;
use crate::image::{Blur, Image};

/// The standard deviation in pixels of the Gaussian that averages the squared errors around a pixel. The average covers about 28 squares.
const POOLED: f64 = 1.5;

/// The noise of an estimate `Â = (n₁ Â₁ + n₂ Â₂)/N` from `N = n₁ + n₂` samples per pixel in two independent halves.
///
/// `e = (Â₁ − Â₂) √(n₁ n₂)/N` has the mean 0 and the variance of `Â`. This holds for each entry, and for every linear function of the
/// entries. Errors that both halves have in common, such as those of a photon map, are not included.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// The errors of the photo under an all-ones pattern, pixel by pixel, in W/(m² sr), without ambient light. Each value is `|e|` of a
    /// single draw, so only the mean square over many pixels is accurate.
    pub white: Image,
    /// The root mean square of `white` over the pixels, relative to the root mean square of the photo.
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

/// The weights of samples from the two halves. The weighted samples sum to a mean and its error.
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

    /// Three weights of a sample: in the mean, in the error if it is of the first half, and in the error if it is of the second half.
    pub(super) fn weights(self) -> [f64; 3] {
        [self.mean, self.error[0], self.error[1]]
    }

    pub(super) fn share(self, value: f64) -> f64 {
        value * self.mean
    }

    pub(super) fn error_share(self, half: usize, value: f64) -> f64 {
        value * self.error[half]
    }

    /// The mean and its error, from the sums over the samples of each half.
    pub(super) fn estimate(self, [first, second]: [f64; 2]) -> [f64; 2] {
        [self.share(first) + self.share(second), self.error_share(0, first) + self.error_share(1, second)]
    }

    pub(super) fn add(self, to: &mut [f64; 2], half: usize, value: f64) {
        to[0] += self.share(value);
        to[1] += self.error_share(half, value);
    }
}

/// The standard errors of the pixels of a photo, estimated from one draw of their errors. One draw says little about a single pixel.
/// Therefore the standard error of a pixel is the root of the mean squared error of the pixels around it, weighted by a Gaussian of 1.5
/// pixels.
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

/// `‖error‖/‖value‖`, computed from the squares of both norms. It is 0 if both norms are 0.
pub(super) fn relative(error_squares: f64, value_squares: f64) -> f64 {
    if error_squares == 0.0 { 0.0 } else { (error_squares / value_squares).sqrt() }
}

/// The sums of the squares of values and errors over all entries of the matrix, including the diagonal. Their bits do not depend on the
/// order of the entries, so each process and each thread can add the entries that it merges.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct EntrySquares {
    /// The sums over entries without light of one bounce, which are nearly all entries.
    indirect: [ExactSum; 2],
    /// The sums over entries with light of one bounce, for all their light. `beside_direct` has the sums for their light of two or more
    /// bounces.
    direct: [ExactSum; 2],
    beside_direct: [ExactSum; 2],
}

impl EntrySquares {
    /// The length of the sums in a message, in 64-bit words.
    pub(super) const WORDS: usize = 6 * ExactSum::WORDS;

    /// Adds the squares of the values and errors of one entry without light of one bounce, `times` times.
    #[inline]
    pub(super) fn add_indirect<const C: usize>(&mut self, times: f64, entry: &Estimates<C>) {
        add(&mut self.indirect, times, entry);
    }

    /// Adds the squares of an entry with light of one bounce, both for all its light and for its light of two or more bounces.
    pub(super) fn add_direct<const C: usize>(
        &mut self,
        times: f64,
        whole: &Estimates<C>,
        global: &Estimates<C>,
    ) {
        add(&mut self.direct, times, whole);
        add(&mut self.beside_direct, times, global);
    }

    pub(super) fn add_all(&mut self, other: &Self) {
        self.sums_mut().zip(other.sums()).for_each(|(sum, other)| sum.add_all(other));
    }

    /// The sums of squares of values and errors for all light.
    pub(super) fn whole(&self) -> [f64; 2] {
        [0, 1].map(|of| self.indirect[of].value() + self.direct[of].value())
    }

    /// The sums of squares of values and errors for light of two or more bounces.
    pub(super) fn global(&self) -> [f64; 2] {
        [0, 1].map(|of| self.indirect[of].value() + self.beside_direct[of].value())
    }

    pub(super) fn to_words(&self) -> Vec<u64> {
        self.sums().flat_map(ExactSum::to_words).collect()
    }

    /// The sums that [`EntrySquares::to_words`] encoded; `None` for invalid words.
    pub(super) fn from_words(words: &[u64]) -> Option<Self> {
        let mut squares = Self::default();
        if words.len() != Self::WORDS {
            return None;
        }
        for (sum, words) in squares.sums_mut().zip(words.chunks(ExactSum::WORDS)) {
            *sum = ExactSum::from_words(words)?;
        }
        Some(squares)
    }

    fn sums(&self) -> impl Iterator<Item = &ExactSum> {
        [&self.indirect, &self.direct, &self.beside_direct].into_iter().flatten()
    }

    fn sums_mut(&mut self) -> impl Iterator<Item = &mut ExactSum> {
        [&mut self.indirect, &mut self.direct, &mut self.beside_direct].into_iter().flatten()
    }
}

#[inline]
fn add<const C: usize>(to: &mut [ExactSum; 2], times: f64, entry: &Estimates<C>) {
    for [mean, error] in entry {
        to[0].add(times * mean * mean);
        to[1].add(times * error * error);
    }
}

/// The number of exponents that one part of the sum covers.
const PART: u32 = 32;

/// A sum of nonnegative numbers without rounding. It does not depend on the order of its terms, and partial sums can be added. The terms
/// may therefore come from any number of threads and processes.
///
/// A floating-point number is an integer times a power of two. The integer is added to the part that covers this power.
#[derive(Clone, Debug, PartialEq)]
struct ExactSum {
    /// Part `i` counts multiples of `2^(32 i − 1075)`. A term adds less than 2⁸⁵ to a part, so 2⁴³ terms are possible.
    parts: [u128; 64],
    /// The sum of infinite and NaN terms. It is 0 if there are none.
    beyond: f64,
}

impl Default for ExactSum {
    fn default() -> Self {
        Self { parts: [0; 64], beyond: 0.0 }
    }
}

impl ExactSum {
    const WORDS: usize = 129;

    #[inline]
    fn add(&mut self, term: f64) {
        let bits = term.to_bits();
        // The sign bit is 0, so the shifted bits are those of the exponent.
        let exponent = (bits >> 52) as u32;
        if exponent >= 0x7ff {
            self.beyond += term;
            return;
        }
        let below = bits & ((1 << 52) - 1);
        // Subnormal numbers have no implicit leading bit, and have the exponent of the smallest normal numbers.
        let whole = below | u64::from(exponent > 0) << 52;
        let exponent = exponent.max(1);
        let part = &mut self.parts[(exponent / PART) as usize];
        *part = part.wrapping_add(u128::from(whole) << (exponent % PART));
    }

    fn add_all(&mut self, other: &Self) {
        self.parts.iter_mut().zip(&other.parts).for_each(|(part, other)| *part += other);
        self.beyond += other.beyond;
    }

    /// The sum as a floating-point number. The parts are added in a fixed order.
    fn value(&self) -> f64 {
        let value = |(part, &whole): (usize, &u128)| {
            let power = PART as i32 * part as i32 - 1075;
            // The power of two of the first parts is too small for an `f64`, so it is split into two factors.
            let [first, second] = if power < -500 { [power + 500, -500] } else { [power, 0] };
            whole as f64 * 2_f64.powi(first) * 2_f64.powi(second)
        };
        self.parts.iter().enumerate().filter(|(_, whole)| **whole > 0).map(value).sum::<f64>() + self.beyond
    }

    fn to_words(&self) -> Vec<u64> {
        let parts = self.parts.iter().flat_map(|&part| [part as u64, (part >> 64) as u64]);
        parts.chain([self.beyond.to_bits()]).collect()
    }

    /// The sum that [`ExactSum::to_words`] encoded; `None` for too few words.
    fn from_words(words: &[u64]) -> Option<Self> {
        let (pairs, beyond) = words.as_chunks::<2>();
        let mut sum = Self { beyond: f64::from_bits(*beyond.first()?), ..Self::default() };
        if pairs.len() != sum.parts.len() {
            return None;
        }
        let part = |&[low, high]: &[u64; 2]| u128::from(low) | u128::from(high) << 64;
        sum.parts.iter_mut().zip(pairs).for_each(|(to, pair)| *to = part(pair));
        Some(sum)
    }
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
        // Var(mean of 3) = σ²/3. The difference of the halves' means has the variance σ²/2 + σ².
        let scale = ((1.0 / 3.0) / (1.0 / 2.0 + 1.0_f64)).sqrt();
        assert!((mean - 4.0 / 3.0).abs() < 1e-15 && (error - 2.0 * scale).abs() < 1e-15, "{mean}, {error}");
        let [_, error] = estimate(Halves::new(3, 3), [&[2.0, 2.0], &[2.0]]);
        assert!(error.abs() < 1e-15, "equal samples have no error: {error}");
    }

    #[test]
    fn a_projectors_paths_are_divided_by_the_cameras_samples() {
        // A sum over four paths is divided by the camera's eight samples, so mean and error are half as large as with a division by four.
        let [mean, error] = estimate(Halves::new(8, 4), [&[1.0, 3.0], &[0.0, 0.0]]);
        assert_eq!([mean, error], [0.5, 0.5]);
    }

    #[test]
    fn squares_of_direct_and_indirect_light_are_told_apart() {
        let mut squares = EntrySquares::default();
        squares.add_indirect(2.0, &[[3.0, 0.5], [1.0, 0.0]]);
        squares.add_direct(1.0, &[[2.0, 0.25], [0.0, 0.0]], &[[1.0, 0.0], [0.0, 0.0]]);
        assert_eq!(squares.whole(), [20.0 + 4.0, 0.5 + 0.0625]);
        assert_eq!(squares.global(), [20.0 + 1.0, 0.5]);
        assert_eq!(EntrySquares::from_words(&squares.to_words()), Some(squares.clone()));
        assert_eq!(EntrySquares::from_words(&squares.to_words()[1..]), None);
        let mut twice = squares.clone();
        twice.add_all(&squares);
        assert_eq!(twice.whole(), [48.0, 1.125]);
    }

    fn of(terms: impl IntoIterator<Item = f64>) -> ExactSum {
        let mut sum = ExactSum::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }

    #[test]
    fn neither_order_nor_parts_change_a_sum() {
        // The numbers differ by up to 2^80, so an `f64` sum depends on the order.
        let term = |at: u64| {
            let drawn = at.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            (drawn >> 11) as f64 * 2_f64.powi((drawn % 80) as i32 - 100)
        };
        let terms: Vec<f64> = (0..1000).map(term).collect();
        let whole = of(terms.iter().copied());
        assert_eq!(whole, of(terms.iter().rev().copied()));
        let mut parts = of(terms[..300].iter().copied());
        parts.add_all(&of(terms[300..].iter().copied()));
        assert_eq!(whole, parts);
        assert_eq!(ExactSum::from_words(&whole.to_words()), Some(whole.clone()));
        assert_eq!(whole.to_words().len(), ExactSum::WORDS);
        let sorted: f64 = {
            let mut terms = terms.clone();
            terms.sort_by(f64::total_cmp);
            terms.iter().sum()
        };
        // The sum to compare with is rounded, so the tolerance is a thousand roundings.
        assert!((whole.value() - sorted).abs() <= 1000.0 * f64::EPSILON * sorted);
    }

    #[test]
    fn numbers_of_every_size_are_added() {
        for term in [0.0, f64::MIN_POSITIVE / 8.0, f64::MIN_POSITIVE, 1e-200, 0.3, 1.0, 6e7, 1e300, f64::MAX]
        {
            assert_eq!(of([term]).value().to_bits(), term.to_bits(), "{term:e}");
        }
        assert_eq!(of([1.0; 7]).value(), 7.0);
        assert_eq!(of([1.0, 2_f64.powi(-60)]).value(), 1.0, "rounded at the end");
        assert_eq!(of([1.0, f64::INFINITY]).value(), f64::INFINITY);
        assert!(of([1.0, f64::NAN]).value().is_nan());
    }
}
