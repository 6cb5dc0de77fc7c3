//! Observers of long computations. They receive progress, messages and photos, and can stop the computation.
//!
//! Every long computation calls an [`Observer`]. The Krylov methods get the observer from their operator
//! ([`Operator::observer`](crate::operator::Operator::observer)); the tracer and the laboratory store an observer. The default everywhere
//! is `()`, an observer that does nothing.

use std::cell::RefCell;
use std::fmt;
use std::ops::ControlFlow;

use crate::finding::decimal;

/// An observer of long computations. The default of every method does nothing and lets the computation continue.
pub trait Observer {
    /// Called after each step. [`ControlFlow::Break`] stops the computation. An iterative method then returns its best result so far; any
    /// other computation ends with [`Error::Interrupted`](crate::Error::Interrupted).
    fn step(&self, _step: &Step<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called with a message for the user.
    fn log(&self, _level: Level, _message: &str) {}

    /// Called before each raw frame while a rig is set up. [`ControlFlow::Break`] ends the work with
    /// [`Error::Interrupted`](crate::Error::Interrupted).
    fn frame(&self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called after each photo. [`ControlFlow::Break`] ends the computation with [`Error::Interrupted`](crate::Error::Interrupted). If
    /// there is a journal, it already holds the photo.
    fn photo(&self, _photo: &PhotoTaken<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// The observer that does nothing.
impl Observer for () {}

/// One step of a computation.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// The name of the computation's stage, such as `loading`, `tracing` or `photos`.
    pub stage: &'static str,
    /// The number of steps so far: light paths, products with the operator, or loaded parts of a scene.
    pub done: u64,
    /// The largest possible number of steps.
    pub total: u64,
    /// The current estimate of the result.
    pub estimate: Estimate<'a>,
}

/// An estimate of a result before the computation is complete.
#[derive(Clone, Copy)]
pub enum Estimate<'a> {
    /// There is no estimate yet.
    None,
    /// Eigenpairs, in the order of the result. In the first steps there are fewer than requested.
    Eigenpairs {
        /// The eigenvalues.
        values: &'a [f64],
        /// The residual norm `‖A y − θ y‖` of each eigenpair `(θ, y)`.
        residuals: &'a [f64],
    },
    /// The solution of a linear system.
    Solution {
        /// The relative residual `‖b − A x‖ / ‖b‖` of the current iterate.
        residual: f64,
        /// The smallest relative residual so far.
        best: f64,
        /// Computes the best iterate so far without a product with `A`. With GMRES, this combines all basis vectors linearly.
        iterate: &'a dyn Fn() -> Vec<f64>,
    },
    /// The error of a low-rank model. The model of the earlier photos does not predict a part of the last photo. The error is the norm of
    /// this part, divided by the norm of the strongest photo.
    Unpredicted(f64),
}

/// Formats the estimate as a text of at most 40 characters. The text is empty if there is no estimate.
impl fmt::Display for Estimate<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None | Self::Eigenpairs { residuals: [], .. } => Ok(()),
            Self::Eigenpairs { residuals, .. } => {
                let worst = residuals.iter().copied().fold(0.0, f64::max);
                match residuals.len() {
                    1 => write!(f, "eigenvalue within {worst:.1e}"),
                    count => write!(f, "{count} eigenvalues within {worst:.1e}"),
                }
            }
            Self::Solution { best, .. } => write!(f, "relative residual {}", decimal(*best, 4)),
            Self::Unpredicted(share) => write!(f, "{:.2} % of the last photo was new", 100.0 * share),
        }
    }
}

impl fmt::Debug for Estimate<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Estimate({self})")
    }
}

/// The importance of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// A possible problem.
    Warning,
    /// A choice that the program made by itself.
    Note,
    /// A result.
    Info,
    /// A detail for diagnosis.
    Detail,
}

/// A photo and its pattern.
#[derive(Clone, Copy, Debug)]
pub struct PhotoTaken<'a> {
    /// The index of the channel.
    pub channel: usize,
    /// The pattern, one value for each pixel. It may have negative values.
    pub pattern: &'a [f64],
    /// The photo, one value for each pixel.
    pub photo: &'a [f64],
    /// True for a dual photo (a product with the transpose): the pattern then has the camera's pixels, and the photo the projector's
    /// pixels.
    pub is_dual: bool,
}

/// An observer that calls a closure at each step.
pub struct OnStep<F>(RefCell<F>);

impl<F: FnMut(&Step<'_>) -> ControlFlow<()>> OnStep<F> {
    /// Makes an observer that calls `closure` after each step.
    pub fn new(closure: F) -> Self {
        Self(RefCell::new(closure))
    }
}

impl<F: FnMut(&Step<'_>) -> ControlFlow<()>> Observer for OnStep<F> {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        match self.0.try_borrow_mut() {
            Ok(mut closure) => closure(step),
            // The closure is already running, because it performs another computation with this observer. Nested steps are not reported.
            Err(_) => ControlFlow::Continue(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_are_formatted_as_short_texts() {
        let residuals = [1e-9, 2.5e-3];
        let eigenpairs = |count| Estimate::Eigenpairs { values: &[], residuals: &residuals[..count] };
        let lines = [0, 1, 2].map(|count| eigenpairs(count).to_string());
        assert_eq!(lines, ["", "eigenvalue within 1.0e-9", "2 eigenvalues within 2.5e-3"]);
        let solution = Estimate::Solution { residual: 0.5, best: 0.25, iterate: &Vec::new };
        assert_eq!(solution.to_string(), "relative residual 0.2500");
    }

    #[test]
    fn a_closure_sees_each_step_and_stops_the_computation() {
        let mut seen = Vec::new();
        {
            let observer = OnStep::new(|step: &Step<'_>| {
                seen.push(step.done);
                if step.done < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
            });
            let step = |done| Step { stage: "photos", done, total: 3, estimate: Estimate::None };
            assert!(observer.step(&step(1)).is_continue() && observer.step(&step(2)).is_break());
        }
        assert_eq!(seen, [1, 2]);
    }
}
