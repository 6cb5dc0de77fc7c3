//! An operator whose photos are seen as they are taken.

use super::Live;
use crate::observer::Observer;
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

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> crate::Result<()> {
        self.operator.apply_block(xs, ys)?;
        xs.iter().zip(ys).try_for_each(|(x, y)| self.live.seen(self.channel, x, y, false))
    }

    fn block_size(&self) -> usize {
        self.operator.block_size()
    }

    fn observer(&self) -> &dyn Observer {
        self.operator.observer()
    }
}

impl<O: Adjoint + ?Sized> Adjoint for Watched<'_, O> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> crate::Result<()> {
        self.operator.apply_adjoint(y, x)?;
        self.live.seen(self.channel, y, x, true)
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> crate::Result<()> {
        self.operator.apply_adjoint_block(ys, xs)?;
        ys.iter().zip(xs).try_for_each(|(y, x)| self.live.seen(self.channel, y, x, true))
    }
}
