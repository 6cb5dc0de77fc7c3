//! Converts arrays to bytes and back, for messages between processes of one program and for the files of shards. Numbers have the byte
//! order of the machine, which is little-endian on every machine with Vulkan.

use std::io::{self, Read, Write};
use std::ops::Range;

use bytemuck::Pod;

use super::contributions::{Chunk, Key, Row, Term, Terms, at};
use super::noise::Estimates;
use super::tiles::{CompressedRows, Fragment, Pages};
use crate::error::Error;
use crate::team;

/// The reason why bytes cannot be read as arrays.
#[derive(Debug)]
pub(super) struct Garbled(pub(super) String);

/// The error for an unreadable message from another process.
pub(super) fn unread(Garbled(why): Garbled) -> Error {
    team::garbled(&why)
}

type Result<T> = std::result::Result<T, Garbled>;

pub(super) fn message(write: impl FnOnce(&mut Vec<u8>) -> io::Result<()>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes).expect("memory takes all bytes");
    bytes
}

pub(super) fn put<T: Pod>(to: &mut impl Write, array: &[T]) -> io::Result<()> {
    to.write_all(&(array.len() as u64).to_le_bytes())?;
    to.write_all(bytemuck::cast_slice(array))
}

/// Reads arrays one after the other from a message or a file.
pub(super) struct Reader<R> {
    from: R,
    left: u64,
}

impl<'a> Reader<&'a [u8]> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self::of(bytes, bytes.len() as u64)
    }
}

impl<R: Read> Reader<R> {
    pub(super) fn of(from: R, left: u64) -> Self {
        Self { from, left }
    }

    pub(super) fn take<T: Pod>(&mut self) -> Result<Vec<T>> {
        let mut array = vec![T::zeroed(); self.length(size_of::<T>())?];
        self.fill(bytemuck::cast_slice_mut(&mut array))?;
        Ok(array)
    }

    /// Reads the next array, whose elements have `C` numbers each.
    fn take_channels<const C: usize>(&mut self) -> Result<Vec<[f32; C]>> {
        let length = self.length(size_of::<f32>())?;
        if length % C > 0 {
            return Err(other_lengths());
        }
        let mut array = vec![[0.0_f32; C]; length / C];
        self.fill(bytemuck::cast_slice_mut(array.as_flattened_mut()))?;
        Ok(array)
    }

