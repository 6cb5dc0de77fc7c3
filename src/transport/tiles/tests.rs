use super::kernels::{LANES, Slice, Sums};
use super::*;
use proptest::prelude::*;

/// A matrix of two channels with about `per_row` entries in each row. Some rows and columns are empty.
fn matrix(rows: usize, cols: usize, per_row: usize, seed: u64) -> CompressedRows {
    let mut state = seed | 1;
    let mut draw = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut made = CompressedRows { row_start: vec![0], columns: Vec::new(), weights: vec![Vec::new(); 2] };
    for row in 0..rows {
        let count = if row / 300 == 1 { 0 } else { draw(2 * per_row + 1) };
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

fn shapes() -> impl Strategy<Value = Shape> {
    (6..12_u32, 6..16_u32).prop_map(|(rows, columns)| Shape { rows: 1 << rows, columns: 1 << columns })
}

fn cut(of: &CompressedRows, each: usize) -> Vec<CompressedRows> {
    let rows = of.row_start.len() - 1;
    let piece = |first: usize| {
        let row_start = &of.row_start[first..=rows.min(first + each)];
        let entries = row_start[0]..row_start[row_start.len() - 1];
        CompressedRows {
            row_start: row_start.iter().map(|start| start - entries.start).collect(),
            columns: of.columns[entries.clone()].to_vec(),
            weights: of.weights.iter().map(|plane| plane[entries.clone()].to_vec()).collect(),
        }
    };
    (0..rows).step_by(each).map(piece).collect()
}

fn tiles(shape: Shape, cols: usize, pieces: Vec<CompressedRows>, symmetric: bool) -> Tiles {
    let pieces = Pieces::new(0, pieces);
    let mut builder = Builder::of_shape(shape, [pieces.rows(), cols], 2, symmetric);
    while builder.next_rows().is_some() {
        builder.push(&pieces);
    }
    builder.finish()
}

fn product(from: &CompressedRows, channel: usize, x: &[f64]) -> Vec<f64> {
    let of_row = |ends: &[usize]| {
        (ends[0]..ends[1]).fold(0.0, |sum, entry| {
            sum + f64::from(from.weights[channel][entry]) * x[from.columns[entry] as usize]
        })
    };
    from.row_start.windows(2).map(of_row).collect()
}

fn pattern(cols: usize) -> Vec<f64> {
    (0..cols).map(|column| (column * 7919 % 1013) as f64 / 1013.0 - 0.5).collect()
}

/// The vector, interleaved with its multiples by −2, 0 and ½. The products of these multiples are exact multiples of the vector's product.
fn four(x: &[f64]) -> Vec<Interleaved> {
    x.iter().map(|x| Interleaved([*x, -2.0 * x, 0.0, 0.5 * x])).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn tiles_hold_the_entries_of_the_rows(
        rows in 1..3000_usize, cols in 1..5000_usize, per_row in 0..12_usize, shape in shapes(), seed: u64,
    ) {
        let rows = matrix(rows, cols, per_row, seed);
        let tiles = tiles(shape, cols, vec![rows.clone()], false);
        prop_assert_eq!(tiles.nonzeros(), rows.columns.len());
        prop_assert!(tiles == self::tiles(shape, cols, cut(&rows, 100), false));
        let square = |weight: &f32| f64::from(*weight).powi(2);
        let of_row = |ends: &[usize]| {
            rows.weights[1][ends[0]..ends[1]].iter().map(square).fold(0.0, |sum, square| sum + square)
        };
        prop_assert_eq!(tiles.squares(1, 0.25), rows.row_start.windows(2).map(of_row).fold(0.25, |sum, row| sum + row));
        prop_assert_eq!(tiles.to_rows(), rows);
    }

    #[test]
    fn products_are_the_sums_of_the_rows(
        rows in 1..3000_usize, cols in 1..5000_usize, shape in shapes(), seed: u64,
    ) {
        let from = matrix(rows, cols, 3, seed);
        let tiles = tiles(shape, cols, vec![from.clone()], false);
        let x = pattern(cols);
        for channel in 0..2 {
            let bands = 0..rows.div_ceil(tiles.band_rows());
            let y: Vec<f64> = bands.clone().flat_map(|band| tiles.product(channel, band, &x)).collect();
            // The same additions in the same order, from left to right, give the same bits.
            prop_assert_eq!(&y, &product(&from, channel, &x));
            let xs = four(&x);
            let of_four: Vec<Interleaved> = bands.flat_map(|band| tiles.product(channel, band, &xs)).collect();
            prop_assert_eq!(of_four, four(&y));
        }
    }
}

/// The triangle of a square matrix on and above its diagonal, and the symmetric matrix with this triangle.
fn symmetric(of: &CompressedRows) -> [CompressedRows; 2] {
    let rows = of.rows();
    let mut dense = vec![Vec::new(); rows];
    let mut upper = CompressedRows::with_room(2, 0, 0);
    for row in 0..rows {
        for entry in of.row(row).filter(|&entry| of.columns[entry] as usize >= row) {
            upper.extend(of, entry..entry + 1);
            dense[row].push((of.columns[entry], entry));
            if of.columns[entry] as usize > row {
                dense[of.columns[entry] as usize].push((row as u32, entry));
            }
        }
        upper.end_row();
    }
    let mut whole = CompressedRows::with_room(2, 0, 0);
    for mut row in dense {
        row.sort_unstable();
        whole.columns.extend(row.iter().map(|(column, _)| column));
        for (to, from) in whole.weights.iter_mut().zip(&of.weights) {
            to.extend(row.iter().map(|&(_, entry)| from[entry]));
        }
        whole.end_row();
    }
    [upper, whole]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// In some cases, there are more rows than become tiles at the same time.
    #[test]
    fn a_symmetric_matrix_is_made_of_its_triangle(
        rows in prop_oneof![1..3000_usize, 33_000..34_000_usize], shape in shapes(), seed: u64,
    ) {
        let [upper, whole] = symmetric(&matrix(rows, rows, 6, seed));
        let tiles = tiles(shape, rows, cut(&upper, 700), true);
        prop_assert_eq!(tiles.nonzeros(), whole.columns.len());
        let row_start = tiles.row_start(Entries::Upper);
        prop_assert_eq!(tiles.columns(Entries::Upper, &row_start).flatten().collect::<Vec<_>>(), upper.columns);
        for (channel, plane) in upper.weights.iter().enumerate() {
            let found: Vec<f32> = tiles.weights(Entries::Upper, channel, &row_start).flatten().collect();
            prop_assert_eq!(&found, plane);
        }
        prop_assert_eq!(row_start, upper.row_start);
        prop_assert_eq!(tiles.to_rows(), whole);
    }
}

#[test]
fn all_kernels_give_the_same_bits() {
    let from = matrix(700, 4000, 40, 7);
    let tiles = tiles(Shape { rows: 1024, columns: 4096 }, 4000, vec![from.clone()], false);
    let x = pattern(4000);
    for channel in 0..2 {
        let expected = product(&from, channel, &x);
        check(Sums::all(), &tiles, channel, &x, &expected);
        check(Sums::all(), &tiles, channel, &four(&x), &four(&expected));
    }
}

fn check<V: Summable + PartialEq + std::fmt::Debug>(
    ways: Vec<Sums<V>>,
    tiles: &Tiles,
    channel: usize,
    x: &[V],
    expected: &[V],
) {
    for sums in ways {
        let mut y = vec![V::default(); 701];
        let [band] = &tiles.bands[..] else { unreachable!("there is one band") };
        sums.add(&band.slices, &band.columns, &band.weights[channel], x, &mut y);
        assert_eq!(y.pop(), Some(V::default()), "lanes without a row add nothing");
        assert_eq!(y, expected);
    }
}

#[test]
fn a_missing_column_is_never_read() {
    let slice = Slice { rows: [0, 1, 2, 3, 4, 5, 6, 7], steps: 1 };
    for sums in Sums::all() {
        let outcome = std::panic::catch_unwind(|| {
            let mut to = [0.0; LANES];
            sums.add(&[slice], &[[5; LANES]], &[[1.0; LANES]], &[2.0, 3.0], &mut to);
            to
        });
        assert!(outcome.is_err() || outcome.is_ok_and(|to| to == [3.0; LANES]));
    }
}

#[test]
#[cfg(target_arch = "x86_64")]
fn processors_with_vector_instructions_have_kernels_for_them() {
    let [one, four] = if is_x86_feature_detected!("avx2") { [2, 1] } else { [0, 0] };
    assert_eq!([f64::special().len(), Interleaved::special().len()], [one, four]);
}
