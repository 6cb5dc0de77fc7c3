//! The polynomials that a Lanczos process builds, as functions.

use super::dense::spectrum_of_rows;
use crate::error::Result;
use crate::krylov::{Factorization, Lanczos, dot, norm};
use crate::operator::Operator;

/// A Lanczos process from the target's light, in units of the light itself.
pub(super) struct Run {
    /// `‖b‖`.
    length: f64,
    alphas: Vec<f64>,
    betas: Vec<f64>,
    basis: Vec<Vec<f64>>,
    /// The rig's reading for 1 W/(m² sr).
    unit: f64,
}

impl Run {
    /// The process of so many photos from `b`, both as a rig reads them that gives `unit` for 1 W/(m² sr).
    pub(super) fn of(operator: &mut dyn Operator, b: &[f64], (photos, unit): (usize, f64)) -> Result<Self> {
        let mut process = Lanczos::new(b, &[])?;
        for _ in 0..photos {
            process.expand(operator)?;
        }
        let scaled = |values: Vec<f64>| values.into_iter().map(|value| value / unit).collect();
        let (alphas, betas) = (scaled(process.alphas()), scaled(process.betas()));
        Ok(Self { length: norm(b), alphas, betas, basis: process.basis().to_vec(), unit })
    }

    /// The coefficients `y` of MINRES' answer `V y` after `k` photos: least squares of `‖b‖ e₁ − T y` with `T` of `(k + 1) × k`.
    pub(super) fn coefficients(&self, k: usize) -> Vec<f64> {
        let rows = faer::Mat::from_fn(k + 1, k, |row, column| match row as isize - column as isize {
            -1 => self.betas[row],
            0 => self.alphas[row],
            1 => self.betas[column],
            _ => 0.0,
        });
        let wanted = faer::Mat::from_fn(k + 1, 1, |row, _| if row == 0 { self.length } else { 0.0 });
        let found = faer::linalg::solvers::SolveLstsq::solve_lstsq(&rows.qr(), &wanted);
        (0..k).map(|row| found[(row, 0)]).collect()
    }

    /// MINRES' answer after `k` photos, a pattern.
    pub(super) fn answer(&self, k: usize) -> Vec<f64> {
        let mut answer = vec![0.0; self.basis[0].len()];
        for (share, vector) in self.coefficients(k).iter().zip(&self.basis) {
            answer.iter_mut().zip(vector).for_each(|(sum, value)| *sum += share / self.unit * value);
        }
        answer
    }

    /// `φ_1(λ) … φ_{k+1}(λ)` with `v_j = φ_j(A) b / ‖b‖`, by the three-term recurrence of the process.
    pub(super) fn basis_polynomials(&self, k: usize, value: f64) -> Vec<f64> {
        let mut found = vec![1.0];
        for j in 0..k {
            let before = if j > 0 { self.betas[j - 1] * found[j - 1] } else { 0.0 };
            found.push(((value - self.alphas[j]) * found[j] - before) / self.betas[j]);
        }
        found
    }

    /// `p(λ) = 1 − λ Σ y_j φ_j(λ) / ‖b‖`, the residual polynomial of MINRES after `k` photos.
    pub(super) fn residual_polynomial(&self, k: usize) -> impl Fn(f64) -> f64 {
        let coefficients = self.coefficients(k);
        move |value| {
            let answer = dot(&coefficients, &self.basis_polynomials(k, value)[..k]);
            1.0 - value * answer / self.length
        }
    }

    /// The monic polynomial of degree `k` whose zeros are the Ritz values: `β_1 … β_k φ_{k+1}`.
    pub(super) fn monic(&self, k: usize, value: f64) -> f64 {
        let scale: f64 = self.betas[..k].iter().product();
        scale * self.basis_polynomials(k, value)[k]
    }

    /// `(‖q_k(A) b‖ / ‖b‖)^{1/k}` of the monic polynomial of each degree: the geometric mean of the `β`s.
    pub(super) fn monic_norms(&self) -> Vec<f64> {
        let mut logarithm = 0.0;
        let mean = |(k, beta): (usize, &f64)| {
            logarithm += beta.ln();
            (logarithm / (k as f64 + 1.0)).exp()
        };
        self.betas.iter().enumerate().map(mean).collect()
    }

    /// The Ritz values after `k` photos, the zeros of the monic polynomial.
    pub(super) fn ritz_values(&self, k: usize) -> Result<Vec<f64>> {
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => self.alphas[i],
            1 => self.betas[i.min(j)],
            _ => 0.0,
        };
        let rows: Vec<Vec<f64>> = (0..k).map(|i| (0..k).map(|j| entry(i, j)).collect()).collect();
        Ok(spectrum_of_rows(&rows)?.values)
    }
}

/// The largest value on `[smallest, largest]` of the residual polynomial of degree `k` that is least there, by Chebyshev: what `k` photos
/// promise if nothing but the interval of the spectrum is known. 1 where the interval holds 0.
pub(super) fn chebyshev_bound(largest: f64, smallest: f64, k: usize) -> f64 {
    if smallest <= 0.0 {
        return 1.0;
    }
    let at_zero = (largest + smallest) / (largest - smallest);
    1.0 / (k as f64 * at_zero.acosh()).cosh()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Closure, Symmetry};

    /// `diag(1, 2, 4)` from `(1, 1, 1)`, read by a rig of 10 counts for a unit.
    fn three_values(photos: usize) -> Result<Run> {
        let mut light = Closure::new(3, 3, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            y.iter_mut().zip(x).zip([10.0, 20.0, 40.0]).for_each(|((y, x), value)| *y = value * x);
            Ok(())
        });
        Run::of(&mut light, &[10.0; 3], (photos, 10.0))
    }

    #[test]
    fn the_polynomial_at_the_eigenvalues_is_the_residual() -> Result<()> {
        let run = three_values(2)?;
        for k in [1, 2] {
            let p = run.residual_polynomial(k);
            assert!((p(0.0) - 1.0).abs() < 1e-14, "{}", p(0.0));
            for (value, x) in [1.0, 2.0, 4.0].into_iter().zip(run.answer(k)) {
                // b is 1 in the units of the light.
                assert!(
                    (p(value) - (1.0 - value * x)).abs() < 1e-12,
                    "rounding at {value}: {} {x}",
                    p(value)
                );
            }
        }
        // One photo of MINRES: p = 1 − λ Σλ / Σλ² = 1 − λ/3.
        assert!((run.residual_polynomial(1)(3.0)).abs() < 1e-12);
        Ok(())
    }

    #[test]
    fn the_monic_polynomial_vanishes_at_its_ritz_values() -> Result<()> {
        let run = three_values(2)?;
        for value in run.ritz_values(2)? {
            assert!(run.monic(2, value).abs() < 1e-12, "{value}");
        }
        // λ² + …: its second difference is 2.
        let second = run.monic(2, 3.0) - 2.0 * run.monic(2, 2.0) + run.monic(2, 1.0);
        assert!((second - 2.0).abs() < 1e-12, "{second}");
        Ok(())
    }

    #[test]
    fn the_interval_promises_nothing_where_it_holds_zero() {
        assert_eq!(chebyshev_bound(1.0, 0.0, 5), 1.0);
        // Degree 1 on [1, 3]: 1 − λ/2 is at most ½.
        assert!((chebyshev_bound(3.0, 1.0, 1) - 0.5).abs() < 1e-15);
    }
}
