//! Merges the rows of the matrix from the contributions of each pixel's paths and the transpose of these contributions.
//!
//! Let `F` be the matrix of contributions with a row for each start pixel. A coaxial rig has `A = F + Fᵀ`. If the projector stands apart,
//! the rows of `F` for camera pixels are rows of `A`, and the rows of `F` for projector pixels are columns of `A`. The transpose of `F` is
//! computed one block of rows at a time (`transpose`), so there is no second copy of `F`. A row of `A` is then the merge of two ascending
//! rows, one of `F` and one of its transpose.
//!
//! The whole matrix of a coaxial rig is symmetric, so only its triangle on and above the diagonal is merged. Contributions to finished rows
//! are freed, so their memory shrinks while the memory of the matrix grows.

use std::cmp::Ordering;
use std::ops::Range;

use rayon::prelude::*;

use super::contributions::{Key, Term};
use super::noise::{EntrySquares, Estimates};
use super::spread::Steps;
use super::tiles::{CompressedRows, take};
use super::transpose::Sources;

/// The approximate number of contributions in one block. Blocks are larger if there would be more than `MOST_BLOCKS`.
const BLOCK: usize = 1 << 21;

/// The maximum number of blocks. Each block takes one pass over all pixels.
const MOST_BLOCKS: usize = 48;

const ROWS_PER_TASK: usize = 64;

/// The rows of a matrix while they are merged. Row numbers start at 0 for the first of these rows.
pub(super) struct Merging<'a, const C: usize> {
    pub(super) sources: Sources<C>,
    pairs: Pairs<'a>,
    first: usize,
    /// The number of contributions to each row.
    terms: Vec<u32>,
    /// The diagonal of these rows, with mean and error for each channel; empty if the matrix has no separate diagonal.
    direct: &'a [Estimates<C>],
    pub(super) squares: EntrySquares,
}

/// The weight of an entry's square in the sum over all entries. With these weights, every entry and every mirror image counts once.
#[derive(Clone, Copy)]
pub(super) enum Pairs<'a> {
    /// The matrix is not symmetric, so each entry counts once.
    Apart,
    /// A step merges the entries of its rows in the columns of this step and of later steps. An entry in a column of a later step counts
    /// twice, because its mirror image is never merged. In columns of this step, entries above the diagonal count twice, and entries below
    /// it do not count.
    Step(&'a Steps, usize),
}

impl Pairs<'_> {
    #[inline]
    fn times(self, row: u32, column: u32) -> f64 {
        match (self, column.cmp(&row)) {
            (Self::Apart, _) | (_, Ordering::Equal) => 1.0,
            (_, Ordering::Greater) => 2.0,
            (Self::Step(steps, now), Ordering::Less) if steps.of_pixel(column as usize) > now => 2.0,
            (Self::Step(..), Ordering::Less) => 0.0,
        }
    }
}

impl<'a, const C: usize> Merging<'a, C> {
    /// Starts the merge. The first row belongs to the pixel `first`.
    pub(super) fn new(
        sources: Sources<C>,
        pairs: Pairs<'a>,
        first: usize,
        direct: &'a [Estimates<C>],
    ) -> Self {
        let terms = sources.counts(first);
        Self { sources, pairs, first, terms, direct, squares: EntrySquares::default() }
    }

    pub(super) fn pieces(&mut self, rows: &Range<usize>, classes: usize) -> Vec<Vec<CompressedRows>> {
        let mut pieces: Vec<Vec<CompressedRows>> = vec![Vec::new(); classes];
        for block in blocks(&self.terms, rows) {
            let merged = self.merge(block, classes);
            pieces.iter_mut().zip(merged).for_each(|(pieces, piece)| pieces.push(piece));
        }
        pieces
    }

    /// Merges these rows from the contributions and their transpose, for each layer. Calls must follow the order of the rows.
    fn merge(&mut self, rows: Range<usize>, classes: usize) -> Vec<CompressedRows> {
        let transposed = self.sources.transposed(&(self.first + rows.start..self.first + rows.end));
        let tasks: Vec<usize> = rows.clone().step_by(ROWS_PER_TASK).collect();
        let (sources, terms) = (&self.sources, &self.terms);
        let merged: Vec<Merged<'_>> = tasks
            .into_par_iter()
            .map(|first| {
                let of_task = first..rows.end.min(first + ROWS_PER_TASK);
                let count = terms[of_task.clone()].iter().sum::<u32>() as usize;
                let mut merged = Merged::new::<C>(classes, count, self.pairs);
                let mut mirrored = Vec::new();
                for row in of_task {
                    mirrored.clear();
                    transposed.iter().for_each(|part| mirrored.extend_from_slice(part.row(row - rows.start)));
                    let pixel = (self.first + row) as u32;
                    merged.row(pixel, sources.own(row), &mirrored, self.direct.get(row));
                }
                merged
            })
            .collect();
        let mut parts: Vec<Vec<CompressedRows>> = vec![Vec::new(); classes];
        for Merged { layers, squares, .. } in merged {
            self.squares.add_all(&squares);
            parts.iter_mut().zip(layers).for_each(|(parts, part)| parts.push(part));
        }
        parts.into_iter().map(joined::<C>).collect()
    }
}

