//! How a method ended, and what it cost.

use std::fmt;

/// What a run took, and how it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stats {
    /// Products with the operator.
    pub products: usize,
    /// Why it ended.
    pub status: Status,
}

/// Why a method ended. Displays as a sentence without its full stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// All that was asked for is within the tolerance.
    ReachedTolerance,
    /// The number of products allowed was taken; the answer is the best so far.
    BudgetSpent,
    /// The space is used up: every eigenpair is known to rounding, and no product could add to it.
    SpaceExhausted,
    /// The monitor asked to stop; the answer is the best so far.
    Stopped,
    /// The residual is as small as the noise of the products, which is not within the tolerance: going on would fit noise.
    NoiseFloor,
    /// No vector has a smaller residual: the system has no solution, and this is a least-squares one.
    LeastSquares,
    /// No vector inside the box has a smaller residual, as far as the products can tell.
    ConstrainedOptimum,
    /// The iterate no longer moves.
    Stalled,
    /// The products are not those of a symmetric operator, and the method needs one; the answer is the best before
    /// that showed.
    NotSymmetric,
    /// The method cannot go on, for this reason; the answer is the best so far.
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
