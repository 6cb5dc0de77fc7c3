//! The end of a search for eigenvalues, and the eigenvalues that the search may have missed.
//!
//! A converged value shows that the matrix has an eigenvalue near it, but does not exclude further eigenvalues. A Krylov process finds only
//! one copy of a repeated eigenvalue, and no eigenvector that is orthogonal to its start. A search therefore makes three separate claims:
//! the *residual* of each value, whether *no value is missed*, and whether the result is *exact* because all directions were spanned.

use std::fmt;
use std::ops::ControlFlow;

use super::basis::norm;
use super::eigen::HistoryRow;
use super::powers::scaled;
use crate::error::{Error, Result};
use crate::observer::{Estimate, Observer, Step};

/// The cost of a run, and the reason why it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stats {
    /// The number of products with the operator.
    pub products: usize,
    /// The reason why the run ended.
    pub status: Status,
}

/// The reason why a method ended. It displays as a sentence without its full stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// All requested results are within the tolerance.
    ReachedTolerance,
    /// The budget of products is spent; the result is the best so far.
    BudgetSpent,
    /// The subspace is the whole space: every eigenpair is known to rounding, and no product could improve it.
    SpaceExhausted,
    /// The observer stopped the method; the result is the best so far.
    Stopped,
    /// The residual is as small as the noise of the products, which is above the tolerance. Further steps would fit noise.
    NoiseFloor,
    /// No vector has a smaller residual. The system cannot be solved exactly, so the result is a least-squares solution.
    LeastSquares,
    /// No vector inside the box has a smaller residual, within the accuracy of the products.
    ConstrainedOptimum,
    /// The iterate no longer changes.
    Stalled,
    /// The products reveal that the operator is not symmetric, but the method needs a symmetric operator. The result is the best result
    /// before the asymmetry was found.
    NotSymmetric,
    /// The method cannot continue, for this reason. The result is the best so far.
    Breakdown(&'static str),
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ReachedTolerance => "the tolerance is reached",
            Self::BudgetSpent => "all allowed products are taken",
            Self::SpaceExhausted => "the whole space is explored; the answer is exact to rounding",
            Self::Stopped => "stopped by the caller",
            Self::NoiseFloor => "the residual is as small as the noise",
            Self::LeastSquares => "no smaller residual exists: a least-squares solution",
            Self::ConstrainedOptimum => "no smaller residual exists within the bounds",
            Self::Stalled => "the iterate no longer moves",
            Self::NotSymmetric => "the operator is not symmetric",
            Self::Breakdown(reason) => return write!(f, "breakdown: {reason}"),
        })
    }
}

/// Lets a search end at the noise floor only after further steps have found nothing new.
///
/// The noise of the first products may hide an eigenvector along which a random start has only a component of about `1/√n`. All residuals
/// are then within the noise although one of the largest eigenvalues is missing. Further steps in effect start from the noise, which is a
/// random direction. Suppose that the missing eigenvalue exceeds the last wanted eigenvalue by the share `ε` of the spectrum's spread. Each
/// step then multiplies the component along the missing eigenvector by about `exp(2√ε)`, relative to the other components (the growth of
/// Chebyshev polynomials: Kuczyński and Woźniakowski, doi:10.1137/0613066). For `ε = ¼`, the component grows from `1/√n` to 1 within
/// `½ ln n` steps. An eigenvalue that is nearer to the last wanted eigenvalue may still be missed.
#[derive(Debug)]
pub(super) struct FurtherSteps {
    steps: usize,
    /// The number of consecutive steps that postponed the end.
    put_off: usize,
}

impl FurtherSteps {
    pub(super) fn new(n: usize) -> Self {
        let steps = (0.5 * (n.max(1) as f64).ln()).ceil();
        // The cast is exact: the value is at most 23, for the largest integer.
        Self { steps: steps as usize, put_off: 0 }
    }

