//! Weighted linear least squares of a few unknowns, with the answer's covariance.

use crate::error::{Error, Result};

/// The normal equations `Σ w a aᵀ x = Σ w a y` of rows `aᵀ x ≈ y` with weights `w = 1/σ²`.
#[derive(Clone, Debug)]
pub(super) struct Normal {
    unknowns: usize,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
}

/// A solution.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// The unknowns.
    pub(super) values: Vec<f64>,
    /// `(Σ w a aᵀ)⁻¹`, row by row: the covariance, if the weights were `1/σ²`.
    pub(super) covariance: Vec<f64>,
}

impl Solution {
    /// The standard error of an unknown.
    pub(super) fn error(&self, unknown: usize) -> f64 {
        self.covariance[unknown * self.values.len() + unknown].max(0.0).sqrt()
    }
}

impl Normal {
    pub(super) fn new(unknowns: usize) -> Self {
        Self { unknowns, matrix: vec![0.0; unknowns * unknowns], rhs: vec![0.0; unknowns] }
    }

    /// Adds a row, given by its entries that are not zero.
    pub(super) fn add(&mut self, row: &[(usize, f64)], value: f64, weight: f64) {
        for &(i, a) in row {
            self.rhs[i] += weight * a * value;
            for &(j, b) in row {
                self.matrix[i * self.unknowns + j] += weight * a * b;
            }
        }
    }

    /// Adds a row that is full.
    pub(super) fn add_full(&mut self, row: &[f64], value: f64, weight: f64) {
        let row: Vec<(usize, f64)> = row.iter().copied().enumerate().collect();
        self.add(&row, value, weight);
    }

    /// The same equations with every diagonal entry larger by this share (Levenberg–Marquardt's damping).
    pub(super) fn damped(&self, share: f64) -> Self {
        let mut damped = self.clone();
        (0..self.unknowns).for_each(|i| damped.matrix[i * self.unknowns + i] *= 1.0 + share);
        damped
    }

    /// Solves by Cholesky's factorization, of the matrix scaled to a diagonal of ones.
    ///
    /// # Errors
    /// [`Error::Numerical`] when the rows do not determine every unknown.
    pub(super) fn solve(&self) -> Result<Solution> {
        let n = self.unknowns;
        let scale: Vec<f64> = (0..n).map(|i| self.matrix[i * n + i].sqrt()).collect();
        let mut factor = vec![0.0; n * n];
        for i in 0..n {
            for j in 0..=i {
                let dot: f64 = (0..j).map(|k| factor[i * n + k] * factor[j * n + k]).sum();
                let rest = self.matrix[i * n + j] / (scale[i] * scale[j]) - dot;
                if i != j {
                    factor[i * n + j] = rest / factor[j * n + j];
                } else if rest > 1e-13 {
                    factor[i * n + i] = rest.sqrt();
                } else {
                    return Err(Error::Numerical(format!("the data do not determine unknown {i} of a fit")));
                }
            }
        }
        let solve = |rhs: &[f64]| {
            let mut x: Vec<f64> = rhs.iter().zip(&scale).map(|(value, scale)| value / scale).collect();
            for i in 0..n {
                let dot: f64 = (0..i).map(|k| factor[i * n + k] * x[k]).sum();
                x[i] = (x[i] - dot) / factor[i * n + i];
            }
            for i in (0..n).rev() {
                let dot: f64 = (i + 1..n).map(|k| factor[k * n + i] * x[k]).sum();
                x[i] = (x[i] - dot) / factor[i * n + i];
            }
            x.iter().zip(&scale).map(|(value, scale)| value / scale).collect::<Vec<f64>>()
        };
        let unit = |at: usize| (0..n).map(|i| f64::from(u8::from(i == at))).collect::<Vec<f64>>();
        let covariance = (0..n).flat_map(|at| solve(&unit(at))).collect();
        Ok(Solution { values: solve(&self.rhs), covariance })
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
    }

    #[test]
    fn what_the_data_do_not_tell_is_an_error() {
        let mut normal = Normal::new(2);
        normal.add_full(&[1.0, 2.0], 3.0, 1.0);
        assert!(normal.solve().is_err());
    }
}
