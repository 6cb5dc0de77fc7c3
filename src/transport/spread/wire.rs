//! Long arrays as bytes. All processes run the same program on machines of the same byte order.

use std::ops::Range;

use bytemuck::Pod;

use super::command::garbled;
use crate::error::Result;
use crate::transport::combine::RowSums;
use crate::transport::rows::{Chunk, Key, Row};
use crate::transport::tiles::CompressedRows;

/// Appends an array: its length, and its elements.
fn put<T: Pod>(to: &mut Vec<u8>, array: &[T]) {
    to.extend_from_slice(&(array.len() as u64).to_le_bytes());
    to.extend_from_slice(bytemuck::cast_slice(array));
}

/// Arrays one after the other.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    /// The next array.
    pub(super) fn take<T: Pod>(&mut self) -> Result<Vec<T>> {
        let (length, rest) = self.0.split_first_chunk().ok_or_else(|| garbled("it ends early"))?;
        let bytes =
            usize::try_from(u64::from_le_bytes(*length)).ok().and_then(|n| n.checked_mul(size_of::<T>()));
        let (array, rest) =
            bytes.and_then(|bytes| rest.split_at_checked(bytes)).ok_or_else(|| garbled("it ends early"))?;
        self.0 = rest;
        Ok(bytemuck::pod_collect_to_vec(array))
    }
}

/// The contributions of a chunk that process `to` needs: those of the pixels of one endpoint, to its `rows`. Whole pixels are sent where the process
/// has their rows itself (`own`).
pub(super) fn put_chunks<const C: usize>(
    to: &mut Vec<u8>,
    chunks: &[Chunk<C>],
    from_camera: bool,
    rows: &Range<usize>,
) {
    let (mut pixels, mut ends, mut keys) = (Vec::new(), Vec::new(), Vec::new());
    let (mut means, mut errors) = (Vec::new(), Vec::new());
    for chunk in chunks {
        for (row, span) in chunk.spans().filter(|(row, _)| row.from_camera == from_camera) {
            let of_row = &chunk.keys[span.clone()];
            let at = |pixel: usize| span.start + of_row.partition_point(|key| (key.other() as usize) < pixel);
            let wanted = at(rows.start)..at(rows.end);
            if wanted.is_empty() {
                continue;
            }
            keys.extend(chunk.keys[wanted.clone()].iter().map(|key| key.bits()));
            means.extend_from_slice(chunk.means[wanted.clone()].as_flattened());
            errors.extend_from_slice(chunk.errors[wanted].as_flattened());
            pixels.push(row.pixel);
            ends.push(keys.len() as u64);
        }
    }
    put(to, &pixels);
    put(to, &ends);
    put(to, &keys);
    put::<f32>(to, &means);
    put::<f32>(to, &errors);
}

/// The chunk that [`put_chunks`] sent.
pub(super) fn take_chunk<const C: usize>(from: &mut Reader<'_>, from_camera: bool) -> Result<Chunk<C>> {
    let (pixels, ends) = (from.take::<u32>()?, from.take::<u64>()?);
    let keys: Vec<Key> = from.take()?.into_iter().map(Key::from_bits).collect();
    let (means, errors) = (from.take::<f32>()?, from.take::<f32>()?);
    let rows = pixels.into_iter().zip(ends).map(|(pixel, end)| Row { pixel, from_camera, end: end as usize });
    let chunk = Chunk {
        rows: rows.collect(),
        keys,
        means: means.as_chunks::<C>().0.to_vec(),
        errors: errors.as_chunks::<C>().0.to_vec(),
    };
    let entries = chunk.keys.len();
    let is_whole = chunk.rows.last().map_or(0, |row| row.end) == entries
        && chunk.rows.is_sorted_by_key(|row| row.end)
        && (chunk.means.len(), chunk.errors.len()) == (entries, entries);
    if is_whole { Ok(chunk) } else { Err(garbled("its arrays have other lengths")) }
}

/// Appends the means and errors of pixels.
pub(super) fn put_estimates<const C: usize>(to: &mut Vec<u8>, estimates: &[[[f64; 2]; C]]) {
    put::<f64>(to, estimates.as_flattened().as_flattened());
}

/// The means and errors that [`put_estimates`] sent.
pub(super) fn take_estimates<const C: usize>(from: &mut Reader<'_>) -> Result<Vec<[[f64; 2]; C]>> {
    Ok(from.take::<f64>()?.as_chunks::<2>().0.as_chunks::<C>().0.to_vec())
}

/// Appends the sums over rows.
pub(super) fn put_sums<const C: usize>(to: &mut Vec<u8>, sums: &[RowSums<C>]) {
    let of_row = |row: &RowSums<C>| {
        [&row.mean[..], &row.error, &[row.mean_squares, row.error_squares], &row.global].concat()
    };
    put(to, &sums.iter().flat_map(of_row).collect::<Vec<f64>>());
}

/// The sums that [`put_sums`] sent.
pub(super) fn take_sums<const C: usize>(from: &mut Reader<'_>) -> Result<Vec<RowSums<C>>> {
    let values = from.take::<f64>()?;
    let row = |row: &[f64]| RowSums {
        mean: std::array::from_fn(|channel| row[channel]),
        error: std::array::from_fn(|channel| row[C + channel]),
        mean_squares: row[2 * C],
        error_squares: row[2 * C + 1],
        global: [row[2 * C + 2], row[2 * C + 3]],
    };
    Ok(values.chunks_exact(2 * C + 4).map(row).collect())
}

/// Rows of a layer as bytes.
pub(super) fn rows_to_bytes(rows: &CompressedRows) -> Vec<u8> {
    let mut bytes = Vec::new();
    put(&mut bytes, &rows.row_start.iter().map(|&start| start as u64).collect::<Vec<_>>());
    put(&mut bytes, &rows.columns);
    rows.weights.iter().for_each(|plane| put(&mut bytes, plane));
    bytes
}

/// The rows that [`rows_to_bytes`] sent, appended to `rows`.
pub(super) fn append_rows(rows: &mut CompressedRows, bytes: &[u8]) -> Result<()> {
    let mut from = Reader(bytes);
    let before = rows.columns.len();
    rows.row_start.extend(from.take::<u64>()?.iter().skip(1).map(|&start| before + start as usize));
    rows.columns.extend(from.take::<u32>()?);
    rows.weights.iter_mut().try_for_each(|plane| {
        plane.extend(from.take::<f32>()?);
        Ok(())
    })
}