    /// Decides whether the search ends after this step, and with which status. `reached` is the status that the residuals have reached. An
    /// end at the noise floor is postponed.
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

/// The confirmation of a search for eigenvalues. A Gaussian vector, orthogonal to all eigenvectors found, starts another Lanczos process.
/// If the search missed eigenvalues beyond the last eigenvalue found, this process finds one of them, except with a small chance.
///
/// Start a Lanczos process of `q` steps in a direction that is uniform on the sphere of `n` dimensions, and let `ξ` be its largest Ritz
/// value. Then `λ_max ≤ ξ + ε (λ_max − λ_min)`, except with a chance of `1.648 √n e^(−√ε (2q−1))`. By Courant and Fischer, the largest
/// eigenvalue on the complement of any `k` vectors is at least the `k+1`st eigenvalue of the whole matrix.
///
/// Kuczyński and Woźniakowski, *Estimating the largest eigenvalue by the power and Lanczos algorithms with a random start* (1992),
/// doi:10.1137/0613066, theorem 4.2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Confirm {
    /// `ε`, in (0, ½]. The confirmation may miss an eigenvalue that lies beyond the last eigenvalue found by at most this share of the
    /// spectrum's spread `λ_max − λ_min`. Default 0.01.
    pub share: f64,
    /// `δ`, in (0, ½]: the chance, for each vector drawn, of missing an eigenvalue that lies further out. Default 0.001.
    pub chance: f64,
    /// The largest number of products. Default: no limit.
    pub products: usize,
    /// True if the noise given to the search is part of the matrix itself and equal in all products, like the noise of a finite number of
    /// light paths. The products of this noisy matrix are then exact. Default false.
    pub is_frozen: bool,
}

impl Default for Confirm {
    fn default() -> Self {
        Self { share: 0.01, chance: 1e-3, products: usize::MAX, is_frozen: false }
    }
}

impl Confirm {
    /// The number of products `q` of one process in a space of `n` dimensions. For `n = 16,384` and `δ = 0.001`, it is 20, 28 and 62 at an
    /// `ε` of 0.1, 0.05 and 0.01. It is at most `n`, because `n` products span the space.
    pub fn steps(&self, n: usize) -> usize {
        let steps = 0.5 * ((1.648 * (n as f64).sqrt() / self.chance).ln() / self.share.sqrt() + 1.0);
        // The value is at most 10¹⁰, for the smallest share that `check` admits.
        (steps.ceil() as usize).clamp(1, n.max(1))
    }

    /// Chooses the confirmation of a search. If products cost nothing (`is_free`), the search is always confirmed, as `asked` or with the
    /// defaults. Otherwise it is confirmed only as `asked`, with one exception: if nothing was asked for and random vectors have continued
    /// a search that `broke_down`, the `left` remaining products confirm it.
    pub(super) fn of(asked: Option<Self>, is_free: bool, broke_down: bool, left: usize) -> Option<Self> {
        match (asked, is_free) {
            (asked, true) => Some(Self { is_frozen: true, ..asked.unwrap_or_default() }),
            (Some(asked), false) => Some(asked),
            (None, false) => broke_down.then(|| Self { products: left, ..Self::default() }),
        }
    }

    /// Limits the products, which are photos on a rig, to the steps of two vectors. A second vector is needed if the first vector finds an
    /// eigenvalue that the search has missed.
    #[must_use]
    pub fn on_rig(self, n: usize) -> Self {
        Self { products: self.products.min(2 * self.steps(n)), ..self }
    }

    /// The share `ε` for which a confirmation of `steps` steps in `n` dimensions holds.
    pub(super) fn share_of(&self, steps: usize, n: usize) -> f64 {
        let factor = (1.648 * (n as f64).sqrt() / self.chance).ln() / (2 * steps).saturating_sub(1) as f64;
        (factor * factor).max(self.share)
    }

    pub(super) fn check(&self) -> Result<()> {
        for (value, option) in [(self.share, "--confirm"), (self.chance, "Confirm::chance")] {
            if !(1e-9..=MOST).contains(&value) {
                return Err(Error::option(option, format!("{value} is no share between 0 and one half"))
                    .help("give a number such as 0.05"));
            }
        }
        Ok(())
    }
}

