//! The polynomials of section 4 of the paper (equations 1 to 3, and the minimization that follows them). They show the information about
//! a matrix in `k` photos of a Krylov method.
//!
//! Every vector of the Krylov subspace `span{b, A b, …, A^{k−1} b}` is `q(A) b` for a polynomial `q`. The residual of MINRES and GMRES is
//! `p(A) b` for a polynomial `p` of degree `k` with `p(0) = 1`. Among all such polynomials, `p` minimizes the norm
//! `‖p(A) b‖² = Σ p(λ_i)² (u_iᵀ b)²`, where `λ_i` and `u_i` are the eigenpairs of `A`. The process ends when `p` vanishes on all
//! eigenvalues whose eigenvectors have a part in `b`. This `p` is the minimal polynomial of `A` for `b`. The monic polynomial of least
//! norm after `k` photos has the Ritz values as its zeros.

use super::bench::{Bench, Set};
use super::check::Check;
use super::contest::{TargetLight, percent};
use super::figure::{Figure, Plot, Points, Reproduced, counted};
use super::vectors::{Spectrum, add, spectrum, spectrum_of_rows};
use crate::error::Result;
use crate::krylov::{Factorization, dot, norm};
use crate::lab::text::decimal;
use crate::operator::Operator;
use crate::transport::Part;

const SIDE: usize = 32;
const PHOTOS: usize = 20;
const SHOWN: [usize; 4] = [1, 2, 3, 5];
const JUDGED: usize = 5;
const POINTS: usize = 400;

pub(super) fn reproduce(bench: &mut Bench) -> Result<Reproduced> {
    let stage = bench.stage(Set::Corner, SIDE.min(bench.side(100)))?;
    let exact = spectrum(&stage.traced.matrix.to_csr(Part::Full, 0)?)?;
    let photos = &mut bench.photos(&stage, Part::Full)?;
    let target_light = TargetLight::new(&stage, photos, 0.0)?;
    let unit = norm(&target_light.wanted()) / norm(&target_light.light);
    let run = Run::of(photos, &target_light.wanted(), (PHOTOS, unit))?;

    let shares: Vec<f64> = exact.vectors.iter().map(|vector| dot(vector, &target_light.light)).collect();
    let scale = norm(&target_light.light);
    let predicted = |run: &Run, k: usize| {
        let minres = run.residual_polynomial(k);
        let squares = exact.values.iter().zip(&shares).map(|(&value, share)| (minres(value) * share).powi(2));
        squares.sum::<f64>().sqrt() / scale
    };
    let seen = |run: &Run, k: usize| target_light.residual(&run.answer(k));
    let [largest, smallest] = [exact.values[0], exact.values[exact.values.len() - 1]];
    let by_condition = chebyshev_bound(largest, smallest, JUDGED);
    let ends = [0.0_f64.min(smallest), largest];
    // The same process on the matrix itself, which has no devices.
    let by_light = Run::of(&mut bench.truth(&stage, Part::Full)?, &target_light.light, (PHOTOS, 1.0))?;
    let worst = |ratio: &dyn Fn(usize) -> f64| (1..=3).map(ratio).fold(0.0, f64::max);
    let checks = vec![
        Check::of(format!(
            "residual of {JUDGED} photos of MINRES, over the error bound from the condition number alone"
        ))
        .at_most(seen(&run, JUDGED) / by_condition, 0.5)
        .refutes("2 photos", seen(&run, 2) / by_condition)
        .without_devices(seen(&by_light, JUDGED) / by_condition),
        Check::of(
            "residual over the norm of its polynomial on the true spectrum, the worst of 1 to 3 photos",
        )
        .at_most(worst(&|k| seen(&run, k) / predicted(&run, k)), 1.2)
        .refutes("the polynomial of the next degree", worst(&|k| seen(&run, k) / predicted(&run, k + 1)))
        .without_devices(worst(&|k| seen(&by_light, k) / predicted(&by_light, k))),
        Check::of(format!("residual of {JUDGED} photos of MINRES, %")).stated(percent(seen(&run, JUDGED))),
        Check::of(format!("norm of the residual polynomial of {JUDGED} photos on the true spectrum, %"))
            .stated(percent(predicted(&run, JUDGED))),
        Check::of("error bound from the condition number alone (Chebyshev), %").stated(percent(by_condition)),
        Check::of("smallest eigenvalue over the largest").stated(smallest / largest),
        Check::of(format!(
            "norm of the monic polynomial of degree {PHOTOS}, its root over the largest eigenvalue"
        ))
        .stated(run.monic_norms().last().map_or(f64::NAN, |norm| norm / largest)),
    ];
    Ok(Reproduced {
        setting: format!("corner, {}, MINRES from the target's light, {PHOTOS} photos", stage.resolution),
        checks,
        plots: vec![
            residual_plot(&run, ends),
            share_plot(&exact, &shares, scale),
            minimal_plot(&run, ends),
            monic_plot(&run, largest),
        ],
        photos: 1 + PHOTOS,
        ..Reproduced::of(Figure::Polynomials, bench.rig())
    })
}

