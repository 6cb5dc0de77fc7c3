//! Sums the contributions of the light paths from each pixel as the paths arrive.

use rayon::prelude::*;

use super::contributions::{About, Chunk, Chunks, Found, Key, Row, Term, Terms, class};
use super::noise::Halves;
use super::project;
use super::spread::Steps;
use crate::render::{Batch, End, Run};

const PIXELS_PER_TASK: usize = 16;

/// The sums of all paths so far, as chunks in path order.
#[derive(Debug)]
pub(super) struct Rows<'a, const C: usize> {
    samples: u32,
    split: bool,
    steps: Option<&'a Steps>,
    chunks: Vec<Chunks<C>>,
    about: About,
    /// The most recent pixel. More of its paths may follow.
    open: Option<Open<C>>,
}

struct Task<const C: usize> {
    /// For each merging step, the sums of the finished pixels.
    finished: Vec<Growing<C>>,
    about: About,
    /// Reusable memory for the connections of one pixel, and for sorting them.
    entries: Vec<Entry<C>>,
    spare: Vec<Entry<C>>,
}

#[derive(Clone, Default)]
struct Growing<const C: usize> {
    rows: Vec<Row>,
    terms: Vec<Term<C>>,
}

#[derive(Debug)]
struct Open<const C: usize> {
    start: Start,
    entries: Vec<Entry<C>>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Start {
    pixel: u32,
    /// Whether the start pixel belongs to the camera. Otherwise it belongs to a projector that stands apart.
    from_camera: bool,
    paths: u32,
}

/// One connection: its colour, the pixel at the other end of its path, and the half of the samples to which the path belongs.
#[derive(Clone, Copy, Debug)]
struct Entry<const C: usize> {
    key: Key,
    value: [f32; C],
}

impl<'a, const C: usize> Rows<'a, C> {
    pub(super) fn new(samples: u32, split: bool, steps: Option<&'a Steps>) -> Self {
        let chunks = (0..steps.map_or(1, Steps::count)).map(|_| Chunks::new()).collect();
        Self { samples, split, steps, chunks, about: About::default(), open: None }
    }

    /// Adds the connections of a batch. Sums are computed in path order, so they do not depend on the sizes of batches.
    pub(super) fn add(&mut self, batch: &Batch<'_>) {
        let of = (batch.samples(), batch.from_camera());
        self.add_by(&batch.runs().collect::<Vec<_>>(), of, batch, &project);
    }

    fn step_of(&self, start: u32, from_camera: bool, key: Key) -> usize {
        self.steps.map_or(0, |steps| steps.of(start, from_camera, key.other()))
    }

    /// Works like [`Rows::add`], for paths that are given as start pixel, half, and connections.
    #[cfg(test)]
    pub(super) fn add_paths(
        &mut self,
        paths: &[(u32, usize, Vec<crate::render::Connection>)],
        from_camera: bool,
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    ) {
        let run = |(path, &(pixel, half, _)): (usize, &_)| Run { pixel, half, paths: path..path + 1 };
        let runs: Vec<Run> = paths.iter().enumerate().map(run).collect();
        self.add_by(&runs, (self.samples, from_camera), &Given { paths, from_camera }, project);
    }

