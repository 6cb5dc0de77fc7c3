//! Sums over the rows of the matrix, from which its noise follows, and how much is merged of each row.

use std::ops::Range;

use rayon::prelude::*;

use super::RigShape;
use super::chunk::{CLASSES, Chunk, Row, Term, at};
use super::fixed::{FixedSums, RowSums, Scale, add_sums};

/// What is known of the rows before they are merged.
pub(super) struct Outline<const C: usize> {
    /// Values and errors, without the diagonal's direct light.
    pub(super) sums: Vec<RowSums<C>>,
    /// The number of contributions to what is merged of each row.
    pub(super) terms: Vec<u32>,
    /// The number of those contributions in each class of bounces.
    pub(super) of_class: [usize; CLASSES],
}

/// The sums of all tasks take at most one of so many parts of the memory that the contributions take.
const MEMORY_SHARE: usize = 4;

/// Pixels to whose sums contributions are added in one go, so that these sums are near in memory.
const STRIPE: usize = 1 << 14;

/// The outline of these `rows`. The chunks have all contributions to them. With `triangle`, only what is on and above the diagonal is
/// merged.
pub(super) fn outline<const C: usize>(
    chunks: &[Chunk<C>],
    rig: RigShape,
    rows: &Range<usize>,
    triangle: bool,
    scale: Scale,
) -> Outline<C> {
    let all: usize = chunks.iter().map(|chunk| chunk.terms.len()).sum();
    // Each task has sums of all rows. They are exact, so that it does not matter how the contributions are shared out.
    let of_task = rows.len().max(1) * (size_of::<FixedSums<C>>() + size_of::<u32>());
    let room = all * size_of::<Term<C>>() / (MEMORY_SHARE * of_task);
    let tasks = rayon::current_num_threads().min(room).max(1);
    let part = |task: usize| {
        let mut part = Partial::new(rig, rows, triangle, scale);
        let share = [all * task / tasks, all * (task + 1) / tasks];
        let mut left: Vec<(Row, &[Term<C>])> = Vec::new();
        let mut before = 0;
        for chunk in chunks {
            // A row belongs to the task in whose share it ends.
            let [first, end] = share.map(|share| chunk.rows.partition_point(|row| before + row.end <= share));
            left.extend((first..end).map(|row| (chunk.rows[row], chunk.row(row))));
            before += chunk.terms.len();
        }
        part.add_all(left);
        part
    };
    let parts: Vec<Partial<C>> = (0..tasks).into_par_iter().map(part).collect();
    let of_row = |row: usize| {
        let mut sums = [[0; C]; 2];
        parts.iter().for_each(|part| add_sums(&mut sums, &part.sums[row]));
        (scale.sums(&sums), parts.iter().map(|part| part.terms[row]).sum::<u32>())
    };
    let (sums, terms) = (0..rows.len()).into_par_iter().map(of_row).unzip();
    let of_class = std::array::from_fn(|class| parts.iter().map(|part| part.of_class[class]).sum());
    Outline { sums, terms, of_class }
}

/// What some of the contributions add to the outline.
struct Partial<const C: usize> {
    rig: RigShape,
    rows: Range<usize>,
    triangle: bool,
    scale: Scale,
    sums: Vec<FixedSums<C>>,
    terms: Vec<u32>,
    of_class: [usize; CLASSES],
}

impl<const C: usize> Partial<C> {
    fn new(rig: RigShape, rows: &Range<usize>, triangle: bool, scale: Scale) -> Self {
        let (sums, terms) = (vec![[[0; C]; 2]; rows.len()], vec![0; rows.len()]);
        Self { rig, rows: rows.clone(), triangle, scale, sums, terms, of_class: [0; CLASSES] }
    }

    /// Adds these contributions, stripe by stripe of the pixels at which their paths end.
    fn add_all(&mut self, mut left: Vec<(Row, &[Term<C>])>) {
        let pixels = self.rig.camera.pixels().max(self.rig.projector.pixels());
        for stripe in (STRIPE..pixels).step_by(STRIPE) {
            for (row, terms) in &mut left {
                let is_now = |term: &&Term<C>| (term.key.other() as usize) < stripe;
                let (now, later) = terms.split_at(terms.iter().take_while(is_now).count());
                self.add(*row, now);
                *terms = later;
            }
        }
        left.into_iter().for_each(|(row, terms)| self.add(row, terms));
    }

    /// Adds the contributions of the paths from a pixel: to its own row, and to the rows of the pixels at which they end.
    fn add(&mut self, row: Row, terms: &[Term<C>]) {
        let pixel = row.pixel as usize;
        let is_own = (self.rig.symmetric || row.from_camera) && self.rows.contains(&pixel);
        let is_mirrored = self.rig.symmetric || !row.from_camera;
        let first = self.rows.start;
        let (mut own, mut count) = ([[0; C]; 2], 0);
        for term in if is_own { terms } else { at(terms, &self.rows) } {
            let units = self.scale.units_of(term);
            let (other, class) = (term.key.other() as usize, term.key.class());
            if is_own {
                add_sums(&mut own, &units);
                let is_merged = !self.triangle || other >= pixel;
                count += u32::from(is_merged);
                self.of_class[class] += usize::from(is_merged);
            }
            if is_mirrored && self.rows.contains(&other) {
                add_sums(&mut self.sums[other - first], &units);
                let is_merged = !self.triangle || other <= pixel;
                self.terms[other - first] += u32::from(is_merged);
                self.of_class[class] += usize::from(is_merged);
            }
        }
        if is_own {
            add_sums(&mut self.sums[pixel - first], &own);
            self.terms[pixel - first] += count;
        }
    }
}
