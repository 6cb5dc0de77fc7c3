//! The light transport matrix of a scene: its light paths are traced, summed pixel by pixel, and combined
//! into rows.

use super::combine::{Combined, combine};
use super::layer::{Bounces, Layer};
use super::noise::{Noise, relative};
use super::pixel_sums::PixelSums;
use super::rows::Rows;
use super::{Channels, GpuMatrix, RigShape, TransportMatrix, from_planes, luminance};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::render::{TraceSettings, TraceSummary, Tracer};

/// A traced scene.
#[derive(Debug)]
pub struct Assembled {
    /// The light transport matrix.
    pub matrix: TransportMatrix,
    /// The photo without projector light, in W/(m² sr): light that the scene itself emits.
    pub ambient: Image,
    /// The noise of the matrix; `None` where an endpoint has only one path per pixel, from which noise cannot
    /// be estimated.
    pub noise: Option<Noise>,
    /// The cost of tracing.
    pub summary: TraceSummary,
    /// The matrix in the memory of a GPU, if products are computed there; see [`Assembled::place`].
    pub(crate) gpu_matrix: Option<GpuMatrix>,
}

/// Traces the scene and assembles its light transport matrix. Equal settings on equal devices give equal
/// bits. The tracer's observer sees the steps.
///
/// # Errors
/// As [`Tracer::trace`].
pub fn assemble(tracer: &mut Tracer, settings: &TraceSettings, channels: Channels) -> Result<Assembled> {
    assemble_layers(tracer, settings, channels, false)
}

/// As [`assemble()`]. If `split` is set, the second bounce and all later ones are separate layers.
///
/// # Errors
/// As [`Tracer::trace`].
pub fn assemble_layers(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
) -> Result<Assembled> {
    match channels {
        Channels::Luma => run(tracer, settings, channels, split, |rgb| [luminance(rgb)]),
        Channels::Rgb => run(tracer, settings, channels, split, |rgb| rgb),
    }
}

/// [`assemble_layers`] for `C` channels; `project` computes them from RGB.
fn run<const C: usize>(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
    project: impl Fn([f32; 3]) -> [f32; C] + Sync,
) -> Result<Assembled> {
    let camera = settings.resolution;
    let symmetric = tracer.symmetric(settings);
    let mut rows = Rows::<C>::new(settings.samples, split);
    let mut direct = PixelSums::<C>::new(camera.pixels(), settings.samples);
    let mut ambient = PixelSums::<C>::new(camera.pixels(), settings.samples);
    // Whether each endpoint has samples in both halves.
    let mut are_two = true;
    let summary = tracer.trace(settings, &mut |batch| {
        are_two &= batch.samples() > 1;
        let of_pixels = || {
            // Paths from the projector carry neither direct light nor ambient light.
            if !batch.from_camera() {
                return;
            }
            direct.add(batch, |path| project(batch.direct(path)));
            if batch.has_ambient() {
                ambient.add(batch, |path| batch.ambient(path).map_or([0.0; C], &project));
            }
        };
        rayon::join(|| rows.add(batch, &project), of_pixels).0?;
        Ok(())
    })?;
    rows.close()?;
    // Combining needs the most memory of all steps.
    tracer.release_buffers();

    let rig = RigShape { camera, projector: tracer.projector_resolution(settings), symmetric };
    let direct = if symmetric { direct.estimates } else { Vec::new() };
    let bounces: &[Bounces] =
        if split { &[Bounces::One, Bounces::Two, Bounces::Rest] } else { &[Bounces::One, Bounces::Global] };
    let Combined { layers, rows: sums } = combine(&rows.chunks, rig, bounces.len(), &direct);
    drop(rows);
    let tiled = |(&bounces, rows)| Layer::new(bounces, rig.projector.pixels(), &rows);
    let mut layers: Vec<Layer> = bounces.iter().zip(layers).map(tiled).collect();
    // A coaxial pinhole rig has no layer of one bounce: its direct light is the diagonal.
    layers.retain(|layer| layer.bounces() != Bounces::One || layer.nonzeros() > 0);

    let plane = |channel: usize| direct.iter().map(|estimate| estimate[channel][0] as f32).collect();
    let matrix = TransportMatrix { rig, channels, direct: (0..C).map(plane).collect(), layers };
    let ambient = image::<C>(camera, |pixel, channel| ambient.estimates[pixel][channel][0])?;
    let noise = are_two.then(|| noise(camera, &sums)).transpose()?;
    Ok(Assembled { matrix, ambient, noise, summary, gpu_matrix: None })
}

/// The noise of the matrix, from the sums over its rows.
fn noise<const C: usize>(camera: Resolution, rows: &[super::combine::RowSums<C>]) -> Result<Noise> {
    let sum = |of: &dyn Fn(&super::combine::RowSums<C>) -> f64| rows.iter().map(of).sum::<f64>();
    let squares = |values: &[f64; C]| values.iter().map(|value| value * value).sum::<f64>();
    Ok(Noise {
        white: image::<C>(camera, |pixel, channel| rows[pixel].error[channel].abs())?,
        white_relative: relative(sum(&|row| squares(&row.error)), sum(&|row| squares(&row.mean))),
        operator: relative(sum(&|row| row.error_squares), sum(&|row| row.mean_squares)),
        global: relative(sum(&|row| row.global[1]), sum(&|row| row.global[0])),
    })
}

/// An image of `C` channels, from a function of pixel and channel.
fn image<const C: usize>(resolution: Resolution, value: impl Fn(usize, usize) -> f64) -> Result<Image> {
    let plane = |channel| (0..resolution.pixels()).map(|pixel| value(pixel, channel)).collect();
    let planes: Vec<Vec<f64>> = (0..C).map(plane).collect();
    from_planes(resolution, &planes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Does not compile for a type that may not move to another thread.
    const fn assert_send<T: Send>() {}

    const _: () = {
        assert_send::<Tracer>();
        assert_send::<Assembled>();
        assert_send::<GpuMatrix>();
        assert_send::<super::super::Retraced<'_>>();
    };
}
