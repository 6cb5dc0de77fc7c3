//! The contributions of the light paths from each pixel, summed pixel by pixel as the paths arrive.

use rayon::prelude::*;

use super::chunk::{Chunk, Chunks, Key, Row, Term};
use super::found::{About, Found};
use super::noise::Halves;
use super::steps::Steps;
use crate::error::{Error, Result};
use crate::render::{Batch, Connection, Run};

/// Number of pixels whose contributions one task sums.
const PIXELS_PER_TASK: usize = 16;

/// The class of a connection: 0 for one bounce, 1 for more. If `split` is set, 1 is the second bounce only,
/// and 2 are all later ones.
pub(super) fn class(bounces: u32, split: bool) -> u32 {
    match bounces {
        1 => 0,
        2 => 1,
        _ if split => 2,
        _ => 1,
    }
}

/// The sums of all paths so far, as chunks in the order of the paths.
#[derive(Debug)]
pub(super) struct Rows<'a, const C: usize> {
    /// Divisor of all sums.
    samples: u32,
    split: bool,
    /// The steps in which several processes merge the contributions.
    steps: Option<&'a Steps>,
    /// For each step.
    chunks: Vec<Chunks<C>>,
    about: About,
    /// The last pixel, whose paths may not be complete yet.
    open: Option<Open<C>>,
}

/// Finished pixels: a chunk for each step.
struct Finished<const C: usize> {
    chunks: Vec<Chunk<C>>,
    about: About,
}

/// A pixel whose contributions are not summed yet.
#[derive(Debug)]
struct Open<const C: usize> {
    pixel: u32,
    /// Number of paths that start from it.
    paths: u32,
    /// Whether it is a pixel of the camera, where that is known before its entries.
    from_camera: Option<bool>,
    entries: Vec<Entry<C>>,
}

/// One connection. `from_camera` says whether its path started from the camera or from the projector. It is
/// `None` where both pixels have the same number, so that the entry does not show it.
#[derive(Clone, Copy, Debug)]
struct Entry<const C: usize> {
    key: Key,
    from_camera: Option<bool>,
    value: [f32; C],
}

impl<'a, const C: usize> Rows<'a, C> {
    pub(super) fn new(samples: u32, split: bool, steps: Option<&'a Steps>) -> Self {
        let chunks = (0..steps.map_or(1, Steps::count)).map(|_| Chunks::new()).collect();
        Self { samples, split, steps, chunks, about: About::default(), open: None }
    }

    /// No pixels yet.
    fn nothing(&self) -> Finished<C> {
        Finished { chunks: vec![Chunk::new(); self.chunks.len()], about: About::default() }
    }

    /// Adds the connections of a batch. Sums are computed in path order, so that they do not depend on the
    /// sizes of batches.
    pub(super) fn add(
        &mut self,
        batch: &Batch<'_>,
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    ) -> Result<()> {
        let from_camera = Some(batch.from_camera());
        self.add_by(&batch.runs().collect::<Vec<_>>(), (batch.samples(), from_camera), batch, project)
    }

    /// As [`Rows::add`], for paths given as start pixel, half, and connections.
    #[cfg(test)]
    pub(super) fn add_paths(
        &mut self,
        paths: &[(u32, usize, Vec<Connection>)],
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    ) -> Result<()> {
        let run = |(path, &(pixel, half, _)): (usize, &_)| Run { pixel, half, paths: path..path + 1 };
        let runs: Vec<Run> = paths.iter().enumerate().map(run).collect();
        self.add_by(&runs, (self.samples, None), paths, project)
    }

    /// Adds the connections of `paths`. `runs` are all these paths in order; `samples` paths start from each
    /// pixel, of the camera or of the projector where that is known.
    fn add_by(
        &mut self,
        runs: &[Run],
        (samples, from_camera): (u32, Option<bool>),
        paths: &(impl Paths + ?Sized),
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    ) -> Result<()> {
        let pixels: Vec<&[Run]> = runs.chunk_by(|a, b| a.pixel == b.pixel).collect();
        let Some((last, whole)) = pixels.split_last() else { return Ok(()) };
        let goes_on = (runs[0].pixel, samples, from_camera);
        let (open, closed) = match self.open.take() {
            Some(open) if (open.pixel, open.paths, open.from_camera) == goes_on => (Some(open), None),
            other => (None, other),
        };
        let collect = |runs: &[Run], entries: &mut Vec<Entry<C>>| -> Result<()> {
            let pixel = runs[0].pixel;
            if let Some(open) = open.as_ref().filter(|open| open.pixel == pixel) {
                entries.extend(&open.entries);
            }
            for run in runs {
                paths.connections(run, |connection| {
                    let value = project(connection.value);
                    if value.iter().any(|&value| value != 0.0) {
                        entries.push(self.entry(pixel, run.half, &connection, value)?);
                    }
                    Ok(())
                })?;
            }
            Ok(())
        };
        let finish = |pixels: &[&[Run]]| -> Result<Finished<C>> {
            let (mut finished, mut entries) = (self.nothing(), Vec::new());
            for runs in pixels {
                entries.clear();
                collect(runs, &mut entries)?;
                self.finish((runs[0].pixel, samples, from_camera), &mut entries, &mut finished)?;
            }
            finished.chunks.iter_mut().for_each(Chunk::close);
            Ok(finished)
        };
        let done: Vec<Result<Finished<C>>> = whole.par_chunks(PIXELS_PER_TASK).map(finish).collect();
        let mut entries = Vec::new();
        collect(last, &mut entries)?;
        let last = Open { pixel: last[0].pixel, paths: samples, from_camera, entries };
        closed.into_iter().try_for_each(|open| self.push(open))?;
        for finished in done {
            self.append(finished?);
        }
        self.open = Some(last);
        Ok(())
    }

