//! The contributions of light paths to the matrix. Each start pixel has a row of contributions, consecutive rows form a `Chunk`, and a
//! `Share` holds all contributions that one process traced.

use std::ops::{Deref, Range};

use rayon::prelude::*;

use super::noise::{Estimates, Halves};
use super::row_sums::largest_exponent;
use super::rows::Rows;
use super::spread::Steps;
use super::tiles::{Pages, take};
use super::{RigShape, project};
use crate::error::Result;
use crate::render::{Batch, StartPixels, TraceSettings, TraceSummary, Tracer};

/// The maximum number of classes of bounces. The classes are either one, two, and at least three bounces; or one, and at least two bounces.
pub(super) const CLASSES: usize = 3;

/// The position of a contribution within a row: the pixel at the other end of the path, and (in the lowest bits) its class of bounces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub(super) struct Key(u32);

impl Key {
    const CLASS_BITS: u32 = 2;
    /// Marks a single contribution of the second half of the samples, before contributions are summed.
    const HALF: u32 = 1 << 31;

    /// A key that is larger than every valid key.
    pub(super) const END: Self = Self(u32::MAX);

    pub(super) fn new(other: u32, class: u32) -> Self {
        debug_assert!(other < 1 << 28 && class < 1 << Self::CLASS_BITS);
        Self(other << Self::CLASS_BITS | class)
    }

    /// The key of a single contribution of this half of the samples.
    pub(super) fn of_half(self, half: usize) -> Self {
        Self(self.0 | (half as u32 * Self::HALF))
    }

    pub(super) fn number(self) -> u32 {
        self.0
    }

    pub(super) fn half(self) -> usize {
        usize::from(self.0 & Self::HALF != 0)
    }

    /// The common key of all contributions of the same pixel and class.
    pub(super) fn position(self) -> Self {
        Self(self.0 & !Self::HALF)
    }

    pub(super) fn other(self) -> u32 {
        self.0 >> Self::CLASS_BITS
    }

    pub(super) fn class(self) -> usize {
        (self.0 & ((1 << Self::CLASS_BITS) - 1)) as usize
    }
}

/// The class of a connection: 0 for one bounce, 1 for more. If `split` is set, 1 means two bounces, and 2 means more.
pub(super) fn class(bounces: u32, split: bool) -> u32 {
    match bounces {
        1 => 0,
        2 => 1,
        _ if split => 2,
        _ => 1,
    }
}

/// The contributions of the paths from one pixel. A camera pixel is a row of the matrix, and a projector pixel is a column.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    pub(super) pixel: u32,
    pub(super) from_camera: bool,
    pub(super) end: usize,
}

/// The rows of finished pixels, in ascending order of pixels. The terms of each row ascend by key.
#[derive(Clone, Debug)]
pub(super) struct Chunk<const C: usize> {
    pub(super) rows: Vec<Row>,
    pub(super) terms: Terms<C>,
}

#[derive(Clone, Debug)]
pub(super) enum Terms<const C: usize> {
    Short(Vec<Term<C>>),
    /// Terms on separate memory pages. The system gets these pages back when the chunk is freed.
    Long(Pages<Term<C>>),
}

impl<const C: usize> Default for Terms<C> {
    fn default() -> Self {
        Self::Short(Vec::new())
    }
}

impl<const C: usize> Deref for Terms<C> {
    type Target = [Term<C>];

    fn deref(&self) -> &[Term<C>] {
        match self {
            Self::Short(terms) => terms,
            Self::Long(terms) => terms,
        }
    }
}

/// The sum of the contributions to one position of a row.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Term<const C: usize> {
    pub(super) key: Key,
    pub(super) mean: [f32; C],
    /// The error of the sum (`e` of [`super::Noise`]).
    pub(super) error: [f32; C],
}

// SAFETY: a term is an array of numbers of four bytes, so it has no padding, and all bit patterns are valid, including zeros.
#[allow(unsafe_code, reason = "bytemuck does not derive it for a number of channels")]
unsafe impl<const C: usize> bytemuck::Zeroable for Term<C> {}

