//! Weighted linear least squares for a few unknowns, cluster-robust covariances, and isotonic regression.
//!
//! The rows are summed up as normal equations, because a fit can have one row per camera pixel, and a QR factorization would keep all rows
//! in memory.

use std::collections::BTreeMap;

use faer::linalg::cholesky::llt::factor::LltError;
use faer::linalg::solvers::{DenseSolveCore, Solve};
use faer::{Col, Mat, Side};

use crate::error::{Error, Result};
use crate::measure::lens_map::PARAMETERS;

/// A pivot of the scaled matrix that is smaller than this is attributed to rounding.
const SMALLEST_PIVOT: f64 = 1e-13;

/// The normal equations `Σ w a aᵀ x = Σ w a y` of rows `aᵀ x ≈ y` with weights `w = 1/σ²`.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    unknowns: usize,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
}

#[derive(Clone, Debug)]
pub(crate) struct Solution {
    pub(crate) values: Vec<f64>,
    /// `(Σ w a aᵀ)⁻¹`, row by row. This is the covariance of the unknowns if the weights were `1/σ²`.
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

    /// Adds a row, given by its nonzero entries.
    pub(crate) fn add(&mut self, row: &[(usize, f64)], value: f64, weight: f64) {
        for &(i, a) in row {
            self.rhs[i] += weight * a * value;
            for &(j, b) in row {
                self.matrix[i * self.unknowns + j] += weight * a * b;
            }
        }
    }

    pub(crate) fn add_full(&mut self, row: &[f64], value: f64, weight: f64) {
        let row: Vec<(usize, f64)> = row.iter().copied().enumerate().collect();
        self.add(&row, value, weight);
    }

    /// Multiplies every diagonal entry by `1 + share` (Levenberg–Marquardt damping).
    pub(crate) fn damped(&self, share: f64) -> Self {
        let mut damped = self.clone();
        (0..self.unknowns).for_each(|i| damped.matrix[i * self.unknowns + i] *= 1.0 + share);
        damped
    }

    /// Solves the equations by Cholesky factorization, after the matrix is scaled to a diagonal of ones. Fails with [`Error::Numerical`]
    /// when the rows do not determine every unknown.
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

/// Equations `slopes · step ≈ residuals` for a step of the lens map's parameters. All equations have the same weight.
#[derive(Clone, Copy)]
pub(crate) struct Equations<const N: usize> {
    pub(crate) residuals: [f64; N],
    /// The derivatives of the model with respect to the parameters.
    pub(crate) slopes: [[f64; PARAMETERS]; N],
    pub(crate) weight: f64,
}

impl<const N: usize> Equations<N> {
    /// Adds the equations to the normal equations of a Gauss–Newton step.
    pub(crate) fn add_to(&self, normal: &mut Normal) {
        if self.weight > 0.0 {
            let rows = self.slopes.iter().zip(&self.residuals);
            rows.for_each(|(slopes, &residual)| normal.add_full(slopes, residual, self.weight));
        }
    }
}

/// Computes the ascending sequence that is nearest to `values` in the weighted mean square (pool-adjacent-violators algorithm).
pub(crate) fn ascending(values: &[f64], weights: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    for (&value, &weight) in values.iter().zip(weights) {
        let mut pool = (value, weight, 1);
        while let Some(&(before, weight, length)) = pools.last() {
            if before <= pool.0 {
                break;
            }
            pools.pop();
            let total = weight + pool.1;
            pool = ((before * weight + pool.0 * pool.1) / total, total, length + pool.2);
        }
        pools.push(pool);
    }
    pools.iter().flat_map(|&(value, _, length)| std::iter::repeat_n(value, length)).collect()
}

/// The gradients of the residuals, summed by group. Each group is one column or row of the projector's pixels.
#[derive(Default)]
pub(crate) struct Clusters(BTreeMap<(usize, u64), [f64; PARAMETERS]>);

impl Clusters {
    /// Adds a residual to a group, with its derivatives with respect to the parameters. `group` is the axis, and the column or row.
    pub(crate) fn add(&mut self, group: (usize, u64), slopes: &[f64; PARAMETERS], weighted_residual: f64) {
        let pull = self.0.entry(group).or_insert([0.0; PARAMETERS]);
        pull.iter_mut().zip(slopes).for_each(|(pull, slope)| *pull += weighted_residual * slope);
    }

    /// Computes the covariance of the parameters, row by row. The gradient of each group, times `inverse`, is a shift of the parameters.
    /// The covariance is the sum of the outer products of these shifts. `inverse` is the inverse of the normal matrix.
    pub(crate) fn covariance(&self, inverse: &[f64]) -> Vec<f64> {
        let mut covariance = vec![0.0; PARAMETERS * PARAMETERS];
        for pull in self.0.values() {
            let shift = times(inverse, pull);
            for (i, row) in covariance.chunks_exact_mut(PARAMETERS).enumerate() {
                row.iter_mut().zip(&shift).for_each(|(entry, other)| *entry += shift[i] * other);
            }
        }
        covariance
    }
}

/// `aᵀ M a` for a square matrix.
pub(crate) fn form(matrix: &[f64], a: &[f64; PARAMETERS]) -> f64 {
    a.iter().zip(times(matrix, a)).map(|(a, b)| a * b).sum()
}

fn times(matrix: &[f64], vector: &[f64; PARAMETERS]) -> [f64; PARAMETERS] {
    let mut product = [0.0; PARAMETERS];
    for (value, row) in product.iter_mut().zip(matrix.chunks_exact(PARAMETERS)) {
        *value = row.iter().zip(vector).map(|(a, x)| a * x).sum();
    }
    product
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
        // Each point has σ = ½ and Σ(x − x̄)² = 10, so the slope's variance is σ²/10.
        assert!((line.error(1) - (0.25_f64 / 10.0).sqrt()).abs() < 1e-12);
        assert!((line.error(0) - (0.25_f64 * (0.2 + 4.0 / 10.0)).sqrt()).abs() < 1e-12);
        // The covariance of the two unknowns is −x̄ σ²/10, on both sides of the diagonal.
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

    #[test]
    fn neighbours_out_of_order_are_replaced_by_their_weighted_mean() {
        assert_eq!(ascending(&[1.0, 3.0, 2.0, 4.0], &[1.0, 1.0, 3.0, 1.0]), [1.0, 2.25, 2.25, 4.0]);
        assert_eq!(ascending(&[3.0, 2.0, 1.0], &[1.0; 3]), [2.0; 3]);
    }

    #[test]
    fn residuals_of_one_group_add_before_they_are_squared() {
        let mut identity = vec![0.0; PARAMETERS * PARAMETERS];
        (0..PARAMETERS).for_each(|i| identity[i * PARAMETERS + i] = 1.0);
        let mut first = [0.0; PARAMETERS];
        first[0] = 1.0;
        let [mut together, mut apart] = [Clusters::default(), Clusters::default()];
        for number in 0..4 {
            together.add((0, 7), &first, 0.5);
            apart.add((0, number), &first, 0.5);
        }
        // Four residuals of ½ give (4 · ½)² in one group, and 4 · (½)² in four groups.
        assert_eq!(form(&together.covariance(&identity), &first), 4.0);
        assert_eq!(form(&apart.covariance(&identity), &first), 1.0);
    }
}
