//! Confirms that a search has missed no eigenvalue, and inserts missed ones.

use serde::{Deserialize, Serialize};

use super::{Eigs, EigsOptions, Found};
use crate::error::Result;
use crate::krylov::claim::{ClaimQuestion, Claimed, MissedPairs};
use crate::krylov::completeness::{
    Completeness, Confirm, Confirmable, Confirmed, MOST, Status, confirm_by, confirming_step, slack,
};
use crate::krylov::factor::{Factorization, PairStatus, Placed, RitzPair, Which, temple_kato};
use crate::krylov::start::{seed_of, seeded};
use crate::operator::{Operator, Symmetry};

/// Confirms eigenpairs of a symmetric operator (`n × n`) that have all converged or reached the noise. The function draws a Gaussian vector
/// orthogonal to the eigenvectors, and takes [`Confirm::steps`] products of a process that starts from this vector. If eigenvalues beyond
/// the last eigenvalue appear, the function inserts them and draws another vector, until no such eigenvalue appears. `options` are the
/// options of the search. [`Eigs::confirming`] counts the products.
///
/// The function takes no product and leaves `found` unchanged in three cases: the search did not end with all pairs, the operator is not
/// symmetric, or the search was for [`Which::SmallestMagnitude`], whose values are inside the spectrum.
///
/// # Errors
/// [`crate::Error::Option`] naming `--confirm`; [`crate::Error::Interrupted`] if the observer stops the confirmation; the errors of
/// [`crate::krylov::eigen::eigs()`]. `found` is then still valid, but not confirmed.
pub fn confirm(
    operator: &mut dyn Operator,
    found: &mut Eigs,
    options: &EigsOptions,
    confirm: &Confirm,
) -> Result<()> {
    confirm.check()?;
    if is_due(operator, found, options) {
        let (completeness, more) = search_missed(operator, found, options, confirm)?;
        found.claim(Claimed { completeness, more, is_kept: false }, options);
    }
    Ok(())
}

/// Whether [`confirm()`] takes products for this result.
pub(super) fn is_due(operator: &dyn Operator, found: &Eigs, options: &EigsOptions) -> bool {
    let ended = matches!(found.stats.status, Status::ReachedTolerance | Status::NoiseFloor);
    let most = operator.cols().saturating_sub(options.deflate.len());
    let is_whole = found.values.len() == options.count.min(most);
    let is_end = !matches!(options.which, Which::SmallestMagnitude | Which::LargestImaginary);
    let is_symmetric = operator.symmetry() == Symmetry::Symmetric;
    ended && is_whole && is_end && is_symmetric && !found.completeness.is_known()
}

/// The question whether these pairs are all that were asked for.
pub(super) fn question(found: &Eigs, options: &EigsOptions) -> ClaimQuestion {
    let EigsOptions { count, which, tolerance, noise, start, deflate, confirm, .. } = options;
    let method = format!("eigenvalues, {count} {which:?}, tolerance {tolerance:e}, noise {noise:.3e}");
    let numbers: [&[f64]; 2] = [&found.values, &found.residuals];
    ClaimQuestion::new(&method, *confirm, (start, deflate), (&numbers, &found.history))
}

/// Pairs that a search missed and one process of its confirmation found, with the fields of [`Eigs`].
#[derive(Serialize, Deserialize)]
pub(super) struct Missed {
    values: Vec<f64>,
    residuals: Vec<f64>,
    standard_errors: Vec<f64>,
    bounds: Vec<f64>,
    gap_bounds: Vec<f64>,
    statuses: Vec<PairStatus>,
    vectors: Vec<Vec<f64>>,
    asymmetry: f64,
}

impl Missed {
    /// Whether these are pairs of an operator of `n × n`.
    pub(super) fn fits(&self, n: usize) -> bool {
        let Self { values, residuals, standard_errors, bounds, gap_bounds, statuses, vectors, .. } = self;
        let lengths = [residuals, standard_errors, bounds, gap_bounds].map(Vec::len);
        let lengths = lengths.into_iter().chain([statuses.len(), vectors.len()]);
        lengths.into_iter().all(|length| length == values.len()) && vectors.iter().all(|v| v.len() == n)
    }
}

/// Does the work of [`confirm()`] for a result for which it is due, and inserts the missed pairs.
pub(super) fn search_missed(
    operator: &mut dyn Operator,
    found: &mut Eigs,
    options: &EigsOptions,
    confirm: &Confirm,
) -> Result<(Completeness, MissedPairs<Missed>)> {
    let scale = found.values.iter().fold(0.0, |scale, value| value.abs().max(scale));
    let noise = if confirm.is_frozen { 0.0 } else { options.noise };
    let (most, products, missed) = (confirm.products, 0, Vec::new());
    let mut search = Confirmation { operator, options, found, noise, most, products, scale, missed };
    let done = confirm_by(&mut search, confirm, options.count);
    let Confirmation { products, missed, .. } = search;
    found.confirming += products;
    let (completeness, is_open) = done?;
    Ok((completeness, MissedPairs { missed, products, is_open }))
}

