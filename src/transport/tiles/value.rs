//! The element type of a product's vectors: one number, or four where four vectors are multiplied at once.

use bytemuck::{Pod, Zeroable};

/// Vectors that are multiplied at once: their four numbers fill one vector register.
pub(in crate::transport) const BLOCK_WIDTH: usize = 4;

/// The entries of four vectors at one row or column, in one cache line.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(in crate::transport) struct Interleaved(pub(in crate::transport) [f64; BLOCK_WIDTH]);

/// An element that a product multiplies by weights and sums.
pub(in crate::transport) trait Value: Pod + Default + Send + Sync + 'static {
    /// The element times `weight`.
    fn times(self, weight: f64) -> Self;

    /// The sum of two elements.
    fn plus(self, other: Self) -> Self;
}

impl Value for f64 {
    fn times(self, weight: f64) -> Self {
        weight * self
    }

    fn plus(self, other: Self) -> Self {
        self + other
    }
}

impl Value for Interleaved {
    fn times(self, weight: f64) -> Self {
        Self(self.0.map(|value| weight * value))
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|vector| self.0[vector] + other.0[vector]))
    }
}
