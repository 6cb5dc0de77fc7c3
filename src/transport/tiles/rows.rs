//! A sparse matrix row by row.

use std::ops::Range;

/// A sparse matrix in compressed rows. An entry has one `f32` weight for each channel. Layers are built and written in this form.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct CompressedRows {
    /// The offset of each row into `columns`. The last element is the number of entries.
    pub(crate) row_start: Vec<usize>,
    /// The column of each entry, ascending in each row.
    pub(crate) columns: Vec<u32>,
    /// The weights, indexed by `[channel][entry]`.
    pub(crate) weights: Vec<Vec<f32>>,
}

impl CompressedRows {
    /// A matrix without rows for this many channels, with reserved memory for rows and entries.
    pub(crate) fn with_room(channels: usize, rows: usize, entries: usize) -> Self {
        let mut row_start = Vec::with_capacity(rows + 1);
        row_start.push(0);
        Self {
            row_start,
            columns: Vec::with_capacity(entries),
            weights: (0..channels).map(|_| Vec::with_capacity(entries)).collect(),
        }
    }

    pub(crate) fn rows(&self) -> usize {
        self.row_start.len().saturating_sub(1)
    }

    pub(in crate::transport) fn row(&self, row: usize) -> Range<usize> {
        self.row_start[row]..self.row_start[row + 1]
    }

    /// Appends entries of another matrix to the current row, which [`CompressedRows::end_row`] will end.
    pub(in crate::transport) fn extend(&mut self, from: &Self, entries: Range<usize>) {
        self.columns.extend_from_slice(&from.columns[entries.clone()]);
        for (to, from) in self.weights.iter_mut().zip(&from.weights) {
            to.extend_from_slice(&from[entries.clone()]);
        }
    }

    /// The transpose of the `wanted` columns, with a row for each of these columns. The first row of this matrix becomes the column
    /// `first`.
    pub(in crate::transport) fn transposed(&self, wanted: &Range<usize>, first: usize) -> Self {
        let of_row = |row: usize| {
            let (start, columns) = (self.row_start[row], &self.columns[self.row(row)]);
            let at = |column: usize| start + columns.partition_point(|&c| (c as usize) < column);
            at(wanted.start)..at(wanted.end)
        };
        let place = |entry: usize| self.columns[entry] as usize - wanted.start;
        let mut row_start = vec![0; wanted.len() + 1];
        (0..self.rows()).flat_map(of_row).for_each(|entry| row_start[place(entry) + 1] += 1);
        (0..wanted.len()).for_each(|row| row_start[row + 1] += row_start[row]);
        let mut next = row_start.clone();
        let entries = row_start[wanted.len()];
        let (mut columns, mut weights) = (vec![0; entries], vec![vec![0.0; entries]; self.weights.len()]);
        // Rows are visited in order, so the entries of each transposed row are filled in from left to right.
        for row in 0..self.rows() {
            for entry in of_row(row) {
                let at = &mut next[place(entry)];
                columns[*at] = (first + row) as u32;
                weights.iter_mut().zip(&self.weights).for_each(|(to, from)| to[*at] = from[entry]);
                *at += 1;
            }
        }
        Self { row_start, columns, weights }
    }

    pub(crate) fn end_row(&mut self) {
        self.row_start.push(self.columns.len());
    }
}

pub(in crate::transport) struct Pieces {
    /// The first row of each piece, and the end of the last piece.
    first: Vec<usize>,
    pieces: Vec<CompressedRows>,
}

impl Pieces {
    pub(in crate::transport) fn new(first: usize, pieces: Vec<CompressedRows>) -> Self {
        let ends = pieces.iter().scan(first, |end, piece| {
            *end += piece.rows();
            Some(*end)
        });
        Self { first: std::iter::once(first).chain(ends).collect(), pieces }
    }

    pub(in crate::transport) fn end(&self) -> usize {
        self.first[self.first.len() - 1]
    }

    pub(super) fn rows(&self) -> usize {
        self.end() - self.first[0]
    }

    pub(super) fn entries(&self) -> usize {
        self.pieces.iter().map(|piece| piece.columns.len()).sum()
    }

    /// The piece that contains a row, and the range of the row's entries in that piece.
    pub(super) fn row(&self, row: usize) -> (&CompressedRows, Range<usize>) {
        let which = self.first.partition_point(|&first| first <= row) - 1;
        let piece = &self.pieces[which];
        (piece, piece.row(row - self.first[which]))
    }

    /// Frees the pieces whose rows all come before `row`. These rows must not be requested afterwards.
    pub(in crate::transport) fn release_before(&mut self, row: usize) {
        for (piece, &end) in self.pieces.iter_mut().zip(&self.first[1..]) {
            if end <= row {
                *piece = CompressedRows::default();
            }
        }
    }
}
