//! Options and results of `eigs`.

use super::super::completeness::{Completeness, Confirm};
use super::super::factor::{PairStatus, Which};
use super::super::start::Start;
use super::super::stats::Stats;
use crate::error::{Error, Result};

/// The method for eigenpairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EigsMethod {
    /// Power iteration, the paper's Algorithm 1: the pair of largest magnitude, for any operator. A baseline.
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

/// The options of [`eigs()`](super::eigs()).
#[derive(Clone, Debug)]
pub struct EigsOptions {
    /// The number of eigenpairs. Default 6.
    pub count: usize,
    /// The wanted end of the spectrum. Default: the largest.
    pub which: Which,
    /// The most products (ARPACK's `ncv`, without restarts). Default 50.
    pub products: usize,
    /// Done when every residual norm `‖A y − θ y‖` is at most this share of `‖A‖`; 0 uses the whole budget.
    /// Default 1e-8.
    pub tolerance: f64,
    /// The method. Default: Lanczos.
    pub method: EigsMethod,
    /// The most basis vectors to keep, without the known ones, by thick restarts (Lanczos and block Lanczos);
    /// at least `count + 2 × block + 1`. Restarts slow convergence, but take no product. Default: no restart.
    pub max_basis: Option<usize>,
    /// The norm of the error of a product with a vector of norm 1, for an operator that does not state its own
    /// ([`Operator::standard_errors`](crate::operator::Operator::standard_errors)). Done when all residuals are down
    /// to the noise, more products would change no eigenvalue by more than its standard error, and `½ ln n` further products have found no
    /// eigenvalue that the noise had hidden. A tolerance of 0 uses the whole budget all the same. Default 0.
    pub noise: f64,
    /// The first vector, or the first block ([`Start::block`]). Default: random signs of seed 0.
    pub start: Start,
    /// Known eigenvectors, which are projected out. Default none.
    pub deflate: Vec<Vec<f64>>,
    /// How the search is confirmed beyond its products ([`confirm`](super::confirm())); Lanczos and block Lanczos only. Default none:
    /// the products that are left confirm a search whose subspace was invariant before it ended, and no other.
    pub confirm: Option<Confirm>,
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
            confirm: None,
        }
    }
}

/// The result of [`eigs()`](super::eigs()): `k = min(count, products)` pairs, the most wanted first.
#[derive(Clone, Debug)]
pub struct Eigs {
    /// `k` eigenvalues (their real parts).
    pub values: Vec<f64>,
    /// The imaginary parts of `k` eigenvalues: zero for symmetric operators.
    pub imaginary_values: Vec<f64>,
    /// `k` eigenvectors of length `n` and norm 1 (their real parts), with positive entry of largest
    /// magnitude; orthogonal for a symmetric operator.
    pub vectors: Vec<Vec<f64>>,
    /// The imaginary parts of `k` eigenvectors (with the real part of norm 1): empty for a real pair.
    pub imaginary_vectors: Vec<Vec<f64>>,
    /// `‖A y − θ y‖` of each pair, from the products taken.
    pub residuals: Vec<f64>,
    /// The standard error of each value due to the noise of the products, that of the options or stated by the operator, and due to
    /// systematic errors as far as the products' departure from symmetry shows them:
    /// [`RitzPair::standard_error`](super::super::RitzPair::standard_error). 0 where none is known.
    pub standard_errors: Vec<f64>,
    /// A bound on the distance of each value to an eigenvalue:
    /// [`RitzPair::bound`](super::super::RitzPair::bound), rigorous for symmetric operators.
    pub bounds: Vec<f64>,
    /// The same by Temple and Kato: [`RitzPair::gap_bound`](super::super::RitzPair::gap_bound), sharper, on a
    /// condition.
    pub gap_bounds: Vec<f64>,
    /// The status of each pair.
    pub statuses: Vec<PairStatus>,
    /// `‖H − Hᵀ‖_F / ‖H‖_F` of the operator on the subspace, see
    /// [`Expansion::asymmetry`](super::super::Expansion::asymmetry). 0 for power iteration, which does not
    /// measure it.
    pub asymmetry: f64,
    /// A row for each product of this run.
    pub history: Vec<HistoryRow>,
    /// The number of products in all, and why the search ended.
    pub stats: Stats,
    /// What is known of eigenvalues that the search may have missed.
    pub completeness: Completeness,
    /// The products that confirmed it; `stats` counts those of the same call.
    pub confirming: usize,
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
            return refuse("--block", "a block needs at least one vector".into(), "give at least 1");
        }
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return refuse(
                "EigsOptions::noise",
                format!("the noise is {}", self.noise),
                "give a number from 0 on",
            );
        }
        if let Some(most) = self.max_basis {
            if most < self.count + 2 * block + 1 {
                return refuse(
                    "EigsOptions::max_basis",
                    format!("{most} vectors are too few for {} eigenpairs", self.count),
                    "give at least count + 2 × block + 1",
                );
            }
            if self.method == EigsMethod::Arnoldi {
                return refuse(
                    "EigsOptions::max_basis",
                    "the Arnoldi method has no restarts".into(),
                    "leave it out, or use Lanczos if the operator is symmetric",
                );
            }
        }
        Ok(())
    }
}
