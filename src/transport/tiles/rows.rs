//! A sparse matrix row by row.

use std::ops::Range;

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

/// A sparse matrix as pieces of consecutive rows.
pub(super) struct Pieces {
    /// The first row of each piece.
    first: Vec<usize>,
    rows: usize,
    pieces: Vec<CompressedRows>,
}

impl Pieces {
    pub(super) fn new(pieces: Vec<CompressedRows>) -> Self {
        let mut rows = 0;
        let mut first = Vec::new();
        for piece in &pieces {
            first.push(rows);
            rows += piece.row_start.len() - 1;
        }
        Self { first, rows, pieces }
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    pub(super) fn entries(&self) -> usize {
        self.pieces.iter().map(|piece| piece.columns.len()).sum()
    }

    pub(super) fn channels(&self) -> usize {
        self.pieces.first().map_or(0, |piece| piece.weights.len())
    }

    /// The piece that has a row, and the row's entries there.
    pub(super) fn row(&self, row: usize) -> (&CompressedRows, Range<usize>) {
        let which = self.first.partition_point(|&first| first <= row) - 1;
        let (piece, at) = (&self.pieces[which], row - self.first[which]);
        (piece, piece.row_start[at]..piece.row_start[at + 1])
    }

    /// Gives back the memory of the pieces whose rows are all before `row`, which must not be asked for any more.
    pub(super) fn release_before(&mut self, row: usize) {
        let ends = self.first.iter().skip(1).copied().chain([usize::MAX]);
        for (piece, end) in self.pieces.iter_mut().zip(ends) {
            if end <= row {
                *piece = CompressedRows::default();
            }
        }
    }
}
