//! Contributions and sums as bytes: messages between processes of one program, and the files of shards. Numbers have the byte order of the machine,
//! which is little-endian wherever Vulkan runs.

use std::io::{self, Read, Write};
use std::ops::Range;

use bytemuck::Pod;

use super::chunk::{Chunk, Key, Row, Term, Terms, at};
use super::fixed::RowSums;
use super::tiles::{CompressedRows, Fragment, Pages};

/// What is wrong with bytes that should be arrays.
#[derive(Debug)]
pub(super) struct Garbled(pub(super) String);

type Result<T> = std::result::Result<T, Garbled>;

/// What `write` writes.
pub(super) fn message(write: impl FnOnce(&mut Vec<u8>) -> io::Result<()>) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes).expect("memory takes all bytes");
    bytes
}

/// Writes an array: its length, and its elements.
pub(super) fn put<T: Pod>(to: &mut impl Write, array: &[T]) -> io::Result<()> {
    to.write_all(&(array.len() as u64).to_le_bytes())?;
    to.write_all(bytemuck::cast_slice(array))
}

/// Arrays one after the other, from a message or a file.
pub(super) struct Reader<R> {
    from: R,
    /// The number of bytes that are left.
    left: u64,
}

impl<'a> Reader<&'a [u8]> {
    /// The arrays of a message.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self::of(bytes, bytes.len() as u64)
    }
}

impl<R: Read> Reader<R> {
    /// The arrays in the next `left` bytes.
    pub(super) fn of(from: R, left: u64) -> Self {
        Self { from, left }
    }

    /// The next array.
    pub(super) fn take<T: Pod>(&mut self) -> Result<Vec<T>> {
        let mut array = vec![T::zeroed(); self.length(size_of::<T>())?];
        self.fill(bytemuck::cast_slice_mut(&mut array))?;
        Ok(array)
    }

    /// The next array, whose elements are `C` numbers each.
    fn take_channels<const C: usize>(&mut self) -> Result<Vec<[f32; C]>> {
        let length = self.length(size_of::<f32>())?;
        if length % C > 0 {
            return Err(other_lengths());
        }
        let mut array = vec![[0.0_f32; C]; length / C];
        self.fill(bytemuck::cast_slice_mut(array.as_flattened_mut()))?;
        Ok(array)
    }

    /// The length of the next array. It is not longer than what is left, whatever is said.
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