impl Eigs {
    /// Applies the answer of a confirmation.
    pub(super) fn claim(&mut self, claimed: Claimed<MissedPairs<Missed>>, options: &EigsOptions) {
        let missed = claimed.apply(&mut self.completeness, &mut self.stats.status, &mut self.confirming);
        missed.iter().for_each(|missed| self.insert(missed, options));
    }

    /// Inserts the missed pairs in their order, and keeps only the requested number of pairs.
    fn insert(&mut self, missed: &Missed, options: &EigsOptions) {
        self.asymmetry = self.asymmetry.max(missed.asymmetry);
        let all = self.values.iter().chain(&missed.values);
        let complex: Vec<(f64, f64)> = all.map(|&value| (value, 0.0)).collect();
        let mut order = options.which.order(&complex);
        order.truncate(options.count);
        let zeros = vec![0.0; missed.values.len()];
        for (entries, new) in [
            (&mut self.values, &missed.values),
            (&mut self.imaginary_values, &zeros),
            (&mut self.residuals, &missed.residuals),
            (&mut self.standard_errors, &missed.standard_errors),
            (&mut self.bounds, &missed.bounds),
            (&mut self.gap_bounds, &missed.gap_bounds),
        ] {
            join(entries, new, &order);
        }
        join(&mut self.vectors, &missed.vectors, &order);
        join(&mut self.imaginary_vectors, &vec![Vec::new(); missed.values.len()], &order);
        join(&mut self.statuses, &missed.statuses, &order);
        // The inserted values reduce the gaps, so the gap bounds are computed again from all values.
        for index in 0..self.values.len() {
            let others = (0..self.values.len()).filter(|other| *other != index);
            let gap = others
                .map(|other| (self.values[other] - self.values[index]).abs() - self.residuals[other])
                .fold(f64::INFINITY, f64::min);
            let bound = self.bounds[index];
            self.gap_bounds[index] = self.gap_bounds[index].max(temple_kato(bound, gap)).min(bound);
        }
    }
}

struct Confirmation<'a> {
    operator: &'a mut dyn Operator,
    options: &'a EigsOptions,
    found: &'a mut Eigs,
    /// The norm of the error of a product with a unit vector, for an operator that does not state its errors.
    noise: f64,
    /// The largest number of products, and the number of products so far.
    most: usize,
    products: usize,
    /// A lower bound of the norm of the operator.
    scale: f64,
    missed: Vec<Missed>,
}

impl Confirmation<'_> {
    fn known(&self) -> Vec<Vec<f64>> {
        self.options.deflate.iter().chain(&self.found.vectors).cloned().collect()
    }

    /// The last values found at the requested lower and upper ends of the spectrum. The confirmation searches for missed values beyond
    /// them.
    fn ends(&self) -> [Option<f64>; 2] {
        let values = &self.found.values;
        let last = values.last().copied();
        match self.options.which {
            Which::SmallestAlgebraic => [last, None],
            Which::LargestMagnitude => [last.map(|value| -value.abs()), last.map(f64::abs)],
            Which::BothEnds => {
                let of = |index: Option<usize>| index.and_then(|index| values.get(index)).copied();
                let count = values.len();
                // The values alternate between the ends of the spectrum, beginning with the largest.
                [of((count / 2 * 2).checked_sub(1)), of(count.div_ceil(2).checked_sub(1).map(|top| 2 * top))]
            }
            _ => [None, last],
        }
    }

    fn slack(&self, process: &Placed, operator: f64) -> f64 {
        let (size, error) = ((process.steps(), process.n()), self.error(Some(process)));
        slack((self.options.tolerance, self.scale), size, &self.found.residuals, error, operator)
    }
}

