//! Products that follow from the photos of a run by linearity.
//!
//! The patterns of a Krylov process repeat to the bit on one machine, and only to rounding on another, or with vectors in another memory. The
//! patterns of the second process still lie in the span of the patterns of the first, so the photos of the first determine their products.

use rayon::prelude::*;

use super::{confirming_name, product_name};
use crate::error::Result;
use crate::journal::Journal;
use crate::krylov::{dot, norm};
use crate::operator::Product;
use crate::transport::{JournaledOperator, Part};

/// The largest error of a product by linearity, relative to the largest product of a pattern of norm 1. It is a tenth of the smallest
/// tolerance that krylux sets by itself.
const ERROR: f64 = 1e-9;

/// Up to this error a product is as good as one that was taken.
const ROUNDING: f64 = 1e-12;

/// A pattern whose part outside the span of the patterns before it is smaller, relative to the pattern, is left out.
const NEW: f64 = 1e-10;

/// The products of one part and channel of a run's light transport.
pub(super) struct Spanned {
    of: (Part, usize),
    /// Orthonormal vectors `Q`, and the columns of the triangular `R`, so that the kept patterns are `P = Q R`.
    orthonormal: Vec<Vec<f64>>,
    triangle: Vec<Vec<f64>>,
    /// The photos `Y` of the kept patterns.
    photos: Vec<Vec<f64>>,
    /// The largest `‖y‖ / ‖p‖`.
    gain: f64,
}

impl Spanned {
    /// The products of this part and channel in the journal, which are read unless they are among the `known` ones.
    pub(super) fn of<'a>(
        known: &'a mut Vec<Self>,
        journal: &mut Journal,
        of: (Part, usize),
    ) -> Result<&'a Self> {
        let place = known.iter().position(|known| known.of == of).unwrap_or(known.len());
        if place == known.len() {
            let mut products = JournaledOperator::kept(journal, &product_name(of.0, of.1))?;
            products.extend(JournaledOperator::kept(journal, &confirming_name(of))?);
            known.push(Self::by(of, products));
        }
        Ok(&known[place])
    }

    fn by(of: (Part, usize), products: Vec<Product>) -> Self {
        let mut spanned =
            Self { of, orthonormal: Vec::new(), triangle: Vec::new(), photos: Vec::new(), gain: 0.0 };
        for Product { from: mut pattern, to: photo } in products {
            let size = norm(&pattern);
            let mut column = spanned.removed(&mut pattern);
            let rest = norm(&pattern);
            if rest.is_finite() && rest > NEW * size {
                pattern.iter_mut().for_each(|value| *value /= rest);
                column.push(rest);
                spanned.gain = spanned.gain.max(norm(&photo) / size);
                spanned.orthonormal.push(pattern);
                spanned.triangle.push(column);
                spanned.photos.push(photo);
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

    /// Writes the product with `x` to `y`, and returns its error, or 0 if that is only rounding. Returns `None`, with the same `y`, if the
    /// product does not follow from the photos.
    ///
    /// With `x = P z + e`, the product is `Y z`. The part `e` outside the span and the rounding of the photos make an error of about
    /// `‖A‖ ‖e‖ + ε Σ |z| ‖y‖`.
    pub(super) fn product(&self, x: &[f64], y: &mut [f64]) -> Option<f64> {
        let mut outside = x.to_vec();
        let mut z = self.removed(&mut outside);
        for column in (0..z.len()).rev() {
            z[column] /= self.triangle[column][column];
            for row in 0..column {
                z[row] -= z[column] * self.triangle[column][row];
            }
        }
        let rounding: f64 = z.iter().zip(&self.photos).map(|(z, photo)| z.abs() * norm(photo)).sum();
        let error = self.gain * norm(&outside) + f64::EPSILON * rounding;
        let scale = self.gain * norm(x);
        // A run without photos has the gain 0.
        if scale == 0.0 || error > ERROR * scale {
            return None;
        }
        y.fill(0.0);
        add(y, &z, 1.0, &self.photos);
        Some(if error > ROUNDING * scale { error } else { 0.0 })
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
        let spanned = Spanned::by((Part::Full, 0), products);
        let twin =
            |k: usize| kept[k].iter().map(|value| value * (1.0 + 2.0 * f64::EPSILON)).collect::<Vec<f64>>();
        let inside = [twin(0), twin(3), mix(&[(2.0, pattern(1)), (-0.3, pattern(2)), (0.7, pattern(0))])];
        for x in inside {
            let mut y = vec![f64::NAN; 40];
            assert_eq!(spanned.product(&x, &mut y), Some(0.0));
            let apart: Vec<f64> = y.iter().zip(light(&x)).map(|(y, expected)| y - expected).collect();
            assert!(norm(&apart) <= ROUNDING * spanned.gain * norm(&x), "{:e}", norm(&apart));
        }
        // One lies outside a little. The other lies in the span, but rounding of the photos is a million times as large in its product.
        for x in [mix(&[(1.0, pattern(1)), (1e-10, pattern(5))]), pattern(7)] {
            let mut y = vec![f64::NAN; 40];
            let error = spanned.product(&x, &mut y).expect("within the tolerance");
            let apart: Vec<f64> = y.iter().zip(light(&x)).map(|(y, expected)| y - expected).collect();
            // The largest eigenvalue is three times the gain of these patterns.
            assert!(error > 0.0 && norm(&apart) < 3.0 * error, "{:e} {error:e}", norm(&apart));
        }
        let mut y = vec![7.0; 40];
        assert_eq!(spanned.product(&mix(&[(1.0, pattern(1)), (1e-7, pattern(5))]), &mut y), None);
        assert_eq!(y, [7.0; 40]);
        let empty = Spanned::by((Part::Full, 0), vec![Product { from: vec![0.0; 40], to: vec![0.0; 40] }]);
        assert_eq!(empty.product(&[0.0; 40], &mut [0.0; 40]), None);
    }
}
