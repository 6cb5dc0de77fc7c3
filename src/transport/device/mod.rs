//! Assembles the matrix on the device that traces the paths, so that neither records nor entries move to the host. If several devices trace
//! (`several`), terms do.
//!
//! 1. Each dispatch's contributions become terms (`parts`): a workgroup takes some samples of a pixel, sorts their contributions, and sums
//!    those of one class and pixel in the order of the paths.
//! 2. When all paths are traced, the terms move to the rows of the pixels at which their paths start and end (`rows`). A workgroup sorts a
//!    row and sums the terms of each entry, its error and the squares from which the noise is computed.
//! 3. The entries of each class of bounces become a layer, in the arrays that products read. The host reads them only if it needs them
//!    ([`DeviceLayer`]).
//!
//! Integer atomics count terms and choose their places. Every sum of floating-point numbers is in double precision and in a fixed order, so
//! the bits repeat, and an entry and its mirror image agree to the last bit. The sums differ from the host's only by rounding.

mod kernels;
mod parts;
mod rows;
mod self_test;
mod several;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use self::kernels::{Assembly, BLOCK, Kernels, PIXELS_OF_GROUP, Packing, SUMS, split, submit};
use self::parts::{ClassRange, Endpoint, Parts};
use self::rows::Rows;
use super::assembled::Assembled;
use super::gpu_matrix::{self, DeviceLayer, GpuMatrix};
use super::layer::Layer;
use super::noise::{Halves, Noise, relative};
use super::spread::classes;
use super::{Bounces, Channels, RigShape, TransportMatrix};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Lent};
use crate::image::{Image, Resolution};
use crate::observer::Level;
use crate::render::{RecordLayout, TraceSettings, TraceSummary, Tracer};

/// The largest arrays of an assembly, in elements.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// Terms of an arena.
    arena: u64,
    /// Terms of a band.
    entries: usize,
    /// Whether keys share a word with their places if they can.
    packs: bool,
}

impl Limits {
    /// The maximum number of terms of an arena: half a gigabyte in one channel.
    const ARENA: u64 = 1 << 26;
    /// The maximum number of terms of a band.
    const ENTRIES: u64 = 1 << 26;

    fn of(gpu: &Gpu, channels: usize) -> Self {
        let room = gpu.summary.max_storage_binding.min(gpu.summary.max_buffer) / (4 * (1 + channels as u64));
        let entries = usize::try_from(Self::ENTRIES.min(room)).unwrap_or(usize::MAX);
        Self { arena: Self::ARENA.min(room), entries, packs: true }
    }
}

/// The maximum number of parts of a pixel. Software Vulkan leaves a loop after 65,535 iterations without an error.
const MOST_PARTS: u32 = 1 << 15;

/// Traces the scene and assembles its matrix on the device, with the help of the tracer's other devices. The observer sees the steps.
///
/// # Errors
/// [`Error::Device`] if the device lacks memory or `f64`, or failed its self-test; otherwise like [`Tracer::trace`].
pub(super) fn assemble(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
) -> Result<Assembled> {
    assemble_within(tracer, settings, (channels, split), None)
}

fn assemble_within(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    (channels, split): (Channels, bool),
    limits: Option<Limits>,
) -> Result<Assembled> {
    let (gpu, rig, layouts) = several::prepared(tracer, settings, channels)?;
    let assembly = Assembling::new(&gpu, rig, channels, (settings.samples, split), &layouts, limits)?;
    let mut parts = Parts::new(&assembly)?;
    let mut others = std::mem::take(&mut tracer.others);
    let summary = several::trace((tracer, &mut others), settings, (channels, split), &mut parts);
    let summary = match summary {
        Err(Error::Device { fault, .. }) if !others.is_empty() && gpu.require_working().is_ok() => {
            let note = format!("note: one device assembles the matrix, without the others: {fault}");
            tracer.observer().log(Level::Note, &note);
            drop(parts);
            tracer.release_buffers();
            return assemble_within(tracer, settings, (channels, split), limits);
        }
        summary => summary?,
    };
    tracer.others = others;
    let (assembled, unfinished) = assembly.finish(&parts, summary)?;
    if unfinished > 0 {
        return Err(tracer.unfinished(unfinished, summary.paths));
    }
    Ok(assembled)
}

/// The assembly of one matrix.
struct Assembling<'a> {
    gpu: &'a Gpu,
    kernels: Kernels,
    limits: Limits,
    rig: RigShape,
    channels: Channels,
    classes: ClassRange,
    /// The parameters that all steps have in common.
    base: Assembly,
}