    /// Finishes the last pixel, after the last batch. Returns the sums of all paths.
    pub(super) fn close(mut self) -> Result<Found<C>> {
        self.open.take().into_iter().try_for_each(|open| self.push(open))?;
        let steps = self.chunks.into_iter().map(Chunks::into_chunks).collect();
        Ok(Found { steps, about: self.about })
    }

    /// Adds one complete pixel.
    fn push(&mut self, Open { pixel, paths, from_camera, mut entries }: Open<C>) -> Result<()> {
        let mut finished = self.nothing();
        self.finish((pixel, paths, from_camera), &mut entries, &mut finished)?;
        finished.chunks.iter_mut().for_each(Chunk::close);
        self.append(finished);
        Ok(())
    }

    fn append(&mut self, finished: Finished<C>) {
        for (chunks, chunk) in self.chunks.iter_mut().zip(finished.chunks) {
            // A pixel has contributions in some of the steps.
            if !chunk.rows.is_empty() {
                chunks.push(chunk);
            }
        }
        self.about = self.about.and(finished.about);
    }

    /// The entry of a connection of a path from `pixel`.
    fn entry(&self, pixel: u32, half: usize, connection: &Connection, value: [f32; C]) -> Result<Entry<C>> {
        let Connection { camera, projector, bounces, .. } = *connection;
        let (other, from_camera) = match (camera == pixel, projector == pixel) {
            (true, true) => (pixel, None),
            (true, false) => (projector, Some(true)),
            (false, true) => (camera, Some(false)),
            (false, false) => return Err(stray(pixel)),
        };
        let key = Key::new(other, class(bounces, self.split)).of_half(half);
        Ok(Entry { key, from_camera, value })
    }

    /// Sums the contributions of a complete pixel, from which so many paths start, and adds them to the chunk of each step as a row. It is a pixel of the
    /// camera or of the projector, where that is known. A row without entries is left out.
    fn finish(
        &self,
        (pixel, paths, from_camera): (u32, u32, Option<bool>),
        entries: &mut [Entry<C>],
        Finished { chunks, about }: &mut Finished<C>,
    ) -> Result<()> {
        if entries.is_empty() {
            return Ok(());
        }
        let halves = Halves::new(self.samples, paths);
        let from_camera =
            from_camera.or_else(|| entries.iter().find_map(|entry| entry.from_camera)).unwrap_or(true);
        if entries.iter().any(|entry| entry.from_camera.is_some_and(|camera| camera != from_camera)) {
            return Err(stray(pixel));
        }
        let position = |entry: &Entry<C>| entry.key.position();
        // The sort is stable: contributions to one position stay in path order.
        entries.sort_by_key(position);
        for run in entries.chunk_by(|a, b| position(a) == position(b)) {
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
            let step = self.steps.map_or(0, |steps| steps.of(pixel, from_camera, term.key.other()));
            chunks[step].terms.push(term);
            about.add(&term);
        }
        for chunk in chunks {
            let end = chunk.terms.len();
            if end > chunk.rows.last().map_or(0, |row| row.end) {
                chunk.rows.push(Row { pixel, from_camera, end });
            }
        }
        Ok(())
    }
}

/// The error for a connection that does not belong to its path's pixel.
fn stray(pixel: u32) -> Error {
    Error::Numerical(format!(
        "a light path from pixel {pixel} ends at neither pixel that it belongs to: this is a fault in krylux"
    ))
}

/// A source of paths' connections.
trait Paths: Sync {
    /// Calls `to` with each connection of a run's paths, path by path, until it fails.
    fn connections(&self, run: &Run, to: impl FnMut(Connection) -> Result<()>) -> Result<()>;
}

impl Paths for Batch<'_> {
    fn connections(&self, run: &Run, mut to: impl FnMut(Connection) -> Result<()>) -> Result<()> {
        run.paths.clone().try_for_each(|path| self.connections_from(run.pixel, path).try_for_each(&mut to))
    }
}

#[cfg(test)]
impl Paths for [(u32, usize, Vec<Connection>)] {
    fn connections(&self, run: &Run, mut to: impl FnMut(Connection) -> Result<()>) -> Result<()> {
        self[run.paths.clone()].iter().flat_map(|path| &path.2).try_for_each(|connection| to(*connection))
    }
}
