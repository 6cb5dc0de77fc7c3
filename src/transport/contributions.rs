//! What the paths of a batch contribute to a photo: read by all cores at once, and added up by one.

use rayon::prelude::*;

use super::matrix::{Direction, Part};
use super::noise::Halves;
use crate::render::{Batch, PIXEL_MASK, Run};

/// What light goes which way.
#[derive(Clone, Copy)]
pub(super) struct Way {
    pub(super) direction: Direction,
    pub(super) part: Part,
    pub(super) with_ambient: bool,
}

/// Sums over samples: a mean, with its error or without.
pub(super) trait Tally: Copy + Default + Send {
    /// Adds a sample.
    fn add(&mut self, halves: Halves, half: usize, value: f64);
}

impl Tally for f64 {
    fn add(&mut self, halves: Halves, _half: usize, value: f64) {
        *self += halves.share(value);
    }
}

impl Tally for [f64; 2] {
    fn add(&mut self, halves: Halves, half: usize, value: f64) {
        halves.add(self, half, value);
    }
}

/// A batch's contributions in `C` channels, in path order.
pub(super) struct Contributions<const C: usize> {
    halves: Halves,
    symmetric: bool,
    /// The paths begin at the pixels that see the light, and not at those that send it.
    from_seeing: bool,
    parts: Vec<Read<C>>,
}

/// Runs that one task reads.
const RUNS: usize = 16;

/// What a contribution is, above its other pixel: direct, ambient, or else a connection.
const DIRECT: u32 = 1 << 30;
const AMBIENT: u32 = 1 << 31;

impl<const C: usize> Contributions<C> {
    /// Reads a batch's records. Sums are to be divided by `samples`; `project` makes channels of colours.
    pub(super) fn read(
        batch: &Batch<'_>,
        samples: u32,
        way: Way,
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    ) -> Self {
        let runs: Vec<Run> = batch.runs().collect();
        Self {
            halves: Halves::new(samples, batch.samples()),
            symmetric: batch.symmetric(),
            from_seeing: batch.from_camera() == (way.direction == Direction::Forward),
            parts: runs.par_chunks(RUNS).map(|runs| Read::new(batch, runs, way, project)).collect(),
        }
    }

    /// `seen += P lit`, channel by channel, for what of `P` is here.
    pub(super) fn add_to<T: Tally>(&self, seen: &mut [[T; C]], lit: &[[f64; C]]) {
        for (run, found) in self.parts.iter().flat_map(Read::runs) {
            let start = run.pixel as usize;
            let mut add = |to: usize, value: &[f32; C], light: &[f64; C]| {
                for ((seen, &value), light) in seen[to].iter_mut().zip(value).zip(light) {
                    seen.add(self.halves, run.half, f64::from(value) * light);
                }
            };
            for (other, value) in found {
                let end = (other & PIXEL_MASK) as usize;
                match other & !PIXEL_MASK {
                    DIRECT => add(start, value, &lit[start]),
                    AMBIENT => add(start, value, &[1.0; C]),
                    _ if self.symmetric => {
                        add(start, value, &lit[end]);
                        // The path's reverse, as in the matrix.
                        add(end, value, &lit[start]);
                    }
                    _ if self.from_seeing => add(start, value, &lit[end]),
                    _ => add(end, value, &lit[start]),
                }
            }
        }
    }
}

/// What some runs' paths contribute, zeros left out: the pixel at the other end, and how much.
struct Read<const C: usize> {
    /// Each with the end of its contributions.
    runs: Vec<(Run, usize)>,
    found: Vec<(u32, [f32; C])>,
}

impl<const C: usize> Read<C> {
    fn new(
        batch: &Batch<'_>,
        runs: &[Run],
        Way { part, with_ambient, .. }: Way,
        project: &impl Fn([f32; 3]) -> [f32; C],
    ) -> Self {
        let (has_direct, has_ambient) = (part.holds(1), with_ambient && batch.has_ambient());
        let mut found = Vec::new();
        let mut end = 0;
        let mut ends = Vec::with_capacity(runs.len());
        for run in runs {
            // No path has more contributions than slots.
            found.resize(end + run.paths.len() * batch.stride(), (0, [0.0; C]));
            // What does not count is written, too, and then written over: a processor that need not know whether to go that
            // way does not wait for one record before it asks for the next.
            let mut keep = |counts: bool, other: u32, color: [f32; 3]| {
                let value = project(color);
                found[end] = (other, value);
                let is_light = value.iter().fold(false, |any, &value| any | (value != 0.0));
                end += usize::from(counts & is_light);
            };
            for path in run.paths.clone() {
                if has_direct {
                    keep(true, DIRECT, batch.direct(path));
                }
                if has_ambient {
                    keep(true, AMBIENT, batch.ambient(path).unwrap_or_default());
                }
                batch
                    .ends(path)
                    .for_each(|end| keep(end.is_seen & part.holds(end.bounces), end.pixel, end.value));
            }
            ends.push((run.clone(), end));
        }
        found.truncate(end);
        Self { runs: ends, found }
    }

    /// Each run with its contributions.
    fn runs(&self) -> impl Iterator<Item = (&Run, &[(u32, [f32; C])])> {
        let starts = std::iter::once(0).chain(self.runs.iter().map(|(_, end)| *end));
        self.runs.iter().zip(starts).map(|((run, end), start)| (run, &self.found[start..*end]))
    }
}
