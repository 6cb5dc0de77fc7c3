//! The light transport matrix of a scene: its light paths are traced, summed pixel by pixel, and combined
//! into rows.

use super::combine::{Combined, combine};
use super::fixed::RowSums;
use super::layer::{Bounces, Layer};
use super::noise::{Noise, relative};
use super::share::Share;
use super::squares::EntrySquares;
use super::tiles::Tiles;
use super::{Channels, GpuMatrix, RigShape, TransportMatrix, from_planes, luminance, spread};
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
    if tracer.remote().is_some() {
        return spread::assemble(tracer, settings, channels, split, project);
    }
    let all = tracer.start_pixels(settings);
    let share = Share::trace(tracer, settings, &all, (split, None), &project)?;
    whole(share, shape(tracer, settings), channels, split)
}

/// The matrix of all light paths.
pub(super) fn whole<const C: usize>(
    share: Share<C>,
    rig: RigShape,
    channels: Channels,
    split: bool,
) -> Result<Assembled> {
    let Share { found, direct, ambient, has_halves, summary } = share;
    let rows = 0..rig.camera.pixels();
    let combined = combine(found, rig, rows.clone(), classes(split).len(), &direct);
    let Combined { layers, rows: sums, squares } = combined;
    let mut layers = of_classes(layers, split);
    // A coaxial pinhole rig has no layer of one bounce: its direct light is the diagonal.
    layers.retain(|layer| layer.bounces() != Bounces::One || layer.nonzeros() > 0);
    let matrix = TransportMatrix { rig, channels, direct: planes(&direct), layers, rows, spread: None };
    finish(matrix, &ambient, has_halves.then_some((&sums, &squares)), summary)
}

/// The shape of the matrix of these settings.
pub(super) fn shape(tracer: &Tracer, settings: &TraceSettings) -> RigShape {
    RigShape {
        camera: settings.resolution,
        projector: tracer.projector_resolution(settings),
        symmetric: tracer.symmetric(settings),
    }
}

/// The bounces of each class of contributions.
pub(super) fn classes(split: bool) -> &'static [Bounces] {
    if split { &[Bounces::One, Bounces::Two, Bounces::Rest] } else { &[Bounces::One, Bounces::Global] }
}

/// The tiles of each class as layers by number of bounces.
pub(super) fn of_classes(tiles: Vec<Tiles>, split: bool) -> Vec<Layer> {
    let layer = |(&bounces, tiles)| Layer::of_tiles(bounces, tiles);
    classes(split).iter().zip(tiles).map(layer).collect()
}

/// The diagonal, `[channel][pixel]`.
pub(super) fn planes<const C: usize>(direct: &[[[f64; 2]; C]]) -> Vec<Vec<f32>> {
    let plane = |channel: usize| direct.iter().map(|estimate| estimate[channel][0] as f32).collect();
    (0..C).map(plane).collect()
}

/// The traced scene of a matrix, the ambient light of each camera pixel, and the sums over all rows and entries if the noise is known.
pub(super) fn finish<const C: usize>(
    matrix: TransportMatrix,
    ambient: &[[[f64; 2]; C]],
    sums: Option<(&Vec<RowSums<C>>, &EntrySquares)>,
    summary: TraceSummary,
) -> Result<Assembled> {
    let camera = matrix.rig.camera;
    let ambient = image::<C>(camera, |pixel, channel| ambient[pixel][channel][0])?;
    let noise = sums.map(|(rows, squares)| noise(camera, rows, squares)).transpose()?;
    Ok(Assembled { matrix, ambient, noise, summary, gpu_matrix: None })
}

/// The noise of the matrix, from the sums over its rows and entries.
fn noise<const C: usize>(camera: Resolution, rows: &[RowSums<C>], squares: &EntrySquares) -> Result<Noise> {
    let sum = |of: &dyn Fn(&RowSums<C>) -> f64| rows.iter().map(of).sum::<f64>();
    let of_row = |values: &[f64; C]| values.iter().map(|value| value * value).sum::<f64>();
    let of_entries = |[mean, error]: [f64; 2]| relative(error, mean);
    Ok(Noise {
        white: image::<C>(camera, |pixel, channel| rows[pixel].error[channel].abs())?,
        white_relative: relative(sum(&|row| of_row(&row.error)), sum(&|row| of_row(&row.mean))),
        operator: of_entries(squares.whole()),
        global: of_entries(squares.global()),
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
