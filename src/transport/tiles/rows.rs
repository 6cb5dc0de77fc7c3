//! A sparse matrix row by row.

/// A sparse matrix of one set of `f32` weights per channel on a common pattern, in compressed rows: what it is built from and
/// written as.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CompressedRows {
    /// One offset into `columns` for each row, and their number last.
    pub(crate) row_start: Vec<usize>,
    /// Ascending in each row.
    pub(crate) columns: Vec<u32>,
    /// `[channel][entry]`
    pub(crate) weights: Vec<Vec<f32>>,
}
