//! Terms that the device made of contributions become rows.

use rayon::prelude::*;

use super::{Rows, Start, Task};
use crate::render::Merged;
use crate::transport::chunk::{Key, Term};

/// Tasks of each thread that take in the terms of a dispatch.
const PARTS_OF_THREAD: usize = 4;

impl<const C: usize> Rows<'_, C> {
    /// Adds the terms of pixels of which the device has summed all paths.
    pub(super) fn add_merged(&mut self, merged: Merged<'_>, (paths, from_camera): (u32, bool)) {
        // What came before is of other pixels.
        self.open.take().into_iter().for_each(|open| self.push(open));
        let finish = |part: &Merged<'_>| {
            let mut task = Task::<C>::new(self.chunks.len());
            let mut last = None;
            let end_row = |task: &mut Task<C>, pixel: u32| {
                let start = Start { pixel, from_camera, paths };
                task.finished.iter_mut().for_each(|chunk| chunk.end_row(start));
            };
            for found in part.terms() {
                if let Some(last) = last.replace(found.start).filter(|last| *last != found.start) {
                    end_row(&mut task, last);
                }
                let term = Term { key: Key::of_number(found.key), mean: found.mean(), error: found.error() };
                task.push(self.step_of(found.start, from_camera, term.key), term);
            }
            last.into_iter().for_each(|last| end_row(&mut task, last));
            task.chunks()
        };
        let parts = merged.parts(PARTS_OF_THREAD * rayon::current_num_threads());
        let done: Vec<_> = parts.par_iter().map(finish).collect();
        done.into_iter().for_each(|done| self.append(done));
    }
}

impl<const C: usize> Task<C> {
    /// Adds a term of the pixel that is not finished yet, in this step.
    fn push(&mut self, step: usize, term: Term<C>) {
        self.finished[step].terms.push(term);
        self.about.add(&term);
    }
}
