//! Wrappers that give an operator another observer, or record its products.

use std::cell::RefCell;
use std::ops::ControlFlow;

use super::{Adjoint, Direction, Operator, Vectors, delegate};
use crate::error::Result;
use crate::observer::{Level, Observer, PhotoTaken, Step};

/// An operator with a replaced observer. Everything else is unchanged.
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
    /// Wraps `operator`; `observer` replaces its observer.
    pub fn new(operator: &'a mut O, observer: &'a dyn Observer) -> Self {
        Self { operator, observer }
    }
}

impl<O: Operator + ?Sized> Operator for Observed<'_, O> {
    delegate!(operator: rows, cols, symmetry, apply, block_size, standard_errors, variances, common_error, frames, confirming);
    delegate!(operator: vectors, apply_within);

    fn observer(&self) -> &dyn Observer {
        self.observer
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Observed<'_, O> {
    delegate!(operator: adjoint);
}

/// An operator that sends its steps through a closure. The closure may pass each step, changed or not, to the original observer.
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
            // The closure itself started a computation with this observer. The steps of that computation pass unchanged.
            Err(_) => own.step(step),
        }
    }

    fn log(&self, level: Level, message: &str) {
        self.operator.observer().log(level, message);
    }

    fn frame(&self) -> ControlFlow<()> {
        self.operator.observer().frame()
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
    delegate!(operator: rows, cols, symmetry, apply, block_size, standard_errors, variances, common_error, frames, confirming);
    delegate!(operator: vectors, apply_within);

    fn observer(&self) -> &dyn Observer {
        self
    }
}

impl<O, F> Adjoint for Relayed<'_, O, F>
where
    O: Adjoint + ?Sized,
    F: FnMut(&dyn Observer, &Step<'_>) -> ControlFlow<()>,
{
    delegate!(operator: adjoint);
}

/// An operator that records its products, and the number of camera frames taken for them.
pub struct Recorded<'a, O: ?Sized> {
    operator: &'a mut O,
    before: Option<u64>,
    keeps_products: bool,
    /// All products in order, including products with the transpose.
    pub products: Vec<Product>,
    /// The number of frames after each product, in order, counted from the start of this record. It is empty if products are computed
    /// ([`Operator::frames`]).
    pub frames: Vec<u64>,
}

/// A vector and its product.
#[derive(Clone, Debug, PartialEq)]
pub struct Product {
    /// `x`.
    pub from: Vec<f64>,
    /// `A x`, or `Aᵀ x`.
    pub to: Vec<f64>,
}

impl<'a, O: Operator + ?Sized> Recorded<'a, O> {
    /// Wraps `operator` with an empty record.
    pub fn new(operator: &'a mut O) -> Self {
        let before = operator.frames();
        Self { operator, before, keeps_products: true, products: Vec::new(), frames: Vec::new() }
    }

    /// Wraps `operator` and records only frames, to save the memory of the vectors.
    pub fn of_frames(operator: &'a mut O) -> Self {
        Self { keeps_products: false, ..Self::new(operator) }
    }

    fn record(&mut self, from: &[&[f64]], to: &[&mut [f64]]) {
        if self.keeps_products {
            let products = from.iter().zip(to);
            self.products.extend(products.map(|(from, to)| Product { from: from.to_vec(), to: to.to_vec() }));
        }
        self.count(from.len());
    }

    /// Records the frames of the last products, of this number.
    fn count(&mut self, products: usize) {
        if let Some((now, before)) = self.operator.frames().zip(self.before) {
            self.frames.resize(self.frames.len() + products, now - before);
        }
    }
}

impl<O: Operator + ?Sized> Operator for Recorded<'_, O> {
    delegate!(operator: rows, cols, symmetry, block_size, observer, standard_errors, variances, common_error, frames);
    delegate!(operator: vectors);

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_block(xs, ys)?;
        self.record(xs, ys);
        Ok(())
    }

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        self.operator.apply_within(vectors, column, direction)?;
        if self.keeps_products {
            self.products.push(vectors.product()?);
        }
        self.count(1);
        Ok(())
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Recorded<'_, O> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_adjoint_block(ys, xs)?;
        self.record(ys, xs);
        Ok(())
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

    /// A rig that has taken this number of frames. Each product takes two more frames.
    struct TwoFrames(u64);

    impl Operator for TwoFrames {
        fn rows(&self) -> usize {
            3
        }

        fn cols(&self) -> usize {
            3
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            self.0 += 2;
            y.copy_from_slice(x);
            Ok(())
        }

        fn frames(&self) -> Option<u64> {
            Some(self.0)
        }
    }

    #[test]
    fn frames_are_counted_from_where_the_counter_began() -> Result<()> {
        let mut rig = TwoFrames(7);
        let mut recorded = Recorded::new(&mut rig);
        let (x, mut y, mut z) = ([1.0, 2.0, 3.0], [0.0; 3], [0.0; 3]);
        recorded.apply(&x, &mut y)?;
        recorded.apply_block(&[&x, &x], &mut [&mut y, &mut z])?;
        assert_eq!(recorded.frames, [2, 6, 6]);
        assert_eq!((y, recorded.frames()), (x, Some(13)));
        assert_eq!(recorded.products, vec![Product { from: x.into(), to: x.into() }; 3]);
        Ok(())
    }

    #[test]
    fn computed_products_cost_no_frames() -> Result<()> {
        let mut computed = Closure::new(3, 3, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            y.copy_from_slice(x);
            Ok(())
        });
        let mut recorded = Recorded::of_frames(&mut computed);
        recorded.apply(&[1.0; 3], &mut [0.0; 3])?;
        assert!(recorded.frames.is_empty() && recorded.frames().is_none() && recorded.products.is_empty());
        Ok(())
    }
}
