//! Singular values and vectors by Golub–Kahan bidiagonalization, within a budget of products with `A` and `Aᵀ`.

mod golub_kahan;

use std::ops::ControlFlow;

use golub_kahan::{GolubKahan, Triplet};
use serde::{Deserialize, Serialize};

use super::claim::{ClaimQuestion, Claimed, MissedPairs, confirming};
use super::completeness::{
    Completeness, Confirm, Confirmable, FurtherSteps, Recorder, Stats, Status, confirm_by, confirming_step,
    slack,
};
use super::eigen::HistoryRow;
use super::factor::PairStatus;
use super::powers::{Rescaled, multiply_singular, scaled};
use super::start::{Start, seed_of};
use crate::error::{Error, Result};
use crate::operator::Adjoint;

/// The options of [`singular`].
#[derive(Clone, Debug)]
pub struct SingularOptions {
    /// The number of singular values, the largest first. Default 6.
    pub count: usize,
    /// The largest number of products with `A` and `Aᵀ` together. Default 50.
    pub products: usize,
    /// The search ends when each residual is at most this share of the largest singular value. Default 1e-8. If the noise of the products
    /// is above this tolerance, the search ends when two conditions hold: more products would change no value by more than its standard
    /// error, and `½ ln n` further pairs of products have found no value that the noise had hidden.
    pub tolerance: f64,
    /// The norm of the error of a product with a unit vector, for an operator that does not state its errors. Default 0.
    pub noise: f64,
    /// The first right vector.
    pub start: Start,
    /// The confirmation of the search by further products ([`confirm_singular`]). The default is `None`: the remaining products confirm the
    /// search only if its subspace became invariant before its end.
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
    /// `v`, of length `cols` and norm 1: patterns. The entry of largest magnitude is positive.
    pub right: Vec<Vec<f64>>,
    /// `√((‖A v − σ u‖² + ‖Aᵀ u − σ v‖²)/2)` from the products already taken. A singular value of `A` lies within this distance of `σ`.
    pub residuals: Vec<f64>,
    /// The standard error of each value due to the noise of the products; 0 if no error is known.
    pub standard_errors: Vec<f64>,
    /// The status of each triplet.
    pub statuses: Vec<PairStatus>,
    /// `‖R − L‖_F / ‖R‖_F`, where `R = UᵀAV` comes from the products with `A`, and `L` is the same matrix from the products with `Aᵀ`. It
    /// measures how far the products with `Aᵀ` differ from products with the true transpose. It is about 1e-16 for a matrix in memory. For
    /// noisy products it is their relative noise, and more if the exchanged devices differ.
    pub disagreement: f64,
    /// A row for each pair of products.
    pub history: Vec<HistoryRow>,
    /// The total number of products, and the reason for the end of the search.
    pub stats: Stats,
    /// The claim about singular values that the search may have missed.
    pub completeness: Completeness,
    /// The number of products that confirmed the search. `stats` includes them if the same call took them.
    pub confirming: usize,
}

/// Finds the largest singular values of `A` (`rows × cols`) and their vectors.
///
/// The process begins with a first right vector. `u_j` is `A v_j` and `v_{j+1}` is `Aᵀ u_j`, each orthogonalized against all earlier
/// vectors and normalized. A step takes two products. In exact arithmetic, `A V = U B` for an upper bidiagonal `B` with the wanted singular
/// values. The process keeps all coefficients: `R` of the products with `A` and `L` of the products with `Aᵀ`. The singular values come
/// from the mean of `R` and `L`, which has less noise than either matrix.
///
/// In exact arithmetic, the process equals Lanczos for `AᵀA`, but it does not square the errors. The method stores `m + 2` vectors for `m`
/// products.
///
/// References: Golub and Kahan, *Calculating the singular values and pseudo-inverse of a matrix* (1965), doi:10.1137/0702016.
///
/// # Errors
/// [`Error::Option`] naming `--count`, `--photos`, `--confirm` or `Confirm::chance`; [`Error::Dimension`] for a start of another length;
/// [`Error::Numerical`] for NaN or a start of zeros; the error of a product.
pub fn singular(operator: &mut dyn Adjoint, options: &SingularOptions) -> Result<Singular> {
    let mut operator = Rescaled::new(operator);
    let found = singular_of(&mut operator, options);
    let Some(power) = operator.begins_again() else { return found };
    let options = SingularOptions { noise: scaled(options.noise, -power), ..options.clone() };
    let mut found = singular_of(&mut operator, &options)?;
    multiply_singular(&mut found, power)?;
    Ok(found)
}

