//! The self-test of a device: it assembles a small matrix from known records, and the host does the same.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::parts::Parts;
use super::{Assembling, Limits};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::Resolution;
use crate::render::{Batch, Consumer, RecordLayout, ResidentPaths, TraceSummary};
use crate::transport::assembled::Assembled;
use crate::transport::contributions::Share;
use crate::transport::spread::of_share;
use crate::transport::{Channels, CompressedRows, Layer, RigShape};

/// The number of roundings to single precision by which a weight may differ: of the luminance, of the sum of a part, and of the result, for
/// each of the two terms of an entry, and here as well as there.
const ROUNDINGS: f64 = 12.0;

/// Fails with [`Error::Device`] if the device does not assemble the known matrix. Each device is tested once.
pub(super) fn require_working(gpu: &Gpu, channels: Channels) -> Result<()> {
    let works = gpu.kept(&format!("self-test of {channels:?}"), || {
        let limits = Limits::of(gpu, channels.count());
        // Rows that are longer than workgroup memory, in several bands.
        let small = Limits { arena: 1 << 12, entries: 1 << 13, ..limits };
        let all = [
            (Known::new(channels), limits),
            (Known::with_long_rows(channels), small),
            (Known::new(channels).with_projector(Resolution::new(5, 11)), small),
        ];
        for (known, limits) in all {
            let [device, host] = known.assembled(gpu, limits)?;
            if difference(&device, &host)?.is_some() {
                return Ok(false);
            }
        }
        Ok(true)
    })?;
    if works { Ok(()) } else { Err(Error::device(format!("{} fails its self-test", gpu.summary.name))) }
}

/// Known records, as a trace might write them.
pub(super) struct Known {
    pub(super) channels: Channels,
    pub(super) split: bool,
    /// The layout of the records of the camera's paths.
    pub(super) layout: RecordLayout,
    pub(super) rig: RigShape,
    /// How many connections there are to each that is not seen.
    pub(super) seen: u32,
    pub(super) seed: u64,
}

const MARK: u32 = 7 << 16;

impl Known {
    pub(super) fn new(channels: Channels) -> Self {
        let layout = RecordLayout {
            samples: 5,
            max_bounces: 4,
            direct: true,
            gathers: true,
            ambient: true,
            symmetric: true,
            from_camera: true,
        };
        Self { channels, split: true, layout, rig: coaxial(Resolution::new(19, 7)), seen: 2, seed: 1 }
    }

    /// Each of a few pixels has more than a thousand terms.
    pub(super) fn with_long_rows(channels: Channels) -> Self {
        let known = Self::new(channels);
        let layout = RecordLayout { samples: 1200, ..known.layout };
        Self { layout, rig: coaxial(Resolution::new(10, 2)), ..known }
    }

    /// The same for a rig whose projector stands apart and has this resolution.
    pub(super) fn with_projector(self, projector: Resolution) -> Self {
        let layout = RecordLayout { direct: false, symmetric: false, ..self.layout };
        Self { layout, rig: RigShape { projector, symmetric: false, ..self.rig }, ..self }
    }

    /// The layouts of the records of all paths, with the numbers of pixels at which paths of a layout start and end.
    fn layouts(&self) -> Vec<(RecordLayout, [usize; 2])> {
        let [camera, projector] = [self.rig.camera, self.rig.projector].map(Resolution::pixels);
        let mut layouts = vec![(self.layout, [camera, projector])];
        if !self.rig.symmetric {
            let from_projector = RecordLayout { ambient: false, from_camera: false, ..self.layout };
            layouts.push((from_projector, [projector, camera]));
        }
        layouts
    }

    fn records(&self, layout: RecordLayout, [starts, ends]: [usize; 2], random: &mut Pcg64) -> Vec<[u32; 4]> {
        let paths = starts * layout.samples as usize;
        let mut records = vec![[u32::MAX, 0, 0, 0]; layout.stride() * paths];
        let light = |random: &mut Pcg64| random.random_range(0.0..2.0_f32).to_bits();
        for path in 0..paths {
            let surfaces = random.random_range(0..=layout.max_bounces);
            let rays = random.random_range(1..20_u32);
            let direct = if layout.direct { light(random) } else { 0 };
            records[path] = [MARK | rays << 8 | surfaces, direct, 0, direct];
            for slot in 1..layout.stride() {
                let is_ambient = layout.ambient && slot == layout.stride() - 1;
                if is_ambient || random.random_range(0..=self.seen) > 0 {
                    // Some surfaces of the other end's chain, in a gathered connection.
                    let chain = u32::from(slot >= layout.gathered(2) && !is_ambient) << 28;
                    let head = if is_ambient { MARK } else { random.random_range(0..ends as u32) | chain };
                    records[slot * paths + path] = [head, light(random), light(random), 0];
                }
            }
        }
        records
    }

