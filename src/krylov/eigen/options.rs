//! What is asked for, and what was found.

use super::super::factor::{PairStatus, Which};
use super::super::start::Start;
use super::super::stats::Stats;
use crate::error::{Error, Result};

/// How eigenpairs are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EigsMethod {
    /// Power iteration, the paper's Algorithm 1: one pair, that of largest magnitude. For any operator; to compare
    /// against. Three vectors of length `n`.
    Power,
    /// [`Lanczos`](super::super::Lanczos), for symmetric operators: the best in nearly all cases.
    #[default]
    Lanczos,
    /// [`BlockLanczos`](super::super::BlockLanczos), for symmetric operators with repeated eigenvalues.
    BlockLanczos {
        /// Vectors in the block, at least 1: as many copies of an eigenvalue are found.
        block: usize,
    },
    /// [`Arnoldi`](super::super::Arnoldi), for any operator: complex pairs.
    Arnoldi,
}

/// What [`eigs()`](super::eigs()) is asked for.
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
    /// How. Default: Lanczos.
    pub method: EigsMethod,
    /// Keep no more than this many basis vectors (known ones not counted), by thick restarts (Lanczos and block
    /// Lanczos). At least `count + 2 × block + 1`. Restarts cost convergence but no product of their own. Default: as many
    /// as there are products, so that there is no restart.
    pub max_basis: Option<usize>,
    /// The norm of the error of a product with a vector of norm 1. Done when all residuals are down to it. Default 0.
    pub noise: f64,
    /// The first vector; of a block the first ones ([`Start::block`]). Default: random signs of seed 0.
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
            method: EigsMethod::default(),
            max_basis: None,
            noise: 0.0,
            start: Start::default(),
            deflate: Vec::new(),
        }
    }
}

/// What [`eigs()`](super::eigs()) found: `k = min(count, products)` pairs, the most wanted first.
#[derive(Clone, Debug)]
pub struct Eigs {
    /// `k` eigenvalues (their real parts).
    pub values: Vec<f64>,
    /// The imaginary parts of `k` eigenvalues: zero for symmetric operators.
    pub imaginary_values: Vec<f64>,
    /// `k` eigenvectors of length `n` and norm 1 (their real parts). Of symmetric operators they are orthogonal, and
    /// the entry of largest magnitude is positive.
    pub vectors: Vec<Vec<f64>>,
    /// The imaginary parts of `k` eigenvectors (with the real part of norm 1): empty for a real pair.
    pub imaginary_vectors: Vec<Vec<f64>>,
    /// `‖A y − θ y‖` of each pair, as the products tell.
    pub residuals: Vec<f64>,
    /// How far each value is from an eigenvalue at most: [`RitzPair::bound`](super::super::RitzPair::bound), rigorous for
    /// symmetric operators.
    pub bounds: Vec<f64>,
    /// The same by Temple and Kato: [`RitzPair::gap_bound`](super::super::RitzPair::gap_bound), sharper, on a condition.
    pub gap_bounds: Vec<f64>,
    /// What can be said of each pair.
    pub verdicts: Vec<PairStatus>,
    /// `‖H − Hᵀ‖_F / ‖H‖_F` of the operator on the subspace, see
    /// [`Expansion::asymmetry`](super::super::Expansion::asymmetry). 0 for power iteration, which cannot tell.
    pub asymmetry: f64,
    /// A row for each product of this run.
    pub history: Vec<HistoryRow>,
    /// Products in all, and why it ended.
    pub stats: Stats,
}

/// The eigenvalues after one product of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryRow {
    /// Products taken so far.
    pub products: usize,
    /// The wanted eigenvalues, the most wanted first; fewer than asked for in the first steps.
    pub values: Vec<f64>,
    /// The residual norm `‖A y − θ y‖` of each.
    pub residuals: Vec<f64>,
}

impl EigsOptions {
    pub(super) fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| {
            Err(Error::Option { option: option.into(), fault, help: help.into() })
        };
        for (value, option, what) in
            [(self.count, "--count", "eigenpairs"), (self.products, "--photos", "products")]
        {
            if value == 0 {
                return refuse(option, format!("0 {what} were asked for"), "ask for at least 1");
            }
        }
        let block = match self.method {
            EigsMethod::BlockLanczos { block } => block,
            _ => 1,
        };
        if block == 0 {
            return refuse("--block", "0 vectors are no block".into(), "give at least 1");
        }
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return refuse("--noise", format!("{} is no noise level", self.noise), "give a number from 0 on");
        }
        if let Some(most) = self.max_basis {
            if most < self.count + 2 * block + 1 {
                return refuse(
                    "--max-basis",
                    format!("{most} vectors are too few for {} eigenpairs", self.count),
                    "give at least count + 2 × block + 1",
                );
            }
            if self.method == EigsMethod::Arnoldi {
                return refuse(
                    "--max-basis",
                    "the Arnoldi method has no restarts".into(),
                    "leave it out, or use Lanczos if the operator is symmetric",
                );
            }
        }
        Ok(())
    }
}
