//! An operator of any size that needs no memory.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use krylux::Result;
use krylux::operator::{Operator, Symmetry};

/// `y_i = (shift + cos i) x_i + mirrored · x_{n−1−i}`: symmetric, and positive definite where `shift > 1 + mirrored`.
pub struct Comb {
    pub n: usize,
    pub shift: f64,
    pub mirrored: f64,
}

impl Comb {
    /// A comb of values of both signs.
    pub fn indefinite(n: usize) -> Self {
        Self { n, shift: 0.0, mirrored: 1.0 }
    }

    /// Solvers have something to do for dozens of steps.
    pub fn definite(n: usize) -> Self {
        Self { n, shift: 2.0, mirrored: 0.4 }
    }
}

impl Operator for Comb {
    fn rows(&self) -> usize {
        self.n
    }
    fn cols(&self) -> usize {
        self.n
    }
    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        for i in 0..x.len() {
            y[i] = x[i] * (self.shift + (i as f64).cos()) + self.mirrored * x[x.len() - 1 - i];
        }
        Ok(())
    }
}