    /// The matrix of these records, as the device and as the host assemble it.
    pub(super) fn assembled(&self, gpu: &Gpu, limits: Limits) -> Result<[Assembled; 2]> {
        let (rig, of) = (self.rig, (self.layout.samples, self.split));
        let mut random = Pcg64::seed_from_u64(self.seed);
        let records = |(layout, pixels)| (layout, self.records(layout, pixels, &mut random));
        let all: Vec<(RecordLayout, Vec<[u32; 4]>)> = self.layouts().into_iter().map(records).collect();
        let layouts: Vec<RecordLayout> = all.iter().map(|(layout, _)| *layout).collect();
        let assembly = Assembling::new(gpu, rig, self.channels, of, &layouts, Some(limits))?;
        let mut parts = Parts::new(&assembly)?;
        for (layout, records) in &all {
            let buffer = gpu.storage("known records", records)?;
            let paths = (records.len() / layout.stride()) as u32;
            parts.begin(layout, 0..u64::from(paths), &buffer)?;
            parts.submit(&ResidentPaths { first_path: 0, paths, mark: MARK }, &mut |_| ())?;
            parts.finish()?;
        }
        let (device, _) = assembly.finish(&parts, TraceSummary::default())?;
        let batches: Vec<Batch<'_>> =
            all.iter().map(|(layout, records)| Batch::new(0, *layout, records)).collect();
        let host = match self.channels {
            Channels::Luma => of_share(Share::<1>::of_batches(&batches, rig, of), rig, self.channels, of.1),
            Channels::Rgb => of_share(Share::<3>::of_batches(&batches, rig, of), rig, self.channels, of.1),
        };
        Ok([device, host?])
    }
}

fn coaxial(resolution: Resolution) -> RigShape {
    RigShape { camera: resolution, projector: resolution, symmetric: true }
}

/// In what the device's matrix differs from the host's by more than rounding; `None` if in nothing.
pub(super) fn difference(device: &Assembled, host: &Assembled) -> Result<Option<String>> {
    let near = |a: f32, b: f32| {
        let size = f64::from(a.abs().max(b.abs()));
        f64::from(a - b).abs() <= ROUNDINGS * 2.0_f64.powi(-24) * size + f64::from(f32::MIN_POSITIVE)
    };
    let all_near = |a: &[f32], b: &[f32]| a.len() == b.len() && a.iter().zip(b).all(|(&a, &b)| near(a, b));
    let (of_device, of_host) = (device.matrix.layers()?, host.matrix.layers()?);
    let kinds = |layers: &[Layer]| layers.iter().map(Layer::bounces).collect::<Vec<_>>();
    if kinds(&of_device) != kinds(&of_host) {
        return Ok(Some(format!("layers {:?} and {:?}", kinds(&of_device), kinds(&of_host))));
    }
    for (device, host) in of_device.iter().zip(of_host.iter()) {
        let bounces = device.bounces();
        let [device, host]: [CompressedRows; 2] = [device, host].map(Layer::to_rows);
        if (&device.row_start, &device.columns) != (&host.row_start, &host.columns) {
            return Ok(Some(format!("places of {bounces:?}")));
        }
        if device.weights.iter().zip(&host.weights).any(|(a, b)| !all_near(a, b)) {
            return Ok(Some(format!("weights of {bounces:?}")));
        }
    }
    if device.matrix.direct.iter().zip(&host.matrix.direct).any(|(a, b)| !all_near(a, b)) {
        return Ok(Some("direct light".into()));
    }
    if !all_near(device.ambient.samples(), host.ambient.samples()) {
        return Ok(Some("ambient light".into()));
    }
    let (Some(a), Some(b)) = (&device.noise, &host.noise) else {
        return Ok((device.noise != host.noise).then(|| "noise".into()));
    };
    // An error is a difference of sums, so that it is rounded by the size of the sums.
    let size = host.matrix.frobenius_norm(super::super::Part::Full, 0) as f32;
    let white = a.white.samples().iter().zip(b.white.samples());
    let is_white = white.into_iter().all(|(&a, &b)| (a - b).abs() <= ROUNDINGS as f32 * f32::EPSILON * size);
    let relative = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b;
    let is_near = relative(a.operator, b.operator)
        && relative(a.global, b.global)
        && relative(a.white_relative, b.white_relative);
    Ok((!is_white || !is_near).then(|| {
        format!(
            "noise {:?} and {:?}",
            (a.operator, a.global, a.white_relative),
            (b.operator, b.global, b.white_relative)
        )
    }))
}
