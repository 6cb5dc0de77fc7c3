//! The contributions of the light paths from some pixels: from all pixels, or from those that one process traces.

use std::ops::Range;

use rayon::prelude::*;

use super::chunk::{CLASSES, Chunk, Term};
use super::noise::{Estimates, Halves};
use super::row_sums::largest_exponent;
use super::rows::Rows;
use super::spread::Steps;
use super::{LUMINANCE, project};
use crate::error::Result;
use crate::render::{Batch, MergeRequest, StartPixels, TraceSettings, TraceSummary, Tracer};

#[derive(Clone, Debug)]
pub(super) struct Share<const C: usize> {
    /// Contributions to the matrix in the order of the paths, the camera's pixels first.
    pub(super) found: Found<C>,
    /// The direct light of each camera pixel that returns to the same pixel, with its error. It is empty if the rig is not coaxial.
    pub(super) direct: Vec<Estimates<C>>,
    /// The light that the scene itself emits towards each camera pixel, with its error.
    pub(super) ambient: Vec<Estimates<C>>,
    /// Whether each endpoint has paths in both halves of the samples, so that the noise is known.
    pub(super) has_halves: bool,
    pub(super) summary: TraceSummary,
}

impl<const C: usize> Share<C> {
    /// Traces the paths from `pixels`. If `split` is set, the second bounce and all later ones stay separate. `steps` are the steps in
    /// which several processes merge the contributions.
    pub(super) fn trace(
        tracer: &mut Tracer,
        settings: &TraceSettings,
        pixels: &StartPixels,
        split: bool,
        steps: Option<&Steps>,
    ) -> Result<Self> {
        let mut rows = Rows::<C>::new(settings.samples, split, steps);
        let mut direct = PixelSums::<C>::new(&pixels.camera, settings.samples);
        let mut ambient = PixelSums::<C>::new(&pixels.camera, settings.samples);
        let mut has_halves = true;
        let weights = |from_each_pixel| Halves::new(settings.samples, from_each_pixel).weights();
        let request = MergeRequest {
            channels: C,
            luminance: LUMINANCE.map(|share| share as f32),
            split,
            weights: &weights,
        };
        let summary = tracer.trace_merged(settings, pixels, Some(&request), &mut |batch| {
            has_halves &= batch.samples() > 1;
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
            Ok(())
        })?;
        let found = rows.close();
        // Combining needs the most memory of all steps.
        tracer.release_buffers();
        let direct = if tracer.symmetric(settings) { direct.estimates } else { Vec::new() };
        let ambient = ambient.estimates;
        Ok(Self { found, direct, ambient, has_halves, summary })
    }

    /// Joins the shares of all parts, which must be in the order of their pixels. The time of tracing is that of the slowest part.
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

#[derive(Clone, Debug)]
pub(super) struct Found<const C: usize> {
    /// Chunks in the order of the paths. There is one list of all chunks, or one for each step if several processes merge them.
    pub(super) steps: Vec<Vec<Chunk<C>>>,
    pub(super) about: About,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct About {
    /// The largest exponent of their values and errors. It determines the unit of their sums.
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

/// Means and errors (`e` of [`super::Noise`]) per camera pixel and channel, summed in path order for batches of any size.
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

    /// Adds `sample(path)` for each path of the batch, which starts from one of the pixels. Zeros are skipped.
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
