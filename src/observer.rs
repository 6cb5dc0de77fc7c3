//! One way to watch long computations: progress, messages, photos as they are taken, and a request to stop.
//!
//! Everything that takes long tells an [`Observer`] what it does. The Krylov methods find it at their operator
//! ([`Operator::observer`](crate::operator::Operator::observer)), the tracer and the laboratory hold their own. `()` is the observer that does
//! nothing: it is the default everywhere.

use std::cell::RefCell;
use std::fmt;
use std::ops::ControlFlow;

/// Watches long computations. Every method has a default that does nothing, and never stops anything.
pub trait Observer {
    /// Called after each step. [`ControlFlow::Break`] stops the computation: an iterative method then returns the best result so far,
    /// and anything else ends with [`Error::Interrupted`](crate::Error::Interrupted).
    fn step(&self, _step: &Step<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Called with a message for a person.
    fn log(&self, _level: Level, _message: &str) {}

    /// Called after each photo. [`ControlFlow::Break`] ends the computation with
    /// [`Error::Interrupted`](crate::Error::Interrupted); the photo is kept.
    fn photo(&self, _photo: &PhotoTaken<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// The observer that does nothing.
impl Observer for () {}

/// One step of a computation.
#[derive(Clone, Copy, Debug)]
pub struct Step<'a> {
    /// What is computed, in a word or two: `tracing`, `photos`.
    pub stage: &'static str,
    /// Steps done so far: light paths, or products with the operator.
    pub done: u64,
    /// Steps in all, at most.
    pub total: u64,
    /// What is known of the result so far.
    pub estimate: Estimate<'a>,
}

/// What is known of a result before it is complete.
#[derive(Clone, Copy)]
pub enum Estimate<'a> {
    /// Nothing.
    None,
    /// Eigenpairs, the best wanted first; fewer than asked for in the first steps.
    Eigenpairs {
        /// The eigenvalues.
        values: &'a [f64],
        /// The residual norm `‖A y − θ y‖` of each.
        residuals: &'a [f64],
    },
    /// The solution of a linear system.
    Solution {
        /// `‖b − A x‖ / ‖b‖` of the current iterate.
        residual: f64,
        /// The least so far.
        best: f64,
        /// Computes the best iterate so far. It takes no product, but a combination of all basis vectors with GMRES.
        iterate: &'a dyn Fn() -> Vec<f64>,
    },
    /// A low-rank model: the part of the last photo that the model of the photos before it did not predict, as a share of the strongest
    /// photo.
    Unpredicted(f64),
}

/// A line of at most 40 characters; empty where nothing is known.
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
            Self::Solution { best, .. } => write!(f, "relative residual {best:.4}"),
            Self::Unpredicted(share) => write!(f, "{:.2} % of the last photo was new", 100.0 * share),
        }
    }
}

impl fmt::Debug for Estimate<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Estimate({self})")
    }
}

/// How important a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Something may be wrong.
    Warning,
    /// Something that was decided without being asked for.
    Note,
    /// A result.
    Info,
    /// Only of interest to somebody who looks for the cause of something.
    Detail,
}

/// A photo and the pattern that it was taken of.
#[derive(Clone, Copy, Debug)]
pub struct PhotoTaken<'a> {
    /// The channel, below the number of channels.
    pub channel: usize,
    /// The pattern, one value for each pixel; it may be signed.
    pub pattern: &'a [f64],
    /// The photo, one value for each pixel.
    pub photo: &'a [f64],
    /// Whether projector and camera have changed places, so that the pattern has the camera's pixels and the photo the
    /// projector's.
    pub is_dual: bool,
}

/// An observer that hands every step to a closure.
pub struct OnStep<F>(RefCell<F>);

impl<F: FnMut(&Step<'_>) -> ControlFlow<()>> OnStep<F> {
    /// Calls `closure` after each step.
    pub fn new(closure: F) -> Self {
        Self(RefCell::new(closure))
    }
}

impl<F: FnMut(&Step<'_>) -> ControlFlow<()>> Observer for OnStep<F> {
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        match self.0.try_borrow_mut() {
            Ok(mut closure) => closure(step),
            // A closure that computes something that is watched by itself is not told of its own steps.
            Err(_) => ControlFlow::Continue(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_fit_a_line() {
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
        let observer = OnStep::new(|step: &Step<'_>| {
            seen.push(step.done);
            if step.done < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        let step = |done| Step { stage: "photos", done, total: 3, estimate: Estimate::None };
        assert!(observer.step(&step(1)).is_continue() && observer.step(&step(2)).is_break());
        drop(observer);
        assert_eq!(seen, [1, 2]);
    }
}
