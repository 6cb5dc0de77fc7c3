//! Operators with another observer.

use std::cell::RefCell;
use std::ops::ControlFlow;

use super::{Adjoint, Operator, delegate};
use crate::error::Result;
use crate::observer::{Level, Observer, PhotoTaken, Step};

/// An operator with an observer put in; everything else is the operator's own.
///
/// ```
/// use std::ops::ControlFlow;
///
/// use krylux::krylov::{EigsOptions, eigs};
/// use krylux::observer::{OnStep, Step};
/// use krylux::operator::{Closure, Observed, Symmetry};
///
/// # fn main() -> krylux::Result<()> {
/// let mut diagonal = Closure::new(100, 100, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
///     y.iter_mut().zip(x).enumerate().for_each(|(i, (y, x))| *y = (i as f64).sqrt() * x);
///     Ok(())
/// });
/// let observer = OnStep::new(|step: &Step<'_>| {
///     if step.done < 20 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
/// });
/// let found = eigs(&mut Observed::new(&mut diagonal, &observer), &EigsOptions::default())?;
/// assert_eq!(found.stats.products, 20);
/// # Ok(())
/// # }
/// ```
pub struct Observed<'a, O: ?Sized> {
    operator: &'a mut O,
    observer: &'a dyn Observer,
}

impl<'a, O: ?Sized> Observed<'a, O> {
    /// `operator`, watched by `observer` and not by the observer it had.
    pub fn new(operator: &'a mut O, observer: &'a dyn Observer) -> Self {
        Self { operator, observer }
    }
}

impl<O: Operator + ?Sized> Operator for Observed<'_, O> {
    delegate!(operator: rows, cols, symmetry, apply, block_size, standard_errors, common_error, frames, confirming);

    fn observer(&self) -> &dyn Observer {
        self.observer
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Observed<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.operator.apply_adjoint(y, x)
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_adjoint_block(ys, xs)
    }
}

/// An operator whose steps go through a closure, which may pass them on to the operator's own observer,
/// changed or not.
pub struct Relayed<'a, O: ?Sized, F> {
    operator: &'a mut O,
    closure: RefCell<F>,
}

impl<'a, O, F> Relayed<'a, O, F>
where
    O: Operator + ?Sized,
    F: FnMut(&dyn Observer, &Step<'_>) -> ControlFlow<()>,
{
    /// Calls `closure` with the observer of `operator` and each step.
    pub fn new(operator: &'a mut O, closure: F) -> Self {
        Self { operator, closure: RefCell::new(closure) }
    }
}

impl<O, F> Observer for Relayed<'_, O, F>
where
    O: Operator + ?Sized,
    F: FnMut(&dyn Observer, &Step<'_>) -> ControlFlow<()>,
{
    fn step(&self, step: &Step<'_>) -> ControlFlow<()> {
        let own = self.operator.observer();
        match self.closure.try_borrow_mut() {
            Ok(mut closure) => closure(own, step),
            // The closure started a computation with this very observer: its steps pass unchanged.
            Err(_) => own.step(step),
        }
    }

    fn log(&self, level: Level, message: &str) {
        self.operator.observer().log(level, message);
    }

    fn photo(&self, photo: &PhotoTaken<'_>) -> ControlFlow<()> {
        self.operator.observer().photo(photo)
    }
}

impl<O, F> Operator for Relayed<'_, O, F>
where
    O: Operator + ?Sized,
    F: FnMut(&dyn Observer, &Step<'_>) -> ControlFlow<()>,
{
    delegate!(operator: rows, cols, symmetry, apply, block_size, standard_errors, common_error, frames, confirming);

    fn observer(&self) -> &dyn Observer {
        self
    }
}

impl<O, F> Adjoint for Relayed<'_, O, F>
where
    O: Adjoint + ?Sized,
    F: FnMut(&dyn Observer, &Step<'_>) -> ControlFlow<()>,
{
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.operator.apply_adjoint(y, x)
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_adjoint_block(ys, xs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observer::{Estimate, OnStep};
    use crate::operator::{Closure, Symmetry};

    #[test]
    fn a_relay_changes_what_the_observer_sees() {
        let mut ramp = Closure::new(9, 9, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            y.iter_mut().zip(x).enumerate().for_each(|(i, (y, x))| *y = i as f64 * x);
            Ok(())
        });
        let mut seen = Vec::new();
        let mut stages = Vec::new();
        {
            let observer = OnStep::new(|step: &Step<'_>| {
                seen.push(step.done);
                ControlFlow::Continue(())
            });
            let mut observed = Observed::new(&mut ramp, &observer);
            let relayed = Relayed::new(&mut observed, |observer: &dyn Observer, step: &Step<'_>| {
                stages.push(step.stage);
                observer.step(&Step { done: step.done + 100, ..*step })
            });
            for done in 1..=3 {
                let step = Step { stage: "photos", done, total: 3, estimate: Estimate::None };
                assert!(relayed.observer().step(&step).is_continue());
            }
        }
        assert_eq!(seen, [101, 102, 103]);
        assert_eq!(stages, ["photos"; 3]);
    }
}
