//! How large a tile is.

/// Rows and columns of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// Rows of a band, at most: places fit 16 bits, with one to spare, and sums the second cache.
const MOST_ROWS: usize = 1 << 15;
/// Rows of a band, at least: fewer would be lost in the work between tiles.
const LEAST_ROWS: usize = 1 << 8;
/// Bands for each thread, at least where that leaves enough rows, so that all finish about the same time.
const BANDS_A_THREAD: usize = 4;

/// Columns of a tile at least: 32 KiB of a vector, which the nearest cache holds.
const LEAST_COLUMNS: usize = 1 << 12;
/// At most: 256 KiB, for the second cache.
const MOST_COLUMNS: usize = 1 << 15;
/// What a row should have in a tile, so that what is done once for its sum does not show.
const ENTRIES_OF_A_ROW: usize = 5;

impl Shape {
    /// For a matrix of `rows × columns` with so many entries, multiplied by so many threads. No sum depends on it.
    pub(super) fn new(rows: usize, columns: usize, entries: usize, threads: usize) -> Self {
        let bands = BANDS_A_THREAD * threads.max(1);
        let of_band = rows.div_ceil(bands).next_power_of_two().clamp(LEAST_ROWS, MOST_ROWS);
        // The narrowest that has enough entries of a row.
        let wish = (ENTRIES_OF_A_ROW * columns * rows).div_ceil(entries.max(1));
        Self { rows: of_band, columns: wish.next_power_of_two().clamp(LEAST_COLUMNS, MOST_COLUMNS) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_matrices_have_narrow_tiles_and_threads_enough_bands() {
        let shape = |side: usize, of_row, threads| {
            let pixels = side * side;
            let Shape { rows, columns } = Shape::new(pixels, pixels, of_row * pixels, threads);
            (rows, columns)
        };
        assert_eq!(shape(128, 320, 2), (2048, 4096));
        assert_eq!(shape(128, 37, 2), (2048, 4096));
        assert_eq!(shape(512, 330, 2), (32_768, 4096));
        assert_eq!(shape(512, 40, 2), (32_768, 32_768));
        assert_eq!(shape(512, 40, 16), (4096, 32_768));
        assert_eq!(shape(1, 0, 2), (256, 4096));
    }
}