fn curve([low, high]: [f64; 2], of: impl Fn(f64) -> f64) -> Points {
    let at = |index: usize| low + (high - low) * index as f64 / (POINTS - 1) as f64;
    (0..POINTS).map(|index| (at(index), of(at(index)))).collect()
}

fn photos_named(k: usize) -> String {
    if k == 1 { "1 photo".into() } else { format!("{k} photos") }
}

fn residual_plot(run: &Run, ends: [f64; 2]) -> Plot {
    let caption = "Residual polynomials of MINRES: all are 1 at 0, and the residual's part along an eigenvector is the target's times the value \
                   at its eigenvalue. They are small where the target has its light, which the next plot shows.";
    let lines = SHOWN.map(|k| (photos_named(k), curve(ends, run.residual_polynomial(k))));
    Plot::linear(caption, ["eigenvalue λ, W/(m² sr)", "p(λ)"], lines).marked(0.0, "")
}

/// The plot of two cumulative fractions of the spectrum: of the number of eigenvalues, and of the target's light in their eigenvectors.
fn share_plot(exact: &Spectrum, shares: &[f64], scale: f64) -> Plot {
    let steps = |of: &dyn Fn(usize) -> f64| -> Points {
        let mut sum = 0.0;
        let ascending = (0..exact.values.len()).rev();
        let points = ascending.map(|at| {
            sum += of(at);
            (exact.values[at], sum)
        });
        points.collect()
    };
    let count = exact.values.len() as f64;
    Plot::linear(
        "The spectrum: the share of the eigenvalues that are no larger than λ, and of the square of the target's light in their \
                  eigenvectors.",
        ["eigenvalue λ, W/(m² sr)", "share"],
        [
            ("eigenvalues", steps(&|_| 1.0 / count)),
            ("light of the target", steps(&|at| (shares[at] / scale).powi(2))),
        ],
    )
}

fn minimal_plot(run: &Run, ends: [f64; 2]) -> Plot {
    let line = |k: usize| {
        let mut points = curve(ends, |value| run.monic(k, value));
        let most = points.iter().map(|point| point.1.abs()).fold(0.0, f64::max);
        points.iter_mut().for_each(|point| point.1 /= most);
        (photos_named(k), points)
    };
    let found = run.ritz_values(JUDGED).unwrap_or_default();
    let list = found.iter().map(|value| decimal(*value, 4)).collect::<Vec<_>>().join(", ");
    let caption = format!(
        "Towards the minimal polynomial: the monic polynomial of each degree with the least norm on the target's light, here divided by its \
         largest value. Its zeros are the Ritz values, after {JUDGED} photos {list}. Where it vanished on all eigenvalues it would be the \
         minimal polynomial, and the answer exact."
    );
    Plot::linear(caption, ["eigenvalue λ, W/(m² sr)", "q(λ) / max |q|"], SHOWN.map(line)).marked(0.0, "")
}

fn monic_plot(run: &Run, largest: f64) -> Plot {
    let norms: Vec<f64> = run.monic_norms().iter().map(|norm| norm / largest).collect();
    Plot::logarithmic(
        "The norm of the monic polynomial of each degree, its k-th root over the largest eigenvalue. It would fall to 0 at the degree of the \
         minimal polynomial; the light of a scene has no such degree below the number of its pixels, and what the line approaches tells \
         how densely the spectrum is filled.",
        ["photos", "‖q(A) b‖^(1/k) / λ₁"],
        [("monic polynomial", counted(&norms))],
    )
}

/// A Lanczos process from the target's light `b`, in units of the light itself.
struct Run {
    /// The norm `‖b‖`.
    length: f64,
    alphas: Vec<f64>,
    betas: Vec<f64>,
    basis: Vec<Vec<f64>>,
    /// The rig's reading for 1 W/(m² sr).
    unit: f64,
}

impl Run {
    /// Runs the process from `b` for this number of photos, on a rig that reads `unit` for 1 W/(m² sr).
    fn of(operator: &mut dyn Operator, b: &[f64], (photos, unit): (usize, f64)) -> Result<Self> {
        let mut process = Factorization::lanczos(b, &[])?;
        for _ in 0..photos {
            process.expand(operator)?;
        }
        let scaled = |values: Vec<f64>| values.into_iter().map(|value| value / unit).collect();
        let (alphas, betas) = (scaled(process.alphas()), scaled(process.betas()));
        Ok(Self { length: norm(b), alphas, betas, basis: process.basis().to_vec(), unit })
    }

