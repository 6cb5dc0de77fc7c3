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
    /// What was asked for is as good as the noise of the products allows, which is not within the tolerance.
    NoiseFloor,
    /// The monitor asked to stop; the answer is the best so far.
    Stopped,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ReachedTolerance => "reached the tolerance",
            Self::BudgetSpent => "budget spent before everything reached the tolerance",
            Self::SpaceExhausted => "the whole space is explored; the answer is exact to rounding",
            Self::NoiseFloor => "residual at the noise floor of the products",
            Self::Stopped => "stopped by the caller",
        })
    }
}
