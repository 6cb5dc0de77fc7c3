//! `eigs`: a few eigenpairs within a budget of products.

use std::ops::ControlFlow;

use super::eigenpairs::{RitzPair, Which};
use super::lanczos::{Lanczos, Step};
use super::monitor::{HistoryRow, Monitor, Progress};
use super::start::Start;
use super::stats::{Stats, Status};
use crate::error::{Error, Result};
use crate::operator::Operator;

/// What [`eigs()`] is asked for.
#[derive(Clone, Debug)]
pub struct EigsOptions {
    /// How many eigenpairs. Default 6.
    pub count: usize,
    /// At which end of the spectrum. Default: the largest.
    pub which: Which,
    /// How many products at most (ARPACK's `ncv`, without restarts). Default 50.
    pub products: usize,
    /// Done when every residual norm `‖A y − θ y‖` is at most this share of `‖A‖`. 0 spends the whole budget. Default
    /// 1e-8.
    pub tolerance: f64,
    /// The first vector. Default: random signs of seed 0.
    pub start: Start,
    /// Known eigenvectors, kept out of the search. Default none.
    pub deflate: Vec<Vec<f64>>,
}

impl Default for EigsOptions {
    fn default() -> Self {
        Self {
            count: 6,
            which: Which::default(),
            products: 50,
            tolerance: 1e-8,
            start: Start::default(),
            deflate: Vec::new(),
        }
    }
}

/// What [`eigs()`] found: `k = min(count, products)` pairs, the most wanted first.
#[derive(Clone, Debug)]
pub struct Eigs {
    /// `k` eigenvalues.
    pub values: Vec<f64>,
    /// `k` eigenvectors of length `n` and norm 1, orthogonal; the entry of largest magnitude is positive.
    pub vectors: Vec<Vec<f64>>,
    /// `‖A y − θ y‖` of each pair.
    pub residuals: Vec<f64>,
    /// Whether each pair is within the tolerance.
    pub resolved: Vec<bool>,
    /// `‖H − Hᵀ‖_F / ‖H‖_F` of the operator on the subspace, see [`Lanczos::asymmetry`].
    pub asymmetry: f64,
    /// A row for each product of this run.
    pub history: Vec<HistoryRow>,
    /// Products in all, and why it ended.
    pub stats: Stats,
}

/// Eigenpairs `A y = θ y` of a symmetric operator by the Lanczos process, within a budget of products.
///
/// Returns the best so far when the budget ends or the monitor stops it. A repeated eigenvalue is found once: its
/// further copies come only with an exactly invariant subspace, or when rounding has let them grow.
///
/// # Errors
/// [`Error::Option`] naming `--count` or `--photos` when either is 0; else as [`Lanczos::new`] and
/// [`Lanczos::expand`]. To keep what was taken before an operator failed, hold the factorization yourself and use
/// [`eigs_from`].
pub fn eigs(operator: &mut dyn Operator, options: &EigsOptions, monitor: &mut Monitor<'_>) -> Result<Eigs> {
    let mut lanczos = Lanczos::new(&options.start.vector(operator.cols()), &options.deflate)?;
    eigs_from(&mut lanczos, operator, options, monitor)
}

/// As [`eigs()`], going on from a factorization; `options.products` counts the products already in it, while `start`
/// and `deflate` are not looked at. After an error, `lanczos` holds everything up to the product that failed: call
/// this again to go on.
///
/// # Errors
/// As [`eigs()`].
pub fn eigs_from(
    lanczos: &mut Lanczos,
    operator: &mut dyn Operator,
    options: &EigsOptions,
    monitor: &mut Monitor<'_>,
) -> Result<Eigs> {
    check(options)?;
    let mut history = Vec::new();
    let mut pairs = lanczos.ritz(options.which, options.count)?;
    let status = loop {
        if lanczos.is_exhausted() {
            break Status::SpaceExhausted;
        }
        if lanczos.steps() >= options.products {
            break if within_tolerance(lanczos, &pairs, options) {
                Status::ReachedTolerance
            } else {
                Status::BudgetSpent
            };
        }
        if within_tolerance(lanczos, &pairs, options) {
            break Status::ReachedTolerance;
        }
        let step = lanczos.expand(operator)?;
        pairs = lanczos.ritz(options.which, options.count)?;
        let values: Vec<f64> = pairs.iter().map(|pair| pair.value).collect();
        let residuals: Vec<f64> = pairs.iter().map(|pair| pair.residual).collect();
        let products = lanczos.products();
        let progress =
            Progress { products, budget: options.products, values: &values, residuals: &residuals };
        let verdict = monitor(&progress);
        history.push(HistoryRow { products, values, residuals });
        if step == Step::Exhausted {
            break Status::SpaceExhausted;
        }
        if verdict == ControlFlow::Break(()) {
            break Status::Stopped;
        }
    };
    Ok(Eigs {
        values: pairs.iter().map(|pair| pair.value).collect(),
        vectors: pairs.iter().map(|pair| lanczos.ritz_vector(pair)).collect(),
        residuals: pairs.iter().map(|pair| pair.residual).collect(),
        resolved: pairs.iter().map(|pair| pair.is_resolved(options.tolerance, lanczos.scale())).collect(),
        asymmetry: lanczos.asymmetry(),
        history,
        stats: Stats { products: lanczos.products(), status },
    })
}

fn within_tolerance(lanczos: &Lanczos, pairs: &[RitzPair], options: &EigsOptions) -> bool {
    pairs.len() == options.count
        && pairs.iter().all(|pair| pair.is_resolved(options.tolerance, lanczos.scale()))
}

fn check(options: &EigsOptions) -> Result<()> {
    for (value, option, what) in
        [(options.count, "--count", "eigenpairs"), (options.products, "--photos", "products")]
    {
        if value == 0 {
            return Err(Error::Option {
                option: option.into(),
                fault: format!("0 {what} were asked for"),
                help: "ask for at least 1".into(),
            });
        }
    }
    Ok(())
}
