//! How a search ends, and which eigenvalues it may have missed.
//!
//! A converged eigenvalue says that the matrix has one there. It does not say that there is no other: a Krylov process finds one copy
//! of a repeated eigenvalue, and nothing that is orthogonal to its start. Three claims are therefore kept apart: the *residual* of each
//! value, whether *none is missed*, and whether the answer is *exact*, since all directions were spanned.

use std::fmt;

use super::powers::scaled;
use crate::error::{Error, Result};
use crate::operator::Operator;

/// The cost of a run, and why it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stats {
    /// The number of products with the operator.
    pub products: usize,
    /// Why it ended.
    pub status: Status,
}

/// Why a method ended. Displays as a sentence without its full stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Everything asked for is within the tolerance.
    ReachedTolerance,
    /// The budget of products is spent; the result is the best so far.
    BudgetSpent,
    /// The subspace is the whole space: every eigenpair is known to rounding, and no product could improve
    /// it.
    SpaceExhausted,
    /// The observer stopped the method; the result is the best so far.
    Stopped,
    /// The residual is down to the noise of the products, which is above the tolerance: further steps would
    /// fit noise.
    NoiseFloor,
    /// No vector has a smaller residual: the system has no solution, and this is a least-squares one.
    LeastSquares,
    /// No vector inside the box has a smaller residual, as far as the products can tell.
    ConstrainedOptimum,
    /// The iterate no longer moves.
    Stalled,
    /// The products are not those of a symmetric operator, and the method needs one; the result is the best
    /// before the asymmetry was found.
    NotSymmetric,
    /// The method cannot continue, for this reason; the result is the best so far.
    Breakdown(&'static str),
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ReachedTolerance => "reached the tolerance",
            Self::BudgetSpent => "budget spent before everything reached the tolerance",
            Self::SpaceExhausted => "the whole space is explored; the answer is exact to rounding",
            Self::Stopped => "stopped by the caller",
            Self::NoiseFloor => "residual at the noise floor",
            Self::LeastSquares => "no smaller residual exists: a least-squares solution",
            Self::ConstrainedOptimum => "no smaller residual exists inside the box",
            Self::Stalled => "the iterate no longer moves",
            Self::NotSymmetric => "operator is not symmetric",
            Self::Breakdown(reason) => return write!(f, "breakdown: {reason}"),
        })
    }
}

/// Lets a search end within noise only after further steps have found nothing more.
///
/// The noise of the first products may hide an eigenvector, along which a random start has a component of about `1/√n` only. All residuals are then
/// within the noise although one of the largest eigenvalues is missing. Further steps in effect start from the noise, which is a random direction.
/// Let the missing eigenvalue exceed the last wanted one by the share `ε`. Each step multiplies the component along its eigenvector by about
/// `exp(2√ε)`, relative to the others (the growth of Chebyshev polynomials: Kuczyński and Woźniakowski, doi:10.1137/0613066). `½ ln n` steps raise
/// `1/√n` to 1 for `ε = ¼`. An eigenvalue that is nearer to the last wanted one may still be missed.
#[derive(Debug)]
pub(super) struct FurtherSteps {
    /// The number of further steps.
    steps: usize,
    /// How many times in a row the end has been put off.
    put_off: usize,
}

impl FurtherSteps {
    /// For vectors of `n` entries.
    pub(super) fn new(n: usize) -> Self {
        let steps = (0.5 * (n.max(1) as f64).ln()).ceil();
        // Exact: at most 23, for the largest integer.
        Self { steps: steps as usize, put_off: 0 }
    }

    /// The status with which the search ends after this step, given the status that the residuals have reached: an end within noise is put off.
    pub(super) fn end(&mut self, reached: Option<Status>) -> Option<Status> {
        if reached != Some(Status::NoiseFloor) {
            self.put_off = 0;
            return reached;
        }
        if self.put_off == self.steps {
            return reached;
        }
        self.put_off += 1;
        None
    }
}

