//! How good an answer is, by light that it was not computed from.
//!
//! The answers of a scene are computed with a matrix from a finite number of light paths, and its noise is frozen: an eigenvector fits the noise of
//! its matrix as well as the light. The same matrix therefore cannot tell how good the eigenvector is. Light paths of another seed can
//! ([`Retraced::estimated_products`](crate::transport::Retraced::estimated_products)); on a rig, a photo that was not used.

use crate::krylov::{Eigs, temple_kato};
use crate::transport::EstimatedProduct;

/// An eigenpair of the scene itself, as opposed to that of a matrix with noise.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct EigenpairEstimate {
    /// The eigenvalue: the mean of the matrix's own, `θ = uᵀ Â u`, and of `q = uᵀ A' u` by independent light. `u` fits the noise `E` of
    /// `Â`, so that `θ` is too large by about `Σ_k (u_kᵀ E u)² / (λ − λ_k)`, and `q` is too small by as much: their mean has no error of
    /// second order.
    pub value: f64,
    /// Its standard error. It counts what more photos would change, too.
    pub standard_error: f64,
    /// `q`, with its standard error by the noise of the independent light alone: how much of its light the eigenvector really keeps.
    pub quotient: [f64; 2],
    /// `‖A u − q u‖` by independent light, without the noise of the latter: there is an eigenvalue of the scene within this distance of `q`, and
    /// a photo of `u` differs from `q u` by this much. `None` where it was not asked for.
    pub residual: Option<f64>,
}

impl EigenpairEstimate {
    /// How far the matrix's own eigenvalue may be from that of the scene: what is known of its bias, with the standard error.
    pub fn error_of(&self, theta: f64) -> f64 {
        self.standard_error.hypot(theta - self.value)
    }
}

/// The part of half the difference `θ − q` that counts as an error of their mean where eigenvalues are nearer to each other than that: their errors
/// of second order do then not cancel. The part was chosen on the scenes zigzag and cornell; `cargo bench --bench stated_errors`
/// judges it on others.
const NOT_CANCELLED: f64 = 2.0 / 3.0;

/// The eigenpairs of the scene from those of a symmetric matrix and the independent products of their eigenvectors, one for each. `None`
/// where pairs are complex or the products state no quadratic form.
pub fn eigenpair_estimates(found: &Eigs, independent: &[EstimatedProduct]) -> Option<Vec<EigenpairEstimate>> {
    if found.imaginary_values.iter().any(|&value| value != 0.0) || found.values.len() != independent.len() {
        return None;
    }
    let of = |(index, independent): (usize, &EstimatedProduct)| {
        let [quadratic, error] = independent.quadratic?;
        let theta = found.values[index];
        let unconverged = found.gap_bounds[index].min(found.residuals[index]);
        let scaled: Vec<f64> = found.vectors[index].iter().map(|u| quadratic * u).collect();
        let squares = independent.squares(&scaled);
        Some(EigenpairEstimate {
            residual: Some((squares.difference - squares.noise).max(0.0).sqrt()),
            ..eigenvalue_estimate(&found.values, index, unconverged, [quadratic - theta, error])
        })
    };
    independent.iter().enumerate().map(of).collect()
}

/// The eigenvalues of the scene from those of the normalized cut of a matrix, with the residuals of their eigenvectors; of each, independent light says by
/// [`Question::shift`](crate::transport::Question::shift) what it is off. `None` where the products state no quadratic form.
pub fn cut_estimates(
    values: &[f64],
    residuals: &[f64],
    independent: &[EstimatedProduct],
) -> Option<Vec<EigenpairEstimate>> {
    let of = |(index, independent): (usize, &EstimatedProduct)| {
        let unconverged = temple_kato(residuals[index], gap(values, index));
        Some(eigenvalue_estimate(values, index, unconverged, independent.quadratic?))
    };
    independent.iter().enumerate().map(of).collect()
}

/// The estimate of the eigenvalue `index` among `values` of a matrix, which more photos would change by about `unconverged`; independent light
/// says with a standard error how much its own quotient is above it. The residual is not known.
fn eigenvalue_estimate(
    values: &[f64],
    index: usize,
    unconverged: f64,
    [above, error]: [f64; 2],
) -> EigenpairEstimate {
    let theta = values[index];
    // The mean of two values of about the same variance.
    let noise = error / std::f64::consts::SQRT_2;
    let half = 0.5 * above.abs();
    let not_cancelled = NOT_CANCELLED * half * (half / gap(values, index)).min(1.0);
    EigenpairEstimate {
        value: theta + 0.5 * above,
        standard_error: noise.hypot(unconverged).hypot(not_cancelled),
        quotient: [theta + above, error],
        residual: None,
    }
}

/// The distance from one value to the nearest other: infinite where there is none, and never 0.
fn gap(values: &[f64], index: usize) -> f64 {
    let others = values.iter().enumerate().filter(|(other, _)| *other != index);
    let distances = others.map(|(_, value)| (value - values[index]).abs());
    distances.fold(f64::INFINITY, f64::min).max(f64::MIN_POSITIVE)
}
