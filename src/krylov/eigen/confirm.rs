//! Confirms that a search has missed no eigenvalue, and inserts missed ones.

use super::{Eigs, EigsOptions, Found};
use crate::error::Result;
use crate::krylov::basis::norm;
use crate::krylov::completeness::{Completeness, Confirm, Confirmed, MOST, Status, confirming_step};
use crate::krylov::factor::{Factorization, Lanczos, PairStatus, RitzPair, Which, temple_kato};
use crate::krylov::start::{seed_of, seeded};
use crate::operator::{Operator, Symmetry};

/// Confirms eigenpairs of a symmetric operator (`n × n`) that have all converged or reached the noise. It draws a Gaussian vector
/// orthogonal to them and takes [`Confirm::steps`] products from there. If eigenvalues beyond the last one appear, they are inserted and
/// another vector is drawn, until none appears. `options` are the options of the search. [`Eigs::confirming`] counts the products.
///
/// The function takes no product and leaves `found` unchanged in three cases: the search did not end with all pairs, the operator is not
/// symmetric, or the end is [`Which::SmallestMagnitude`], which is in the middle of the spectrum.
///
/// # Errors
/// [`crate::Error::Option`] naming `--confirm`; [`crate::Error::Interrupted`] if the observer stops it; the errors of
/// [`crate::krylov::eigen::eigs()`]. `found` is then a valid answer that is not confirmed.
pub fn confirm<O: Operator + ?Sized>(
    operator: &mut O,
    found: &mut Eigs,
    options: &EigsOptions,
    confirm: &Confirm,
) -> Result<()> {
    let mut operator = operator;
    confirm_dyn(&mut operator, found, options, confirm)
}

pub(super) fn confirm_dyn(
    operator: &mut dyn Operator,
    found: &mut Eigs,
    options: &EigsOptions,
    confirm: &Confirm,
) -> Result<()> {
    confirm.check()?;
    let mut confirmation = Confirmation { operator, options, confirm, products: 0, scale: 0.0 };
    let done = confirmation.run(found);
    found.confirming += confirmation.products;
    done
}

/// A new pair may use this many times the steps of a confirmation to converge.
const PATIENCE: usize = 10;

struct Confirmation<'a> {
    operator: &'a mut dyn Operator,
    options: &'a EigsOptions,
    confirm: &'a Confirm,
    products: usize,
    /// A lower bound of the norm of the operator.
    scale: f64,
}