impl<'a> Assembling<'a> {
    /// Prepares for paths whose records have these layouts: one for a coaxial rig, or one for the camera and one for the projector. Without
    /// `limits`, the device's own hold.
    fn new(
        gpu: &'a Gpu,
        rig: RigShape,
        channels: Channels,
        (samples, is_split): (u32, bool),
        layouts: &[RecordLayout],
        limits: Option<Limits>,
    ) -> Result<Self> {
        let limits = limits.unwrap_or_else(|| Limits::of(gpu, channels.count()));
        let direct = layouts.first().is_some_and(|layout| layout.direct);
        let classes = ClassRange::of(direct, is_split);
        let divided = |layout: &RecordLayout| Assembly::default().divided(layout.samples, layout.most_ends());
        let most_parts = layouts.iter().map(|layout| divided(layout).parts_of_pixel).max().unwrap_or(1);
        if most_parts > MOST_PARTS {
            return Err(Error::device(format!("{samples} samples of a pixel are too many for its sums")));
        }
        // These are the largest arrays that are needed whatever the paths meet.
        let sums = 8 * (2 * channels.count() + 4) * rig.camera.pixels().max(rig.projector.pixels());
        gpu.check_size("sums of rows", sums as u64)?;
        let part_bits = bits(u64::from(most_parts));
        let pixel_bits = bits(rig.camera.pixels().max(rig.projector.pixels()) as u64);
        let term_bits = pixel_bits + classes.bits();
        let packing = Packing::new(term_bits, term_bits + 1 + part_bits)?;
        let packing = if limits.packs { packing } else { Packing { of_part: false, of_row: false } };
        let kernels = Kernels::of(gpu, channels.count(), packing)?;
        let mut errors = [[0.0; 2]; 4];
        for (layout, of_endpoint) in layouts.iter().zip(errors.chunks_mut(2)) {
            let [_, first, second] = Halves::new(samples, layout.samples).weights();
            of_endpoint.copy_from_slice(&[split(first), split(second)]);
        }
        let [mean, ..] = Halves::new(samples, samples).weights();
        let halves = |index: usize| layouts.get(index).map_or(0, |of| divided(of).parts_of_first_half);
        let base = Assembly {
            luminance: crate::image::LUMINANCE.map(|share| share as f32),
            split: u32::from(is_split),
            mean: split(mean),
            error_high: errors.map(|[high, _]| high),
            error_low: errors.map(|[_, low]| low),
            direct: u32::from(direct),
            lowest_class: classes.lowest,
            class_bits: classes.bits(),
            part_bits,
            first_halves: [halves(0), halves(1)],
            ..Assembly::default()
        };
        Ok(Self { gpu, kernels, limits, rig, channels, classes, base })
    }

    /// Submits the sums of direct and ambient light and of the paths' costs.
    fn pixels(&self, endpoints: &[Endpoint]) -> Result<PixelLight> {
        let (gpu, plane) = (self.gpu, (self.channels.count() * self.rig.camera.pixels()) as u64);
        let has_ambient = endpoints.iter().any(|endpoint| endpoint.layout.ambient);
        let has_any = self.base.direct == 1 || has_ambient;
        let estimates = gpu.scratch("direct light", if has_any { 16 * plane } else { 8 })?;
        let of_plane = |label| gpu.scratch(label, if has_any { 4 * plane } else { 4 });
        let [direct, ambient] = [of_plane("matrix's diagonal")?, of_plane("ambient light")?];
        let (mut costs, mut steps) = (Vec::new(), Vec::new());
        for endpoint in endpoints {
            let groups = endpoint.pixels().div_ceil(PIXELS_OF_GROUP);
            let of_groups = gpu.scratch("costs", 16 * u64::from(groups))?;
            let parameters = Assembly { rows: endpoint.pixels(), ..endpoint.base };
            let buffers = [&*endpoint.parts, &*endpoint.heads, &*estimates, &*direct, &*ambient, &*of_groups];
            steps.push(self.kernels.pixels.step(gpu, &parameters, &buffers, groups)?);
            costs.push((of_groups, 4 * groups as usize));
        }
        submit(gpu, &steps)?;
        Ok(PixelLight { has_any, has_ambient, estimates, direct, ambient, costs })
    }

    /// The layers of the matrix, or of its transpose, and the sums of its rows.
    fn layers(&self, parts: &Parts<'_>, light: &PixelLight, is_transposed: bool) -> Result<(Layers, Lent)> {
        let [rows, columns] = match is_transposed {
            false => [self.rig.camera, self.rig.projector].map(Resolution::pixels),
            true => [self.rig.projector, self.rig.camera].map(Resolution::pixels),
        };
        let sums = self.gpu.scratch("sums of rows", 8 * (rows * (2 * self.channels.count() + 4)) as u64)?;
        let flags = |endpoint| (endpoint, Endpoint::flags(endpoint, is_transposed));
        let made = Rows {
            of: self,
            sources: parts.endpoints.iter().map(flags).collect(),
            counts: &parts.counts,
            first_count: if is_transposed { self.rig.camera.pixels() as u32 } else { 0 },
            rows: rows as u32,
            columns,
            estimates: &light.estimates,
            sums: &sums,
        };
        let layers = made.layers(&classes(self.base.split == 1)[self.classes.lowest as usize..])?;
        let keeps = |layer: &DeviceLayer| layer.bounces != Bounces::One || layer.entries > 0;
        Ok((layers.into_iter().filter(keeps).map(Arc::new).collect(), sums))
    }

