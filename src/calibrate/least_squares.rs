//! Weighted linear least squares of a few unknowns, with the answer's covariance.
//!
//! The rows are summed up as normal equations, because a fit can have a row for every pixel of a camera: a QR factorization would have
//! to hold them all.

use faer::linalg::cholesky::llt::factor::LltError;
use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Col, Mat, Side};

use crate::error::{Error, Result};

/// A smaller pivot of the scaled matrix is no more than rounding.
const SMALLEST_PIVOT: f64 = 1e-13;

/// The normal equations `Σ w a aᵀ x = Σ w a y` of rows `aᵀ x ≈ y` with weights `w = 1/σ²`.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    unknowns: usize,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
}

/// A solution.
#[derive(Clone, Debug)]
pub(crate) struct Solution {
    /// The unknowns.
    pub(crate) values: Vec<f64>,
    /// `(Σ w a aᵀ)⁻¹`, row by row: the covariance, if the weights were `1/σ²`.
    pub(crate) covariance: Vec<f64>,
}

impl Solution {
    /// The standard error of an unknown.
    pub(crate) fn error(&self, unknown: usize) -> f64 {
        self.covariance[unknown * self.values.len() + unknown].max(0.0).sqrt()
    }
}

impl Normal {
    pub(crate) fn new(unknowns: usize) -> Self {
        Self { unknowns, matrix: vec![0.0; unknowns * unknowns], rhs: vec![0.0; unknowns] }
    }

    /// Adds a row, given by its entries that are not zero.
    pub(crate) fn add(&mut self, row: &[(usize, f64)], value: f64, weight: f64) {
        for &(i, a) in row {
            self.rhs[i] += weight * a * value;
            for &(j, b) in row {
                self.matrix[i * self.unknowns + j] += weight * a * b;
            }
        }
    }

    /// Adds a row that is full.
    pub(crate) fn add_full(&mut self, row: &[f64], value: f64, weight: f64) {
        let row: Vec<(usize, f64)> = row.iter().copied().enumerate().collect();
        self.add(&row, value, weight);
    }

    /// The same equations with every diagonal entry larger by this share (Levenberg–Marquardt's damping).
    pub(crate) fn damped(&self, share: f64) -> Self {
        let mut damped = self.clone();
        (0..self.unknowns).for_each(|i| damped.matrix[i * self.unknowns + i] *= 1.0 + share);
        damped
    }

    /// Solves by the Cholesky factorization of the matrix scaled to a diagonal of ones.
    ///
    /// # Errors
    /// [`Error::Numerical`] when the rows do not determine every unknown.
    pub(crate) fn solve(&self) -> Result<Solution> {
        let n = self.unknowns;
        let undetermined = |unknown: usize| {
            Error::Numerical(format!("the data do not determine unknown {unknown} of a fit"))
        };
        let scale: Vec<f64> = (0..n).map(|i| self.matrix[i * n + i].sqrt()).collect();
        let scaled = Mat::from_fn(n, n, |i, j| self.matrix[i * n + j] / (scale[i] * scale[j]));
        let factor =
            scaled.llt(Side::Lower).map_err(|LltError::NonPositivePivot { index }| undetermined(index))?;
        let determined = |unknown: usize| factor.L()[(unknown, unknown)].powi(2) > SMALLEST_PIVOT;
        if let Some(unknown) = (0..n).find(|&unknown| !determined(unknown)) {
            return Err(undetermined(unknown));
        }
        let values = factor.solve(Col::from_fn(n, |i| self.rhs[i] / scale[i]));
        let inverse = factor.inverse();
        Ok(Solution {
            values: (0..n).map(|i| values[i] / scale[i]).collect(),
            covariance: (0..n * n)
                .map(|at| (at / n, at % n))
                .map(|(i, j)| inverse[(i, j)] / (scale[i] * scale[j]))
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_with_its_textbook_errors() {
        let mut normal = Normal::new(2);
        for x in 0..5 {
            normal.add_full(&[1.0, f64::from(x)], 3.0 + 0.5 * f64::from(x), 4.0);
        }
        let line = normal.solve().expect("two unknowns, five points");
        assert!((line.values[0] - 3.0).abs() < 1e-12 && (line.values[1] - 0.5).abs() < 1e-12);
        // σ = ½ at each point; Σ(x − x̄)² = 10: the slope's variance is σ²/10.
        assert!((line.error(1) - (0.25_f64 / 10.0).sqrt()).abs() < 1e-12);
        assert!((line.error(0) - (0.25_f64 * (0.2 + 4.0 / 10.0)).sqrt()).abs() < 1e-12);
        // Their covariance is −x̄ σ²/10, on both sides of the diagonal.
        let [a, b, c, d] = line.covariance[..] else { unreachable!("two unknowns") };
        assert!((a - 0.15).abs() < 1e-12 && (d - 0.025).abs() < 1e-12, "{a} {d}");
        assert!((b + 0.05).abs() < 1e-12 && (c + 0.05).abs() < 1e-12, "{b} {c}");
    }

    #[test]
    fn what_the_data_do_not_tell_is_an_error() {
        let mut normal = Normal::new(2);
        normal.add_full(&[1.0, 2.0], 3.0, 1.0);
        assert!(normal.solve().is_err());
    }
}
