//! A sparse matrix row by row.

/// A sparse matrix in compressed rows, with one set of `f32` weights per channel on a common sparsity
/// pattern: the form in which layers are built and written.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CompressedRows {
    /// The offset into `columns` for each row, then the number of entries.
    pub(crate) row_start: Vec<usize>,
    /// Column of each entry, ascending in each row.
    pub(crate) columns: Vec<u32>,
    /// `[channel][entry]`
    pub(crate) weights: Vec<Vec<f32>>,
}
