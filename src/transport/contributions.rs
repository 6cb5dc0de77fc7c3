//! Contributions of a batch's paths to a photo. All cores read them in parallel; one core adds them up in
//! path order.

use rayon::prelude::*;

use super::matrix::{Direction, Part};
use super::noise::Halves;
use crate::render::{Batch, PIXEL_MASK, Run};

/// Which part of the transport is applied, in which direction.
#[derive(Clone, Copy)]
pub(super) struct Way {
    pub(super) direction: Direction,
    pub(super) part: Part,
    pub(super) with_ambient: bool,
}

/// A running mean over samples, with or without its error.
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
    /// The paths start at the pixels that receive light; else at the pixels that send it.
    from_seeing: bool,
    parts: Vec<Read<C>>,
}

/// Number of runs that one task reads.
const RUNS: usize = 16;

/// Kinds of contributions, as bits above those of the other pixel: direct light, ambient light; without
/// either, a connection.
const DIRECT: u32 = 1 << 30;
const AMBIENT: u32 = 1 << 31;

impl<const C: usize> Contributions<C> {
    /// Reads the records of a batch. Sums will be divided by `samples`; `project` computes the channels from
    /// RGB.
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

    /// `seen += P lit`, channel by channel, for the contributions to `P` of this batch.
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
                        // The reverse of the path, which has the same weight.
                        add(end, value, &lit[start]);
                    }
                    _ if self.from_seeing => add(start, value, &lit[end]),
                    _ => add(end, value, &lit[start]),
                }
            }
        }
    }
}

impl Contributions<1> {
    /// The weights of both halves of the samples.
    pub(super) fn halves(&self) -> Halves {
        self.halves
    }

    /// Each contribution of these forward paths, without ambient light, as an entry of the matrix: the run of its path, row and column, and the value.
    pub(super) fn entries(&self, mut entry: impl FnMut(&Run, [usize; 2], f64)) {
        for (run, found) in self.parts.iter().flat_map(Read::runs) {
            let start = run.pixel as usize;
            for (other, [value]) in found {
                let (end, value) = ((other & PIXEL_MASK) as usize, f64::from(*value));
                match other & !PIXEL_MASK {
                    DIRECT => entry(run, [start, start], value),
                    AMBIENT => {}
                    _ if self.symmetric => {
                        entry(run, [start, end], value);
                        entry(run, [end, start], value);
                    }
                    _ if self.from_seeing => entry(run, [start, end], value),
                    _ => entry(run, [end, start], value),
                }
            }
        }
    }
}

/// The contributions of some runs' paths without zeros: kind and other pixel, and value.
struct Read<const C: usize> {
    /// Each run, with the end of its contributions.
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
            // A contribution that does not count is written as well, and then overwritten. This avoids a
            // branch, so that the processor does not wait for one record before it loads the next.
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