/// Reports a step of a confirmation to the observer. Fails with [`Error::Interrupted`] if the observer stops the confirmation.
pub(super) fn confirming_step(observer: &dyn Observer, done: usize, total: usize) -> Result<()> {
    let (done, total) = (done as u64, total.max(done) as u64);
    let flow = observer.step(&Step { stage: "confirming", done, total, estimate: Estimate::None });
    if flow.is_break() { Err(Error::Interrupted) } else { Ok(()) }
}

/// The largest useful share `ε`. Beyond half of the spectrum's spread, a confirmation says nothing.
pub(super) const MOST: f64 = 0.5;

/// A confirmation that finds a new pair may take this many times its planned steps, so that the pair converges.
const PATIENCE: usize = 10;

/// A search that further processes confirm. Each process runs on the complement of the pairs found so far.
pub(super) trait Confirmable {
    type Process;
    type Pair;

    /// The dimension of the complement.
    fn free(&self) -> usize;
    /// The number of further steps that the remaining products allow.
    fn left(&self) -> usize;
    /// Starts the process of round `round`, which will take about `steps` steps.
    fn begin(&self, round: u64, steps: usize) -> Result<Self::Process>;
    /// Takes one step. `total` is the expected number of steps.
    fn step(&mut self, process: &mut Self::Process, total: usize) -> Result<()>;
    /// The number of steps taken, and true if no further step is possible.
    fn progress(process: &Self::Process) -> (usize, bool);
    /// The error of the products with unit vectors.
    fn error(&self, process: Option<&Self::Process>) -> f64;
    /// The pairs of the process beyond the pairs found so far, the most wanted first.
    fn beyond(&self, process: &Self::Process) -> Result<Vec<Self::Pair>>;
    /// Returns true if more steps would improve one of these pairs.
    fn is_open(&self, pairs: &[Self::Pair]) -> bool;
    /// Inserts the missed pairs in their order, and keeps only the requested number of pairs.
    fn insert(&mut self, process: &mut Self::Process, missed: &[Self::Pair]) -> Result<()>;
    /// The limits of [`Confirmed`] for this share `ε`.
    fn limits(&self, process: &Self::Process, share: f64) -> Result<[Option<f64>; 2]>;
}

/// Confirms the `count` pairs of a search. Returns the claim, and true if a missed pair was found but has not converged.
pub(super) fn confirm_by<S: Confirmable>(
    search: &mut S,
    confirm: &Confirm,
    count: usize,
) -> Result<(Completeness, bool)> {
    // The claim if all directions are spanned by products with this error.
    let spanned = |error: f64| if error > 0.0 { Completeness::NotExcluded } else { Completeness::Exact };
    // Each round except the last inserts at least one missed pair. The number of copies of the eigenvalues limits the number of rounds.
    for round in 0..4 * count as u64 + 8 {
        let free = search.free();
        if free == 0 {
            return Ok((spanned(search.error(None)), false));
        }
        let steps = confirm.steps(free).min(search.left());
        let share = confirm.share_of(steps, free);
        if steps < free && share > MOST {
            break;
        }
        let mut process = search.begin(round, steps)?;
        let has_more = |process: &S::Process, most: usize| {
            let (done, is_exhausted) = S::progress(process);
            done < most && !is_exhausted
        };
        while has_more(&process, steps) {
            search.step(&mut process, steps)?;
        }
        let mut missed = search.beyond(&process)?;
        let most = PATIENCE * S::progress(&process).0;
        while search.is_open(&missed) && search.left() > 0 && has_more(&process, most) {
            let total = S::progress(&process).0 + 1;
            search.step(&mut process, total)?;
            missed = search.beyond(&process)?;
        }
        let is_open = search.is_open(&missed);
        search.insert(&mut process, &missed)?;
        if is_open {
            return Ok((Completeness::NotExcluded, true));
        }
        if S::progress(&process).1 {
            return Ok((spanned(search.error(Some(&process))), false));
        }
        if missed.is_empty() {
            let limits = search.limits(&process, share)?;
            let ends = limits.iter().flatten().count();
            let chance = confirm.chance * (round + 1) as f64 * ends as f64;
            return Ok((Completeness::Confirmed(Confirmed { limits, share, chance }), false));
        }
    }
    Ok((Completeness::NotExcluded, false))
}

