//! What the light paths from some pixels contribute to the matrix: the part of a process that traces only these, or everything.

use super::LUMINANCE;
use super::found::Found;
use super::noise::Halves;
use super::pixel_sums::PixelSums;
use super::rows::Rows;
use super::steps::Steps;
use crate::error::Result;
use crate::render::{MergeRequest, StartPixels, TraceSettings, TraceSummary, Tracer};

/// The contributions of the paths from some pixels, summed pixel by pixel.
pub(super) struct Share<const C: usize> {
    /// Contributions to the matrix, in the order of the paths: those of the camera's pixels come first.
    pub(super) found: Found<C>,
    /// Direct light of each of the camera's pixels, which returns to its own pixel, with its error; empty where the rig is not coaxial.
    pub(super) direct: Vec<[[f64; 2]; C]>,
    /// Light that the scene emits towards each of the camera's pixels, with its error.
    pub(super) ambient: Vec<[[f64; 2]; C]>,
    /// Whether each endpoint has paths in both halves of the samples, so that the noise is known.
    pub(super) has_halves: bool,
    /// The cost of tracing.
    pub(super) summary: TraceSummary,
}

impl<const C: usize> Share<C> {
    /// Traces the paths from `pixels`. `project` computes the channels from RGB. If `split` is set, the second bounce and all later ones stay
    /// apart. `steps` are those in which several processes merge the contributions.
    ///
    /// # Errors
    /// As [`Tracer::trace`].
    pub(super) fn trace(
        tracer: &mut Tracer,
        settings: &TraceSettings,
        pixels: &StartPixels,
        (split, steps): (bool, Option<&Steps>),
        project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
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
            rayon::join(|| rows.add(batch, project), of_pixels);
            Ok(())
        })?;
        let found = rows.close();
        // Combining needs the most memory of all steps.
        tracer.release_buffers();
        let direct = if tracer.symmetric(settings) { direct.estimates } else { Vec::new() };
        let ambient = ambient.estimates;
        Ok(Self { found, direct, ambient, has_halves, summary })
    }
}
