//! An operator that remembers what it was asked.

use super::figure::Shot;
use crate::error::Result;
use crate::operator::{Adjoint, Operator, Symmetry};

/// Keeps every pattern with its photo. A transposed product (a photo of the dual rig) is kept like any other.
pub(super) struct Recorded<'a> {
    operator: &'a mut dyn Adjoint,
    pub(super) shots: Vec<Shot>,
}

impl<'a> Recorded<'a> {
    pub(super) fn new(operator: &'a mut dyn Adjoint) -> Self {
        Self { operator, shots: Vec::new() }
    }
}

impl Operator for Recorded<'_> {
    fn rows(&self) -> usize {
        self.operator.rows()
    }
    fn cols(&self) -> usize {
        self.operator.cols()
    }
    fn symmetry(&self) -> Symmetry {
        self.operator.symmetry()
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.operator.apply(x, y)?;
        self.shots.push(Shot { pattern: x.to_vec(), photo: y.to_vec() });
        Ok(())
    }
}

impl Adjoint for Recorded<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.operator.apply_adjoint(y, x)?;
        self.shots.push(Shot { pattern: y.to_vec(), photo: x.to_vec() });
        Ok(())
    }
}
