//! What stands at a row or a column: a number, or several side by side where several vectors are multiplied at once.

use std::sync::OnceLock;

use super::sums::{Kernel, Sums};

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

    /// By instructions that not every processor has.
    fn special() -> Option<Kernel<Self>>;

    /// The quickest way to add up such values, found out once.
    fn sums() -> Sums<Self>;
}

impl Value for f64 {
    fn times(self, weight: f64) -> Self {
        weight * self
    }

    fn plus(self, other: Self) -> Self {
        self + other
    }

    fn special() -> Option<Kernel<Self>> {
        #[cfg(target_arch = "x86_64")]
        return super::gather::of_one();
        #[cfg(not(target_arch = "x86_64"))]
        None
    }

    fn sums() -> Sums<Self> {
        static FASTEST: OnceLock<Sums<f64>> = OnceLock::new();
        *FASTEST.get_or_init(Sums::fastest)
    }
}

impl Value for Abreast {
    fn times(self, weight: f64) -> Self {
        Self(self.0.map(|value| weight * value))
    }

    fn plus(self, other: Self) -> Self {
        Self(std::array::from_fn(|vector| self.0[vector] + other.0[vector]))
    }

    fn special() -> Option<Kernel<Self>> {
        #[cfg(target_arch = "x86_64")]
        return super::gather::of_four();
        #[cfg(not(target_arch = "x86_64"))]
        None
    }

    fn sums() -> Sums<Self> {
        static FASTEST: OnceLock<Sums<Abreast>> = OnceLock::new();
        *FASTEST.get_or_init(Sums::fastest)
    }
}