/// How a search is confirmed: a Gaussian vector, orthogonal to all eigenvectors that were found, starts another Lanczos process. If
/// an eigenvalue beyond the last one found was missed, that process finds one, too, except with a small chance.
///
/// The largest Ritz value `ξ` of `q` Lanczos steps from a direction that is uniform on the sphere of `n` dimensions fulfils
/// `λ_max ≤ ξ + ε (λ_max − λ_min)`, except with a chance of `1.648 √n e^(−√ε (2q−1))`. By Courant and Fischer the largest eigenvalue
/// on the complement of `k` vectors is at least the `k+1`st of the whole matrix, whatever these vectors are.
///
/// Kuczyński and Woźniakowski, *Estimating the largest eigenvalue by the power and Lanczos algorithms with a random start* (1992),
/// doi:10.1137/0613066, theorem 4.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Confirm {
    /// `ε`, in (0, ½]: the share of the spectrum's spread `λ_max − λ_min` that an eigenvalue may lie beyond the last one found and
    /// still be missed. Default 0.01.
    pub share: f64,
    /// `δ`, in (0, ½]: the chance of missing one that lies further out, for each vector that is drawn. Default 0.001.
    pub chance: f64,
    /// Products at most. Default: as many as it takes.
    pub products: usize,
    /// Whether the noise that the search was told of is in the matrix itself, the same in all products, as that of a finite number of light
    /// paths: the products then tell the matrix exactly. Default false.
    pub is_frozen: bool,
}

impl Default for Confirm {
    fn default() -> Self {
        Self { share: 0.01, chance: 1e-3, products: usize::MAX, is_frozen: false }
    }
}

impl Confirm {
    /// The products `q` of one process in a space of `n` dimensions: 20, 28 and 62 at `n = 16,384` and `δ = 0.001` for `ε` of 0.1,
    /// 0.05 and 0.01; never more than `n`, which span the space.
    pub fn steps(&self, n: usize) -> usize {
        let steps = 0.5 * ((1.648 * (n as f64).sqrt() / self.chance).ln() / self.share.sqrt() + 1.0);
        // At most 10¹⁰ for the smallest share that `check` admits.
        (steps.ceil() as usize).clamp(1, n.max(1))
    }

    /// How a search is confirmed, as far as this was `asked` for: at no cost where `is_free`; otherwise, where random vectors have continued a
    /// search that `broke_down`, by the products that are `left`.
    pub(super) fn of(asked: Option<Self>, is_free: bool, broke_down: bool, left: usize) -> Option<Self> {
        match (asked, is_free) {
            (asked, true) => Some(Self { is_frozen: true, ..asked.unwrap_or_default() }),
            (Some(asked), false) => Some(asked),
            (None, false) => broke_down.then(|| Self { products: left, ..Self::default() }),
        }
    }

    /// On a rig: as many products at most as two vectors take, of which the first may find an eigenvalue that the search has missed.
    #[must_use]
    pub fn on_rig(self, n: usize) -> Self {
        Self { products: self.products.min(2 * self.steps(n)), ..self }
    }

    /// The share `ε` that so many steps in `n` dimensions reach.
    pub(super) fn share_of(&self, steps: usize, n: usize) -> f64 {
        let factor = (1.648 * (n as f64).sqrt() / self.chance).ln() / (2 * steps).saturating_sub(1) as f64;
        (factor * factor).max(self.share)
    }

    /// # Errors
    /// [`Error::Option`] naming `--confirm` or `Confirm::chance`.
    pub(super) fn check(&self) -> Result<()> {
        for (value, option) in [(self.share, "--confirm"), (self.chance, "Confirm::chance")] {
            if !(1e-9..=MOST).contains(&value) {
                return Err(Error::Option {
                    option: option.into(),
                    fault: format!("{value} is no share between 0 and one half"),
                    help: "give a number such as 0.05".into(),
                });
            }
        }
        Ok(())
    }
}

/// Lets `work` take products that only confirm an answer; it is told whether they cost nothing. Returns that as well, and what `work` found: nothing
/// where the photos of a run answer, which hold what was asked of the run and confirm nothing else.
///
/// # Errors
/// Those of `work`.
pub fn confirming<O: Operator + ?Sized, T>(
    operator: &mut O,
    work: impl FnOnce(&mut O, bool) -> Result<T>,
) -> Result<(bool, Option<T>)> {
    let is_free = operator.confirming(true);
    let found = work(operator, is_free);
    operator.confirming(false);
    match found {
        Err(Error::NotTaken { .. }) if is_free => Ok((is_free, None)),
        found => Ok((is_free, Some(found?))),
    }
}