// SAFETY: as above.
#[allow(unsafe_code, reason = "bytemuck does not derive it for a number of channels")]
unsafe impl<const C: usize> bytemuck::Pod for Term<C> {}

const _: () = assert!(size_of::<Term<1>>() == 12 && size_of::<Term<3>>() == 28);

impl<const C: usize> Term<C> {
    pub(super) fn none(key: Key) -> Self {
        Self { key, mean: [0.0; C], error: [0.0; C] }
    }
}

/// The terms of a row for paths whose other end is in `pixels`. The terms must ascend by key.
pub(super) fn at<'a, const C: usize>(terms: &'a [Term<C>], pixels: &Range<usize>) -> &'a [Term<C>] {
    &terms[places(terms, pixels)]
}

/// The index range of a row's terms for paths whose other end is in `pixels`. The terms must ascend by key.
pub(super) fn places<const C: usize>(terms: &[Term<C>], pixels: &Range<usize>) -> Range<usize> {
    let place = |pixel: usize| terms.partition_point(|term| (term.key.other() as usize) < pixel);
    place(pixels.start)..place(pixels.end)
}

/// Chunks whose terms have at least this size in bytes are long.
const LONG: usize = 4 << 20;

/// Chunks in path order. Short chunks are joined into long chunks, whose memory the system gets back when they are freed.
#[derive(Debug)]
pub(super) struct Chunks<const C: usize> {
    long: Vec<Chunk<C>>,
    short: Vec<Chunk<C>>,
    /// The size in bytes of the terms of the short chunks.
    bytes: usize,
}

impl<const C: usize> Chunks<C> {
    pub(super) fn new() -> Self {
        Self { long: Vec::new(), short: Vec::new(), bytes: 0 }
    }

    pub(super) fn push(&mut self, chunk: Chunk<C>) {
        self.bytes += size_of_val(&chunk.terms[..]);
        self.short.push(chunk);
        if self.bytes >= LONG {
            self.join();
        }
    }

    fn join(&mut self) {
        self.long.push(Chunk::joined(std::mem::take(&mut self.short)));
        self.bytes = 0;
    }

    pub(super) fn into_chunks(mut self) -> Vec<Chunk<C>> {
        if !self.short.is_empty() {
            self.join();
        }
        self.long
    }
}

impl<const C: usize> Chunk<C> {
    fn joined(chunks: Vec<Self>) -> Self {
        let mut terms = Pages::zeros(chunks.iter().map(|chunk| chunk.terms.len()).sum());
        let (mut rows, mut before) = (Vec::new(), 0);
        let (mut left, mut to) = (&mut terms[..], Vec::new());
        for chunk in &chunks {
            rows.extend(chunk.rows.iter().map(|row| Row { end: before + row.end, ..*row }));
            before += chunk.terms.len();
            to.push(take(&mut left, chunk.terms.len()));
        }
        chunks.into_par_iter().zip(to).for_each(|(chunk, to)| to.copy_from_slice(&chunk.terms));
        Self { rows, terms: Terms::Long(terms) }
    }

    pub(super) fn start(&self, row: usize) -> usize {
        row.checked_sub(1).map_or(0, |before| self.rows[before].end)
    }

