//! The basis in which the covariance of captured photos is diagonal, and the solution for one camera pixel in it.

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
    /// The rows of the Cholesky factor of `I + Bᵀ diag(inverse) B`. Its inverse would lose all digits where columns are strong and alike.
    factor: Vec<Vec<f64>>,
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
        let llt = products
            .llt(Side::Lower)
            .map_err(|_| Error::Numerical("the light of a pixel is not finite".into()))?;
        let lower = llt.L();
        let factor = (0..size).map(|a| (0..=a).map(|b| lower[(a, b)]).collect()).collect();
        Ok(Self { inverse, columns, scaled, factor })
    }

    /// `L⁻¹ Bᵀ diag(inverse) y` for the Cholesky factor `L`, by forward substitution.
    fn shares(&self, y: &[f64]) -> Vec<f64> {
        let mut shares: Vec<f64> = Vec::with_capacity(self.factor.len());
        for (row, column) in self.factor.iter().zip(&self.scaled) {
            let rest = dot(column, y) - dot(&row[..shares.len()], &shares);
            shares.push(rest / row[shares.len()]);
        }
        shares
    }

    /// `S⁻¹ y`, in the basis.
    pub(super) fn solve(&self, y: &[f64]) -> Vec<f64> {
        let mut shares = self.shares(y);
        // Back substitution with `Lᵀ`.
        for a in (0..shares.len()).rev() {
            shares[a] /= self.factor[a][a];
            let (rest, solved) = shares.split_at_mut(a);
            rest.iter_mut().zip(&self.factor[a]).for_each(|(share, value)| *share -= value * solved[0]);
        }
        let mut found: Vec<f64> = y.iter().zip(&self.inverse).map(|(y, e)| y * e).collect();
        for (share, column) in shares.iter().zip(&self.scaled) {
            found.iter_mut().zip(column).for_each(|(found, value)| *found -= share * value);
        }
        found
    }

    /// `uᵀ S⁻¹ u` for a row `u` of the basis, which is the entry of `S⁻¹` for a photo.
    pub(super) fn quadratic(&self, u: &[f64]) -> f64 {
        let whole: f64 = u.iter().zip(&self.inverse).map(|(u, e)| u * u * e).sum();
        let shares = self.shares(u);
        whole - dot(&shares, &shares)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::krylov::Start;

    /// The direct light of a window of one pixel is in two columns, which are then multiples of each other.
    #[test]
    fn strong_columns_that_are_alike_lose_no_digits() -> Result<()> {
        for seed in 0..20 {
            let vector = |at: u64| Start::Gaussian { seed: 10 * seed + at }.vector(40);
            let variances: Vec<f64> = vector(0).iter().map(|v| 1e-5 * (1.0 + v * v)).collect();
            // The prior allows the window 10 times a row's light, and its only pixel twice that.
            let strength = 0.1 * 10_f64.powf(2.5 * seed as f64 / 19.0);
            let strong: Vec<f64> = vector(1).iter().map(|v| strength * v).collect();
            let columns = vec![strong.clone(), strong.iter().map(|v| 2.0 * v).collect(), vector(2)];
            let covariance = Covariance::new(variances.iter().copied(), columns.clone())?;
            // A photo of light from these columns, with noise.
            let noise: Vec<f64> = vector(3).iter().zip(&variances).map(|(v, e)| v * e.sqrt()).collect();
            let y: Vec<f64> = (0..40).map(|k| 0.1 * strong[k] + columns[2][k] + noise[k]).collect();
            let solved = covariance.solve(&y);
            let shares: Vec<f64> = columns.iter().map(|column| dot(column, &solved)).collect();
            let back: Vec<f64> = (0..40)
                .map(|k| {
                    let light: f64 =
                        columns.iter().zip(&shares).map(|(column, share)| column[k] * share).sum();
                    variances[k] * solved[k] + light
                })
                .collect();
            let off = back.iter().zip(&y).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            let noise = dot(&noise, &noise).sqrt();
            // A hundredth of the noise changes no answer.
            assert!(off < 1e-2 * noise, "{strength:.1}: {off:e} of {noise:e}");
            // `yᵀ S⁻¹ y` by both ways.
            let [whole, again] = [dot(&y, &solved), covariance.quadratic(&y)];
            assert!((whole - again).abs() < 1e-2 * whole, "{strength:.1}: {whole} {again}");
        }
        Ok(())
    }
}
