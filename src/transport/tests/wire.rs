//! Tests of contributions as bytes. Written bytes can be read again, and incomplete bytes are rejected.

use std::ops::Range;

use crate::transport::contributions::{Chunk, Key, Row, Term, Terms};
use crate::transport::tiles::{CompressedRows, Fragment};
use crate::transport::wire::{
    Garbled, Reader, chunks_to_bytes, message, put, put_chunks, put_estimates, put_fragments, rows_to_bytes,
    take_chunk, take_estimates, take_fragments, take_rows,
};

/// Contributions from three camera pixels and two projector pixels, to the pixels 2, 5 and 8 each, in different classes.
fn chunk() -> Chunk<3> {
    let row = |at: usize| Row { pixel: [4, 6, 9, 1, 3][at], from_camera: at < 3, end: 3 * (at + 1) };
    let term = |at: usize| Term {
        key: Key::new([2, 5, 8][at % 3], (at % 2) as u32),
        mean: [1.0, 2.0, 3.0].map(|value| value + at as f32),
        error: [-0.5, 0.25, 0.125].map(|value| value * at as f32),
    };
    Chunk { rows: (0..5).map(row).collect(), terms: Terms::Short((0..15).map(term).collect()) }
}

type Contributions = Vec<(u32, bool, Key, [[u32; 3]; 2])>;

fn wanted(from_camera: bool, pixels: &Range<u32>) -> Contributions {
    let is_wanted = |(_, of_camera, key, _): &(u32, bool, Key, [[u32; 3]; 2])| {
        *of_camera == from_camera && pixels.contains(&key.other())
    };
    chunk().contributions().filter(is_wanted).collect()
}

#[test]
fn contributions_are_read_as_they_were_written() {
    for pixels in [0..10_u32, 5..8, 5..6, 6..8, 0..2, 8..9, 9..10] {
        let rows = pixels.start as usize..pixels.end as usize;
        for from_camera in [true, false] {
            let bytes = chunks_to_bytes(&[&chunk()], from_camera, &rows);
            assert_eq!(bytes, message(|to| put_chunks(to, &[&chunk()], from_camera, &rows)));
            let mut from = Reader::new(&bytes);
            let found: Chunk<3> = take_chunk(&mut from, from_camera).expect("it is whole");
            from.end().expect("nothing is left");
            let expected = wanted(from_camera, &pixels);
            assert_eq!(found.contributions().collect::<Contributions>(), expected, "{pixels:?}");
        }
    }
}

/// Checks that truncated bytes and extra bytes are rejected.
fn check_ends<T>(bytes: &[u8], take: impl Fn(&mut Reader<&[u8]>) -> Result<T, Garbled>) {
    for end in 0..bytes.len() {
        assert!(take(&mut Reader::new(&bytes[..end])).is_err(), "{end} of {} bytes", bytes.len());
    }
    let longer = [bytes, &[0]].concat();
    let mut from = Reader::new(&longer);
    assert!(take(&mut from).is_ok() && from.end().is_err_and(|Garbled(why)| why.contains("1 bytes")));
}

#[test]
fn what_ends_early_or_late_is_refused() {
    check_ends(&chunks_to_bytes(&[&chunk()], true, &(0..10)), |from| take_chunk::<3>(from, true));
    let rows = rows_to_bytes(&rows());
    for end in 0..rows.len() {
        assert!(take_rows(&rows[..end], 2).is_err(), "{end} of {} bytes", rows.len());
    }
    assert!(take_rows(&rows, 2).is_ok() && take_rows(&[&rows[..], &[0]].concat(), 2).is_err());
    let fragment = fragment();
    check_ends(&message(|to| put_fragments(to, &[fragment])), |from| take_fragments(from, 2, 3));
    check_ends(&message(|to| put(to, &[1.5_f64, 2.5])), |from| from.take::<f64>());
    // No memory can hold an array of this length.
    for length in [u64::MAX, u64::MAX / 8 + 1, 1 << 40] {
        assert!(Reader::new(&length.to_le_bytes()).take::<u64>().is_err());
    }
}

fn chunk_of(pixels: &[u32], ends: &[u64], keys: &[u32], lights: [usize; 2]) -> Result<Chunk<1>, Garbled> {
    let bytes = message(|to| {
        put(to, pixels)?;
        put(to, ends)?;
        put(to, keys)?;
        lights.iter().try_for_each(|&count| put(to, &vec![1.0_f32; count]))
    });
    take_chunk(&mut Reader::new(&bytes), true)
}