    /// Reads the length of the next array. A length that exceeds the remaining bytes is an error.
    fn length(&mut self, element: usize) -> Result<usize> {
        let mut length = [0; 8];
        self.fill(&mut length)?;
        let length = u64::from_le_bytes(length);
        let is_there = length.checked_mul(element as u64).is_some_and(|bytes| bytes <= self.left);
        usize::try_from(length).ok().filter(|_| is_there).ok_or_else(ends_early)
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<()> {
        self.left = self.left.checked_sub(bytes.len() as u64).ok_or_else(ends_early)?;
        self.from.read_exact(bytes).map_err(|error| Garbled(error.to_string()))
    }

    pub(super) fn end(self) -> Result<()> {
        if self.left == 0 { Ok(()) } else { Err(Garbled(format!("{} bytes too many", self.left))) }
    }
}

fn ends_early() -> Garbled {
    Garbled("it ends early".into())
}

fn other_lengths() -> Garbled {
    Garbled("its arrays have other lengths".into())
}

/// Encodes the contributions of these chunks to these `rows` as bytes. Only start pixels of one endpoint (camera or projector) are
/// included.
pub(super) fn chunks_to_bytes<const C: usize>(
    chunks: &[&Chunk<C>],
    from_camera: bool,
    rows: &Range<usize>,
) -> Vec<u8> {
    let of_endpoint =
        chunks.iter().flat_map(|chunk| chunk.rows()).filter(|(row, _)| row.from_camera == from_camera);
    let counts = of_endpoint.map(|(_, terms)| at(terms, rows).len()).filter(|count| *count > 0);
    let (pixels, entries) = counts.fold((0, 0), |(pixels, entries), count| (pixels + 1, entries + count));
    // There are five arrays with their lengths: pixels and ends, keys, means and errors.
    let mut bytes = Vec::with_capacity(40 + 12 * pixels + entries * size_of::<Term<C>>());
    put_chunks(&mut bytes, chunks, from_camera, rows).expect("memory takes all bytes");
    bytes
}

/// Writes the contributions of these chunks to these `rows`, for start pixels of one endpoint. Pixels without contributions are left out.
pub(super) fn put_chunks<const C: usize>(
    to: &mut impl Write,
    chunks: &[&Chunk<C>],
    from_camera: bool,
    rows: &Range<usize>,
) -> io::Result<()> {
    let wanted: Vec<(u32, &[Term<C>])> = chunks
        .iter()
        .flat_map(|chunk| chunk.rows())
        .filter(|(row, _)| row.from_camera == from_camera)
        .map(|(row, terms)| (row.pixel, at(terms, rows)))
        .filter(|(_, terms)| !terms.is_empty())
        .collect();
    let pixels: Vec<u32> = wanted.iter().map(|(pixel, _)| *pixel).collect();
    let mut entries = 0;
    let ends: Vec<u64> = wanted
        .iter()
        .map(|(_, terms)| {
            entries += terms.len();
            entries as u64
        })
        .collect();
    put(to, &pixels)?;
    put(to, &ends)?;
    put_words(to, entries, &wanted, |term| [bytemuck::cast(term.key)])?;
    put_words(to, entries, &wanted, |term| term.mean.map(f32::to_bits))?;
    put_words(to, entries, &wanted, |term| term.error.map(f32::to_bits))
}

/// Writes an array of the words that `part` returns for each term of these rows. `terms` is the number of terms.
fn put_words<const C: usize, const N: usize>(
    to: &mut impl Write,
    terms: usize,
    rows: &[(u32, &[Term<C>])],
    part: impl Fn(&Term<C>) -> [u32; N],
) -> io::Result<()> {
    to.write_all(&((terms * N) as u64).to_le_bytes())?;
    let mut words = Vec::new();
    for (_, terms) in rows {
        words.clear();
        words.extend(terms.iter().map(&part));
        to.write_all(bytemuck::cast_slice(words.as_flattened()))?;
    }
    Ok(())
}

pub(super) fn take_chunk<const C: usize>(
    from: &mut Reader<impl Read>,
    from_camera: bool,
) -> Result<Chunk<C>> {
    let (pixels, ends, keys) = (from.take::<u32>()?, from.take::<u64>()?, from.take::<Key>()?);
    let is_whole = pixels.len() == ends.len()
        && ends.last().map_or(0, |&end| end) == keys.len() as u64
        && ends.is_sorted();
    if !is_whole {
        return Err(other_lengths());
    }
    let mut terms = Pages::<Term<C>>::zeros(keys.len());
    terms.iter_mut().zip(keys).for_each(|(term, key)| term.key = key);
    let means = from.take_channels::<C>()?;
    let errors = from.take_channels::<C>()?;
    if means.len() != terms.len() || errors.len() != terms.len() {
        return Err(other_lengths());
    }
    for ((term, mean), error) in terms.iter_mut().zip(means).zip(errors) {
        (term.mean, term.error) = (mean, error);
    }
    let rows = pixels.into_iter().zip(ends).map(|(pixel, end)| Row { pixel, from_camera, end: end as usize });
    Ok(Chunk { rows: rows.collect(), terms: Terms::Long(terms) })
}

pub(super) fn put_estimates<const C: usize>(
    to: &mut impl Write,
    estimates: &[Estimates<C>],
) -> io::Result<()> {
    put::<f64>(to, estimates.as_flattened().as_flattened())
}

pub(super) fn take_estimates<const C: usize>(from: &mut Reader<impl Read>) -> Result<Vec<Estimates<C>>> {
    Ok(from.take::<f64>()?.as_chunks::<2>().0.as_chunks::<C>().0.to_vec())
}

type Sparse<S, N> = (Vec<S>, Vec<N>, Vec<Vec<f32>>);

fn put_sparse<S: Pod, N: Pod>(
    to: &mut Vec<u8>,
    starts: &[S],
    columns: &[N],
    weights: &[Vec<f32>],
) -> io::Result<()> {
    put(to, starts)?;
    put(to, columns)?;
    weights.iter().try_for_each(|plane| put(to, plane))
}

fn take_sparse<S: Pod + Ord + TryInto<usize>, N: Pod>(
    from: &mut Reader<impl Read>,
    channels: usize,
) -> Result<Sparse<S, N>> {
    let (starts, columns) = (from.take::<S>()?, from.take::<N>()?);
    let weights = (0..channels).map(|_| from.take::<f32>()).collect::<Result<Vec<_>>>()?;
    let is_whole = starts.is_sorted()
        && starts.last().is_some_and(|&end| end.try_into().is_ok_and(|end: usize| end == columns.len()))
        && weights.iter().all(|plane| plane.len() == columns.len());
    if is_whole { Ok((starts, columns, weights)) } else { Err(other_lengths()) }
}

pub(super) fn put_fragments(to: &mut Vec<u8>, fragments: &[Fragment]) -> io::Result<()> {
    let size = |fragment: &Fragment| {
        let columns = fragment.columns.len();
        64 + 4 * fragment.row_start.len() + 2 * columns + fragment.weights.len() * (8 + 4 * columns)
    };
    to.reserve(16 + fragments.iter().map(size).sum::<usize>());
    put(to, &[fragments.len() as u64])?;
    for Fragment { first, base, row_start, columns, weights } in fragments {
        put(to, &[*first as u64, u64::from(*base)])?;
        put_sparse(to, row_start, columns, weights)?;
    }
    Ok(())
}

/// Reads the fragments that [`put_fragments`] wrote, with `channels` weights per entry. Row numbers are relative to `first_row`.
pub(super) fn take_fragments(
    from: &mut Reader<impl Read>,
    channels: usize,
    first_row: usize,
) -> Result<Vec<Fragment>> {
    let count = from.take::<u64>()?.first().copied().unwrap_or_default();
    let fragment = |_| {
        let head = from.take::<u64>()?;
        let [first, base] = head[..] else { return Err(other_lengths()) };
        let first = (first as usize).checked_sub(first_row).ok_or_else(other_lengths)?;
        let (row_start, columns, weights) = take_sparse(from, channels)?;
        Ok(Fragment { first, base: base as u32, row_start, columns, weights })
    };
    (0..count).map(fragment).collect()
}

pub(super) fn rows_to_bytes(rows: &CompressedRows) -> Vec<u8> {
    message(|to| put_sparse(to, &rows.row_start, &rows.columns, &rows.weights))
}

pub(super) fn take_rows(bytes: &[u8], channels: usize) -> Result<CompressedRows> {
    let mut from = Reader::new(bytes);
    let (row_start, columns, weights) = take_sparse(&mut from, channels)?;
    from.end()?;
    Ok(CompressedRows { row_start, columns, weights })
}