/// Divides these rows into blocks of whole rows that are as full as possible. `terms` is the number of contributions to each row.
fn blocks(terms: &[u32], rows: &Range<usize>) -> Vec<Range<usize>> {
    let most = BLOCK.max(terms.iter().map(|&terms| terms as usize).sum::<usize>() / MOST_BLOCKS);
    let mut blocks = Vec::new();
    let (mut first, mut held) = (rows.start, 0);
    for row in rows.clone() {
        let terms = terms[row] as usize;
        if row > first && held + terms > most {
            blocks.push(first..row);
            (first, held) = (row, 0);
        }
        held += terms;
    }
    blocks.push(first..rows.end);
    blocks
}

/// Joins the rows of several tasks into one piece. The piece's arrays are long, so the system gets their memory back when they are freed.
fn joined<const C: usize>(parts: Vec<CompressedRows>) -> CompressedRows {
    let count = parts.iter().map(|part| part.columns.len()).sum();
    let mut joined =
        CompressedRows { row_start: vec![0], columns: vec![0; count], weights: vec![vec![0.0; count]; C] };
    let mut columns = joined.columns.as_mut_slice();
    let mut planes: Vec<&mut [f32]> = joined.weights.iter_mut().map(Vec::as_mut_slice).collect();
    let (mut to, mut before) = (Vec::new(), 0);
    for part in &parts {
        joined.row_start.extend(part.row_start.iter().skip(1).map(|end| before + end));
        let count = part.columns.len();
        before += count;
        let planes: Vec<&mut [f32]> = planes.iter_mut().map(|plane| take(plane, count)).collect();
        to.push((take(&mut columns, count), planes));
    }
    parts.into_par_iter().zip(to).for_each(|(part, (columns, planes))| {
        columns.copy_from_slice(&part.columns);
        planes.into_iter().zip(&part.weights).for_each(|(to, from)| to.copy_from_slice(from));
    });
    joined
}

struct Merged<'a> {
    layers: Vec<CompressedRows>,
    pairs: Pairs<'a>,
    squares: EntrySquares,
}

struct Entry<const C: usize> {
    column: u32,
    /// Means and errors: `whole` for all light, and `global` for light of two or more bounces.
    whole: Estimates<C>,
    global: Estimates<C>,
    has_direct: bool,
}

impl<const C: usize> Entry<C> {
    fn new(column: u32, direct: Option<&Estimates<C>>) -> Self {
        let none = [[0.0; 2]; C];
        Self { column, whole: *direct.unwrap_or(&none), global: none, has_direct: direct.is_some() }
    }
}

impl<'a> Merged<'a> {
    /// `layers` layers without rows. The last layer reserves memory for `count` entries, because nearly all entries belong to it.
    fn new<const C: usize>(layers: usize, count: usize, pairs: Pairs<'a>) -> Self {
        let room = |layer: usize| if layer + 1 == layers { count } else { 0 };
        let layers = (0..layers).map(|layer| CompressedRows::with_room(C, ROWS_PER_TASK, room(layer)));
        Self { layers: layers.collect(), pairs, squares: EntrySquares::default() }
    }

    /// Merges one row. Terms of equal column and class are summed in `f64`.
    fn row<const C: usize>(
        &mut self,
        row: u32,
        own: &[Term<C>],
        mirrored: &[Term<C>],
        mut direct: Option<&Estimates<C>>,
    ) {
        let mut entry = Entry::<C>::new(u32::MAX, None);
        each_key(own, mirrored, |key, sum| {
            let column = key.other();
            if column != entry.column {
                self.count(row, &entry);
                let direct = if column == row { direct.take() } else { None };
                entry = Entry::new(column, direct);
            }
            let class = key.class();
            add(&mut entry.whole, &sum);
            if class > 0 {
                add(&mut entry.global, &sum);
            } else {
                entry.has_direct = true;
            }
            let layer = &mut self.layers[class];
            layer.columns.push(column);
            layer.weights.iter_mut().zip(sum).for_each(|(plane, [mean, _])| plane.push(mean as f32));
        });
        self.count(row, &entry);
        // A remaining `direct` means that the diagonal entry of this row has only direct light.
        if direct.is_some() {
            self.count(row, &Entry::new(row, direct));
        }
        self.layers.iter_mut().for_each(CompressedRows::end_row);
    }

