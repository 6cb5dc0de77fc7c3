//! A row of tiles.

use rayon::prelude::*;

use super::pages::Pages;
use super::shape::Shape;
use super::slice::{LANES, Slice};
use super::take;
use super::window::{Filled, Start, Window};

/// A row of tiles.
#[derive(Clone, Debug)]
pub(super) struct Band {
    /// Where each tile begins, from left to right, and the end of the last.
    pub(super) tiles: Vec<Start>,
    pub(super) slices: Vec<Slice>,
    /// Columns within the tile, ascending in each row. A repeated column is padding of the slice and has
    /// weight 0.
    pub(super) columns: Pages<[u16; LANES]>,
    /// `[channel][step][lane]`
    pub(super) weights: Vec<Pages<[f32; LANES]>>,
}

impl Band {
    /// The band of so many rows, which `windows` have.
    pub(super) fn new(rows: usize, windows: &[Window], channels: usize, shape: Shape, cols: usize) -> Self {
        // Within a tile, the windows follow one another.
        let across = cols.div_ceil(shape.columns);
        let mut tiles = vec![Start::default()];
        let mut end = Start::default();
        for tile in 0..across {
            for size in windows.iter().map(|window| window.sizes[tile]) {
                end = Start { slice: end.slice + size.slice, step: end.step + size.step };
            }
            tiles.push(end);
        }
        let mut slices = vec![Slice::default(); end.slice];
        let mut columns = Pages::zeros(end.step);
        let mut weights: Vec<Pages<[f32; LANES]>> = (0..channels).map(|_| Pages::zeros(end.step)).collect();
        let (mut slices_left, mut columns_left) = (slices.as_mut_slice(), &mut columns[..]);
        let mut weights_left: Vec<&mut [[f32; LANES]]> =
            weights.iter_mut().map(|plane| &mut plane[..]).collect();
        let mut to: Vec<Vec<Filled<'_>>> = windows.iter().map(|_| Vec::with_capacity(across)).collect();
        for tile in 0..across {
            for (to, window) in to.iter_mut().zip(windows) {
                let Start { slice, step } = window.sizes[tile];
                to.push(Filled {
                    slices: take(&mut slices_left, slice),
                    columns: take(&mut columns_left, step),
                    weights: weights_left.iter_mut().map(|plane| take(plane, step)).collect(),
                });
            }
        }
        windows.par_iter().zip(to).for_each(|(window, to)| window.fill(shape, cols, rows as u16, to));
        Self { tiles, slices, columns, weights }
    }

    pub(super) fn bytes(&self) -> usize {
        let weights: usize = self.weights.iter().map(|plane| size_of_val(&plane[..])).sum();
        size_of_val(self.tiles.as_slice())
            + size_of_val(self.slices.as_slice())
            + size_of_val(&self.columns[..])
            + weights
    }

    /// Where the rows of a tile are, of `rows` rows; `None` where the tile is empty.
    pub(super) fn places(&self, tile: usize, rows: usize) -> Option<Vec<Place>> {
        let [start, end] = [self.tiles[tile], self.tiles[tile + 1]];
        let mut step = start.step;
        let mut places = vec![Place::default(); rows + 1];
        for slice in &self.slices[start.slice..end.slice] {
            for (lane, &row) in slice.rows.iter().enumerate() {
                places[usize::from(row)] = Place { step, steps: slice.steps, lane: lane as u8 };
            }
            step += slice.steps as usize;
        }
        // The last one is of lanes without a row.
        places.truncate(rows);
        (end.slice > start.slice).then_some(places)
    }
}

/// Where the entries of a row within a tile are: in one lane of some steps.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    step: usize,
    /// As many as the row has entries, or more: the rest are padding.
    steps: u32,
    pub(super) lane: u8,
}

impl Place {
    /// Calls `visit` with each of the row's entries from the column `from` of the tile on, and before the column `to`:
    /// column and step. The columns are those of the tile's band.
    pub(super) fn each(
        self,
        columns: &[[u16; LANES]],
        from: usize,
        to: usize,
        mut visit: impl FnMut(u16, usize),
    ) {
        let of_row = &columns[self.step..self.step + self.steps as usize];
        let column = |step: &[u16; LANES]| step[usize::from(self.lane)];
        let first =
            if from == 0 { 0 } else { of_row.partition_point(|step| usize::from(column(step)) < from) };
        let mut before = None;
        for (at, step) in of_row.iter().enumerate().skip(first) {
            let column = column(step);
            // A repeated column is padding, and so are all that follow.
            if usize::from(column) >= to || before >= Some(column) {
                break;
            }
            visit(column, self.step + at);
            before = Some(column);
        }
    }
}
