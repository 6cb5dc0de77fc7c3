//! The size of the tiles.

/// Rows and columns of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// Most rows of a band: row numbers (and one past the last) fit 16 bits, and the sums fit the second-level cache.
const MOST_ROWS: usize = 1 << 14;
/// Fewest rows of a band: with fewer, the work between tiles would dominate.
const LEAST_ROWS: usize = 1 << 8;
/// Fewest bands for each thread, where that leaves enough rows, so that all threads finish at about the same
/// time.
const BANDS_A_THREAD: usize = 4;

/// Fewest bands of a large matrix, so that it can be made group by group, and the rows that a band then has at least.
const BANDS: usize = 16;
const ROWS_OF_MANY_BANDS: usize = 1 << 12;

/// Fewest columns of a tile: 32 KiB of a vector, which the first-level cache holds.
const LEAST_COLUMNS: usize = 1 << 12;
/// Most columns of a tile: 256 KiB of a vector, for the second-level cache.
const MOST_COLUMNS: usize = 1 << 15;
/// Entries that a row should have in a tile, so that the fixed cost of its sum is small.
const ENTRIES_OF_A_ROW: usize = 5;

impl Shape {
    /// The shape for a matrix of `rows × columns` with `entries` entries that is multiplied by `threads`
    /// threads. No sum depends on it.
    pub(super) fn new(rows: usize, columns: usize, entries: usize, threads: usize) -> Self {
        let bands = (BANDS_A_THREAD * threads.max(1)).max(BANDS.min(rows / ROWS_OF_MANY_BANDS));
        // A power of two that leaves at least so many bands.
        let of_band = (1 << rows.div_ceil(bands).max(1).ilog2()).clamp(LEAST_ROWS, MOST_ROWS);
        // The narrowest tile with enough entries of a row.
        let least = (ENTRIES_OF_A_ROW * columns * rows).div_ceil(entries.max(1));
        Self { rows: of_band, columns: least.next_power_of_two().clamp(LEAST_COLUMNS, MOST_COLUMNS) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_matrices_have_narrow_tiles_and_enough_bands() {
        let shape = |side: usize, of_row, threads| {
            let pixels = side * side;
            let Shape { rows, columns } = Shape::new(pixels, pixels, of_row * pixels, threads);
            (rows, columns)
        };
        assert_eq!(shape(128, 320, 2), (2048, 4096));
        assert_eq!(shape(128, 37, 2), (2048, 4096));
        assert_eq!(shape(512, 330, 2), (16_384, 4096));
        assert_eq!(shape(512, 40, 2), (16_384, 32_768));
        assert_eq!(shape(512, 40, 16), (4096, 32_768));
        // The part of a process of four, which has one thread.
        let Shape { rows, .. } = Shape::new(512 * 512 / 4, 512 * 512, 330 * 512 * 512 / 4, 1);
        assert_eq!(rows, 4096);
        assert_eq!(shape(1, 0, 2), (256, 4096));
    }
}
