//! A sparse matrix cut into squares, so that a product finds all it needs in the processor's nearest cache.

use rayon::prelude::*;

/// Rows and columns of a tile: of both vectors 8 KiB. Places within one fit 16 bits.
pub(super) const TILE: usize = 1024;

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

/// The same by tiles.
///
/// An entry takes as many bytes as in compressed rows. Those of a tile come by columns: neighbours then add to different rows, and none has to wait for
/// the sum of the one before.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tiles {
    rows: usize,
    cols: usize,
    /// Where each tile's entries begin, one row of tiles after the other, and their number last.
    starts: Vec<usize>,
    /// Row and column within the tile.
    places: Vec<[u16; 2]>,
    /// `[channel][entry]`
    weights: Vec<Vec<f32>>,
}

impl Tiles {
    pub(super) fn new(cols: usize, from: &CompressedRows) -> Self {
        let rows = from.row_start.len() - 1;
        let across = cols.div_ceil(TILE);
        let mut starts = vec![0; rows.div_ceil(TILE) * across + 1];
        let mut places = vec![[0; 2]; from.columns.len()];
        let mut weights: Vec<Vec<f32>> = from.weights.iter().map(|plane| vec![0.0; plane.len()]).collect();
        // A row of tiles has the same entries as its rows, so that each can be sorted by itself.
        let mut bands = Vec::new();
        let (mut starts_left, mut places_left) = (&mut starts[1..], places.as_mut_slice());
        let mut weights_left: Vec<&mut [f32]> = weights.iter_mut().map(Vec::as_mut_slice).collect();
        for first_row in (0..rows).step_by(TILE) {
            let end_row = (first_row + TILE).min(rows);
            let count = from.row_start[end_row] - from.row_start[first_row];
            bands.push(Band {
                first_row,
                ends: take(&mut starts_left, across),
                places: take(&mut places_left, count),
                weights: weights_left.iter_mut().map(|plane| take(plane, count)).collect(),
            });
        }
        bands.into_par_iter().for_each(|band| band.fill(cols, from));
        Self { rows, cols, starts, places, weights }
    }

    pub(super) fn cols(&self) -> usize {
        self.cols
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.places.len()
    }

    pub(super) fn bytes(&self) -> usize {
        let weights: usize = self.weights.iter().map(|plane| size_of_val(plane.as_slice())).sum();
        size_of_val(self.starts.as_slice()) + size_of_val(self.places.as_slice()) + weights
    }

    /// The product with `from` in the rows `TILE·band` and the next ones; sums are taken in the order of the columns.
    pub(super) fn product(&self, channel: usize, band: usize, from: &[f64]) -> [f64; TILE] {
        let across = self.cols.div_ceil(TILE);
        let starts = &self.starts[band * across..=(band + 1) * across];
        let weights = &self.weights[channel];
        let mut to = [0.0; TILE];
        for (ends, from) in starts.windows(2).zip(from.chunks(TILE)) {
            let entries = ends[0]..ends[1];
            for (&[row, column], &weight) in self.places[entries.clone()].iter().zip(&weights[entries]) {
                to[usize::from(row) % TILE] += f64::from(weight) * from[usize::from(column)];
            }
        }
        to
    }

    pub(super) fn to_rows(&self) -> CompressedRows {
        let mut row_start = vec![0; self.rows + 1];
        self.each(|row, _, _| row_start[row + 1] += 1);
        for row in 0..self.rows {
            row_start[row + 1] += row_start[row];
        }
        let mut next = row_start.clone();
        let mut columns = vec![0; self.nonzeros()];
        let mut weights: Vec<Vec<f32>> = self.weights.iter().map(|plane| vec![0.0; plane.len()]).collect();
        // Of one row the tiles come from left to right, and so do the entries of each.
        self.each(|row, column, entry| {
            let at = next[row];
            next[row] += 1;
            columns[at] = column as u32;
            for (to, from) in weights.iter_mut().zip(&self.weights) {
                to[at] = from[entry];
            }
        });
        CompressedRows { row_start, columns, weights }
    }

