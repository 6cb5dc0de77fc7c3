//! What stands at a row or a column: a number, or several side by side where several vectors are multiplied at once.

/// Vectors that are multiplied at once: their four numbers are one register of today's processors.
pub(in crate::transport) const ABREAST: usize = 4;

/// Of four vectors, in one line of the caches.
#[repr(align(32))]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::transport) struct Abreast(pub(in crate::transport) [f64; ABREAST]);

/// A number of each vector.
pub(in crate::transport) trait Value: Copy + Default + Send + Sync + 'static {
    /// Times `weight`.
    fn times(self, weight: f64) -> Self;

    /// The sum.
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

impl Value for Abreast {
    fn times(self, weight: f64) -> Self {
        Self(self.0.map(|value| weight * value))
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|vector| self.0[vector] + other.0[vector]))
    }
}
