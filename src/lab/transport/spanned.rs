//! Products that follow from the photos of a run by linearity.
//!
//! The patterns of a Krylov process repeat to the bit on one machine, and only to rounding on another, or with vectors in another memory.
//! The patterns of the second process still lie in the span of the patterns of the first, so the photos of the first determine their
//! products.

use rayon::prelude::*;

use super::product_name;
use crate::error::Result;
use crate::journal::Journal;
use crate::krylov::{dot, norm};
use crate::operator::{Direction, Product};
use crate::transport::{JournaledOperator, Part};

/// The largest error of a product by linearity, relative to the largest product of a pattern of norm 1. Within it the product is as good as
/// one that was taken, whose rounding is about `√n ε`: 2e-13 for a million pixels.
const ERROR: f64 = 1e-12;

/// The factor by which the estimate of an error may be too small, since the largest product of a kept pattern estimates the norm of `A`.
const SAFETY: f64 = 3.0;

/// A pattern whose part outside the span of the patterns before it is smaller, relative to the pattern, is left out.
const NEW: f64 = 1e-10;

/// The products of one part and channel of a run's light transport, in one direction.
pub(super) struct Spanned {
    of: Of,
    /// Orthonormal vectors `Q`, and the columns of the triangular `R`, so that the kept patterns are `P = Q R`.
    orthonormal: Vec<Vec<f64>>,
    triangle: Vec<Vec<f64>>,
    /// The photos `Y` of the kept patterns, and the norms of these patterns.
    photos: Vec<Vec<f64>>,
    sizes: Vec<f64>,
    /// The largest `‖y‖ / ‖p‖`.
    gain: f64,
}

/// A part and a channel, and the direction of products.
type Of = ((Part, usize), Direction);

impl Spanned {
    /// These products in the journal, which are read unless they are among the `known` ones.
    pub(super) fn of<'a>(known: &'a mut Vec<Self>, journal: &mut Journal, of: Of) -> Result<&'a Self> {
        let place = known.iter().position(|known| known.of == of).unwrap_or(known.len());
        if place == known.len() {
            let ((part, channel), direction) = of;
            let products = JournaledOperator::kept(journal, &product_name(part, channel), direction)?;
            known.push(Self::by(of, products));
        }
        Ok(&known[place])
    }

    fn by(of: Of, products: Vec<Product>) -> Self {
        let (orthonormal, triangle, photos, sizes) = Default::default();
        let mut spanned = Self { of, orthonormal, triangle, photos, sizes, gain: 0.0 };
        for Product { from: mut pattern, to: photo } in products {
            let (size, length) = (norm(&pattern), norm(&photo));
            let mut column = spanned.removed(&mut pattern);
            let rest = norm(&pattern);
            if rest.is_finite() && length.is_finite() && rest > NEW * size {
                pattern.iter_mut().for_each(|value| *value /= rest);
                column.push(rest);
                spanned.gain = spanned.gain.max(length / size);
                spanned.orthonormal.push(pattern);
                spanned.triangle.push(column);
                spanned.photos.push(photo);
                spanned.sizes.push(size);
            }
        }
        spanned
    }

    /// Removes from `x` its part in the span, in two passes, and returns its coefficients on `Q`.
    fn removed(&self, x: &mut [f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.orthonormal.len()];
        for _ in 0..2 {
            let of_rows = |(q, x): (&[f64], &[f64])| dot(q, x);
            let along =
                self.orthonormal.par_iter().map(|q| q.chunks(ROWS).zip(x.chunks(ROWS)).map(of_rows).sum());
            let along: Vec<f64> = along.collect();
            add(x, &along, -1.0, &self.orthonormal);
            sums.iter_mut().zip(&along).for_each(|(sum, along)| *sum += along);
        }
        sums
    }

    /// Writes the product with `x` to `y`. Returns false, with the same `y`, if it does not follow from the photos.
    ///
    /// With `x = P z + e`, the product is `Y z`. The part `e` outside the span, and rounding, make an error of about
    /// `‖A‖ (‖e‖ + ε Σ |z| ‖p‖)`, which decides.
    pub(super) fn product(&self, x: &[f64], y: &mut [f64]) -> bool {
        let mut outside = x.to_vec();
        let mut z = self.removed(&mut outside);
        for column in (0..z.len()).rev() {
            z[column] /= self.triangle[column][column];
            for row in 0..column {
                z[row] -= z[column] * self.triangle[column][row];
            }
        }
        let shares: f64 = z.iter().zip(&self.sizes).map(|(z, size)| z.abs() * size).sum();
        let error = norm(&outside) + f64::EPSILON * shares;
        // False for the error NaN, and for a run without light.
        let is_known = self.gain > 0.0 && SAFETY * error <= ERROR * norm(x);
        if is_known {
            y.fill(0.0);
            add(y, &z, 1.0, &self.photos);
        }
        is_known
    }
}