    /// Calls `visit` with row, column and index of each entry, tile by tile.
    fn each(&self, mut visit: impl FnMut(usize, usize, usize)) {
        let across = self.cols.div_ceil(TILE);
        for (tile, ends) in self.starts.windows(2).enumerate() {
            let (first_row, first_column) = (tile / across * TILE, tile % across * TILE);
            for entry in ends[0]..ends[1] {
                let [row, column] = self.places[entry].map(usize::from);
                visit(first_row + row, first_column + column, entry);
            }
        }
    }
}

/// A row of tiles to be filled.
struct Band<'a> {
    first_row: usize,
    ends: &'a mut [usize],
    places: &'a mut [[u16; 2]],
    weights: Vec<&'a mut [f32]>,
}

impl Band<'_> {
    /// Counting sort of its rows' entries by column.
    fn fill(mut self, cols: usize, from: &CompressedRows) {
        let first = from.row_start[self.first_row];
        let columns = &from.columns[first..first + self.places.len()];
        let mut next = vec![0_usize; cols + 1];
        for &column in columns {
            next[column as usize + 1] += 1;
        }
        for column in 0..cols {
            next[column + 1] += next[column];
        }
        for (tile, end) in self.ends.iter_mut().enumerate() {
            *end = first + next[((tile + 1) * TILE).min(cols)];
        }
        let mut row = 0;
        for (entry, &column) in columns.iter().enumerate() {
            while from.row_start[self.first_row + row + 1] <= first + entry {
                row += 1;
            }
            let at = next[column as usize];
            next[column as usize] += 1;
            // Both are below TILE.
            self.places[at] = [row as u16, (column as usize % TILE) as u16];
            for (to, from) in self.weights.iter_mut().zip(&from.weights) {
                to[at] = from[first + entry];
            }
        }
    }
}

/// Splits the first `count` off.
fn take<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (mine, others) = std::mem::take(rest).split_at_mut(count);
    *rest = others;
    mine
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A matrix of two channels with about `per_row` entries in each row, some rows and columns of tiles without any.
    fn matrix(rows: usize, cols: usize, per_row: usize, seed: u64) -> CompressedRows {
        let mut state = seed | 1;
        let mut draw = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let mut made =
            CompressedRows { row_start: vec![0], columns: Vec::new(), weights: vec![Vec::new(); 2] };
        for row in 0..rows {
            let count = if row / TILE == 1 { 0 } else { draw(2 * per_row + 1) };
            let mut columns: Vec<u32> = (0..count).map(|_| draw(cols) as u32).collect();
            columns.sort_unstable();
            columns.dedup();
            for plane in &mut made.weights {
                plane.extend(columns.iter().map(|_| draw(1000) as f32 / 1000.0 - 0.25));
            }
            made.columns.extend(columns);
            made.row_start.push(made.columns.len());
        }
        made
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]

        #[test]
        fn tiles_hold_what_the_rows_held(rows in 1..3000_usize, cols in 1..3000_usize, seed: u64) {
            let rows = matrix(rows, cols, 3, seed);
            prop_assert_eq!(Tiles::new(cols, &rows).to_rows(), rows);
        }

        #[test]
        fn products_are_the_sums_of_the_rows(rows in 1..3000_usize, cols in 1..3000_usize, seed: u64) {
            let from = matrix(rows, cols, 3, seed);
            let tiles = Tiles::new(cols, &from);
            let x: Vec<f64> = (0..cols).map(|column| (column * 7919 % 1013) as f64 / 1013.0 - 0.5).collect();
            for (channel, weights) in from.weights.iter().enumerate() {
                let mut y = vec![0.0; rows];
                for (band, y) in y.chunks_mut(TILE).enumerate() {
                    y.iter_mut().zip(tiles.product(channel, band, &x)).for_each(|(y, product)| *y = product);
                }
                for (row, y) in y.iter().enumerate() {
                    let entries = from.row_start[row]..from.row_start[row + 1];
                    // The same additions from left to right: the same to the last bit.
                    let sum = entries.fold(0.0, |sum, entry| {
                        sum + f64::from(weights[entry]) * x[from.columns[entry] as usize]
                    });
                    prop_assert_eq!(*y, sum);
                }
            }
        }
    }
}
