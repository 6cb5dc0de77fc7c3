//! Singular values and vectors by Golub–Kahan bidiagonalization, within a budget of products with `A` and `Aᵀ`.

mod confirm;
mod golub_kahan;

use std::ops::ControlFlow;

use self::golub_kahan::{GolubKahan, Triplet};
use super::completeness::{Completeness, Confirm, confirming};
use super::confirmation::Confirmation;
use super::eigen::HistoryRow;
use super::factor::PairStatus;
use super::powers::{Rescaled, multiply_singular, scaled};
use super::start::Start;
use super::stats::{Stats, Status};
use crate::error::{Error, Result};
use crate::observer::{Estimate, Step};
use crate::operator::Adjoint;

/// What [`singular`] is asked.
#[derive(Clone, Debug)]
pub struct SingularOptions {
    /// How many singular values, the largest first. Default 6.
    pub count: usize,
    /// Products with `A` and with `Aᵀ` at most, in all. Default 50.
    pub products: usize,
    /// Done when each residual is at most this share of the largest singular value. Default 1e-8. Where the noise of the products is above it, done
    /// when more products would change no value by more than its standard error, and `½ ln n` further pairs of products have found no value that the
    /// noise had hidden.
    pub tolerance: f64,
    /// The norm of the error of a product with a unit vector, where the operator does not state it. Default 0.
    pub noise: f64,
    /// The first right vector.
    pub start: Start,
    /// How the search is confirmed beyond its products ([`confirm_singular`]). Default none: the products that are left confirm a
    /// search whose subspace was invariant before it ended, and no other.
    pub confirm: Option<Confirm>,
}

impl Default for SingularOptions {
    fn default() -> Self {
        Self { count: 6, products: 50, tolerance: 1e-8, noise: 0.0, start: Start::default(), confirm: None }
    }
}

/// The result of [`singular`]: `k` triplets `A v = σ u`, `Aᵀ u = σ v`, the largest first.
#[derive(Clone, Debug)]
pub struct Singular {
    /// `σ`, descending.
    pub values: Vec<f64>,
    /// `u`, of length `rows` and norm 1: photos.
    pub left: Vec<Vec<f64>>,
    /// `v`, of length `cols` and norm 1, whose entry of largest magnitude is positive: patterns.
    pub right: Vec<Vec<f64>>,
    /// `√((‖A v − σ u‖² + ‖Aᵀ u − σ v‖²)/2)` from the products that were taken. A singular value of `A` is that near.
    pub residuals: Vec<f64>,
    /// The standard error of each value due to the noise of the products; 0 where none is known.
    pub standard_errors: Vec<f64>,
    /// The status of each triplet.
    pub statuses: Vec<PairStatus>,
    /// `‖R − L‖_F / ‖R‖_F` for `R = UᵀAV` from the products with `A` and `L` the same from those with `Aᵀ`: how far the second are from those of
    /// the transpose. About 1e-16 for a matrix in memory; with noise, the noise; more where the exchanged devices differ.
    pub disagreement: f64,
    /// A row for each pair of products.
    pub history: Vec<HistoryRow>,
    /// The number of products in all, and why the search ended.
    pub stats: Stats,
    /// What is known of singular values that the search may have missed.
    pub completeness: Completeness,
    /// The products that confirmed it; `stats` counts those of the same call.
    pub confirming: usize,
}

pub use confirm::confirm_singular;

/// The largest singular values of `A` (`rows × cols`) and their vectors.
///
/// From a first right vector, `u_j` is `A v_j` and `v_{j+1}` is `Aᵀ u_j`, each made orthogonal to all before: two products a step. In exact
/// arithmetic `A V = U B` for an upper bidiagonal `B`, whose singular values are the answer. Both triangles of coefficients are kept, `R` of the
/// products with `A` and `L` of those with `Aᵀ`; the answer is that of their mean, which has less noise than either.
///
/// It equals Lanczos for `AᵀA` in exact arithmetic, but does not square the errors. Stores `m + 2` vectors for `m` products.
///
/// # Errors
/// [`Error::Option`] naming `--count` or `--photos`; [`Error::Dimension`] for a start of another length; [`Error::Numerical`] for NaN and a start
/// of zeros; whatever a product fails with.
///
/// # References
/// Golub and Kahan, *Calculating the singular values and pseudo-inverse of a matrix* (1965), doi:10.1137/0702016.
pub fn singular(operator: &mut dyn Adjoint, options: &SingularOptions) -> Result<Singular> {
    let mut operator = Rescaled::new(operator);
    let found = singular_of(&mut operator, options);
    let Some(power) = operator.begins_again() else { return found };
    let options = SingularOptions { noise: scaled(options.noise, -power), ..options.clone() };
    let mut found = singular_of(&mut operator, &options)?;
    multiply_singular(&mut found, power)?;
    Ok(found)
}