impl Confirmation<'_> {
    fn run(&mut self, found: &mut Eigs) -> Result<()> {
        let ended = matches!(found.stats.status, Status::ReachedTolerance | Status::NoiseFloor);
        let most = self.operator.cols().saturating_sub(self.options.deflate.len());
        let is_whole = found.values.len() == self.options.count.min(most);
        let is_end = !matches!(self.options.which, Which::SmallestMagnitude | Which::LargestImaginary);
        let is_symmetric = self.operator.symmetry() == Symmetry::Symmetric;
        if !(ended && is_whole && is_end && is_symmetric) || found.completeness.is_known() {
            return Ok(());
        }
        self.scale = found.values.iter().fold(0.0, |scale, value| value.abs().max(scale));
        // Each round inserts at least one pair, so the number of rounds is at most the number of copies.
        for round in 0..4 * self.options.count as u64 + 8 {
            let mut known = self.options.deflate.clone();
            known.extend(found.vectors.iter().cloned());
            let n = self.operator.cols();
            let free = n - known.len();
            if free == 0 {
                found.completeness = self.spanned(0.0);
                break;
            }
            let seed = seed_of(self.options.start.seed(), round);
            let mut process = Lanczos::new(&seeded(n, !seed), &known)?;
            let steps = self.confirm.steps(free).min(self.left());
            let share = self.confirm.share_of(steps, free);
            if steps < free && share > MOST {
                break;
            }
            process.expansion_mut().reserve(steps);
            while process.steps() < steps {
                self.expand(&mut process, steps)?;
            }
            let missed = self.settle(&mut process, found)?;
            let is_spanned = process.steps() == free;
            if !missed.is_empty() {
                self.insert(&process, &missed, found)?;
                if self.is_open(&missed) {
                    break;
                }
            }
            if is_spanned {
                found.completeness = self.spanned(process.expansion().largest_error());
                break;
            }
            if missed.is_empty() {
                let limits = self.limits(&process, found, share)?;
                let chance = self.confirm.chance
                    * (round + 1) as f64
                    * self.ends(found).iter().flatten().count() as f64;
                found.completeness = Completeness::Confirmed(Confirmed { limits, share, chance });
                break;
            }
        }
        Ok(())
    }

    /// The error of a product with a unit vector, if the operator does not state it.
    fn noise(&self) -> f64 {
        if self.confirm.is_frozen { 0.0 } else { self.options.noise }
    }

    fn left(&self) -> usize {
        self.confirm.products.saturating_sub(self.products)
    }

    /// The claim when products with these errors have spanned all directions.
    fn spanned(&self, error: f64) -> Completeness {
        if error > 0.0 || self.noise() > 0.0 { Completeness::NotExcluded } else { Completeness::Exact }
    }

    fn expand(&mut self, process: &mut Lanczos, total: usize) -> Result<()> {
        process.expand(&mut *self.operator)?;
        self.products += 1;
        self.scale = self.scale.max(process.scale());
        confirming_step(self.operator.observer(), process.steps(), total)
    }

    /// The last values at the requested lower and upper ends. No value beyond them may be missing.
    fn ends(&self, found: &Eigs) -> [Option<f64>; 2] {
        let last = found.values.last().copied();
        match self.options.which {
            Which::SmallestAlgebraic => [last, None],
            Which::LargestMagnitude => [last.map(|value| -value.abs()), last.map(f64::abs)],
            Which::BothEnds => {
                let of = |index: Option<usize>| index.and_then(|index| found.values.get(index)).copied();
                let count = found.values.len();
                // The values alternate between the ends, beginning with the largest.
                [of((count / 2 * 2).checked_sub(1)), of(count.div_ceil(2).checked_sub(1).map(|top| 2 * top))]
            }
            _ => [None, last],
        }
    }

    /// The tolerance within which a Ritz value of this process may lie beyond a converged one and still be the same. It adds the tolerance,
    /// rounding, noise, and the residuals of the pairs found, which bound their coupling to the complement. `m` products whose errors have
    /// the norm `e` and are spread evenly over `n` entries change a Ritz value by at most about `2e √(m/n)`. They change the operator that
    /// the process sees by about `2e (1 + √(m/n))`.
    fn slack(&self, process: &Lanczos, residuals: &[f64]) -> [f64; 2] {
        let rounding =
            f64::EPSILON * self.scale * (10.0 + (process.n() as f64).sqrt() + process.steps() as f64);
        let noise = 2.0 * self.noise().max(process.expansion().largest_error());
        let share = (process.steps() as f64 / process.n() as f64).sqrt();
        let exact = self.options.tolerance * self.scale + rounding + norm(residuals);
        [0.0, 1.0].map(|operator| exact + noise * (share + operator))
    }

    /// Finds the pairs of the process beyond the ends, the most wanted first.
    fn beyond(&self, process: &Lanczos, found: &Eigs) -> Result<Vec<RitzPair>> {
        let [slack, _] = self.slack(process, &found.residuals);
        let [low, high] = self.ends(found);
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

    /// Continues until the pairs beyond the ends have converged, or the products are spent.
    fn settle(&mut self, process: &mut Lanczos, found: &Eigs) -> Result<Vec<RitzPair>> {
        let mut missed = self.beyond(process, found)?;
        let most = PATIENCE * process.steps();
        while self.is_open(&missed) && self.left() > 0 && process.steps() < most && !process.is_exhausted() {
            let total = process.steps() + 1;
            self.expand(process, total)?;
            missed = self.beyond(process, found)?;
        }
        Ok(missed)
    }

    fn limits(&self, process: &Lanczos, found: &Eigs, share: f64) -> Result<[Option<f64>; 2]> {
        let outermost =
            |which| -> Result<Option<f64>> { Ok(process.ritz(which, 1)?.first().map(|pair| pair.value)) };
        let (top, bottom) = (outermost(Which::LargestAlgebraic)?, outermost(Which::SmallestAlgebraic)?);
        let values = || found.values.iter().copied().chain(top).chain(bottom);
        let spread = values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min);
        let [_, slack] = self.slack(process, &found.residuals);
        let margin = share * spread + slack;
        let [low, high] = self.ends(found);
        Ok([low.map(|low| low - margin), high.map(|high| high + margin)])
    }

    /// Inserts pairs in their order, and keeps the requested number.
    fn insert(&mut self, process: &Lanczos, missed: &[RitzPair], found: &mut Eigs) -> Result<()> {
        let vectors: Vec<Vec<f64>> = missed.iter().map(|pair| process.ritz_vector(pair)).collect();
        let common =
            vectors.iter().map(|vector| self.operator.common_error(vector)).collect::<Result<_>>()?;
        let imaginary = vec![Vec::new(); missed.len()];
        let new = Found { pairs: missed, vectors, common, imaginary, scale: self.scale, rows: process.n() };
        let new = new.eigs(self.options, process.asymmetry(), Vec::new(), found.stats);
        found.asymmetry = found.asymmetry.max(new.asymmetry);
        let all = found.values.iter().chain(&new.values);
        let complex: Vec<(f64, f64)> = all.map(|&value| (value, 0.0)).collect();
        let mut order = self.options.which.order(&complex);
        order.truncate(self.options.count);
        join(&mut found.values, new.values, &order);
        join(&mut found.imaginary_values, new.imaginary_values, &order);
        join(&mut found.vectors, new.vectors, &order);
        join(&mut found.imaginary_vectors, new.imaginary_vectors, &order);
        join(&mut found.residuals, new.residuals, &order);
        join(&mut found.standard_errors, new.standard_errors, &order);
        join(&mut found.bounds, new.bounds, &order);
        join(&mut found.gap_bounds, new.gap_bounds, &order);
        join(&mut found.statuses, new.statuses, &order);
        if self.is_open(missed) {
            found.stats.status = Status::BudgetSpent;
        }
        // The gaps are smaller than a single process could know.
        for index in 0..found.values.len() {
            let others = (0..found.values.len()).filter(|other| *other != index);
            let gap = others
                .map(|other| (found.values[other] - found.values[index]).abs() - found.residuals[other])
                .fold(f64::INFINITY, f64::min);
            let bound = found.bounds[index];
            found.gap_bounds[index] = found.gap_bounds[index].max(temple_kato(bound, gap)).min(bound);
        }
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
    /// An upper bound, given as the limit of a confirmed search.
    pub completeness: Completeness,
    /// The number of products taken.
    pub products: usize,
}