#[test]
fn arrays_of_other_lengths_are_refused() {
    assert!(chunk_of(&[4, 5], &[1, 3], &[8, 8, 12], [3, 3]).is_ok());
    assert!(chunk_of(&[], &[], &[], [0, 0]).is_ok());
    for (what, chunk) in [
        ("a pixel without an end", chunk_of(&[4, 5, 6], &[1, 3], &[8, 8, 12], [3, 3])),
        ("an end without a pixel", chunk_of(&[4], &[1, 3], &[8, 8, 12], [3, 3])),
        ("more entries than the last end", chunk_of(&[4, 5], &[1, 2], &[8, 8, 12], [3, 3])),
        ("fewer entries than the last end", chunk_of(&[4, 5], &[1, 4], &[8, 8, 12], [3, 3])),
        ("entries without rows", chunk_of(&[], &[], &[8], [1, 1])),
        ("ends that do not ascend", chunk_of(&[4, 5, 6], &[2, 1, 3], &[8, 8, 12], [3, 3])),
        ("more means", chunk_of(&[4, 5], &[1, 3], &[8, 8, 12], [4, 3])),
        ("fewer means", chunk_of(&[4, 5], &[1, 3], &[8, 8, 12], [2, 3])),
        ("more errors", chunk_of(&[4, 5], &[1, 3], &[8, 8, 12], [3, 4])),
        ("fewer errors", chunk_of(&[4, 5], &[1, 3], &[8, 8, 12], [3, 2])),
    ] {
        assert!(chunk.is_err(), "{what}");
    }
    let bytes = message(|to| {
        put(to, &[4_u32])?;
        put(to, &[1_u64])?;
        put(to, &[8_u32])?;
        put(to, &[1.0_f32; 4])
    });
    assert!(take_chunk::<3>(&mut Reader::new(&bytes), true).is_err());
}

fn fragment() -> Fragment {
    Fragment {
        first: 5,
        base: 70_000,
        row_start: vec![0, 2, 2, 3],
        columns: vec![1, 65_535, 4],
        weights: vec![vec![1.0, 2.0, 3.0], vec![-1.0, 0.0, 0.5]],
    }
}

#[test]
fn fragments_are_read_as_they_were_written_and_counted_from_another_row() {
    let bytes = message(|to| put_fragments(to, &[fragment(), Fragment { first: 3, ..fragment() }]));
    let found = take_fragments(&mut Reader::new(&bytes), 2, 3).expect("they are whole");
    assert_eq!(found.iter().map(|found| found.first).collect::<Vec<_>>(), [2, 0]);
    for found in &found {
        let expected = fragment();
        assert_eq!(
            (found.base, &found.row_start, &found.columns),
            (70_000, &expected.row_start, &expected.columns)
        );
        assert_eq!(found.weights, expected.weights);
    }
    assert!(take_fragments(&mut Reader::new(&bytes), 2, 4).is_err(), "its rows are before the first one");
    for broken in [
        Fragment { row_start: vec![0, 2, 2, 2], ..fragment() },
        Fragment { row_start: vec![0, 2, 1, 3], ..fragment() },
        Fragment { row_start: Vec::new(), ..fragment() },
        Fragment { weights: vec![vec![1.0; 3], vec![1.0; 2]], ..fragment() },
        Fragment { weights: vec![vec![1.0; 4], vec![1.0; 3]], ..fragment() },
    ] {
        let bytes = message(|to| put_fragments(to, &[broken]));
        assert!(take_fragments(&mut Reader::new(&bytes), 2, 0).is_err());
    }
}

fn rows() -> CompressedRows {
    CompressedRows {
        row_start: vec![0, 2, 2, 3],
        columns: vec![0, 9, 4],
        weights: vec![vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]],
    }
}

#[test]
fn estimates_and_rows_are_read_as_they_were_written() {
    let estimates = vec![[[1.0, 0.5], [2.0, -0.5], [3.0, 0.25]], [[4.0, 0.0], [5.0, 1.0], [6.0, 2.0]]];
    let bytes = message(|to| put_estimates(to, &estimates));
    assert_eq!(take_estimates::<3>(&mut Reader::new(&bytes)).expect("they are whole"), estimates);
    assert_eq!(take_rows(&rows_to_bytes(&rows()), 2).expect("they are whole"), rows());
    for broken in [
        CompressedRows { row_start: vec![0, 2, 1, 3], ..rows() },
        CompressedRows { row_start: vec![0, 2, 2, 4], ..rows() },
        CompressedRows { columns: vec![0, 9], ..rows() },
        CompressedRows { weights: vec![vec![1.0; 3], vec![1.0; 2]], ..rows() },
    ] {
        assert!(take_rows(&rows_to_bytes(&broken), 2).is_err());
    }
}

/// In the transpose of some columns, row `i` becomes column `first + i`, where `first` is the number of this process's first row.
#[test]
fn the_transpose_of_some_columns_counts_from_the_first_row() {
    let transposed = rows().transposed(&(4..10), 100);
    assert_eq!(transposed.row_start, [0, 1, 1, 1, 1, 1, 2]);
    assert_eq!(transposed.columns, [102, 100]);
    assert_eq!(transposed.weights, [[3.0, 2.0], [6.0, 5.0]]);
    assert_eq!(rows().transposed(&(0..4), 0).columns, [0]);
}
