//! Rows whose sums grow side by side, and what adds to them.

/// Rows of a slice, whose sums grow side by side.
pub(super) const LANES: usize = 8;

/// Eight rows of a tile with about as many entries each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::transport) struct Slice {
    /// Within the tile, or one past its last for a lane without a row.
    pub(super) rows: [u16; LANES],
    /// Entries of the longest of them.
    pub(super) steps: u32,
}

/// Adds a tile's products to the sums of its rows: `to[row] += Σ weight · from[column]`, the entries of a row in their order.
///
/// Slices take their steps one after the other. Every row must be below `to.len()`, and every column below `from.len()`.
pub(in crate::transport) type Kernel<V> = fn(&[Slice], &[[u16; LANES]], &[[f32; LANES]], &[V], &mut [V]);
