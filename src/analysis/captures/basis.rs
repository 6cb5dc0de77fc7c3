//! The basis in which the covariance of captured photos is diagonal, and the solution for one camera pixel in it.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};
use rayon::prelude::*;

use super::Prior;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::krylov::dot;

/// The eigenvectors of `X K Xᵀ` for `N` patterns `X` and the kernel `K` of global light.
#[derive(Clone, Debug)]
pub(super) struct Basis {
    /// The eigenvalues (`N`).
    pub values: Vec<f64>,
    /// `U`, by rows (`N × N`): row `k` has the entry of photo `k` in each eigenvector.
    pub photos: Vec<Vec<f64>>,
    /// `Uᵀ X`, by columns (`n × N`).
    pub pixels: Vec<Vec<f64>>,
    /// `Uᵀ X K` (`N × n`).
    pub smooth: Vec<Vec<f64>>,
}

impl Basis {
    pub(super) fn new(patterns: &[Vec<f64>], projector: Resolution, prior: &Prior) -> Result<Self> {
        let count = patterns.len();
        let smooth: Vec<Vec<f64>> = patterns.par_iter().map(|x| prior.smooth(projector, x)).collect();
        let rows: Vec<Vec<f64>> =
            patterns.par_iter().map(|x| smooth.iter().map(|z| dot(x, z)).collect()).collect();
        let products = Mat::from_fn(count, count, |i, j| 0.5 * (rows[i][j] + rows[j][i]));
        let eigen = products.self_adjoint_eigen(Side::Lower).map_err(|_| {
            Error::Numerical("the patterns have no eigenvalues: a value is not finite".into())
        })?;
        let vectors = eigen.U();
        let values = eigen.S().column_vector().iter().map(|value| value.max(0.0)).collect();
        let photos: Vec<Vec<f64>> =
            (0..count).map(|k| (0..count).map(|i| vectors[(k, i)]).collect()).collect();
        let combined = |of: &[Vec<f64>], pixel: usize| -> Vec<f64> {
            let mut sums = vec![0.0; count];
            for (row, pattern) in photos.iter().zip(of) {
                let value = pattern[pixel];
                if value != 0.0 {
                    sums.iter_mut().zip(row).for_each(|(sum, u)| *sum += value * u);
                }
            }
            sums
        };
        let by_pixel = |of: &[Vec<f64>]| -> Vec<Vec<f64>> {
            (0..projector.pixels()).into_par_iter().map(|pixel| combined(of, pixel)).collect()
        };
        let pixels = by_pixel(patterns);
        let turned = by_pixel(&smooth);
        let smooth = (0..count).map(|i| turned.iter().map(|column| column[i]).collect()).collect();
        Ok(Self { values, photos, pixels, smooth })
    }
}

/// The covariance of the photos of one camera pixel, `S = diag(1/inverse) + B Bᵀ` in the basis, ready to be solved.
pub(super) struct Covariance {
    inverse: Vec<f64>,
    /// The columns of `B`: of direct light, and of samples that are missing.
    pub columns: Vec<Vec<f64>>,
    scaled: Vec<Vec<f64>>,
    inner: Mat<f64>,
}

impl Covariance {
    /// Fails with [`Error::Numerical`] if the covariance is not positive.
    pub(super) fn new(variances: impl Iterator<Item = f64>, columns: Vec<Vec<f64>>) -> Result<Self> {
        let inverse: Vec<f64> = variances.map(|variance| 1.0 / variance).collect();
        let scaled: Vec<Vec<f64>> =
            columns.iter().map(|column| column.iter().zip(&inverse).map(|(b, e)| b * e).collect()).collect();
        let size = columns.len();
        let products = Mat::from_fn(size, size, |a, b| {
            let one = if a == b { 1.0 } else { 0.0 };
            one + dot(&columns[a.min(b)], &scaled[a.max(b)])
        });
        let inner = match size {
            0 => products,
            _ => products
                .llt(Side::Lower)
                .map_err(|_| Error::Numerical("the light of a pixel is not finite".into()))?
                .inverse(),
        };
        Ok(Self { inverse, columns, scaled, inner })
    }

    /// `S⁻¹ y`, in the basis.
    pub(super) fn solve(&self, y: &[f64]) -> Vec<f64> {
        let shares: Vec<f64> = self.scaled.iter().map(|column| dot(column, y)).collect();
        let mut found: Vec<f64> = y.iter().zip(&self.inverse).map(|(y, e)| y * e).collect();
        for (a, column) in self.scaled.iter().enumerate() {
            let share: f64 = shares.iter().enumerate().map(|(b, share)| self.inner[(a, b)] * share).sum();
            found.iter_mut().zip(column).for_each(|(found, value)| *found -= share * value);
        }
        found
    }

    /// `uᵀ S⁻¹ u` for a row `u` of the basis, which is the entry of `S⁻¹` for a photo.
    pub(super) fn quadratic(&self, u: &[f64]) -> f64 {
        let shares: Vec<f64> = self.scaled.iter().map(|column| dot(column, u)).collect();
        let whole: f64 = u.iter().zip(&self.inverse).map(|(u, e)| u * u * e).sum();
        let rows = shares.iter().enumerate().map(|(a, share)| {
            share * shares.iter().enumerate().map(|(b, other)| self.inner[(a, b)] * other).sum::<f64>()
        });
        whole - rows.sum::<f64>()
    }
}
