//! The result of a compensation with its quality figures.

use super::run::{Planes, Solved};
use super::target::{norm_of, residual_norm};
use super::{CompensateOptions, Compensation, Target};
use crate::analysis::similarity::similarity;
use crate::error::Result;
use crate::krylov::{Constraint, Status};

/// Residuals that differ by less are equal, because patterns and photos are stored in single precision.
pub(super) const ROUNDING: f64 = 1e-6;

/// A projected pattern and its photos, taken or modelled. Each has one plane per channel, and photos are without ambient light.
pub(super) struct Answer<'a> {
    pub(super) target: &'a Target,
    pub(super) options: &'a CompensateOptions,
    pub(super) peak: f64,
    /// The target light from the projector.
    pub(super) b: &'a [Vec<f64>],
    pub(super) pattern: Planes,
    pub(super) observed: Planes,
    pub(super) uncompensated: Planes,
}

impl Answer<'_> {
    /// Completes the result with the figures that the method reports. A pattern is good in three cases: it is within the tolerance; it is
    /// no worse than no compensation and the optimum inside the box; or it is better than no compensation, nobody asked for a tolerance,
    /// and its photos allowed no more. Preparation and comparisons are left empty.
    pub(super) fn of(self, solved: Solved) -> Result<Compensation> {
        let Self { target, options, peak, b, pattern, observed, uncompensated } = self;
        let scale = norm_of(b);
        let residual = residual_norm(b, &observed) / scale;
        let uncompensated_residual = residual_norm(b, &uncompensated) / scale;
        // The method's recurrence agrees with a photo only up to rounding.
        let reached = residual <= options.rtol * (1.0 + ROUNDING);
        let boxed = options.method.facts().constraint == Constraint::Box;
        let optimal = boxed && solved.status == Status::ConstrainedOptimum;
        let spent = !options.must_reach
            && matches!(solved.status, Status::BudgetSpent | Status::NoiseFloor | Status::LeastSquares);
        let (radiance, observed) = (target.radiance(peak)?, target.photo(&observed)?);
        let uncompensated = target.photo(&uncompensated)?;
        Ok(Compensation {
            unclipped: if pattern == solved.patterns { None } else { Some(target.image(&solved.patterns)?) },
            pattern: target.image(&pattern)?,
            similarity: similarity(&observed, &radiance, peak)?,
            uncompensated_similarity: similarity(&uncompensated, &radiance, peak)?,
            target: radiance,
            observed,
            uncompensated,
            peak,
            residual,
            unclipped_residual: solved.residual,
            uncompensated_residual,
            history: solved.history,
            baseline: Vec::new(),
            photos: solved.photos,
            frames: solved.frames,
            preparation: 0,
            clamping: None,
            status: solved.status,
            good: reached
                || (optimal && residual <= uncompensated_residual + ROUNDING)
                || (spent && residual < uncompensated_residual),
        })
    }
}
