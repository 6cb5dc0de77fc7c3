//! An operator whose photos are seen as they are taken.

use super::Live;
use crate::operator::{Adjoint, Operator, Symmetry};

/// Hands on every product, and shows it.
pub(in crate::cli) struct Watched<'a, O: ?Sized> {
    pub(super) live: &'a Live,
    pub(super) channel: usize,
    pub(super) operator: &'a mut O,
}

impl<O: Adjoint + ?Sized> Operator for Watched<'_, O> {
    fn rows(&self) -> usize {
        self.operator.rows()
    }

    fn cols(&self) -> usize {
        self.operator.cols()
    }

    fn symmetry(&self) -> Symmetry {
        self.operator.symmetry()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> crate::Result<()> {
        self.operator.apply(x, y)?;
        self.live.seen(self.channel, x, y, false)
    }

    fn announce(&mut self, xs: &[Vec<f64>]) {
        self.operator.announce(xs);
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Watched<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> crate::Result<()> {
        self.operator.apply_adjoint(y, x)?;
        self.live.seen(self.channel, y, x, true)
    }

    fn announce_adjoint(&mut self, ys: &[Vec<f64>]) {
        self.operator.announce_adjoint(ys);
    }
}
