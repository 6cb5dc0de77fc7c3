//! Contributions to the matrix, row by row.

use std::ops::Range;

/// The position of a contribution within a row: the pixel at the other end of the path, and (in the lowest
/// bits) its class of bounces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub(super) struct Key(u32);

impl Key {
    const CLASS_BITS: u32 = 2;
    /// Marks a single contribution, not yet summed, from the second half of the samples.
    const HALF: u32 = 1 << 31;

    /// The key for this pixel and class.
    pub(super) fn new(other: u32, class: u32) -> Self {
        debug_assert!(other < 1 << 28 && class < 1 << Self::CLASS_BITS);
        Self(other << Self::CLASS_BITS | class)
    }

    /// This key, for a single contribution of this half of the samples.
    pub(super) fn of_half(self, half: usize) -> Self {
        Self(self.0 | (half as u32 * Self::HALF))
    }

    /// The half of the samples that a single contribution is of, 0 or 1.
    pub(super) fn half(self) -> usize {
        usize::from(self.0 & Self::HALF != 0)
    }

    /// The key of all contributions of the same pixel and class.
    pub(super) fn position(self) -> Self {
        Self(self.0 & !Self::HALF)
    }

    /// The pixel at the other end.
    pub(super) fn other(self) -> u32 {
        self.0 >> Self::CLASS_BITS
    }

    /// The class of bounces.
    pub(super) fn class(self) -> usize {
        (self.0 & ((1 << Self::CLASS_BITS) - 1)) as usize
    }
}

/// The paths from one pixel. A pixel of the camera is a row of the matrix, a pixel of the projector a column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) pixel: u32,
    pub(super) from_camera: bool,
    /// Index after its last entry in the chunk.
    pub(super) end: usize,
}

/// Rows of finished pixels in ascending order, each with its entries by ascending key.
#[derive(Clone, Debug)]
pub(super) struct Chunk<const C: usize> {
    pub(super) rows: Vec<Row>,
    pub(super) keys: Vec<Key>,
    /// Means over the samples, for each key.
    pub(super) means: Vec<[f32; C]>,
    /// Their errors (`e` of [`super::Noise`]).
    pub(super) errors: Vec<[f32; C]>,
}

impl<const C: usize> Chunk<C> {
    /// Each row with the range of its entries.
    pub(super) fn spans(&self) -> impl Iterator<Item = (Row, Range<usize>)> + '_ {
        let starts = std::iter::once(0).chain(self.rows.iter().map(|row| row.end));
        self.rows.iter().zip(starts).map(|(&row, start)| (row, start..row.end))
    }

    /// The rows of the camera's pixels, and those of the projector's, which come after them.
    fn split(mut self) -> [Self; 2] {
        let row = self.rows.partition_point(|row| row.from_camera);
        let entry = if row == 0 { 0 } else { self.rows[row - 1].end };
        let mut rows = self.rows.split_off(row);
        rows.iter_mut().for_each(|row| row.end -= entry);
        let keys = self.keys.split_off(entry);
        let (means, errors) = (self.means.split_off(entry), self.errors.split_off(entry));
        [self, Self { rows, keys, means, errors }]
    }

    /// Whether its rows are some of these `pixels`, in ascending order, with their entries in ascending order, each of `classes` classes and at one of
    /// `others` pixels.
    pub(super) fn is_of(&self, pixels: &Range<usize>, others: usize, classes: usize) -> bool {
        let is_row = |(row, span): (Row, Range<usize>)| {
            let keys = &self.keys[span];
            pixels.contains(&(row.pixel as usize))
                && keys.is_sorted_by(|a, b| a < b)
                && keys.last().is_some_and(|last| (last.other() as usize) < others)
                && keys.iter().all(|key| key.class() < classes)
        };
        self.rows.is_sorted_by(|a, b| a.pixel < b.pixel) && self.spans().all(is_row)
    }

    /// Every contribution: the pixel that its paths start from, its key, and the bits of its values.
    pub(super) fn contributions(&self) -> impl Iterator<Item = (u32, Key, [[u32; C]; 2])> + '_ {
        let of_row = move |(row, span): (Row, Range<usize>)| {
            span.map(move |at| {
                let values = [self.means[at], self.errors[at]].map(|values| values.map(f32::to_bits));
                (row.pixel, self.keys[at], values)
            })
        };
        self.spans().flat_map(of_row)
    }

    /// The chunks of the camera's paths, and those of the projector's, which come after them.
    pub(super) fn by_endpoint(chunks: Vec<Self>) -> [Vec<Self>; 2] {
        let mut parts = [Vec::new(), Vec::new()];
        for chunk in chunks {
            parts.iter_mut().zip(chunk.split()).for_each(|(part, chunk)| part.push(chunk));
        }
        parts
    }
}