/// Finds the largest eigenvalue of a symmetric operator (`n × n`) on the complement of `known` vectors, from a Gaussian vector with this
/// seed. By Courant and Fischer it bounds the `k+1`st eigenvalue for `k` known vectors, even if these are not exact. Returns `None` if the
/// complement is empty or `confirm` allows too few products. Fails with the errors of [`confirm`].
pub fn largest_beside(
    operator: &mut dyn Operator,
    known: &[Vec<f64>],
    seed: u64,
    confirm: &Confirm,
) -> Result<Option<Beside>> {
    confirm.check()?;
    let options = EigsOptions { deflate: known.to_vec(), tolerance: 0.0, ..EigsOptions::default() };
    let n = operator.cols();
    let free = n.saturating_sub(known.len());
    let steps = confirm.steps(free).min(confirm.products);
    let share = confirm.share_of(steps, free);
    if free == 0 || steps == 0 || (steps < free && share > MOST) {
        return Ok(None);
    }
    let mut process = Lanczos::new(&seeded(n, !seed), known)?;
    let mut confirmation = Confirmation { operator, options: &options, confirm, products: 0, scale: 0.0 };
    while process.steps() < steps {
        confirmation.expand(&mut process, steps)?;
    }
    let [slack_of_value, slack] = confirmation.slack(&process, &[]);
    let [top, bottom] =
        [Which::LargestAlgebraic, Which::SmallestAlgebraic].map(|which| process.ritz(which, 1));
    let (Some(top), Some(bottom)) = (top?.pop(), bottom?.pop()) else { return Ok(None) };
    let value = top.value;
    let (margin, chance) = if steps == free {
        (slack_of_value, 0.0)
    } else {
        (share * (value - bottom.value) + slack, confirm.chance)
    };
    let limits = [None, Some(value + margin)];
    let completeness = Completeness::Confirmed(Confirmed { limits, share, chance });
    let vector = process.ritz_vector(&top);
    Ok(Some(Beside { value, vector, completeness, products: confirmation.products }))
}

/// Appends new entries, and keeps the entries of these indices in their order.
fn join<T: Clone>(entries: &mut Vec<T>, new: Vec<T>, order: &[usize]) {
    entries.extend(new);
    *entries = order.iter().map(|&index| entries[index].clone()).collect();
}