    pub(super) fn row(&self, row: usize) -> &[Term<C>] {
        &self.terms[self.start(row)..self.rows[row].end]
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = (Row, &[Term<C>])> {
        let starts = std::iter::once(0).chain(self.rows.iter().map(|row| row.end));
        self.rows.iter().zip(starts).map(|(&row, start)| (row, &self.terms[start..row.end]))
    }

    /// Whether the rows belong to different pixels of `pixels`, in ascending order. The keys of each row must ascend. The class of each key
    /// must be below `classes`, and the pixel at the other end must be below `others`.
    pub(super) fn is_of(&self, pixels: &Range<usize>, others: usize, classes: usize) -> bool {
        let is_row = |(row, terms): (Row, &[Term<C>])| {
            pixels.contains(&(row.pixel as usize))
                && terms.is_sorted_by(|a, b| a.key < b.key)
                && terms.last().is_some_and(|last| (last.key.other() as usize) < others)
                && terms.iter().all(|term| term.key.class() < classes)
        };
        self.rows.is_sorted_by(|a, b| a.pixel < b.pixel) && self.rows().all(is_row)
    }

    /// All contributions. Each is given as its start pixel, whether this pixel belongs to the camera, its key, and the bits of its values.
    pub(super) fn contributions(&self) -> impl Iterator<Item = (u32, bool, Key, [[u32; C]; 2])> + '_ {
        self.rows().flat_map(|(row, terms)| {
            terms.iter().map(move |term| {
                let bits = [term.mean, term.error].map(|values| values.map(f32::to_bits));
                (row.pixel, row.from_camera, term.key, bits)
            })
        })
    }
}

/// The contributions of the light paths from some pixels: from all pixels, or only from the pixels of one process.
#[derive(Clone, Debug)]
pub(super) struct Share<const C: usize> {
    /// The contributions to the matrix, in the order of the paths. Paths from camera pixels come first.
    pub(super) found: Found<C>,
    /// For each camera pixel, the direct light that returns to the same pixel, with its error. It is empty if the rig is not coaxial.
    pub(super) direct: Vec<Estimates<C>>,
    /// The light that the scene itself emits towards each camera pixel, with its error.
    pub(super) ambient: Vec<Estimates<C>>,
    /// Whether each endpoint (camera, projector) has paths in both halves of the samples. Only then can the noise be estimated.
    pub(super) has_halves: bool,
    pub(super) summary: TraceSummary,
}

impl<const C: usize> Share<C> {
    /// Traces the paths from `pixels`. If `split` is set, light of two bounces and light of more bounces are separate classes. If several
    /// processes merge the contributions, `steps` are their merging steps.
    pub(super) fn trace(
        tracer: &mut Tracer,
        settings: &TraceSettings,
        pixels: &StartPixels,
        split: bool,
        steps: Option<&Steps>,
    ) -> Result<Self> {
        let mut growing = GrowingShare::new(settings.samples, &pixels.camera, split, steps);
        let summary = tracer.trace_from(settings, pixels, &mut |batch| {
            growing.add(batch);
            Ok(())
        })?;
        // The contributions are merged next, which needs the most memory.
        tracer.release_buffers();
        Ok(growing.close(tracer.symmetric(settings), summary))
    }

    /// The contributions of batches with all paths of a rig.
    pub(super) fn of_batches(batches: &[Batch<'_>], rig: RigShape, (samples, split): (u32, bool)) -> Self {
        let mut growing = GrowingShare::new(samples, &(0..rig.camera.pixels()), split, None);
        batches.iter().for_each(|batch| growing.add(batch));
        growing.close(rig.symmetric, TraceSummary::default())
    }

    /// Joins the shares of all parts, which must be in the order of their pixels. The tracing time is that of the slowest part.
    pub(super) fn joined(parts: Vec<Self>) -> Self {
        let (mut chunks, mut direct, mut ambient) = (Vec::new(), Vec::new(), Vec::new());
        let (mut has_halves, mut summary) = (true, TraceSummary::default());
        for part in parts {
            chunks.extend(part.found.into_chunks());
            direct.extend(part.direct);
            ambient.extend(part.ambient);
            has_halves &= part.has_halves;
            summary.add_parallel(&part.summary);
        }
        Self { found: Found::of_chunks(chunks), direct, ambient, has_halves, summary }
    }
}

/// A share while its paths arrive.
struct GrowingShare<'a, const C: usize> {
    rows: Rows<'a, C>,
    direct: PixelSums<C>,
    ambient: PixelSums<C>,
    has_halves: bool,
}

