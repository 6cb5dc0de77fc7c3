//! The cost of a run, and why it ended.

use std::fmt;

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