/// The tolerance within which a value of a process may lie beyond a converged value and still count as the same value. It sums four terms:
/// the search tolerance times the norm `scale` of the operator, rounding, the norm of the residuals of the pairs found (which bounds their
/// coupling to the complement), and noise. `m` products whose errors have the norm `e` and are spread evenly over `n` entries change a
/// value by at most about `2e √(m/n)`. They change the operator that the process sees by about `2e (1 + √(m/n))`. The argument `operator`
/// is 1 for the bound on the operator's change, and 0 for the bound on a value's change.
pub(super) fn slack(
    (tolerance, scale): (f64, f64),
    (steps, n): (usize, usize),
    residuals: &[f64],
    error: f64,
    operator: f64,
) -> f64 {
    let (steps, n) = (steps as f64, n as f64);
    let rounding = f64::EPSILON * scale * (10.0 + n.sqrt() + steps);
    tolerance * scale + rounding + norm(residuals) + 2.0 * error * ((steps / n).sqrt() + operator)
}

/// Records the rows of a history after the observer has seen them.
pub(super) struct Recorder {
    budget: usize,
    pub(super) history: Vec<HistoryRow>,
}

impl Recorder {
    pub(super) fn new(budget: usize) -> Self {
        Self { budget, history: Vec::new() }
    }

    /// Records the values and residuals after a product.
    pub(super) fn row(
        &mut self,
        observer: &dyn Observer,
        products: usize,
        pairs: impl Iterator<Item = (f64, f64)>,
    ) -> ControlFlow<()> {
        let (values, residuals): (Vec<f64>, Vec<f64>) = pairs.unzip();
        let flow = observer.step(&Step {
            stage: "photos",
            done: products as u64,
            total: self.budget as u64,
            estimate: Estimate::Eigenpairs { values: &values, residuals: &residuals },
        });
        self.history.push(HistoryRow { products, values, residuals });
        flow
    }
}

/// The claim about eigenvalues (or singular values) that a search may have missed. It displays as a sentence without its full stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[serde(tag = "claim", rename_all = "kebab-case")]
pub enum Completeness {
    /// The search may have missed further copies of a repeated value, and values whose vectors were not in its subspace.
    #[default]
    NotExcluded,
    /// No value beyond the limits is missing, except with a small chance (see [`Confirm`]).
    Confirmed(Confirmed),
    /// No value is missing, because products without noise have spanned all directions.
    Exact,
}

/// The claim of a confirmed search.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Confirmed {
    /// No value below the first limit or above the second limit is missing. The limits are `λ_k ± (ε (λ_max − λ_min) + tolerance + noise)`,
    /// with the spread `λ_max − λ_min` taken from the Ritz values. A limit is `None` at an end of the spectrum that was not requested.
    pub limits: [Option<f64>; 2],
    /// `ε` of [`Confirm`].
    pub share: f64,
    /// The chance that this claim is wrong: the sum of the chances of all vectors drawn.
    pub chance: f64,
}

impl Completeness {
    /// Extends this claim, made for the last of several vectors, to the `others` vectors before it. The chances add up.
    #[must_use]
    pub fn after(self, others: u64) -> Self {
        match self {
            Self::Confirmed(claim) => {
                Self::Confirmed(Confirmed { chance: claim.chance * (others + 1) as f64, ..claim })
            }
            other => other,
        }
    }

    pub(super) fn multiply(&mut self, power: i32) {
        if let Self::Confirmed(claim) = self {
            claim.limits = claim.limits.map(|limit| limit.map(|limit| scaled(limit, power)));
        }
    }

    /// Returns true if it is known, for certain or except with a stated chance, that no value is missing.
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
        // A confirmation of 28 steps holds for a larger share `ε`, and this share needs at most 28 steps.
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