/// The rows that are summed or added at once.
const ROWS: usize = 2048;

/// `sum ← sum + sign · Σ z_k v_k`.
fn add(sum: &mut [f64], z: &[f64], sign: f64, vectors: &[Vec<f64>]) {
    sum.par_chunks_mut(ROWS).enumerate().for_each(|(index, sum)| {
        for (z, vector) in z.iter().zip(vectors) {
            let rows = &vector[index * ROWS..][..sum.len()];
            sum.iter_mut().zip(rows).for_each(|(sum, value)| *sum += sign * z * value);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `A x` of a symmetric matrix of 40 pixels.
    fn light(x: &[f64]) -> Vec<f64> {
        let row = |i: usize| -> f64 {
            x.iter().enumerate().map(|(j, x)| x / (1.0 + (i as f64 - j as f64).powi(2))).sum()
        };
        (0..x.len()).map(row).collect()
    }

    fn pattern(k: usize) -> Vec<f64> {
        (0..40).map(|i| ((i * (k + 2)) as f64 * 0.7).sin() + 0.1 * k as f64).collect()
    }

    fn mix(of: &[(f64, Vec<f64>)]) -> Vec<f64> {
        (0..40).map(|i| of.iter().map(|(share, vector)| share * vector[i]).sum()).collect()
    }

    #[test]
    fn a_product_follows_from_kept_ones_only_within_rounding_of_their_span() {
        // The last pattern differs from the first one by a millionth, so that its own part has large coefficients.
        let near = mix(&[(1.0, pattern(0)), (1e-6, pattern(7))]);
        let kept = [pattern(0), pattern(1), pattern(2), near];
        let products = kept.iter().map(|x| Product { from: x.clone(), to: light(x) }).collect();
        let spanned = Spanned::by(((Part::Full, 0), Direction::Forward), products);
        let twin =
            |k: usize| kept[k].iter().map(|value| value * (1.0 + 2.0 * f64::EPSILON)).collect::<Vec<f64>>();
        let inside = [twin(0), twin(3), mix(&[(2.0, pattern(1)), (-0.3, pattern(2)), (0.7, pattern(0))])];
        for x in inside {
            let mut y = vec![f64::NAN; 40];
            assert!(spanned.product(&x, &mut y));
            let apart: Vec<f64> = y.iter().zip(light(&x)).map(|(y, expected)| y - expected).collect();
            assert!(norm(&apart) <= ERROR * spanned.gain * norm(&x), "{:e}", norm(&apart));
        }
        // One lies outside a little. The other lies in the span, but rounding is a million times as large in its product.
        let mut nan = pattern(1);
        nan[7] = f64::NAN;
        for x in [mix(&[(1.0, pattern(1)), (1e-11, pattern(5))]), pattern(7), nan, vec![0.0; 40]] {
            let mut y = vec![7.0; 40];
            assert!(!spanned.product(&x, &mut y) || x == [0.0; 40]);
            assert!(y == [7.0; 40] || y == [0.0; 40]);
        }
        let dark = Product { from: vec![0.0; 40], to: vec![0.0; 40] };
        let broken = Product { from: pattern(3), to: vec![f64::NAN; 40] };
        let empty = Spanned::by(((Part::Full, 0), Direction::Forward), vec![dark, broken]);
        assert!(!empty.product(&pattern(3), &mut [0.0; 40]));
    }
}