/// Does the work of [`singular`] for an operator of ordinary size.
fn singular_of(operator: &mut dyn Adjoint, options: &SingularOptions) -> Result<Singular> {
    options.check()?;
    let mut process = GolubKahan::new(operator.rows(), operator.cols(), options)?;
    process.upload(operator, options.products)?;
    let mut further = FurtherSteps::new(operator.cols());
    let mut recorder = Recorder::new(options.products);
    let mut triplets = Vec::new();
    let status = loop {
        if process.is_exhausted() {
            if options.noise > 0.0 || process.largest_error() > 0.0 {
                break Status::NoiseFloor;
            }
            process.complete()?;
            triplets = process.triplets(options)?;
            break Status::SpaceExhausted;
        }
        if process.products + 2 > options.products {
            break process.spent(&triplets, options);
        }
        process.step(operator)?;
        triplets = process.triplets(options)?;
        let pairs = triplets.iter().map(|triplet: &Triplet| (triplet.value, triplet.residual));
        let flow = recorder.row(operator.observer(), process.products, pairs);
        if let Some(status) = further.end(process.good_enough(&triplets, options)) {
            break status;
        }
        if flow == ControlFlow::Break(()) {
            break Status::Stopped;
        }
    };
    let broke_down = process.broke_down();
    let mut found = answer(process, &triplets, options, recorder.history, status)?;
    if !is_due(&found, options) {
        return Ok(found);
    }
    let left = options.products.saturating_sub(found.stats.products);
    let size = [operator.rows(), operator.cols()];
    let fits = |more: &MissedPairs<Missed>| more.missed.iter().all(|missed| missed.fits(size));
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

impl SingularOptions {
    fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: &str, help: &str| Err(Error::option(option, fault).help(help));
        if self.count == 0 {
            return refuse("--count", "0 singular values were asked for", "ask for at least 1");
        }
        if self.products < 2 {
            return refuse("--photos", "a step takes one photo there and one back", "give at least 2");
        }
        if !(self.noise >= 0.0 && self.noise.is_finite()) {
            return refuse("SingularOptions::noise", "the noise is no amount", "give a number from 0 on");
        }
        self.confirm.map_or(Ok(()), |confirm| confirm.check())
    }
}

fn answer(
    mut process: GolubKahan,
    triplets: &[Triplet],
    options: &SingularOptions,
    history: Vec<HistoryRow>,
    status: Status,
) -> Result<Singular> {
    let wanted = options.tolerance * triplets.first().map_or(0.0, |triplet| triplet.value);
    let each = |of: &dyn Fn(&Triplet) -> f64| -> Vec<f64> { triplets.iter().map(of).collect() };
    let vectors = triplets.iter().map(|triplet| process.vectors(triplet));
    let vectors: Vec<[Vec<f64>; 2]> = vectors.collect::<Result<_>>()?;
    let (left, right) = vectors.into_iter().map(|[photo, pattern]| (photo, pattern)).unzip();
    Ok(Singular {
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
    })
}

/// Confirms that no singular value above `√(σ_k² + ε σ_1²)` is missed. Works like [`confirm`](crate::krylov::confirm()), for the
/// eigenvalues `σ²` of `AᵀA`. Each step takes one product with `A` and one with `Aᵀ`. Fails with the errors of
/// [`confirm`](crate::krylov::confirm()).
pub fn confirm_singular(
    operator: &mut dyn Adjoint,
    found: &mut Singular,
    options: &SingularOptions,
    confirm: &Confirm,
) -> Result<()> {
    confirm.check()?;
    if is_due(found, options) {
        let (completeness, more) = search_missed(operator, found, options, confirm)?;
        found.claim(Claimed { completeness, more, is_kept: false }, options);
    }
    Ok(())
}

/// Whether this result can be confirmed.
fn is_due(found: &Singular, options: &SingularOptions) -> bool {
    let ended = matches!(found.stats.status, Status::ReachedTolerance | Status::NoiseFloor);
    ended && found.values.len() == options.count && !found.completeness.is_known()
}

/// The question whether these triplets are all that were asked for.
fn question(found: &Singular, options: &SingularOptions) -> ClaimQuestion {
    let SingularOptions { count, tolerance, noise, start, confirm, .. } = options;
    let method = format!("singular values, {count}, tolerance {tolerance:e}, noise {noise:.3e}");
    let numbers: [&[f64]; 2] = [&found.values, &found.residuals];
    ClaimQuestion::new(&method, *confirm, (start, &[]), (&numbers, &found.history))
}

/// A triplet that a search missed, with the fields of [`Singular`].
#[derive(Serialize, Deserialize)]
struct Missed {
    value: f64,
    left: Vec<f64>,
    right: Vec<f64>,
    residual: f64,
    standard_error: f64,
    status: PairStatus,
}

impl Missed {
    /// Whether this is a triplet of an operator of this size.
    fn fits(&self, size: [usize; 2]) -> bool {
        [self.left.len(), self.right.len()] == size
    }
}

/// Does the work of [`confirm_singular`] for a result for which it is due, and inserts the missed triplets.
fn search_missed(
    operator: &mut dyn Adjoint,
    found: &mut Singular,
    options: &SingularOptions,
    confirm: &Confirm,
) -> Result<(Completeness, MissedPairs<Missed>)> {
    let settled = found.statuses.iter().all(|&status| status == PairStatus::Converged);
    if found.values.len() == operator.rows().min(operator.cols()) && settled {
        let findings = MissedPairs { missed: Vec::new(), products: 0, is_open: false };
        return Ok((Completeness::Exact, findings));
    }
    let noise = if confirm.is_frozen { 0.0 } else { options.noise };
    let (most, products, missed, count) = (confirm.products, 0, Vec::new(), found.values.len());
    let mut search = Confirmation { operator, options, found, noise, most, products, missed };
    let done = confirm_by(&mut search, confirm, count);
    let Confirmation { products, missed, .. } = search;
    found.confirming += products;
    let (completeness, is_open) = done?;
    Ok((completeness, MissedPairs { missed, products, is_open }))
}