    /// Makes the matrix from the terms of all paths. Returns it with the number of unfinished paths.
    fn finish(&self, parts: &Parts<'_>, summary: TraceSummary) -> Result<(Assembled, u64)> {
        let (gpu, channels, rig) = (self.gpu, self.channels.count(), self.rig);
        let camera = rig.camera.pixels();
        let light = self.pixels(&parts.endpoints)?;
        let (layers, of_rows) = self.layers(parts, &light, false)?;
        // The matrix of a coaxial rig is its own transpose.
        let transposed = match rig.symmetric {
            true => None,
            false => Some(self.layers(parts, &light, true)?.0),
        };
        let (groups, plane) = ((camera as u32).div_ceil(BLOCK), channels * camera);
        let white = gpu.scratch("errors of the white photo", 4 * plane as u64)?;
        let all = gpu.scratch("sums of the matrix", 8 * u64::from(groups) * SUMS as u64)?;
        let parameters = Assembly { rows: camera as u32, ..self.base };
        submit(gpu, &[self.kernels.sums.step(gpu, &parameters, &[&*of_rows, &*white, &*all], groups)?])?;
        let of_light = if light.has_any { plane } else { 0 };
        let mut asked = vec![
            (&*white, plane),
            (&*all, 2 * SUMS * groups as usize),
            (&*light.direct, of_light),
            (&*light.ambient, of_light),
        ];
        asked.extend(light.costs.iter().map(|(buffer, words)| (&**buffer, *words)));
        let found = gpu.read_all::<u32>(&asked)?;
        let [low, high, unfinished] = [0, 1, 2].map(|which| {
            let costs = found[4..].iter().flat_map(|words| words.as_chunks::<4>().0);
            costs.map(|cost| u64::from(cost[which])).sum::<u64>()
        });
        let summary = TraceSummary { rays: low + (high << 16), ..summary };
        let floats = |words: &[u32]| words.iter().map(|&word| f32::from_bits(word)).collect::<Vec<f32>>();
        let image = |words: &[u32]| {
            let plane = |words: &[u32]| floats(words).into_iter().map(f64::from).collect();
            Image::from_planes(rig.camera, &words.chunks(camera).map(plane).collect::<Vec<Vec<f64>>>())
        };
        let has_noise = parts.endpoints.iter().all(|endpoint| endpoint.layout.samples > 1);
        let noise = if has_noise { Some(noise(image(&found[0])?, &found[1])) } else { None };
        let ambient = match light.has_ambient {
            true => image(&found[3])?,
            false => Image::filled(rig.camera, channels, 0.0),
        };
        let direct = match (self.base.direct == 1, rig.symmetric) {
            (true, _) => found[2].chunks(camera).map(floats).collect(),
            // With a lens, direct light is not a diagonal.
            (false, true) => vec![vec![0.0; camera]; channels],
            (false, false) => vec![Vec::new(); channels],
        };
        let of_host = layers.iter().map(|layer| Layer::on_device(Arc::clone(layer))).collect();
        let matrix = TransportMatrix::new(rig, self.channels, direct, of_host);
        let limits = gpu_matrix::Limits::of(gpu);
        let gpu_matrix = Some(GpuMatrix::of_layers(gpu, &matrix, layers, transposed, limits)?);
        Ok((Assembled { matrix, ambient, noise, summary, gpu_matrix }, unfinished))
    }
}

/// Layers on the device, by bounces.
type Layers = Vec<Arc<DeviceLayer>>;

/// Direct and ambient light of the camera's pixels, and the costs of the paths.
struct PixelLight {
    has_any: bool,
    has_ambient: bool,
    /// Direct light and its error, for each pixel and channel.
    estimates: Lent,
    /// Planes of the channels.
    direct: Lent,
    ambient: Lent,
    /// For each endpoint, the rays and the unfinished paths of groups of pixels, with the number of words.
    costs: Vec<(Lent, usize)>,
}

/// The noise, from the errors of the white photo and the sums of all groups of rows, as `shaders/assemble_sums.wgsl` writes them.
fn noise(white: Image, all: &[u32]) -> Noise {
    let mut sums = [0.0; SUMS];
    let words = all.as_chunks::<2>().0.iter().map(|&[low, high]| u64::from(low) | u64::from(high) << 32);
    for (index, word) in words.enumerate() {
        sums[index % SUMS] += f64::from_bits(word);
    }
    Noise {
        white,
        white_relative: relative(sums[5], sums[4]),
        operator: relative(sums[1], sums[0]),
        global: relative(sums[3], sums[2]),
    }
}

/// The number of bits of numbers below `count`.
fn bits(count: u64) -> u32 {
    count.next_power_of_two().ilog2()
}
