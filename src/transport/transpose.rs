//! The contributions by rows of the matrix, and their transpose. All cores compute the transpose block by block.
//!
//! The rows of the contributions are divided among tasks with about equal numbers of entries. Each task keeps a cursor in each of its rows.
//! Entries of a row ascend by pixel, so advancing the cursors yields the transpose one block of rows at a time. Each task has consecutive
//! rows, so the entries of a transposed row ascend if the parts of the tasks are concatenated in order.

use std::ops::Range;

use rayon::prelude::*;

use super::RigShape;
use super::contributions::{Chunk, Key, Term, Terms, places};

/// The number of tasks per thread. There are several, because in the triangle of a symmetric matrix the first tasks run out of entries
/// first.
const TASKS_A_THREAD: usize = 8;

/// All contributions to some rows of the matrix, ordered by the pixel at which their paths start.
pub(super) struct Sources<const C: usize> {
    chunks: Vec<Chunk<C>>,
    /// For each row, the location of the contributions of the paths that start at its pixel.
    own: Vec<Source>,
    tasks: Vec<Task>,
}

#[derive(Clone, Debug, Default)]
struct Source {
    pixel: u32,
    chunk: u32,
    entries: Range<usize>,
}

impl Source {
    fn terms<'a, const C: usize>(&self, chunks: &'a [Chunk<C>]) -> &'a [Term<C>] {
        // A row without contributions has a chunk index that does not exist.
        chunks.get(self.chunk as usize).map_or(&[], |chunk| &chunk.terms[self.entries.clone()])
    }
}

/// The rows that one task transposes, with the entries that are not yet transposed.
struct Task {
    left: Vec<Source>,
}

/// The part of some rows of the transpose that one task computes.
pub(super) struct Transposed<const C: usize> {
    /// The index of the first term of each row. The last element is the number of terms.
    start: Vec<usize>,
    terms: Vec<Term<C>>,
}

impl<const C: usize> Transposed<C> {
    pub(super) fn row(&self, row: usize) -> &[Term<C>] {
        &self.terms[self.start[row]..self.start[row + 1]]
    }
}

impl<const C: usize> Sources<C> {
    /// Divides the rows of all chunks among tasks. The chunks must contain all contributions to these `rows`, and may contain others. With
    /// `triangle`, rows and transpose contain only entries on and above the diagonal.
    pub(super) fn new(chunks: Vec<Chunk<C>>, rig: RigShape, rows: &Range<usize>, triangle: bool) -> Self {
        let columns = rig.projector.pixels();
        let of_row = |number: usize, chunk: &Chunk<C>, at: usize| {
            let row = chunk.rows[at];
            let (first, pixel) = (chunk.start(at), row.pixel as usize);
            let source = |wanted: Range<usize>| {
                let all = wanted.start == 0 && wanted.end >= columns;
                let terms = &chunk.terms[first..row.end];
                let found = if all { 0..terms.len() } else { places(terms, &wanted) };
                let entries = first + found.start..first + found.end;
                Source { pixel: row.pixel, chunk: number as u32, entries }
            };
            let is_own = (rig.symmetric || row.from_camera) && rows.contains(&pixel);
            let own = is_own.then(|| source(if triangle { pixel } else { 0 }..columns));
            let is_mirrored = rig.symmetric || !row.from_camera;
            let to = if triangle { pixel + 1 } else { rows.end };
            let mirrored = is_mirrored.then(|| source(rows.start..to));
            [own, mirrored]
        };
        let found: Vec<[Option<Source>; 2]> = chunks
            .par_iter()
            .enumerate()
            .flat_map(|(number, chunk)| {
                (0..chunk.rows.len()).into_par_iter().map(move |at| of_row(number, chunk, at))
            })
            .collect();
        let mut own = vec![Source::default(); rows.len()];
        let mut mirrored = Vec::new();
        for [of_own, of_mirrored] in found {
            if let Some(source) = of_own {
                let row = source.pixel as usize - rows.start;
                own[row] = source;
            }
            mirrored.extend(of_mirrored.filter(|source| !source.entries.is_empty()));
        }
        Self { chunks, own, tasks: Task::share_out(mirrored) }
    }

    /// The number of contributions to each row. No block may be transposed before this call. The first row belongs to the pixel `first`.
    pub(super) fn counts(&self, first: usize) -> Vec<u32> {
        let rows = self.own.len();
        let of_tasks = |tasks: &[Task]| {
            let mut counts = vec![0_u32; rows];
            let left = tasks.iter().flat_map(|task| &task.left);
            for term in left.flat_map(|source| source.terms(&self.chunks)) {
                counts[term.key.other() as usize - first] += 1;
            }
            counts
        };
        // Each thread needs memory for one count of each row.
        let of_thread = self.tasks.len().div_ceil(rayon::current_num_threads()).max(1);
        let mirrored: Vec<Vec<u32>> = self.tasks.par_chunks(of_thread).map(of_tasks).collect();
        let count = |(row, own): (usize, &Source)| {
            own.entries.len() as u32 + mirrored.iter().map(|counts| counts[row]).sum::<u32>()
        };
        self.own.iter().enumerate().map(count).collect()
    }

