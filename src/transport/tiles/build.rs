//! Builds tiles from rows. The rows of a band are divided into windows, and each window is divided at the columns of the tiles.

use std::borrow::Borrow;
use std::cmp::Reverse;
use std::ops::Range;

use rayon::prelude::*;

use super::band::{Band, Filled, Fragment, Start, below, of_bands};
use super::kernels::{LANES, Slice};
use super::rows::{CompressedRows, Pieces};
use super::{Shape, Tiles};

/// The minimum number of groups of rows that become tiles one after the other. There are fewer groups if a group would have too few windows
/// for all cores. While a group becomes tiles, its entries are in memory two more times.
const GROUPS: usize = 16;

pub(in crate::transport) struct Builder {
    tiles: Tiles,
    /// Whether the pushed rows contain only the entries on and above the diagonal.
    symmetric: bool,
    /// The number of rows of a group. A group consists of whole bands.
    group: usize,
    next: usize,
}

impl Builder {
    /// An empty builder. A symmetric matrix is built from its entries on and above the diagonal. `entries` is an estimate of the number of
    /// entries.
    pub(in crate::transport) fn new(
        [rows, cols]: [usize; 2],
        channels: usize,
        entries: usize,
        symmetric: bool,
    ) -> Self {
        let shape = Shape::new(rows, cols, entries, rayon::current_num_threads());
        Self::of_shape(shape, [rows, cols], channels, symmetric)
    }

    pub(super) fn of_shape(shape: Shape, [rows, cols]: [usize; 2], channels: usize, symmetric: bool) -> Self {
        let tiles = Tiles { rows, cols, channels, entries: 0, shape, bands: Vec::new() };
        Self { tiles, symmetric, group: group_of(rows, shape), next: 0 }
    }

    /// The rows to push next; `None` once all rows are in tiles.
    pub(in crate::transport) fn next_rows(&self) -> Option<Range<usize>> {
        (self.next < self.tiles.rows).then(|| self.next..self.tiles.rows.min(self.next + self.group))
    }

    /// Adds the rows of [`Builder::next_rows`]. The pieces must contain these rows.
    pub(in crate::transport) fn push(&mut self, pieces: impl Borrow<Pieces>) {
        let Some(rows) = self.next_rows() else { return };
        let Tiles { shape, channels, cols, .. } = self.tiles;
        let fragments = if self.symmetric {
            below(&self.tiles.bands, pieces.borrow(), &rows, (shape, channels))
        } else {
            Vec::new()
        };
        self.push_joined(pieces, vec![Before { fragments, columns_before: cols }]);
    }

    /// Works like [`Builder::push`] for pieces that lack some entries. The fragments in `parts` have these entries. In each row, entries of
    /// fragments and of pieces alternate. If the caller passes `pieces` by value, pieces and fragments are freed before memory for the
    /// tiles is allocated.
    pub(in crate::transport) fn push_joined(&mut self, pieces: impl Borrow<Pieces>, parts: Vec<Before>) {
        let Some(rows) = self.next_rows() else { return };
        let Tiles { shape, channels, cols, .. } = self.tiles;
        let of_pieces: &Pieces = pieces.borrow();
        let bands: Vec<Range<usize>> =
            rows.clone().step_by(shape.rows).map(|first| first..rows.end.min(first + shape.rows)).collect();
        let windows: Vec<Vec<Window>> = bands
            .par_iter()
            .map(|band| {
                let windows: Vec<usize> = band.clone().step_by(WINDOW).collect();
                let window = |&first: &usize| {
                    let rows = whole_rows(&parts, of_pieces, first..band.end.min(first + WINDOW), channels);
                    Window::new(first - band.start, rows, shape, cols)
                };
                windows.par_iter().map(window).collect()
            })
            .collect();
        // The windows now contain all these entries.
        drop((pieces, parts));
        self.tiles.entries += windows.iter().flatten().map(Window::entries).sum::<usize>();
        let band = |(rows, windows): (Range<usize>, Vec<Window>)| {
            Band::new(rows.len(), &windows, channels, shape, cols)
        };
        self.tiles.bands.par_extend(bands.into_par_iter().zip(windows).map(band));
        self.next = rows.end;
    }

