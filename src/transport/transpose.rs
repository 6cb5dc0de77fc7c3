//! The transpose of the contributions, block by block, on all cores.
//!
//! The rows of the contributions are shared out: each task has as many entries, and keeps a cursor in each of its rows.
//! Since the entries of a row ascend, the cursors yield the transpose one block of rows at a time. Tasks have consecutive
//! rows, so that the tasks' parts of a row of the transpose, one after the other, ascend as well.

use std::ops::Range;

use rayon::prelude::*;

use super::RigShape;
use super::chunk::{Chunk, Key, Term, at};

/// A row of the contributions.
struct Source<'a, const C: usize> {
    pixel: u32,
    /// Its entries that the transpose does not have yet.
    left: &'a [Term<C>],
}

/// The rows that one task transposes, and the terms that they give to each row of the transpose.
struct Task<'a, const C: usize> {
    /// The pixel of the first row.
    first: usize,
    sources: Vec<Source<'a, C>>,
    terms: Vec<u32>,
}

/// All contributions to some rows of the matrix, by the pixels at which their paths start.
pub(super) struct Sources<'a, const C: usize> {
    tasks: Vec<Task<'a, C>>,
    /// For each of these rows, the contributions of paths from its pixel.
    own: Vec<&'a [Term<C>]>,
}

/// A task's part of some rows of the transpose.
pub(super) struct Transposed<const C: usize> {
    /// The first term of each row, then their number.
    start: Vec<usize>,
    terms: Vec<Term<C>>,
}

impl<const C: usize> Transposed<C> {
    /// The terms of a row of the block, by ascending keys.
    pub(super) fn row(&self, row: usize) -> &[Term<C>] {
        &self.terms[self.start[row]..self.start[row + 1]]
    }
}

impl<'a, const C: usize> Sources<'a, C> {
    /// Shares out the rows of all chunks, which have all contributions to these `rows` of the matrix, and may have others.
    pub(super) fn new(chunks: &'a [Chunk<C>], rig: RigShape, rows: &Range<usize>) -> Self {
        let mut own: Vec<&[Term<C>]> = vec![&[]; rows.len()];
        let mut mirrored = Vec::new();
        for (row, terms) in chunks.iter().flat_map(Chunk::rows) {
            if (rig.symmetric || row.from_camera) && rows.contains(&(row.pixel as usize)) {
                own[row.pixel as usize - rows.start] = terms;
            }
            if rig.symmetric || !row.from_camera {
                mirrored.push(Source { pixel: row.pixel, left: at(terms, rows) });
            }
        }

        let entries: usize = mirrored.iter().map(|source| source.left.len()).sum();
        let each = entries.div_ceil(rayon::current_num_threads()).max(1);
        let mut tasks: Vec<Task<'a, C>> = Vec::new();
        let mut held = each;
        for source in mirrored {
            if held >= each {
                tasks.push(Task { first: rows.start, sources: Vec::new(), terms: Vec::new() });
                held = 0;
            }
            held += source.left.len();
            if let Some(task) = tasks.last_mut() {
                task.sources.push(source);
            }
        }
        tasks.par_iter_mut().for_each(|task| task.count(rows.len()));
        Self { tasks, own }
    }

    /// The number of terms of each of the rows.
    pub(super) fn terms(&self) -> Vec<u32> {
        let row = |row: usize| {
            self.own[row].len() as u32 + self.tasks.iter().map(|task| task.terms[row]).sum::<u32>()
        };
        (0..self.own.len()).into_par_iter().with_min_len(1024).map(row).collect()
    }

    /// The entries of the paths from the pixel of a row, counted from the first of the rows, by ascending keys.
    pub(super) fn own(&self, row: usize) -> &'a [Term<C>] {
        self.own[row]
    }

    /// The rows `block` of the transpose, as the tasks' parts. Blocks follow one another.
    pub(super) fn transposed(&mut self, block: Range<usize>) -> Vec<Transposed<C>> {
        self.tasks.par_iter_mut().map(|task| task.transpose(block.clone())).collect()
    }
}

impl<const C: usize> Task<'_, C> {
    /// Counts the terms for each of so many rows of the transpose.
    fn count(&mut self, rows: usize) {
        self.terms = vec![0; rows];
        for term in self.sources.iter().flat_map(|source| source.left) {
            self.terms[term.key.other() as usize - self.first] += 1;
        }
    }

    /// The rows `block` of the transpose, counted from the first of the rows.
    fn transpose(&mut self, block: Range<usize>) -> Transposed<C> {
        let mut start = Vec::with_capacity(block.len() + 1);
        let mut count = 0;
        for &terms in &self.terms[block.clone()] {
            start.push(count);
            count += terms as usize;
        }
        let mut next = start.clone();
        start.push(count);
        let mut terms = vec![Term::none(Key::END); count];
        for Source { pixel, left } in &mut self.sources {
            while let Some((term, rest)) = left.split_first() {
                let row = term.key.other() as usize - self.first;
                if row >= block.end {
                    break;
                }
                let to = &mut next[row - block.start];
                terms[*to] = Term { key: Key::new(*pixel, term.key.class() as u32), ..*term };
                *to += 1;
                *left = rest;
            }
        }
        Transposed { start, terms }
    }
}