/// Beyond half of the spectrum's spread, a confirmation says nothing that is of use.
pub(super) const MOST: f64 = 0.5;

/// What is known of eigenvalues (or singular values) that a search may have missed. Displays as a sentence without its full stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[serde(tag = "claim", rename_all = "kebab-case")]
pub enum Completeness {
    /// Further copies of a repeated value, and values whose vectors the search has not met, are not excluded.
    #[default]
    NotExcluded,
    /// None beyond the limits is missing, except with a small chance: see [`Confirm`].
    Confirmed(Confirmed),
    /// All directions were spanned, without noise: none is missing.
    Exact,
}

/// A search that was confirmed.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Confirmed {
    /// No value below the first or above the second is missing: `λ_k ± (ε (λ_max − λ_min) + tolerance + noise)`, with the spread as the
    /// Ritz values show it. `None` at an end of the spectrum that was not asked for.
    pub limits: [Option<f64>; 2],
    /// `ε` of [`Confirm`].
    pub share: f64,
    /// The chance that this is wrong: the sum over the vectors that were drawn.
    pub chance: f64,
}

impl Completeness {
    /// The claim of the last of several vectors, after so many others: their chances add up.
    #[must_use]
    pub fn after(self, others: u64) -> Self {
        match self {
            Self::Confirmed(claim) => {
                Self::Confirmed(Confirmed { chance: claim.chance * (others + 1) as f64, ..claim })
            }
            other => other,
        }
    }

    /// Multiplies the limits by `2^power`.
    pub(super) fn multiply(&mut self, power: i32) {
        if let Self::Confirmed(claim) = self {
            claim.limits = claim.limits.map(|limit| limit.map(|limit| scaled(limit, power)));
        }
    }

    /// Whether nothing is missing, for certain or except with a stated chance.
    pub fn is_known(&self) -> bool {
        *self != Self::NotExcluded
    }
}

impl fmt::Display for Completeness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotExcluded => f.write_str("further copies and other values are not excluded"),
            Self::Exact => f.write_str("none is missing: all directions were spanned"),
            Self::Confirmed(Confirmed { limits, chance, .. }) => {
                let name = |value: f64| format!("{value:.4e}").parse::<f64>().unwrap_or(value);
                match limits.map(|limit| limit.map(name)) {
                    [Some(low), Some(high)] => write!(f, "none below {low} or above {high} is missing")?,
                    [Some(low), None] => write!(f, "none below {low} is missing")?,
                    [None, high] => write!(f, "none above {} is missing", high.unwrap_or(f64::INFINITY))?,
                }
                write!(f, ", except with a chance of {chance:.1e}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_within_noise_waits_for_half_the_logarithm_of_the_size() {
        let mut confirmation = FurtherSteps::new(576);
        // ½ ln 576 is 3.2.
        for _ in 0..4 {
            assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        }
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), Some(Status::NoiseFloor));
    }

    #[test]
    fn a_residual_above_the_noise_starts_it_anew_and_a_tolerance_needs_none() {
        let mut confirmation = FurtherSteps::new(9);
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        assert_eq!(confirmation.end(None), None);
        assert_eq!(confirmation.end(Some(Status::NoiseFloor)), None);
        assert_eq!(confirmation.end(Some(Status::ReachedTolerance)), Some(Status::ReachedTolerance));
    }

    #[test]
    fn the_number_of_products_is_that_of_the_bound() {
        let steps = |share| Confirm { share, ..Confirm::default() }.steps(16_384);
        assert_eq!([0.1, 0.05, 0.01].map(steps), [20, 28, 62]);
        let confirm = Confirm::default();
        assert_eq!((confirm.steps(5), confirm.steps(1)), (5, 1), "as many span the space");
        // Fewer steps than it takes reach a larger share, and that share takes no more steps.
        let share = confirm.share_of(28, 16_384);
        assert!((0.045..0.05).contains(&share), "{share}");
        assert!(Confirm { share, ..confirm }.steps(16_384) <= 28);
    }

    #[test]
    fn shares_that_say_nothing_are_refused() {
        for share in [0.0, -0.1, 0.6, f64::NAN] {
            assert!(Confirm { share, ..Confirm::default() }.check().is_err(), "{share}");
        }
        assert!(Confirm { share: 0.5, ..Confirm::default() }.check().is_ok());
    }
}
