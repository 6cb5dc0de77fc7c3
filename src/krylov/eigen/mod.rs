//! Eigenvalues and eigenvectors within a budget of products, from a start vector or from a given factorization.

mod confirm;
mod power;

use std::ops::ControlFlow;

use power::power;

use super::claim::{MissedPairs, confirming};
use super::completeness::{Completeness, Confirm, FurtherSteps, Recorder, Stats, Status};
use super::factor;
use super::factor::{Factorization, PairStatus, Placed, RitzPair, Which};
use super::powers::{Rescaled, multiply_eigs, scaled};
use super::start::Start;
use crate::error::{Error, Result};
use crate::operator::Operator;

pub use confirm::{Beside, confirm, largest_beside};
use confirm::{Missed, is_due, question, search_missed};

/// A method that finds eigenpairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EigsMethod {
    /// Power iteration, Algorithm 1 in section 4 of the paper: the pair of largest magnitude, for any operator. It serves as a baseline.
    Power,
    /// [`Factorization::lanczos`], for symmetric operators: the best method in nearly all cases.
    #[default]
    Lanczos,
    /// [`Factorization::block_lanczos`], for symmetric operators with repeated eigenvalues.
    BlockLanczos {
        /// The number of vectors in the block, at least 1. The method finds up to this many copies of an eigenvalue.
        block: usize,
    },
    /// [`Factorization::arnoldi`], for any operator. It also finds complex pairs.
    Arnoldi,
}

/// The options of [`eigs()`].
#[derive(Clone, Debug)]
pub struct EigsOptions {
    /// The number of eigenpairs. Default 6.
    pub count: usize,
    /// The wanted end of the spectrum. Default: the largest.
    pub which: Which,
    /// The largest number of products (ARPACK's `ncv`, without restarts). Default 50.
    pub products: usize,
    /// The search ends when every residual norm `‖A y − θ y‖` is at most this share of `‖A‖`. 0 uses the whole budget. Default 1e-8.
    pub tolerance: f64,
    /// The method. Default: Lanczos.
    pub method: EigsMethod,
    /// The largest number of basis vectors to keep, without known vectors; at least `count + 2 × block + 1`. Lanczos and block Lanczos keep
    /// this limit by thick restarts. Restarts slow convergence but take no product. Default: no restart.
    pub max_basis: Option<usize>,
    /// The norm of the error of a product with a vector of norm 1, for an operator that does not state its errors
    /// ([`Operator::standard_errors`]). The search ends when three conditions hold: all residuals are within the noise; more products would
    /// change no eigenvalue by more than its standard error; and `½ ln n` further products have found no eigenvalue that the noise had
    /// hidden. If the tolerance is 0, the search still uses the whole budget. Default 0.
    pub noise: f64,
    /// The first vector, or the first block ([`Start::block`]). Default: [`Start::Random`] with seed 0.
    pub start: Start,
    /// Known eigenvectors to project out. Default none.
    pub deflate: Vec<Vec<f64>>,
    /// The confirmation of the search by further products ([`confirm`](confirm())); Lanczos and block Lanczos only. The default is `None`:
    /// the remaining products confirm the search only if its subspace became invariant before its end.
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

/// The result of [`eigs()`]: `k = min(count, products)` pairs, the most wanted first.
#[derive(Clone, Debug)]
pub struct Eigs {
    /// `k` eigenvalues (their real parts).
    pub values: Vec<f64>,
    /// The imaginary parts of `k` eigenvalues: zero for symmetric operators.
    pub imaginary_values: Vec<f64>,
    /// `k` eigenvectors of length `n` and norm 1 (their real parts). The entry of largest magnitude is positive. They are orthogonal for a
    /// symmetric operator.
    pub vectors: Vec<Vec<f64>>,
    /// The imaginary parts of `k` eigenvectors; empty for a real pair. The real and imaginary parts together have norm 1.
    pub imaginary_vectors: Vec<Vec<f64>>,
    /// `‖A y − θ y‖` of each pair, from the products taken.
    pub residuals: Vec<f64>,
    /// The standard error of each value: [`RitzPair::standard_error`](crate::krylov::RitzPair::standard_error). It covers the noise of the
    /// products, which the options give or the operator states, and the systematic errors that the asymmetry of the products reveals. It is
    /// 0 if no error is known.
    pub standard_errors: Vec<f64>,
    /// A bound on the distance from each value to the nearest eigenvalue: [`RitzPair::bound`](crate::krylov::RitzPair::bound). It is
    /// rigorous for symmetric operators.
    pub bounds: Vec<f64>,
    /// A sharper bound on this distance by Temple and Kato: [`RitzPair::gap_bound`](crate::krylov::RitzPair::gap_bound). It holds only if
    /// the search has missed no eigenvalue within the gap.
    pub gap_bounds: Vec<f64>,
    /// The status of each pair.
    pub statuses: Vec<PairStatus>,
    /// `‖H − Hᵀ‖_F / ‖H‖_F` of the operator on the subspace (see [`Factorization::asymmetry`]). Power iteration does not measure the
    /// asymmetry and returns 0.
    pub asymmetry: f64,
    /// A row for each product of this run.
    pub history: Vec<HistoryRow>,
    /// The total number of products, and the reason for the end of the search.
    pub stats: Stats,
    /// The claim about eigenvalues that the search may have missed.
    pub completeness: Completeness,
    /// The number of products that confirmed the search. `stats` includes them if the same call took them.
    pub confirming: usize,
}

/// The eigenvalues after one product of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryRow {
    /// The number of products so far.
    pub products: usize,
    /// The wanted eigenvalues, the most wanted first. In the first steps there are fewer values than requested.
    pub values: Vec<f64>,
    /// The residual norm `‖A y − θ y‖` of each value.
    pub residuals: Vec<f64>,
}

