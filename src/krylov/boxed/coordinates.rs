//! The inner products of a vector with all patterns and products of a model.

/// The inner products of a vector `u` that a model needs.
#[derive(Clone, Default)]
pub(super) struct Coordinates {
    /// `Vᵀ u`.
    pub(super) c: Vec<f64>,
    /// `Wᵀ u`.
    pub(super) d: Vec<f64>,
    /// `Vᵀ D u`.
    pub(super) c_weighted: Vec<f64>,
    /// `Wᵀ D u`.
    pub(super) d_weighted: Vec<f64>,
}

impl Coordinates {
    /// Those of `a u + b v`.
    pub(super) fn combined(&self, a: f64, other: &Self, b: f64) -> Self {
        let of = |u: &[f64], v: &[f64]| u.iter().zip(v).map(|(u, v)| a * u + b * v).collect();
        Self {
            c: of(&self.c, &other.c),
            d: of(&self.d, &other.d),
            c_weighted: of(&self.c_weighted, &other.c_weighted),
            d_weighted: of(&self.d_weighted, &other.d_weighted),
        }
    }

    /// Splits sums in this order.
    pub(super) fn split(mut sums: Vec<f64>, k: usize) -> Self {
        let d_weighted = sums.split_off(3 * k);
        let c_weighted = sums.split_off(2 * k);
        let d = sums.split_off(k);
        Self { c: sums, d, c_weighted, d_weighted }
    }
}