impl<'a, const C: usize> GrowingShare<'a, C> {
    fn new(samples: u32, camera: &Range<usize>, split: bool, steps: Option<&'a Steps>) -> Self {
        let [direct, ambient] = [(); 2].map(|()| PixelSums::new(camera, samples));
        Self { rows: Rows::new(samples, split, steps), direct, ambient, has_halves: true }
    }

    fn add(&mut self, batch: &Batch<'_>) {
        let Self { rows, direct, ambient, has_halves } = self;
        *has_halves &= batch.samples() > 1;
        let of_pixels = || {
            // Paths from the projector carry neither direct light nor ambient light.
            if !batch.from_camera() {
                return;
            }
            direct.add(batch, |path| project(batch.direct(path)));
            if batch.has_ambient() {
                ambient.add(batch, |path| batch.ambient(path).map_or([0.0; C], project));
            }
        };
        rayon::join(|| rows.add(batch), of_pixels);
    }

    fn close(self, symmetric: bool, summary: TraceSummary) -> Share<C> {
        let direct = if symmetric { self.direct.estimates } else { Vec::new() };
        let (ambient, has_halves) = (self.ambient.estimates, self.has_halves);
        Share { found: self.rows.close(), direct, ambient, has_halves, summary }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Found<const C: usize> {
    /// Chunks in the order of the paths. There is one list of all chunks, or one list for each merging step if several processes merge
    /// them.
    pub(super) steps: Vec<Vec<Chunk<C>>>,
    pub(super) about: About,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct About {
    /// The largest exponent of the values and errors of all terms. It determines the unit of the exact sums over rows.
    pub(super) largest: u32,
    pub(super) of_class: [usize; CLASSES],
}

impl About {
    pub(super) fn add<const C: usize>(&mut self, term: &Term<C>) {
        self.largest = self.largest.max(largest_exponent(term));
        self.of_class[term.key.class()] += 1;
    }

    pub(super) fn and(mut self, more: Self) -> Self {
        self.largest = self.largest.max(more.largest);
        self.of_class.iter_mut().zip(more.of_class).for_each(|(all, more)| *all += more);
        self
    }
}

impl<const C: usize> Found<C> {
    pub(super) fn of_chunks(chunks: Vec<Chunk<C>>) -> Self {
        let about = |chunk: &Chunk<C>| {
            let mut about = About::default();
            chunk.terms.iter().for_each(|term| about.add(term));
            about
        };
        let about = chunks.par_iter().map(about).reduce(About::default, About::and);
        Self { steps: vec![chunks], about }
    }

    pub(super) fn chunks(&self) -> impl Iterator<Item = &Chunk<C>> {
        self.steps.iter().flatten()
    }

    pub(super) fn into_chunks(self) -> Vec<Chunk<C>> {
        self.steps.into_iter().flatten().collect()
    }
}

/// Means and errors (`e` of [`super::Noise`]) per camera pixel and channel. Samples are added in path order, whatever the sizes of the
/// batches.
struct PixelSums<const C: usize> {
    halves: Halves,
    first: usize,
    estimates: Vec<Estimates<C>>,
}

impl<const C: usize> PixelSums<C> {
    fn new(pixels: &Range<usize>, samples: u32) -> Self {
        let estimates = vec![[[0.0; 2]; C]; pixels.len()];
        Self { halves: Halves::new(samples, samples), first: pixels.start, estimates }
    }

    /// Adds `sample(path)` for each path of the batch. All paths must start at pixels of these sums. Zeros are skipped.
    fn add(&mut self, batch: &Batch<'_>, sample: impl Fn(usize) -> [f32; C]) {
        for run in batch.runs() {
            let estimates = &mut self.estimates[run.pixel as usize - self.first];
            for path in run.paths {
                let value = sample(path);
                if value.iter().all(|&value| value == 0.0) {
                    continue;
                }
                for (estimate, value) in estimates.iter_mut().zip(value) {
                    self.halves.add(estimate, run.half, f64::from(value));
                }
            }
        }
    }
}