impl EigsOptions {
    fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| Err(Error::option(option, fault).help(help));
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
        if let Some(confirm) = self.confirm {
            confirm.check()?;
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

/// Finds eigenpairs `A y = θ y` of an operator (`n × n`) by the chosen method, within a budget of products.
///
/// The operator's observer sees each product ([`Estimate::Eigenpairs`](crate::observer::Estimate::Eigenpairs)). The function returns the
/// best pairs so far when the budget ends or the observer stops the search. Lanczos finds only one copy of a repeated eigenvalue, and a
/// block of `b` vectors finds up to `b` copies; [`EigsOptions::confirm`] finds the other copies. [`Eigs::completeness`] states which values
/// may have been missed.
///
/// # Errors
/// [`Error::Option`] naming `--count`, `--photos`, `--block`, `EigsOptions::max_basis`, `EigsOptions::noise`, `--confirm`,
/// `Confirm::chance` or `--which` if its value cannot be used; the errors of [`Factorization::lanczos`] and [`Factorization::expand`]. If
/// an operator fails, the products taken so far are lost. To keep them, make the factorization separately and use [`eigs_from`].
pub fn eigs(operator: &mut dyn Operator, options: &EigsOptions) -> Result<Eigs> {
    let mut operator = Rescaled::new(operator);
    let found = eigs_of(&mut operator, options);
    let Some(power) = operator.begins_again() else { return found };
    let options = EigsOptions { noise: scaled(options.noise, -power), ..options.clone() };
    let mut found = eigs_of(&mut operator, &options)?;
    multiply_eigs(&mut found, power)?;
    Ok(found)
}

fn eigs_of(operator: &mut dyn Operator, options: &EigsOptions) -> Result<Eigs> {
    options.check()?;
    let n = operator.cols();
    let (start, deflate) = (|| options.start.vector(n), &options.deflate);
    let factorization = match options.method {
        EigsMethod::Power => return power(operator, options),
        EigsMethod::Arnoldi => Factorization::arnoldi(&start(), deflate)?,
        EigsMethod::Lanczos => Factorization::lanczos(&start(), deflate)?,
        EigsMethod::BlockLanczos { block } => {
            Factorization::block_lanczos(&options.start.block(n, block), deflate)?
        }
    };
    let mut process = Placed::new(factorization);
    let mut found = eigs_within(&mut process, operator, options)?;
    let broke_down = process.broke_down();
    drop(process);
    if options.method == EigsMethod::Arnoldi || !is_due(operator, &found, options) {
        return Ok(found);
    }
    let left = options.products.saturating_sub(found.stats.products);
    let fits = |more: &MissedPairs<Missed>| more.missed.iter().all(|missed| missed.fits(n));
    let (is_free, claimed) = confirming(operator, question(&found, options), fits, |operator, is_free| {
        let how = Confirm::of(options.confirm, is_free, broke_down, left);
        how.map(|how| search_missed(operator, &mut found, options, &how)).transpose()
    })?;
    if let Some(claimed) = claimed {
        found.claim(claimed, options);
    }
    if !is_free {
        found.stats.products += found.confirming;
    }
    Ok(found)
}

/// Products are taken one by one if every residual is within this factor of its target, because a few products seldom gain a larger factor.
const NEAR: f64 = 1e3;

/// Continues the search of [`eigs()`] from a factorization. `options.products` includes the products already in the factorization.
/// `method`, `start` and `deflate` of the options are ignored. After an error, `factorization` holds all steps up to the product that
/// failed, and another call continues from there. If the operator holds the vectors ([`Operator::vectors`]) and its memory fails, the
/// factorization returns to the last state whose vectors are in the host's memory. Fails with the errors of [`eigs()`].
pub fn eigs_from(
    factorization: &mut Factorization,
    operator: &mut dyn Operator,
    options: &EigsOptions,
) -> Result<Eigs> {
    Placed::within(factorization, |process| eigs_within(process, operator, options))
}

/// Works like [`eigs_from`], but computes no vectors. Returns why the search ended.
pub(crate) fn search_from(
    factorization: &mut Factorization,
    operator: &mut dyn Operator,
    options: &EigsOptions,
) -> Result<Status> {
    Placed::within(factorization, |process| Ok(search(process, operator, options)?.status))
}

fn eigs_within(process: &mut Placed, operator: &mut dyn Operator, options: &EigsOptions) -> Result<Eigs> {
    let Searched { pairs, status, history } = search(process, operator, options)?;
    let stats = Stats { products: process.products(), status };
    let mut found = Found {
        pairs: &pairs,
        vectors: Vec::new(),
        common: Vec::new(),
        imaginary: Vec::new(),
        scale: process.scale(),
        rows: process.n(),
    };
    for pair in &pairs {
        let vector = process.ritz_vector(pair)?;
        found.common.push(operator.common_error(&vector)?);
        found.vectors.push(vector);
        let imaginary = &pair.imaginary_coefficients;
        found.imaginary.push(if pair.is_real() { Vec::new() } else { process.combine(imaginary)? });
    }
    Ok(found.eigs(options, process.asymmetry(), history, stats))
}

/// The last pairs of a search, the reason for its end, and its history.
struct Searched {
    pairs: Vec<RitzPair>,
    status: Status,
    history: Vec<HistoryRow>,
}

/// Takes products until the search ends.
fn search(process: &mut Placed, operator: &mut dyn Operator, options: &EigsOptions) -> Result<Searched> {
    options.check()?;
    let most = options.max_basis.unwrap_or(usize::MAX);
    let left = options.products.saturating_sub(process.products());
    process.place(operator, (process.steps() + left).min(most))?;
    let mut recorder = Recorder::new(options.products);
    let mut further = FurtherSteps::new(process.n());
    let mut pairs = process.ritz(options.which, options.count)?;
    let status = loop {
        if process.is_exhausted() {
            break exhausted(process, options);
        }
        let reached = good_enough(&pairs, options, (process.scale(), process.n()));
        if let Some(status) = further.end(reached) {
            break status;
        }
        if process.products() >= options.products {
            break spent(&pairs, options, process.scale());
        }
        let waiting = process.pending();
        if process.steps() + waiting >= most {
            // The restart also keeps half of the unwanted pairs, so that the next cycle converges faster.
            let keep = options.count + process.steps().saturating_sub(options.count) / 2;
            process.shrink(operator, (options.which, keep.min(most - 2 * waiting)), most)?;
        }
        if !is_near(&pairs, options, process.scale()) {
            process.multiply_block(operator, options.products - process.products())?;
        }
        let step = process.expand(operator)?;
        pairs = process.ritz(options.which, options.count)?;
        let flow = recorder.row(
            operator.observer(),
            process.products(),
            pairs.iter().map(|pair| (pair.value, pair.residual)),
        );
        if step == factor::Step::Exhausted {
            break exhausted(process, options);
        }
        if flow == ControlFlow::Break(()) {
            break Status::Stopped;
        }
    };
    Ok(Searched { pairs, status, history: recorder.history })
}

/// The status if all directions are spanned. The result is exact unless the products have noise.
fn exhausted(factorization: &Factorization, options: &EigsOptions) -> Status {
    let is_noisy = options.noise > 0.0 || factorization.largest_error() > 0.0;
    if is_noisy { Status::NoiseFloor } else { Status::SpaceExhausted }
}

/// Returns true if these pairs may reach the tolerance or the noise within the next block of products. Products are then taken one by one,
/// so that no product is wasted.
fn is_near(pairs: &[RitzPair], options: &EigsOptions, scale: f64) -> bool {
    let target = (options.tolerance * scale).max(options.noise);
    pairs.len() >= options.count && pairs.iter().all(|pair| pair.residual <= NEAR * target.max(pair.rounding))
}

/// The status to end with if these pairs need no further product, else `None`. `scale` and `n` are the norm and the rows of the operator.
fn good_enough(pairs: &[RitzPair], options: &EigsOptions, (scale, n): (f64, usize)) -> Option<Status> {
    if pairs.len() < options.count {
        return None;
    }
    let wanted = options.tolerance * scale;
    if pairs.iter().all(|pair| pair.status(wanted, options.noise) == PairStatus::Converged) {
        return Some(Status::ReachedTolerance);
    }
    let is_settled = |pair: &RitzPair| pair.is_settled(options.noise, n);
    (options.tolerance > 0.0 && pairs.iter().all(is_settled)).then_some(Status::NoiseFloor)
}

fn spent(pairs: &[RitzPair], options: &EigsOptions, scale: f64) -> Status {
    let wanted = options.tolerance * scale;
    let limited = |pair: &RitzPair| pair.status(wanted, options.noise) != PairStatus::NotResolved;
    if pairs.len() >= options.count && pairs.iter().all(limited) {
        Status::NoiseFloor
    } else {
        Status::BudgetSpent
    }
}

struct Found<'a> {
    pairs: &'a [RitzPair],
    vectors: Vec<Vec<f64>>,
    /// [`Operator::common_error`] of each vector.
    common: Vec<f64>,
    imaginary: Vec<Vec<f64>>,
    scale: f64,
    rows: usize,
}

impl Found<'_> {
    fn eigs(self, options: &EigsOptions, asymmetry: f64, history: Vec<HistoryRow>, stats: Stats) -> Eigs {
        let wanted = options.tolerance * self.scale;
        let each = |of: &dyn Fn(&RitzPair) -> f64| -> Vec<f64> { self.pairs.iter().map(of).collect() };
        Eigs {
            values: each(&|pair| pair.value),
            imaginary_values: each(&|pair| pair.imaginary),
            residuals: each(&|pair| pair.residual),
            standard_errors: (self.pairs.iter().zip(&self.common))
                .map(|(pair, common)| pair.standard_error(options.noise, self.rows).hypot(*common))
                .collect(),
            bounds: each(&|pair| pair.bound(options.noise)),
            gap_bounds: each(&|pair| pair.gap_bound(options.noise)),
            statuses: self.pairs.iter().map(|pair| pair.status(wanted, options.noise)).collect(),
            vectors: self.vectors,
            imaginary_vectors: self.imaginary,
            asymmetry,
            history,
            completeness: match stats.status {
                Status::SpaceExhausted => Completeness::Exact,
                _ => Completeness::NotExcluded,
            },
            confirming: 0,
            stats,
        }
    }
}
