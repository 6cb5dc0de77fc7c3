//! Drives a factorization until its eigenpairs are good enough or the budget is spent.

use std::ops::ControlFlow;

use super::super::completeness::Completeness;
use super::super::confirmation::Confirmation;
use super::super::factor::{self, Factorization, PairStatus, RitzPair};
use super::super::stats::{Stats, Status};
use super::options::{Eigs, EigsOptions, HistoryRow};
use crate::error::Result;
use crate::observer::{Estimate, Step};
use crate::operator::Operator;

/// Products are taken one by one where the residuals are within this factor of their target: a few products
/// seldom gain more.
const NEAR: f64 = 1e3;

/// As [`eigs()`](super::eigs()), going on from a factorization; `options.products` counts the products
/// already in it, `method`, `start` and `deflate` are ignored. After an error, `factorization` holds
/// everything up to the product that failed: call this function again to continue.
///
/// # Errors
/// As [`eigs()`](super::eigs()).
pub fn eigs_from<O: Operator + ?Sized>(
    factorization: &mut dyn Factorization,
    operator: &mut O,
    options: &EigsOptions,
) -> Result<Eigs> {
    let mut operator = operator;
    drive(factorization, &mut operator, options)
}

/// As [`eigs_from`].
pub(super) fn drive(
    factorization: &mut dyn Factorization,
    operator: &mut dyn Operator,
    options: &EigsOptions,
) -> Result<Eigs> {
    options.check()?;
    let most = options.max_basis.unwrap_or(usize::MAX);
    let left = options.products.saturating_sub(factorization.products());
    let steps = (factorization.steps() + left).min(most);
    factorization.expansion_mut().reserve(steps);
    let mut recorder = Recorder::new(options);
    let mut confirmation = Confirmation::new(factorization.n());
    let mut pairs = factorization.ritz(options.which, options.count)?;
    let status = loop {
        if factorization.is_exhausted() {
            break exhausted(factorization, options);
        }
        let reached = good_enough(&pairs, options, (factorization.scale(), factorization.n()));
        if let Some(status) = confirmation.end(reached) {
            break status;
        }
        if factorization.products() >= options.products {
            break spent(&pairs, options, factorization.scale());
        }
        let waiting = factorization.expansion().pending();
        if factorization.steps() + waiting >= most {
            // Half of the unwanted pairs are kept too: the next cycle converges faster from them.
            let steps = factorization.steps();
            let keep = options.count + steps.saturating_sub(options.count) / 2;
            factorization.shrink(options.which, keep.min(most - 2 * waiting))?;
        }
        if !is_near(&pairs, options, factorization.scale()) {
            factorization.multiply_block(operator, options.products - factorization.products())?;
        }
        let step = factorization.expand(operator)?;
        pairs = factorization.ritz(options.which, options.count)?;
        let flow = recorder.row(operator, factorization.products(), &pairs);
        if step == factor::Step::Exhausted {
            break exhausted(factorization, options);
        }
        if flow == ControlFlow::Break(()) {
            break Status::Stopped;
        }
    };
    let stats = Stats { products: factorization.products(), status };
    let vectors: Vec<Vec<f64>> = pairs.iter().map(|pair| factorization.ritz_vector(pair)).collect();
    let common = vectors.iter().map(|vector| operator.common_error(vector)).collect::<Result<_>>()?;
    let imaginary = pairs
        .iter()
        .map(|pair| if pair.is_real() { Vec::new() } else { factorization.ritz_vector_imaginary(pair) });
    let imaginary = imaginary.collect();
    let (scale, rows) = (factorization.scale(), factorization.n());
    let found = Found { pairs: &pairs, vectors, common, imaginary, scale, rows };
    Ok(found.eigs(options, factorization.asymmetry(), recorder.history, stats))
}

/// The status once all directions are spanned: the answer is exact unless the products have noise.
fn exhausted(factorization: &dyn Factorization, options: &EigsOptions) -> Status {
    let is_noisy = options.noise > 0.0 || factorization.expansion().largest_error() > 0.0;
    if is_noisy { Status::NoiseFloor } else { Status::SpaceExhausted }
}

/// Whether these pairs may be within the tolerance, or the noise, before a whole block is through. Products
/// are then taken one by one, so that none is taken in vain.
fn is_near(pairs: &[RitzPair], options: &EigsOptions, scale: f64) -> bool {
    let target = (options.tolerance * scale).max(options.noise);
    pairs.len() >= options.count && pairs.iter().all(|pair| pair.residual <= NEAR * target.max(pair.rounding))
}

/// Why these pairs of an operator of this norm and of `n` rows need no further product, if they need none.
pub(super) fn good_enough(
    pairs: &[RitzPair],
    options: &EigsOptions,
    (scale, n): (f64, usize),
) -> Option<Status> {
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

/// The status of pairs for which no product is left.
pub(super) fn spent(pairs: &[RitzPair], options: &EigsOptions, scale: f64) -> Status {
    let wanted = options.tolerance * scale;
    let limited = |pair: &RitzPair| pair.status(wanted, options.noise) != PairStatus::NotResolved;
    if pairs.len() >= options.count && pairs.iter().all(limited) {
        Status::NoiseFloor
    } else {
        Status::BudgetSpent
    }
}

/// Tells the operator's observer of each product, and records it.
pub(super) struct Recorder {
    budget: usize,
    pub(super) history: Vec<HistoryRow>,
}

impl Recorder {
    pub(super) fn new(options: &EigsOptions) -> Self {
        Self { budget: options.products, history: Vec::new() }
    }

    pub(super) fn row(
        &mut self,
        operator: &dyn Operator,
        products: usize,
        pairs: &[RitzPair],
    ) -> ControlFlow<()> {
        let values: Vec<f64> = pairs.iter().map(|pair| pair.value).collect();
        let residuals: Vec<f64> = pairs.iter().map(|pair| pair.residual).collect();
        let flow = operator.observer().step(&Step {
            stage: "photos",
            done: products as u64,
            total: self.budget as u64,
            estimate: Estimate::Eigenpairs { values: &values, residuals: &residuals },
        });
        self.history.push(HistoryRow { products, values, residuals });
        flow
    }
}

/// Pairs with their vectors.
pub(super) struct Found<'a> {
    pub(super) pairs: &'a [RitzPair],
    pub(super) vectors: Vec<Vec<f64>>,
    /// [`Operator::common_error`] of each vector.
    pub(super) common: Vec<f64>,
    pub(super) imaginary: Vec<Vec<f64>>,
    pub(super) scale: f64,
    /// `n` of the `n × n` operator.
    pub(super) rows: usize,
}

impl Found<'_> {
    pub(super) fn eigs(
        self,
        options: &EigsOptions,
        asymmetry: f64,
        history: Vec<HistoryRow>,
        stats: Stats,
    ) -> Eigs {
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