impl Confirmable for Confirmation<'_> {
    type Process = Placed;
    type Pair = RitzPair;

    fn free(&self) -> usize {
        self.operator.cols() - self.options.deflate.len() - self.found.vectors.len()
    }

    fn left(&self) -> usize {
        self.most.saturating_sub(self.products)
    }

    fn begin(&self, round: u64, steps: usize) -> Result<Placed> {
        let seed = seed_of(self.options.start.seed(), round);
        let process = Factorization::lanczos(&seeded(self.operator.cols(), !seed), &self.known())?;
        let mut process = Placed::new(process);
        process.place(self.operator, steps)?;
        Ok(process)
    }

    fn step(&mut self, process: &mut Placed, total: usize) -> Result<()> {
        process.expand(&mut *self.operator)?;
        self.products += 1;
        self.scale = self.scale.max(process.scale());
        confirming_step(self.operator.observer(), process.steps(), total)
    }

    fn progress(process: &Placed) -> (usize, bool) {
        (process.steps(), process.is_exhausted())
    }

    fn error(&self, process: Option<&Placed>) -> f64 {
        self.noise.max(process.map_or(0.0, |process| process.largest_error()))
    }

    fn beyond(&self, process: &Placed) -> Result<Vec<RitzPair>> {
        let slack = self.slack(process, 0.0);
        let [low, high] = self.ends();
        let mut beyond = Vec::new();
        for (end, which) in [(high, Which::LargestAlgebraic), (low, Which::SmallestAlgebraic)] {
            let Some(end) = end else { continue };
            let outwards =
                |value: f64| if which == Which::LargestAlgebraic { value - end } else { end - value };
            let pairs = process.ritz(which, self.options.count)?;
            beyond.extend(pairs.into_iter().filter(|pair| outwards(pair.value) > slack));
        }
        Ok(beyond)
    }

    fn is_open(&self, pairs: &[RitzPair]) -> bool {
        let wanted = self.options.tolerance * self.scale;
        pairs.iter().any(|pair| pair.status(wanted, self.options.noise) == PairStatus::NotResolved)
    }

    fn limits(&self, process: &Placed, share: f64) -> Result<[Option<f64>; 2]> {
        let outermost =
            |which| -> Result<Option<f64>> { Ok(process.ritz(which, 1)?.first().map(|pair| pair.value)) };
        let (top, bottom) = (outermost(Which::LargestAlgebraic)?, outermost(Which::SmallestAlgebraic)?);
        let values = || self.found.values.iter().copied().chain(top).chain(bottom);
        let spread = values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min);
        let margin = share * spread + self.slack(process, 1.0);
        let [low, high] = self.ends();
        Ok([low.map(|low| low - margin), high.map(|high| high + margin)])
    }

    fn insert(&mut self, process: &mut Placed, missed: &[RitzPair]) -> Result<()> {
        if missed.is_empty() {
            return Ok(());
        }
        let vectors: Vec<Vec<f64>> =
            missed.iter().map(|pair| process.ritz_vector(pair)).collect::<Result<_>>()?;
        let common =
            vectors.iter().map(|vector| self.operator.common_error(vector)).collect::<Result<_>>()?;
        let imaginary = vec![Vec::new(); missed.len()];
        let new = Found { pairs: missed, vectors, common, imaginary, scale: self.scale, rows: process.n() };
        let new = new.eigs(self.options, process.asymmetry(), Vec::new(), self.found.stats);
        let Eigs {
            values, vectors, residuals, standard_errors, bounds, gap_bounds, statuses, asymmetry, ..
        } = new;
        let missed =
            Missed { values, residuals, standard_errors, bounds, gap_bounds, statuses, vectors, asymmetry };
        self.found.insert(&missed, self.options);
        self.missed.push(missed);
        Ok(())
    }
}

/// The largest eigenvalue on the complement of known vectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Beside {
    /// The largest Ritz value, a lower bound.
    pub value: f64,
    /// The Ritz vector (`n`) of this value, of norm 1.
    pub vector: Vec<f64>,
    /// An upper bound, in the form of the limit of a confirmed search.
    pub completeness: Completeness,
    /// The number of products taken.
    pub products: usize,
}

/// Finds the largest eigenvalue of a symmetric operator (`n × n`) on the complement of `known` vectors, from a Gaussian vector with this
/// seed. By Courant and Fischer, this value bounds the `k+1`st eigenvalue of the operator for `k` known vectors, even if the known vectors
/// are not exact. Returns `None` if the complement is empty or if `confirm` allows too few products. Fails with the errors of [`confirm`].
pub fn largest_beside(
    operator: &mut dyn Operator,
    known: &[Vec<f64>],
    seed: u64,
    confirm: &Confirm,
) -> Result<Option<Beside>> {
    confirm.check()?;
    let n = operator.cols();
    let free = n.saturating_sub(known.len());
    let steps = confirm.steps(free).min(confirm.products);
    let share = confirm.share_of(steps, free);
    if free == 0 || steps == 0 || (steps < free && share > MOST) {
        return Ok(None);
    }
    let process = Factorization::lanczos(&seeded(n, !seed), known)?;
    let mut process = Placed::new(process);
    process.place(operator, steps)?;
    while process.steps() < steps {
        process.expand(operator)?;
        confirming_step(operator.observer(), process.steps(), steps)?;
    }
    let slack = |of: f64| {
        slack((0.0, process.scale()), (process.steps(), process.n()), &[], process.largest_error(), of)
    };
    let [top, bottom] =
        [Which::LargestAlgebraic, Which::SmallestAlgebraic].map(|which| process.ritz(which, 1));
    let (Some(top), Some(bottom)) = (top?.pop(), bottom?.pop()) else { return Ok(None) };
    let value = top.value;
    let (margin, chance) = if steps == free {
        (slack(0.0), 0.0)
    } else {
        (share * (value - bottom.value) + slack(1.0), confirm.chance)
    };
    let limits = [None, Some(value + margin)];
    let completeness = Completeness::Confirmed(Confirmed { limits, share, chance });
    let vector = process.ritz_vector(&top)?;
    Ok(Some(Beside { value, vector, completeness, products: process.products() }))
}

/// Appends the new entries, and then arranges all entries by the indices in `order`. Entries that `order` omits are dropped.
fn join<T: Clone>(entries: &mut Vec<T>, new: &[T], order: &[usize]) {
    let at = |&index: &usize| entries.get(index).unwrap_or_else(|| &new[index - entries.len()]).clone();
    *entries = order.iter().map(at).collect();
}