    #[inline]
    fn count<const C: usize>(&mut self, row: u32, entry: &Entry<C>) {
        if entry.column == u32::MAX {
            return;
        }
        let times = self.pairs.times(row, entry.column);
        if times == 0.0 {
            return;
        }
        if entry.has_direct {
            self.squares.add_direct(times, &entry.whole, &entry.global);
        } else {
            self.squares.add_indirect(times, &entry.global);
        }
    }
}

/// Calls `visit` with each key that occurs in a row of the contributions (`own`) or in the same row of their transpose (`mirrored`), in
/// ascending order, and with the sum of its one or two terms. An entry of the matrix and its mirror image are sums of the same two numbers,
/// so they agree to the last bit.
fn each_key<const C: usize>(own: &[Term<C>], mirrored: &[Term<C>], mut visit: impl FnMut(Key, Estimates<C>)) {
    let nothing = Term::none(Key::END);
    let (mut first, mut second) = (0, 0);
    loop {
        let next = [own.get(first).unwrap_or(&nothing), mirrored.get(second).unwrap_or(&nothing)];
        let key = next[0].key.min(next[1].key);
        if key == Key::END {
            return;
        }
        // Which of the two next terms has the smaller key is random, so a branch would often be mispredicted.
        let has = next.map(|term| term.key == key);
        let [a, b] = [0, 1].map(|which| if has[which] { next[which] } else { &nothing });
        visit(
            key,
            std::array::from_fn(|channel| {
                let sum = |a: f32, b: f32| f64::from(a) + f64::from(b);
                [sum(a.mean[channel], b.mean[channel]), sum(a.error[channel], b.error[channel])]
            }),
        );
        first += usize::from(has[0]);
        second += usize::from(has[1]);
    }
}

fn add<const C: usize>(to: &mut Estimates<C>, more: &Estimates<C>) {
    for (to, more) in to.iter_mut().flatten().zip(more.iter().flatten()) {
        *to += more;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::RigShape;

    /// Blocks follow one another and are as full as possible. A row with more contributions than a block allows is a block of its own.
    #[test]
    fn blocks_are_full_and_cover_all_rows() {
        let blocks = |terms: &[u32], rows: Range<usize>| blocks(terms, &rows);
        let half = (BLOCK / 2) as u32;
        assert_eq!(blocks(&[half, half, 1, half, half - 1, half, 2], 0..7), [0..2, 2..5, 5..7]);
        assert_eq!(blocks(&[half, half, 1, half, half - 1, half, 2], 1..4), [1..3, 3..4]);
        assert_eq!(blocks(&[3 * half, 3 * half, 1, 0, 3 * half, 0], 0..6), [0..1, 1..2, 2..4, 4..5, 5..6]);
        assert_eq!(blocks(&[0, 0], 0..2), vec![0..2]);
        // A large matrix has larger blocks. There are at most 48, and each has a 48th of all contributions, or less by at most one row.
        let large = blocks(&[half; 480], 0..480);
        assert!(large.iter().all(|block| block.len() == 10) && large.len() == 48, "{large:?}");
    }

    #[test]
    fn an_entry_above_the_diagonal_counts_for_its_mirror_image() {
        let times = |pairs: Pairs<'_>| [(3, 3), (3, 4), (4, 3)].map(|(row, column)| pairs.times(row, column));
        assert_eq!(times(Pairs::Apart), [1.0; 3]);
        let size = crate::image::Resolution::new(8, 1);
        let rig = RigShape { camera: size, projector: size, symmetric: true };
        assert_eq!(times(Pairs::Step(&Steps::one(rig), 0)), [1.0, 2.0, 0.0]);
        // The first step merges the rows of the pixels 0, 1, 4 and 5.
        let steps = Steps::new(rig, vec![vec![0..2, 2..4], vec![4..6, 6..8]]);
        let of_step = |step, row, column| Pairs::Step(&steps, step).times(row, column);
        assert_eq!([of_step(0, 5, 3), of_step(0, 5, 1), of_step(1, 6, 3)], [2.0, 0.0, 0.0]);
        assert_eq!([of_step(0, 1, 3), of_step(0, 1, 5), of_step(1, 3, 6)], [2.0; 3]);
    }
}