    /// The coefficients `y` of the MINRES solution `V y` after `k` photos: least squares of `‖b‖ e₁ − T y` with `T` of size `(k + 1) × k`.
    fn coefficients(&self, k: usize) -> Vec<f64> {
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

    fn answer(&self, k: usize) -> Vec<f64> {
        let mut answer = vec![0.0; self.basis[0].len()];
        for (share, vector) in self.coefficients(k).iter().zip(&self.basis) {
            add(&mut answer, share / self.unit, vector);
        }
        answer
    }

    /// The values `φ_1(λ) … φ_{k+1}(λ)` with `v_j = φ_j(A) b / ‖b‖`, by the three-term recurrence of the process.
    fn basis_polynomials(&self, k: usize, value: f64) -> Vec<f64> {
        let mut found = vec![1.0];
        for j in 0..k {
            let before = if j > 0 { self.betas[j - 1] * found[j - 1] } else { 0.0 };
            found.push(((value - self.alphas[j]) * found[j] - before) / self.betas[j]);
        }
        found
    }

    /// The residual polynomial `p(λ) = 1 − λ Σ y_j φ_j(λ) / ‖b‖` of MINRES after `k` photos.
    fn residual_polynomial(&self, k: usize) -> impl Fn(f64) -> f64 {
        let coefficients = self.coefficients(k);
        move |value| {
            let answer = dot(&coefficients, &self.basis_polynomials(k, value)[..k]);
            1.0 - value * answer / self.length
        }
    }

    /// The monic polynomial of degree `k` with the Ritz values as zeros: `β_1 … β_k φ_{k+1}`.
    fn monic(&self, k: usize, value: f64) -> f64 {
        let scale: f64 = self.betas[..k].iter().product();
        scale * self.basis_polynomials(k, value)[k]
    }

    /// The relative norm `(‖q_k(A) b‖ / ‖b‖)^{1/k}` of the monic polynomial `q_k` of each degree, the geometric mean of the `β`s.
    fn monic_norms(&self) -> Vec<f64> {
        let mut logarithm = 0.0;
        let mean = |(k, beta): (usize, &f64)| {
            logarithm += beta.ln();
            (logarithm / (k as f64 + 1.0)).exp()
        };
        self.betas.iter().enumerate().map(mean).collect()
    }

    /// The Ritz values after `k` photos, the zeros of the monic polynomial.
    fn ritz_values(&self, k: usize) -> Result<Vec<f64>> {
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 => self.alphas[i],
            1 => self.betas[i.min(j)],
            _ => 0.0,
        };
        let rows: Vec<Vec<f64>> = (0..k).map(|i| (0..k).map(|j| entry(i, j)).collect()).collect();
        Ok(spectrum_of_rows(&rows)?.values)
    }
}

/// The guarantee after `k` photos if only the interval `[smallest, largest]` of the spectrum is known. By Chebyshev, it is the smallest
/// possible maximum of a residual polynomial of degree `k` there. It is 1 if the interval contains 0.
fn chebyshev_bound(largest: f64, smallest: f64, k: usize) -> f64 {
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

    /// A process for `diag(1, 2, 4)` from `(1, 1, 1)`, on a rig that reads 10 counts per unit.
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
                // Each entry of b is 1 in the units of the light.
                assert!(
                    (p(value) - (1.0 - value * x)).abs() < 1e-12,
                    "rounding at {value}: {} {x}",
                    p(value)
                );
            }
        }
        // One photo of MINRES gives p = 1 − λ Σλ / Σλ² = 1 − λ/3.
        assert!((run.residual_polynomial(1)(3.0)).abs() < 1e-12);
        Ok(())
    }

    #[test]
    fn the_monic_polynomial_vanishes_at_its_ritz_values() -> Result<()> {
        let run = three_values(2)?;
        for value in run.ritz_values(2)? {
            assert!(run.monic(2, value).abs() < 1e-12, "{value}");
        }
        // The polynomial is λ² + …, and its second difference is 2.
        let second = run.monic(2, 3.0) - 2.0 * run.monic(2, 2.0) + run.monic(2, 1.0);
        assert!((second - 2.0).abs() < 1e-12, "{second}");
        Ok(())
    }

    #[test]
    fn the_interval_promises_nothing_where_it_holds_zero() {
        assert_eq!(chebyshev_bound(1.0, 0.0, 5), 1.0);
        // The polynomial of degree 1 on [1, 3] is 1 − λ/2. Its largest value is ½.
        assert!((chebyshev_bound(3.0, 1.0, 1) - 0.5).abs() < 1e-15);
    }
}