    /// The transpose of these columns of all rows so far, as fragments by ascending columns. The first row becomes the column `first_row`.
    pub(in crate::transport) fn transposed(&self, columns: &Range<usize>, first_row: usize) -> Vec<Fragment> {
        let Tiles { shape, channels, .. } = self.tiles;
        of_bands(&self.tiles.bands, columns, first_row, (shape, channels))
    }

    pub(in crate::transport) fn channels(&self) -> usize {
        self.tiles.channels
    }

    pub(in crate::transport) fn finish(self) -> Tiles {
        debug_assert!(self.next_rows().is_none(), "all rows were given");
        self.tiles
    }
}

fn group_of(rows: usize, shape: Shape) -> usize {
    let enough = (WINDOW * rayon::current_num_threads()).div_ceil(shape.rows);
    (rows.div_ceil(GROUPS) / shape.rows).max(enough) * shape.rows
}

pub(in crate::transport) fn groups(rows: usize) -> Vec<Range<usize>> {
    // The number of rows of a band depends only on the number of rows and of threads, so the other arguments do not matter.
    let shape = Shape::new(rows, 1, 1, rayon::current_num_threads());
    let group = group_of(rows, shape);
    (0..rows).step_by(group).map(|first| first..rows.min(first + group)).collect()
}

/// Entries of some rows in the columns of one process, copied from finished rows of that process. In each row, these entries come before
/// the entries of the pieces in the columns of that process, which end before the column `columns_before`.
pub(in crate::transport) struct Before {
    pub(in crate::transport) fragments: Vec<Fragment>,
    pub(in crate::transport) columns_before: usize,
}

/// Joins the fragments of `parts` and the pieces to whole rows. For each part, a row has the entries of the part's fragments, and then
/// entries of the pieces.
fn whole_rows(parts: &[Before], pieces: &Pieces, rows: Range<usize>, channels: usize) -> CompressedRows {
    let parts: Vec<(Vec<&Fragment>, usize)> = parts
        .iter()
        .map(|part| {
            let found = part.fragments.iter().filter(|fragment| fragment.overlaps(&rows));
            (found.collect(), part.columns_before)
        })
        .collect();
    let before = |row: usize| -> usize {
        parts.iter().flat_map(|part| &part.0).map(|fragment| fragment.entries_of(row)).sum()
    };
    let entries = rows.clone().map(|row| before(row) + pieces.row(row).1.len()).sum();
    let mut whole = CompressedRows::with_room(channels, rows.len(), entries);
    for row in rows {
        let (piece, entries) = pieces.row(row);
        let mut next = entries.start;
        for (fragments, columns_before) in &parts {
            fragments.iter().for_each(|fragment| fragment.append(row, &mut whole));
            let left = &piece.columns[next..entries.end];
            let end = next + left.partition_point(|&column| (column as usize) < *columns_before);
            whole.extend(piece, next..end);
            next = end;
        }
        whole.end_row();
    }
    whole
}

pub(in crate::transport) fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (mine, others) = std::mem::take(rest).split_at_mut(count);
    *rest = others;
    mine
}

/// The number of rows of a window. Within a window, rows are sorted by length, so that the rows of a slice have about equal numbers of
/// entries. The sums of a window's rows are close enough in memory to share cache lines.
pub(super) const WINDOW: usize = 512;

pub(super) struct Window {
    /// The index of the first row within the band.
    first: usize,
    rows: CompressedRows,
    pub(super) sizes: Vec<Start>,
}

#[derive(Clone, Copy)]
struct Segment {
    row: usize,
    first: usize,
    length: usize,
}

impl Window {
    /// The window of these rows. Its first row is row `first` of the band.
    pub(super) fn new(first: usize, rows: CompressedRows, shape: Shape, cols: usize) -> Self {
        let mut window = Self { first, rows, sizes: Vec::with_capacity(cols.div_ceil(shape.columns)) };
        let mut sizes = std::mem::take(&mut window.sizes);
        window.each_tile(shape, cols, |_, segments| {
            let slices = segments.chunks(LANES);
            sizes.push(Start { slice: slices.len(), step: slices.map(|slice| slice[0].length).sum() });
        });
        window.sizes = sizes;
        window
    }

    pub(super) fn entries(&self) -> usize {
        self.rows.columns.len()
    }