/// As [`singular`], for an operator of ordinary size.
fn singular_of(operator: &mut dyn Adjoint, options: &SingularOptions) -> Result<Singular> {
    options.check()?;
    let mut process = GolubKahan::new(operator.rows(), operator.cols(), options)?;
    let mut confirmation = Confirmation::new(operator.cols());
    let mut history = Vec::new();
    let mut triplets = Vec::new();
    let status = loop {
        if process.is_exhausted() {
            if options.noise > 0.0 || process.largest_error() > 0.0 {
                break Status::NoiseFloor;
            }
            process.complete();
            triplets = process.triplets(options)?;
            break Status::SpaceExhausted;
        }
        if process.products + 2 > options.products {
            break process.spent(&triplets, options);
        }
        process.step(operator)?;
        triplets = process.triplets(options)?;
        let flow = record(&*operator, &process, &triplets, (options.products, &mut history));
        if let Some(status) = confirmation.end(process.good_enough(&triplets, options)) {
            break status;
        }
        if flow == ControlFlow::Break(()) {
            break Status::Stopped;
        }
    };
    let mut found = answer(&process, &triplets, options, history, status);
    let left = options.products.saturating_sub(found.stats.products);
    let (is_free, _) = confirming(operator, |operator, is_free| {
        let how = Confirm::of(options.confirm, is_free, process.broke_down(), left);
        how.map_or(Ok(()), |how| confirm_singular(operator, &mut found, options, &how))
    })?;
    if !is_free {
        found.stats.products += found.confirming;
    }
    Ok(found)
}

impl SingularOptions {
    fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: &str, help: &str| {
            Err(Error::Option { option: option.into(), fault: fault.into(), help: help.into() })
        };
        if self.count == 0 {
            return refuse("--count", "0 singular values were asked for", "ask for at least 1");
        }
        if self.products < 2 {
            return refuse("--photos", "a step takes one photo there and one back", "give at least 2");
        }
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return refuse("SingularOptions::noise", "the noise is no amount", "give a number from 0 on");
        }
        Ok(())
    }
}

/// The triplets with their vectors.
fn answer(
    process: &GolubKahan,
    triplets: &[Triplet],
    options: &SingularOptions,
    history: Vec<HistoryRow>,
    status: Status,
) -> Singular {
    let wanted = options.tolerance * triplets.first().map_or(0.0, |triplet| triplet.value);
    let each = |of: &dyn Fn(&Triplet) -> f64| -> Vec<f64> { triplets.iter().map(of).collect() };
    let vectors = triplets.iter().map(|triplet| process.vectors(triplet));
    let (left, right) = vectors.map(|[photo, pattern]| (photo, pattern)).unzip();
    Singular {
        values: each(&|triplet| triplet.value),
        left,
        right,
        residuals: each(&|triplet| triplet.residual),
        standard_errors: each(&|triplet| triplet.standard_error),
        statuses: triplets.iter().map(|triplet| triplet.status(wanted)).collect(),
        disagreement: process.disagreement(),
        history,
        stats: Stats { products: process.products, status },
        completeness: if status == Status::SpaceExhausted {
            Completeness::Exact
        } else {
            Completeness::NotExcluded
        },
        confirming: 0,
    }
}

/// Tells the operator's observer of a step, and records it.
fn record(
    operator: &dyn Adjoint,
    process: &GolubKahan,
    triplets: &[Triplet],
    (budget, history): (usize, &mut Vec<HistoryRow>),
) -> ControlFlow<()> {
    let values: Vec<f64> = triplets.iter().map(|triplet| triplet.value).collect();
    let residuals: Vec<f64> = triplets.iter().map(|triplet| triplet.residual).collect();
    let flow = operator.observer().step(&Step {
        stage: "photos",
        done: process.products as u64,
        total: budget as u64,
        estimate: Estimate::Eigenpairs { values: &values, residuals: &residuals },
    });
    history.push(HistoryRow { products: process.products, values, residuals });
    flow
}