    /// Fails if anything is left.
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

/// The contributions of some chunks to these `rows`, of the pixels of one endpoint. A pixel without such contributions is left out.
pub(super) fn put_chunks<const C: usize>(
    to: &mut impl Write,
    chunks: &[Chunk<C>],
    from_camera: bool,
    rows: &Range<usize>,
) -> io::Result<()> {
    let wanted: Vec<(u32, &[Term<C>])> = chunks
        .iter()
        .flat_map(Chunk::rows)
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

/// Writes an array of the words that `part` takes of each of the terms of these rows, of which there are so many.
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

/// The chunk that [`put_chunks`] wrote.
pub(super) fn take_chunk<const C: usize>(
    from: &mut Reader<impl Read>,
    from_camera: bool,
) -> Result<Chunk<C>> {
    let (pixels, ends) = (from.take::<u32>()?, from.take::<u64>()?);
    let mut terms: Vec<Term<C>> = from.take::<Key>()?.into_iter().map(Term::none).collect();
    let means = from.take_channels::<C>()?;
    let is_whole = pixels.len() == ends.len()
        && ends.last().map_or(0, |&end| end) == terms.len() as u64
        && ends.is_sorted()
        && means.len() == terms.len();
    if !is_whole {
        return Err(other_lengths());
    }
    terms.iter_mut().zip(means).for_each(|(term, mean)| term.mean = mean);
    let errors = from.take_channels::<C>()?;
    if errors.len() != terms.len() {
        return Err(other_lengths());
    }
    terms.iter_mut().zip(errors).for_each(|(term, error)| term.error = error);
    let rows = pixels.into_iter().zip(ends).map(|(pixel, end)| Row { pixel, from_camera, end: end as usize });
    Ok(Chunk { rows: rows.collect(), terms: Terms::Short(terms) })
}

/// The contributions of some chunks to these `rows`, of the pixels of one endpoint, for another process of this program.
pub(super) fn terms_to_bytes<const C: usize>(chunks: &[Chunk<C>], rows: &Range<usize>) -> Vec<u8> {
    let wanted = || {
        let of_row = |(row, terms)| (row, at(terms, rows));
        chunks
            .iter()
            .flat_map(Chunk::rows)
            .map(of_row)
            .filter(|(_, terms): &(Row, &[Term<C>])| !terms.is_empty())
    };
    let mut end = 0_u64;
    let heads: Vec<[u64; 2]> = wanted()
        .map(|(row, terms)| {
            end += terms.len() as u64;
            [u64::from(row.pixel), end]
        })
        .collect();
    let mut bytes = Vec::with_capacity(16 + size_of_val(&heads[..]) + end as usize * size_of::<Term<C>>());
    bytes.extend((2 * heads.len() as u64).to_le_bytes());
    bytes.extend_from_slice(bytemuck::cast_slice(&heads));
    bytes.extend(end.to_le_bytes());
    wanted().for_each(|(_, terms)| bytes.extend_from_slice(bytemuck::cast_slice(terms)));
    bytes
}

/// The chunk that [`terms_to_bytes`] wrote.
pub(super) fn take_terms<const C: usize>(
    from: &mut Reader<impl Read>,
    from_camera: bool,
) -> Result<Chunk<C>> {
    let heads = from.take::<u64>()?;
    let count = from.length(size_of::<Term<C>>())?;
    let mut terms = Pages::<Term<C>>::zeros(count);
    from.fill(bytemuck::cast_slice_mut(&mut terms))?;
    let row = |&[pixel, end]: &[u64; 2]| Row { pixel: pixel as u32, from_camera, end: end as usize };
    let rows: Vec<Row> = heads.as_chunks::<2>().0.iter().map(row).collect();
    if rows.last().map_or(0, |row| row.end) != count || !rows.is_sorted_by_key(|row| row.end) {
        return Err(other_lengths());
    }
    Ok(Chunk { rows, terms: Terms::Long(terms) })
}

/// Writes the means and errors of pixels.
pub(super) fn put_estimates<const C: usize>(
    to: &mut impl Write,
    estimates: &[[[f64; 2]; C]],
) -> io::Result<()> {
    put::<f64>(to, estimates.as_flattened().as_flattened())
}

/// The means and errors that [`put_estimates`] wrote.
pub(super) fn take_estimates<const C: usize>(from: &mut Reader<impl Read>) -> Result<Vec<[[f64; 2]; C]>> {
    Ok(from.take::<f64>()?.as_chunks::<2>().0.as_chunks::<C>().0.to_vec())
}

/// Writes the sums over rows.
pub(super) fn put_sums<const C: usize>(to: &mut impl Write, sums: &[RowSums<C>]) -> io::Result<()> {
    put(to, &sums.iter().flat_map(|row| [row.mean, row.error]).flatten().collect::<Vec<f64>>())
}

/// The sums that [`put_sums`] wrote.
pub(super) fn take_sums<const C: usize>(from: &mut Reader<impl Read>) -> Result<Vec<RowSums<C>>> {
    let values = from.take::<f64>()?;
    let row = |row: &[[f64; C]; 2]| RowSums { mean: row[0], error: row[1] };
    Ok(values.as_chunks::<C>().0.as_chunks::<2>().0.iter().map(row).collect())
}

/// Writes fragments of rows.
pub(super) fn put_fragments(to: &mut Vec<u8>, fragments: &[Fragment]) -> io::Result<()> {
    let size = |fragment: &Fragment| {
        let columns = fragment.columns.len();
        64 + 4 * fragment.row_start.len() + 2 * columns + fragment.weights.len() * (8 + 4 * columns)
    };
    to.reserve(16 + fragments.iter().map(size).sum::<usize>());
    put(to, &[fragments.len() as u64])?;
    for fragment in fragments {
        put(to, &[fragment.first as u64, u64::from(fragment.base)])?;
        put(to, &fragment.row_start)?;
        put(to, &fragment.columns)?;
        fragment.weights.iter().try_for_each(|plane| put(to, plane))?;
    }
    Ok(())
}

/// The fragments that [`put_fragments`] wrote, with so many channels. Their rows are counted from `first_row` on.
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
        let (row_start, columns) = (from.take::<u32>()?, from.take::<u16>()?);
        let weights = (0..channels).map(|_| from.take::<f32>()).collect::<Result<Vec<_>>>()?;
        let is_whole = row_start.is_sorted()
            && row_start.last().is_some_and(|&end| end as usize == columns.len())
            && weights.iter().all(|plane| plane.len() == columns.len());
        if !is_whole {
            return Err(other_lengths());
        }
        Ok(Fragment { first, base: base as u32, row_start, columns, weights })
    };
    (0..count).map(fragment).collect()
}

/// Rows of a layer as bytes.
pub(super) fn rows_to_bytes(rows: &CompressedRows) -> Vec<u8> {
    message(|to| {
        put(to, &rows.row_start.iter().map(|&start| start as u64).collect::<Vec<_>>())?;
        put(to, &rows.columns)?;
        rows.weights.iter().try_for_each(|plane| put(to, plane))
    })
}

/// The rows that [`rows_to_bytes`] wrote, appended to `rows`.
pub(super) fn append_rows(rows: &mut CompressedRows, bytes: &[u8]) -> Result<()> {
    let mut from = Reader::new(bytes);
    let before = rows.columns.len();
    rows.row_start.extend(from.take::<u64>()?.iter().skip(1).map(|&start| before + start as usize));
    rows.columns.extend(from.take::<u32>()?);
    rows.weights.iter_mut().try_for_each(|plane| {
        plane.extend(from.take::<f32>()?);
        Ok(())
    })
}
