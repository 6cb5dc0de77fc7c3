//! Contributions as bytes: what is written is read again, and what is not whole is refused.

use std::ops::Range;

use crate::transport::chunk::{Chunk, Key, Row, Term, Terms};
use crate::transport::fixed::RowSums;
use crate::transport::tiles::{CompressedRows, Fragment};
use crate::transport::wire::{
    Garbled, Reader, append_rows, message, put, put_chunks, put_estimates, put_fragments, put_sums,
    rows_to_bytes, take_chunk, take_estimates, take_fragments, take_sums, take_terms, terms_to_bytes,
};

/// Three pixels of the camera and two of the projector, each with contributions at the pixels 2, 5 and 8, of different classes.
fn chunk() -> Chunk<3> {
    let row = |at: usize| Row { pixel: [4, 6, 9, 1, 3][at], from_camera: at < 3, end: 3 * (at + 1) };
    let term = |at: usize| Term {
        key: Key::new([2, 5, 8][at % 3], (at % 2) as u32),
        mean: [1.0, 2.0, 3.0].map(|value| value + at as f32),
        error: [-0.5, 0.25, 0.125].map(|value| value * at as f32),
    };
    Chunk { rows: (0..5).map(row).collect(), terms: Terms::Short((0..15).map(term).collect()) }
}

type Contributions = Vec<(u32, Key, [[u32; 3]; 2])>;

/// The contributions of the chunk to these pixels, of paths from these places in its list of rows.
fn wanted(rows: Range<usize>, pixels: &Range<u32>) -> Contributions {
    let chunk = chunk();
    let starts: Vec<u32> = chunk.rows[rows].iter().map(|row| row.pixel).collect();
    let all = chunk.contributions();
    all.filter(|(start, key, _)| starts.contains(start) && pixels.contains(&key.other())).collect()
}

#[test]
fn contributions_are_read_as_they_were_written() {
    for pixels in [0..10_u32, 5..8, 5..6, 6..8, 0..2, 8..9, 9..10] {
        let rows = pixels.start as usize..pixels.end as usize;
        for (from_camera, of) in [(true, 0..3), (false, 3..5)] {
            let bytes = message(|to| put_chunks(to, &[chunk()], from_camera, &rows));
            let mut from = Reader::new(&bytes);
            let found: Chunk<3> = take_chunk(&mut from, from_camera).expect("it is whole");
            from.end().expect("nothing is left");
            assert_eq!(found.contributions().collect::<Contributions>(), wanted(of, &pixels), "{pixels:?}");
            assert!(found.rows.iter().all(|row| row.from_camera == from_camera));
        }
        let bytes = terms_to_bytes(&[chunk()], &rows);
        let mut from = Reader::new(&bytes);
        let found: Chunk<3> = take_terms(&mut from, true).expect("it is whole");
        from.end().expect("nothing is left");
        assert_eq!(found.contributions().collect::<Contributions>(), wanted(0..5, &pixels), "{pixels:?}");
    }
}

/// Bytes that end anywhere are refused, and so are those with some too many.
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
    check_ends(&message(|to| put_chunks(to, &[chunk()], true, &(0..10))), |from| take_chunk::<3>(from, true));
    check_ends(&terms_to_bytes(&[chunk()], &(0..10)), |from| take_terms::<3>(from, true));
    let fragment = fragment();
    check_ends(&message(|to| put_fragments(to, &[fragment])), |from| take_fragments(from, 2, 3));
    check_ends(&message(|to| put(to, &[1.5_f64, 2.5])), |from| from.take::<f64>());
    // A length that no memory has.
    for length in [u64::MAX, u64::MAX / 8 + 1, 1 << 40] {
        assert!(Reader::new(&length.to_le_bytes()).take::<u64>().is_err());
    }
}

/// The arrays of a message of contributions of one channel.
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
    // Colours come in threes.
    let bytes = message(|to| {
        put(to, &[4_u32])?;
        put(to, &[1_u64])?;
        put(to, &[8_u32])?;
        put(to, &[1.0_f32; 4])
    });
    assert!(take_chunk::<3>(&mut Reader::new(&bytes), true).is_err());
    let terms = |ends: [u64; 2], count: u64| {
        let mut bytes = message(|to| put(to, &[4_u64, ends[0], 5, ends[1]]));
        bytes.extend(count.to_le_bytes());
        bytes.resize(bytes.len() + 12 * count as usize, 0);
        take_terms::<1>(&mut Reader::new(&bytes), true).is_ok()
    };
    assert!(terms([1, 3], 3) && !terms([1, 3], 2) && !terms([1, 3], 4) && !terms([4, 3], 3));
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

#[test]
fn estimates_sums_and_rows_are_read_as_they_were_written() {
    let estimates = vec![[[1.0, 0.5], [2.0, -0.5], [3.0, 0.25]], [[4.0, 0.0], [5.0, 1.0], [6.0, 2.0]]];
    let bytes = message(|to| put_estimates(to, &estimates));
    assert_eq!(take_estimates::<3>(&mut Reader::new(&bytes)).expect("they are whole"), estimates);
    let sums: Vec<RowSums<3>> = (0..2)
        .map(|row| f64::from(row) * 10.0)
        .map(|row| RowSums { mean: [row, row + 1.0, row + 2.0], error: [row + 3.0, row + 4.0, row + 5.0] })
        .collect();
    let bytes = message(|to| put_sums(to, &sums));
    assert_eq!(take_sums::<3>(&mut Reader::new(&bytes)).expect("they are whole"), sums);
    let rows = CompressedRows {
        row_start: vec![0, 2, 2, 3],
        columns: vec![0, 9, 4],
        weights: vec![vec![1.0, 2.0, 3.0], vec![4.0, 5.0, 6.0]],
    };
    let mut twice = rows.clone();
    append_rows(&mut twice, &rows_to_bytes(&rows)).expect("they are whole");
    assert_eq!(twice.row_start, [0, 2, 2, 3, 5, 5, 6]);
    assert_eq!(twice.columns, [0, 9, 4, 0, 9, 4]);
    assert_eq!(twice.weights[1], [4.0, 5.0, 6.0, 4.0, 5.0, 6.0]);
}