    /// Writes the entries to the arrays of each tile. Lanes without a row get the row number `nowhere`.
    pub(super) fn fill(&self, shape: Shape, cols: usize, nowhere: u16, to: Vec<Filled<'_>>) {
        let mut to = to.into_iter();
        self.each_tile(shape, cols, |first_column, segments| {
            if let Some(to) = to.next() {
                self.fill_tile(first_column, segments, nowhere, to);
            }
        });
    }

    fn fill_tile(&self, first_column: usize, segments: &[Segment], nowhere: u16, mut to: Filled<'_>) {
        for segments in segments.chunks(LANES) {
            let longest = segments[0].length;
            let columns = take(&mut to.columns, longest);
            let row = |segment: &Segment| (self.first + segment.row) as u16;
            let rows = std::array::from_fn(|lane| segments.get(lane).map_or(nowhere, row));
            take(&mut to.slices, 1)[0] = Slice { rows, steps: longest as u32 };
            for (lane, segment) in segments.iter().enumerate() {
                let entries = segment.first..segment.first + segment.length;
                // A column within a tile fits into 16 bits.
                let place = |column: &u32| (*column as usize - first_column) as u16;
                let mut last = 0;
                for (columns, place) in columns.iter_mut().zip(self.rows.columns[entries].iter().map(place)) {
                    columns[lane] = place;
                    last = place;
                }
                columns[segment.length..].iter_mut().for_each(|columns| columns[lane] = last);
            }
            for (to, from) in to.weights.iter_mut().zip(&self.rows.weights) {
                let to = take(to, longest);
                for (lane, segment) in segments.iter().enumerate() {
                    let from = &from[segment.first..segment.first + segment.length];
                    to.iter_mut().zip(from).for_each(|(to, &weight)| to[lane] = weight);
                }
            }
        }
    }

    /// Calls `visit` with the first column of each tile and its non-empty rows, the longest row first.
    fn each_tile(&self, shape: Shape, cols: usize, mut visit: impl FnMut(usize, &[Segment])) {
        let mut next: Vec<usize> = self.rows.row_start[..self.rows.rows()].to_vec();
        let mut segments = Vec::new();
        for first_column in (0..cols).step_by(shape.columns) {
            let end_column = first_column + shape.columns;
            segments.clear();
            for (row, (next, &end)) in next.iter_mut().zip(&self.rows.row_start[1..]).enumerate() {
                let first = *next;
                let in_tile = |column: &&u32| (**column as usize) < end_column;
                *next += self.rows.columns[first..end].iter().take_while(in_tile).count();
                if *next > first {
                    segments.push(Segment { row, first, length: *next - first });
                }
            }
            // The sort is stable, so rows of equal length keep their order.
            segments.sort_by_key(|segment| Reverse(segment.length));
            visit(first_column, &segments);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::tests::on_threads;

    /// Groups consist of whole bands. A group has a sixteenth of the rows, or more if it would otherwise have fewer windows than there are
    /// threads.
    #[test]
    fn groups_are_whole_bands_with_work_for_every_thread() {
        for threads in [1, 2, 3, 8] {
            for rows in [1, 300, 5000, 40_000, 262_144, 1 << 20] {
                let (groups, shape) = on_threads(threads, || (groups(rows), Shape::new(rows, 1, 1, threads)));
                let all: Vec<usize> = groups.iter().flat_map(Clone::clone).collect();
                assert_eq!(all, (0..rows).collect::<Vec<_>>(), "every row is in one group, in order");
                let longest = groups[0].len();
                let (last, full) = groups.split_last().expect("there are rows");
                assert!(full.iter().all(|group| group.len() == longest) && last.len() <= longest);
                assert!(
                    groups.len() == 1 || longest.is_multiple_of(shape.rows),
                    "{rows} rows, {threads} threads"
                );
                assert!(
                    groups.len() == 1 || longest >= 512 * threads,
                    "{rows} rows, {threads} threads: {longest}"
                );
                // The largest group has a sixteenth of the rows, or one window for each thread, rounded up to whole bands.
                let most = rows.div_ceil(16).max(512 * threads + shape.rows - 1);
                assert!(longest <= most, "{rows} rows, {threads} threads: {longest} of {most}");
            }
        }
    }
}
