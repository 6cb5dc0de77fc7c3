//! Watching a method step by step.

use std::ops::ControlFlow;

/// What a monitor sees after each step.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Products taken so far.
    pub products: usize,
    /// Products allowed.
    pub budget: usize,
    /// The wanted eigenvalues as they are now, best wanted first; fewer than asked for in the first steps.
    pub values: &'a [f64],
    /// The residual norm `‖A y − θ y‖` of each, known without a further product.
    pub residuals: &'a [f64],
}

/// Sees each step, and stops the method by [`ControlFlow::Break`].
pub type Monitor<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<()> + 'a;

/// The monitor that looks on and never stops anything.
pub fn keep_going(_: &Progress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// One step of a method, kept: the values of [`Progress`] after `products` products.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryRow {
    /// Products taken so far.
    pub products: usize,
    /// The wanted eigenvalues as they were then.
    pub values: Vec<f64>,
    /// The residual norm of each.
    pub residuals: Vec<f64>,
}