    /// Adds the connections of `paths`. `runs` lists the runs of these paths in order. `samples` paths start from each pixel.
    fn add_by(
        &mut self,
        runs: &[Run],
        (samples, from_camera): (u32, bool),
        paths: &impl Paths,
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    ) {
        let pixels: Vec<&[Run]> = runs.chunk_by(|a, b| a.pixel == b.pixel).collect();
        let Some((last, whole)) = pixels.split_last() else { return };
        let start = |runs: &[Run]| Start { pixel: runs[0].pixel, from_camera, paths: samples };
        // The open pixel is complete, unless the first run here continues it.
        let (open, closed) = match self.open.take() {
            Some(open) if open.start == start(runs) => (Some(open), None),
            other => (None, other),
        };
        let collect = |runs: &[Run], entries: &mut Vec<Entry<C>>| -> usize {
            let before = open.as_ref().filter(|open| open.start == start(runs));
            let before = before.map_or(&[][..], |open| &open.entries);
            let most =
                before.len() + runs.iter().map(|run| run.paths.len()).sum::<usize>() * paths.most_ends();
            if entries.len() < most {
                entries.resize(most, Entry { key: Key::END, value: [0.0; C] });
            }
            entries[..before.len()].copy_from_slice(before);
            let mut count = before.len();
            for run in runs {
                paths.ends_of(run, |end| {
                    let value = project(end.value);
                    let is_light = value.iter().fold(false, |any, &value| any | (value != 0.0));
                    // A connection that is not seen or has no light is also written, but the next one overwrites it. A branch would delay
                    // the load of the next record.
                    let key = Key::new(end.pixel, class(end.bounces, self.split)).of_half(run.half);
                    entries[count] = Entry { key, value };
                    count += usize::from(end.is_seen & is_light);
                });
            }
            count
        };
        let finish = |pixels: &[&[Run]]| -> (Vec<Chunk<C>>, About) {
            let mut task = Task::new(self.chunks.len());
            for runs in pixels {
                let count = collect(runs, &mut task.entries);
                self.finish(start(runs), count, &mut task);
            }
            task.chunks()
        };
        let done: Vec<_> = whole.par_chunks(PIXELS_PER_TASK).map(finish).collect();
        let mut entries = Vec::new();
        let count = collect(last, &mut entries);
        entries.truncate(count);
        let last = Open { start: start(last), entries };
        closed.into_iter().for_each(|open| self.push(open));
        done.into_iter().for_each(|done| self.append(done));
        self.open = Some(last);
    }

    /// Finishes the last pixel after the last batch. Returns the sums of all paths.
    pub(super) fn close(mut self) -> Found<C> {
        self.open.take().into_iter().for_each(|open| self.push(open));
        let steps = self.chunks.into_iter().map(Chunks::into_chunks).collect();
        Found { steps, about: self.about }
    }

    fn push(&mut self, Open { start, entries }: Open<C>) {
        let count = entries.len();
        let mut task = Task { entries, ..Task::new(self.chunks.len()) };
        self.finish(start, count, &mut task);
        self.append(task.chunks());
    }

    fn append(&mut self, (chunks, about): (Vec<Chunk<C>>, About)) {
        for (chunks, chunk) in self.chunks.iter_mut().zip(chunks) {
            // A pixel may have no contributions in some steps.
            if !chunk.rows.is_empty() {
                chunks.push(chunk);
            }
        }
        self.about = self.about.and(about);
    }

    /// Sums the contributions of a complete pixel, which are the first `count` entries of the task. For each merging step, the sums become
    /// a row of the task's chunk. Empty rows are left out.
    fn finish(&self, start: Start, count: usize, task: &mut Task<C>) {
        let Task { finished, about, entries, spare } = task;
        let halves = Halves::new(self.samples, start.paths);
        let position = |entry: &Entry<C>| entry.key.position();
        // The sort is stable, so contributions to the same position stay in path order.
        sort_by_number(&mut entries[..count], spare, |entry| position(entry).number());
        for run in entries[..count].chunk_by(|a, b| position(a) == position(b)) {
            let mut estimates = [[0.0_f64; 2]; C];
            for entry in run {
                for (estimate, value) in estimates.iter_mut().zip(entry.value) {
                    halves.add(estimate, entry.key.half(), f64::from(value));
                }
            }
            let term = Term {
                key: position(&run[0]),
                mean: estimates.map(|[mean, _]| mean as f32),
                error: estimates.map(|[_, error]| error as f32),
            };
            finished[self.step_of(start.pixel, start.from_camera, term.key)].terms.push(term);
            about.add(&term);
        }
        finished.iter_mut().for_each(|chunk| chunk.end_row(start));
    }
}

impl<const C: usize> Task<C> {
    fn new(steps: usize) -> Self {
        let finished = vec![Growing::default(); steps];
        Self { finished, about: About::default(), entries: Vec::new(), spare: Vec::new() }
    }

    fn chunks(self) -> (Vec<Chunk<C>>, About) {
        let chunk = |Growing { rows, terms }| Chunk { rows, terms: Terms::Short(terms) };
        (self.finished.into_iter().map(chunk).collect(), self.about)
    }
}

impl<const C: usize> Growing<C> {
    fn end_row(&mut self, Start { pixel, from_camera, .. }: Start) {
        let end = self.terms.len();
        if end > self.rows.last().map_or(0, |row| row.end) {
            self.rows.push(Row { pixel, from_camera, end });
        }
    }
}

trait Paths: Sync {
    fn most_ends(&self) -> usize;

