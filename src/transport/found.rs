//! The contributions that were traced, with what is known of all of them.

use rayon::prelude::*;

use super::chunk::{CLASSES, Chunk, Term};
use super::fixed::largest_exponent;

/// The contributions of all paths.
#[derive(Clone)]
pub(super) struct Found<const C: usize> {
    /// Chunks in the order of the paths: all of them, or where several processes merge them, those of each step.
    pub(super) steps: Vec<Vec<Chunk<C>>>,
    pub(super) about: About,
}

/// What is known of contributions.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct About {
    /// The largest exponent of their values and errors, from which the unit of their sums follows.
    pub(super) largest: u32,
    /// The number of contributions of each class of bounces.
    pub(super) of_class: [usize; CLASSES],
}

impl About {
    /// Adds what a contribution tells.
    pub(super) fn add<const C: usize>(&mut self, term: &Term<C>) {
        self.largest = self.largest.max(largest_exponent(term));
        self.of_class[term.key.class()] += 1;
    }

    /// What is known of both.
    pub(super) fn and(mut self, more: Self) -> Self {
        self.largest = self.largest.max(more.largest);
        self.of_class.iter_mut().zip(more.of_class).for_each(|(all, more)| *all += more);
        self
    }
}

impl<const C: usize> Found<C> {
    /// All of these chunks, which one process merges.
    pub(super) fn of_chunks(chunks: Vec<Chunk<C>>) -> Self {
        let about = |chunk: &Chunk<C>| {
            let mut about = About::default();
            chunk.terms.iter().for_each(|term| about.add(term));
            about
        };
        let about = chunks.par_iter().map(about).reduce(About::default, About::and);
        Self { steps: vec![chunks], about }
    }

    /// All chunks, which one process merges.
    pub(super) fn into_chunks(self) -> Vec<Chunk<C>> {
        self.steps.into_iter().flatten().collect()
    }
}
