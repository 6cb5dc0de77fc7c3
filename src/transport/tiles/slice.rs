//! Slices: eight rows whose sums are computed at the same time, and the kernel's signature.

/// Rows of a slice. Their sums are computed at the same time, one per SIMD lane.
pub(super) const LANES: usize = 8;

/// Eight rows of a tile with about equally many entries.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::transport) struct Slice {
    /// Row within the tile for each lane; one past the last row for a lane without a row.
    pub(super) rows: [u16; LANES],
    /// Steps: the number of entries of the longest row.
    pub(super) steps: u32,
}

/// Adds a tile's products to the sums of its rows, `to[row] += Σ weight · from[column]`, with the entries of
/// each row in order.
///
/// The steps of a slice are taken one after the other. Every row must be below `to.len()`, and every column
/// below `from.len()`.
pub(in crate::transport) type Kernel<V> = fn(&[Slice], &[[u16; LANES]], &[[f32; LANES]], &[V], &mut [V]);