    /// Calls `to` with the end of each connection of a run's paths, path by path. Ends outside the field of view are included.
    fn ends_of(&self, run: &Run, to: impl FnMut(End));
}

impl Paths for Batch<'_> {
    fn most_ends(&self) -> usize {
        self.stride()
    }

    fn ends_of(&self, run: &Run, mut to: impl FnMut(End)) {
        run.paths.clone().for_each(|path| self.ends(path).for_each(&mut to));
    }
}

#[cfg(test)]
struct Given<'a> {
    paths: &'a [(u32, usize, Vec<crate::render::Connection>)],
    from_camera: bool,
}

#[cfg(test)]
impl Paths for Given<'_> {
    fn most_ends(&self) -> usize {
        self.paths.iter().map(|path| path.2.len()).max().unwrap_or(0)
    }

    fn ends_of(&self, run: &Run, to: impl FnMut(End)) {
        let end = |connection: &crate::render::Connection| {
            let crate::render::Connection { camera, projector, bounces, value } = *connection;
            let [pixel, other] = if self.from_camera { [camera, projector] } else { [projector, camera] };
            assert_eq!(pixel, run.pixel, "the connection is one of this path");
            End { is_seen: true, pixel: other, bounces, value }
        };
        self.paths[run.paths.clone()].iter().flat_map(|path| &path.2).map(end).for_each(to);
    }
}

/// The minimum number of elements to sort by digits. Fewer elements are sorted by comparisons in less time than the counters of a digit
/// take.
const FEWEST: usize = 48;

/// The maximum number of bits of a digit. The counters of such a digit take a small part of the first-level cache, and are quickly summed.
const MOST_BITS: u32 = 8;

/// Sorts a few hundred elements by a small number, digit by digit. Elements of equal numbers keep their order. `spare` is reusable memory.
fn sort_by_number<T: Copy>(elements: &mut [T], spare: &mut Vec<T>, number: impl Fn(&T) -> u32) {
    if elements.len() < FEWEST {
        return elements.sort_by_key(number);
    }
    // Sorting needs only the bits in which the numbers differ.
    let first = number(&elements[0]);
    let differing = elements.iter().fold(0, |bits, element| bits | (number(element) ^ first));
    if differing == 0 {
        return;
    }
    let lowest = differing.trailing_zeros();
    let bits = u32::BITS - differing.leading_zeros() - lowest;
    let passes = bits.div_ceil(MOST_BITS);
    let of_digit = bits.div_ceil(passes);
    spare.clear();
    spare.extend_from_slice(elements);
    let (mut from, mut to) = (&mut *elements, spare.as_mut_slice());
    for pass in 0..passes {
        let shift = lowest + pass * of_digit;
        by_digit(from, to, |element| (number(element) >> shift) & ((1 << of_digit) - 1));
        std::mem::swap(&mut from, &mut to);
    }
    if passes % 2 == 1 {
        to.copy_from_slice(from);
    }
}

/// Copies the elements to `to`, ordered by a digit of at most [`MOST_BITS`] bits.
fn by_digit<T: Copy>(from: &[T], to: &mut [T], digit: impl Fn(&T) -> u32) {
    let digit = |element: &T| digit(element) as usize % (1 << MOST_BITS);
    let mut next = [0_u32; 1 << MOST_BITS];
    from.iter().for_each(|element| next[digit(element)] += 1);
    let mut before = 0;
    for next in &mut next {
        (*next, before) = (before, before + *next);
    }
    for element in from {
        let next = &mut next[digit(element)];
        to[*next as usize] = *element;
        *next += 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_order_is_that_of_a_stable_sort(
            numbers in prop::collection::vec(any::<u32>(), 0..300),
            bits in 0..32_u32,
            shift in 0..32_u32,
        ) {
            let number = |drawn: u32| ((drawn & ((1 << bits) - 1)) << shift) | 0x10;
            let mut elements: Vec<(u32, usize)> =
                numbers.iter().enumerate().map(|(at, &drawn)| (number(drawn), at)).collect();
            let mut expected = elements.clone();
            expected.sort_by_key(|element| element.0);
            sort_by_number(&mut elements, &mut Vec::new(), |element| element.0);
            prop_assert_eq!(elements, expected);
        }
    }
}