    /// The contributions of the paths from the pixel of a row, by ascending keys. Row 0 is the first row of these sources.
    pub(super) fn own(&self, row: usize) -> &[Term<C>] {
        self.own[row].terms(&self.chunks)
    }

    /// The transposed rows of the pixels `block`, one part for each task with entries there. Blocks must be requested in ascending order.
    pub(super) fn transposed(&mut self, block: &Range<usize>) -> Vec<Transposed<C>> {
        let Self { chunks, tasks, .. } = self;
        tasks.par_iter_mut().filter_map(|task| task.transpose(chunks, block)).collect()
    }

    /// Frees the chunks whose pixels all come before `pixel`. The rows of these pixels must not be requested afterwards.
    pub(super) fn release_before(&mut self, pixel: usize) {
        let done = |chunk: &&mut Chunk<C>| chunk.rows.iter().all(|row| (row.pixel as usize) < pixel);
        self.chunks.iter_mut().take_while(done).for_each(|chunk| chunk.terms = Terms::default());
    }
}

impl Task {
    /// Divides these rows among tasks with about equal numbers of entries. No row may be empty.
    fn share_out(rows: Vec<Source>) -> Vec<Self> {
        let entries: usize = rows.iter().map(|source| source.entries.len()).sum();
        let each = entries.div_ceil(TASKS_A_THREAD * rayon::current_num_threads()).max(1);
        let mut tasks: Vec<Self> = Vec::new();
        let mut held = each;
        for source in rows {
            if held >= each {
                tasks.push(Self { left: Vec::new() });
                held = 0;
            }
            held += source.entries.len();
            if let Some(task) = tasks.last_mut() {
                task.left.push(source);
            }
        }
        tasks
    }

    /// The transposed rows of the pixels `block`, from this task; `None` if there are no entries.
    fn transpose<const C: usize>(
        &mut self,
        chunks: &[Chunk<C>],
        block: &Range<usize>,
    ) -> Option<Transposed<C>> {
        let mut start = vec![0; block.len() + 1];
        let place = |term: &Term<C>| (term.key.other() as usize).checked_sub(block.start);
        let in_block = |source: &Source| {
            let terms = source.terms(chunks);
            terms
                .iter()
                .map_while(move |term| place(term).filter(|&row| row < block.len()).map(|row| (row, term)))
        };
        for (row, _) in self.left.iter().flat_map(in_block) {
            start[row + 1] += 1;
        }
        (0..block.len()).for_each(|row| start[row + 1] += start[row]);
        let count = start[block.len()];
        if count == 0 {
            return None;
        }
        let mut next = start.clone();
        let mut terms = vec![Term::none(Key::END); count];
        for source in &mut self.left {
            let mut taken = 0;
            for (row, term) in in_block(source) {
                terms[next[row]] = Term { key: Key::new(source.pixel, term.key.class() as u32), ..*term };
                next[row] += 1;
                taken += 1;
            }
            source.entries.start += taken;
        }
        // Finished rows are dropped, because their chunks may be freed.
        self.left.retain(|source| !source.entries.is_empty());
        Some(Transposed { start, terms })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::tests::on_threads;

    /// Every row belongs to one task, and the tasks keep the order of the rows. All tasks have about equal numbers of entries.
    #[test]
    fn rows_are_shared_out_evenly() {
        let lengths: Vec<usize> = (0..500).map(|row| 1 + row * 37 % 90).collect();
        let rows = |lengths: &[usize]| -> Vec<Source> {
            let row = |(pixel, &length): (usize, &usize)| Source {
                pixel: pixel as u32,
                chunk: 0,
                entries: 0..length,
            };
            lengths.iter().enumerate().map(row).collect()
        };
        let tasks = on_threads(3, || Task::share_out(rows(&lengths)));
        let pixels: Vec<usize> =
            tasks.iter().flat_map(|task| &task.left).map(|source| source.pixel as usize).collect();
        assert_eq!(pixels, (0..500).collect::<Vec<_>>());
        let each = lengths.iter().sum::<usize>().div_ceil(24);
        let held = |task: &Task| task.left.iter().map(|source| source.entries.len()).sum::<usize>();
        let (last, full) = tasks.split_last().expect("there are some");
        // A task ends with the row that completes its equal part, so it exceeds this part by less than one row.
        assert!(full.iter().all(|task| (each..each + 90).contains(&held(task))) && held(last) < each + 90);
        assert!((20..=24).contains(&tasks.len()), "eight of each thread: {}", tasks.len());
        assert_eq!(on_threads(3, || Task::share_out(rows(&[5, 7]))).len(), 2, "no task is without rows");
        assert!(Task::share_out(Vec::new()).is_empty());
    }
}