impl Singular {
    fn largest(&self) -> f64 {
        self.values.first().copied().unwrap_or(0.0)
    }

    /// Applies the answer of a confirmation.
    fn claim(&mut self, claimed: Claimed<MissedPairs<Missed>>, options: &SingularOptions) {
        let missed = claimed.apply(&mut self.completeness, &mut self.stats.status, &mut self.confirming);
        self.insert(&missed, options);
    }

    /// Inserts the missed triplets in their order, and keeps only the requested number of triplets.
    fn insert(&mut self, missed: &[Missed], options: &SingularOptions) {
        for missed in missed {
            let at = self.values.partition_point(|&value| value >= missed.value);
            self.values.insert(at, missed.value);
            self.left.insert(at, missed.left.clone());
            self.right.insert(at, missed.right.clone());
            self.residuals.insert(at, missed.residual);
            self.standard_errors.insert(at, missed.standard_error);
            self.statuses.insert(at, missed.status);
        }
        for numbers in [&mut self.values, &mut self.residuals, &mut self.standard_errors] {
            numbers.truncate(options.count);
        }
        self.left.truncate(options.count);
        self.right.truncate(options.count);
        self.statuses.truncate(options.count);
    }
}

struct Confirmation<'a> {
    operator: &'a mut dyn Adjoint,
    options: &'a SingularOptions,
    found: &'a mut Singular,
    /// The norm of the error of a product with a unit vector, for an operator that does not state its errors.
    noise: f64,
    /// The largest number of products, and the number of products so far.
    most: usize,
    products: usize,
    missed: Vec<Missed>,
}

impl Confirmation<'_> {
    fn slack(&self, process: &GolubKahan, operator: f64) -> f64 {
        let size = (process.steps(), self.operator.cols());
        let (scale, error) = ((self.options.tolerance, self.found.largest()), self.error(Some(process)));
        slack(scale, size, &self.found.residuals, error, operator)
    }
}

impl Confirmable for Confirmation<'_> {
    type Process = GolubKahan;
    type Pair = Triplet;

    fn free(&self) -> usize {
        self.operator.cols() - self.found.values.len()
    }

    fn left(&self) -> usize {
        self.most.saturating_sub(self.products) / 2
    }

    fn begin(&self, round: u64, steps: usize) -> Result<GolubKahan> {
        let seed = seed_of(self.options.start.seed(), round + 1);
        let mut process = GolubKahan::beside(self.operator.rows(), &self.found.right, seed)?;
        process.upload(self.operator, 2 * steps)?;
        Ok(process)
    }

    fn step(&mut self, process: &mut GolubKahan, total: usize) -> Result<()> {
        let before = process.products;
        let done = process.step(self.operator);
        self.products += process.products - before;
        done?;
        confirming_step(self.operator.observer(), process.steps(), total)
    }

    fn progress(process: &GolubKahan) -> (usize, bool) {
        (process.steps(), process.is_exhausted())
    }

    fn error(&self, process: Option<&GolubKahan>) -> f64 {
        self.noise.max(process.map_or(0.0, GolubKahan::largest_error))
    }

    fn beyond(&self, process: &GolubKahan) -> Result<Vec<Triplet>> {
        let slack = self.slack(process, 0.0);
        let limit = self.found.values.last().map_or(0.0, |last| last + slack);
        let mut triplets = process.triplets(self.options)?;
        triplets.retain(|triplet| triplet.value > limit);
        Ok(triplets)
    }

    fn is_open(&self, triplets: &[Triplet]) -> bool {
        let wanted = |triplet: &Triplet| self.options.tolerance * self.found.largest().max(triplet.value);
        triplets.iter().any(|triplet| triplet.status(wanted(triplet)) == PairStatus::NotResolved)
    }

    fn insert(&mut self, process: &mut GolubKahan, missed: &[Triplet]) -> Result<()> {
        if missed.is_empty() {
            return Ok(());
        }
        let mut largest = self.found.largest();
        let missed = missed.iter().map(|triplet| {
            let &Triplet { value, residual, standard_error, .. } = triplet;
            largest = largest.max(value);
            let status = triplet.status(self.options.tolerance * largest);
            let [left, right] = process.vectors(triplet)?;
            Ok(Missed { value, left, right, residual, standard_error, status })
        });
        let missed: Vec<Missed> = missed.collect::<Result<_>>()?;
        self.found.insert(&missed, self.options);
        self.missed.extend(missed);
        Ok(())
    }

    fn limits(&self, process: &GolubKahan, share: f64) -> Result<[Option<f64>; 2]> {
        let last = self.found.values.last().copied().unwrap_or(0.0);
        Ok([None, Some(last.hypot(share.sqrt() * self.found.largest()) + self.slack(process, 1.0))])
    }
}
