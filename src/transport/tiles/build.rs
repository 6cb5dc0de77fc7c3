//! From rows to tiles.

use std::ops::Range;

use rayon::prelude::*;

use super::Tiles;
use super::band::Band;
use super::mirror::{Fragment, below};
use super::rows::{CompressedRows, Pieces};
use super::shape::Shape;
use super::window::{WINDOW, Window};

/// Groups of rows that become tiles one after the other, at least, unless a group had too few windows for all cores. While a group becomes
/// tiles, it is in memory twice more.
const GROUPS: usize = 16;

/// Tiles that rows are added to, group by group.
pub(in crate::transport) struct Builder {
    tiles: Tiles,
    /// Whether only what is on and above the diagonal is given.
    symmetric: bool,
    /// Rows of a group: whole bands.
    group: usize,
    /// The first row that is not in tiles yet.
    next: usize,
}

impl Builder {
    /// For a matrix of so many rows and columns, and about so many entries. If it is symmetric, its rows are given from the diagonal on.
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
        let group = rows.div_ceil(GROUPS).max(WINDOW * rayon::current_num_threads());
        Self { tiles, symmetric, group: group.next_multiple_of(shape.rows), next: 0 }
    }

    /// The rows that are to be given next; `None` once all are in tiles.
    pub(in crate::transport) fn next_rows(&self) -> Option<Range<usize>> {
        (self.next < self.tiles.rows).then(|| self.next..self.tiles.rows.min(self.next + self.group))
    }

    /// Adds the rows of [`Builder::next_rows`], which the pieces have.
    pub(in crate::transport) fn push(&mut self, pieces: &Pieces) {
        let Some(rows) = self.next_rows() else { return };
        let Tiles { shape, channels, cols, .. } = self.tiles;
        let below = if self.symmetric {
            below(&self.tiles.bands, pieces, &rows, (shape, channels))
        } else {
            Vec::new()
        };
        let bands: Vec<Range<usize>> =
            rows.clone().step_by(shape.rows).map(|first| first..rows.end.min(first + shape.rows)).collect();
        let windows: Vec<Vec<Window>> = bands
            .par_iter()
            .map(|band| {
                let windows: Vec<usize> = band.clone().step_by(WINDOW).collect();
                let window = |&first: &usize| {
                    let rows = whole_rows(&below, pieces, first..band.end.min(first + WINDOW), channels);
                    Window::new(first - band.start, rows, shape, cols)
                };
                windows.par_iter().map(window).collect()
            })
            .collect();
        drop(below);
        self.tiles.entries += windows.iter().flatten().map(Window::entries).sum::<usize>();
        let band = |(rows, windows): (Range<usize>, Vec<Window>)| {
            Band::new(rows.len(), &windows, channels, shape, cols)
        };
        self.tiles.bands.par_extend(bands.into_par_iter().zip(windows).map(band));
        self.next = rows.end;
    }

    /// The tiles of all rows.
    pub(in crate::transport) fn finish(self) -> Tiles {
        debug_assert!(self.next_rows().is_none(), "all rows were given");
        self.tiles
    }
}

/// These rows, each as its fragments below the diagonal, and what the pieces have of it.
fn whole_rows(below: &[Fragment], pieces: &Pieces, rows: Range<usize>, channels: usize) -> CompressedRows {
    let below: Vec<&Fragment> = below.iter().filter(|fragment| fragment.overlaps(&rows)).collect();
    let entries = |row: usize| {
        below.iter().map(|fragment| fragment.entries_of(row)).sum::<usize>() + pieces.row(row).1.len()
    };
    let mut whole = CompressedRows::with_room(channels, rows.len(), rows.clone().map(entries).sum());
    for row in rows {
        below.iter().for_each(|fragment| fragment.append(row, &mut whole));
        let (piece, entries) = pieces.row(row);
        whole.extend(piece, entries);
        whole.end_row();
    }
    whole
}

/// Splits off the first `count` elements of `rest`.
pub(in crate::transport) fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (mine, others) = std::mem::take(rest).split_at_mut(count);
    *rest = others;
    mine
}
