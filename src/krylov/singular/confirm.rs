//! Confirms that a search has missed no singular value, and inserts those that it has missed.

use super::golub_kahan::{GolubKahan, Triplet};
use super::{Singular, SingularOptions};
use crate::error::{Error, Result};
use crate::krylov::basis::norm;
use crate::krylov::completeness::{Completeness, Confirm, Confirmed, MOST};
use crate::krylov::factor::PairStatus;
use crate::krylov::stats::Status;
use crate::observer::{Estimate, Step};
use crate::operator::Adjoint;

/// As [`confirm`](super::super::confirm()), for singular values: eigenvalues `σ²` of `AᵀA`, so that none above
/// `√(σ_k² + ε σ_1²)` is missed. Each step takes one product with `A` and one with `Aᵀ`.
///
/// # Errors
/// As [`confirm`](super::super::confirm()).
pub fn confirm_singular(
    operator: &mut dyn Adjoint,
    found: &mut Singular,
    options: &SingularOptions,
    confirm: &Confirm,
) -> Result<()> {
    confirm.check()?;
    let mut confirmation = Confirmation { operator, options, confirm, products: 0 };
    let done = confirmation.run(found);
    found.confirming += confirmation.products;
    done
}

/// A triplet that has come out gets so many times the steps of a confirmation to converge.
const PATIENCE: usize = 10;

struct Confirmation<'a> {
    operator: &'a mut dyn Adjoint,
    options: &'a SingularOptions,
    confirm: &'a Confirm,
    products: usize,
}

impl Confirmation<'_> {
    fn run(&mut self, found: &mut Singular) -> Result<()> {
        let ended = matches!(found.stats.status, Status::ReachedTolerance | Status::NoiseFloor);
        let count = found.values.len();
        if !ended || count != self.options.count || found.completeness.is_known() {
            return Ok(());
        }
        let (rows, cols) = (self.operator.rows(), self.operator.cols());
        let settled = found.statuses.iter().all(|&status| status == PairStatus::Converged);
        if count == rows.min(cols) && settled {
            found.completeness = Completeness::Exact;
            return Ok(());
        }
        for round in 0..4 * count as u64 + 8 {
            let free = cols - count;
            let seed = self.options.start.seed().wrapping_add(round + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let mut process = GolubKahan::beside(rows, &found.right, seed);
            let steps = self.confirm.steps(free).min(self.left() / 2);
            let share = self.confirm.share_of(steps, free);
            if steps < free && share > MOST {
                break;
            }
            while process.steps() < steps && !process.is_exhausted() {
                self.step(&mut process, steps)?;
            }
            let missed = self.settle(&mut process, found)?;
            let is_open = missed.iter().any(|triplet| self.is_open(triplet, found));
            self.insert(&process, &missed, found);
            if is_open {
                found.stats.status = Status::BudgetSpent;
                break;
            }
            if process.is_exhausted() {
                if process.largest_error() == 0.0 && self.noise() == 0.0 {
                    found.completeness = Completeness::Exact;
                }
                break;
            }
            if missed.is_empty() {
                let (largest, last) = (found.values[0], found.values[count - 1]);
                let limit = last.hypot(share.sqrt() * largest) + self.slack(&process, found, 1.0);
                let chance = self.confirm.chance * (round + 1) as f64;
                found.completeness =
                    Completeness::Confirmed(Confirmed { limits: [None, Some(limit)], share, chance });
                break;
            }
        }
        Ok(())
    }

    /// The error of a product with a unit vector, where the operator does not state it.
    fn noise(&self) -> f64 {
        if self.confirm.is_frozen { 0.0 } else { self.options.noise }
    }

    fn left(&self) -> usize {
        self.confirm.products.saturating_sub(self.products)
    }

    fn step(&mut self, process: &mut GolubKahan, total: usize) -> Result<()> {
        let before = process.products;
        let done = process.step(self.operator);
        self.products += process.products - before;
        done?;
        let flow = self.operator.observer().step(&Step {
            stage: "confirming",
            done: process.steps() as u64,
            total: total.max(process.steps()) as u64,
            estimate: Estimate::None,
        });
        if flow.is_break() { Err(Error::Interrupted) } else { Ok(()) }
    }

    /// How far a value of this process may be above a converged one and still be the same; as for eigenvalues, with the residuals that were
    /// found and the noise of both kinds of products. `operator` is 1 for the matrix that the process sees.
    fn slack(&self, process: &GolubKahan, found: &Singular, operator: f64) -> f64 {
        let largest = found.values.first().copied().unwrap_or(0.0);
        let n = self.operator.cols() as f64;
        let rounding = f64::EPSILON * largest * (10.0 + n.sqrt() + process.steps() as f64);
        let noise = 2.0 * self.noise().max(process.largest_error());
        self.options.tolerance * largest
            + rounding
            + norm(&found.residuals)
            + noise * ((process.steps() as f64 / n).sqrt() + operator)
    }

    fn is_open(&self, triplet: &Triplet, found: &Singular) -> bool {
        let largest = found.values.first().map_or(triplet.value, |largest| largest.max(triplet.value));
        triplet.status(self.options.tolerance * largest) == PairStatus::NotResolved
    }

    fn beyond(&self, process: &GolubKahan, found: &Singular) -> Result<Vec<Triplet>> {
        let limit = found.values.last().map_or(0.0, |last| last + self.slack(process, found, 0.0));
        let mut triplets = process.triplets(self.options)?;
        triplets.retain(|triplet| triplet.value > limit);
        Ok(triplets)
    }

    /// Goes on until the values above the last one have converged, or the products end.
    fn settle(&mut self, process: &mut GolubKahan, found: &Singular) -> Result<Vec<Triplet>> {
        let mut missed = self.beyond(process, found)?;
        let most = PATIENCE * process.steps();
        while missed.iter().any(|triplet| self.is_open(triplet, found))
            && self.left() >= 2
            && process.steps() < most
            && !process.is_exhausted()
        {
            let total = process.steps() + 1;
            self.step(process, total)?;
            missed = self.beyond(process, found)?;
        }
        Ok(missed)
    }

    /// Inserts triplets where they belong, and keeps as many as were asked for.
    fn insert(&self, process: &GolubKahan, missed: &[Triplet], found: &mut Singular) {
        for triplet in missed {
            let at = found.values.partition_point(|&value| value >= triplet.value);
            let [photo, pattern] = process.vectors(triplet);
            let wanted =
                self.options.tolerance * found.values.first().map_or(0.0, |first| first.max(triplet.value));
            found.values.insert(at, triplet.value);
            found.left.insert(at, photo);
            found.right.insert(at, pattern);
            found.residuals.insert(at, triplet.residual);
            found.standard_errors.insert(at, triplet.standard_error);
            found.statuses.insert(at, triplet.status(wanted));
        }
        let count = self.options.count;
        found.values.truncate(count);
        found.left.truncate(count);
        found.right.truncate(count);
        found.residuals.truncate(count);
        found.standard_errors.truncate(count);
        found.statuses.truncate(count);
    }
}
