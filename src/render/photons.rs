//! The photon map of an endpoint's specular chains. It shows which pixels of the endpoint see a surface point through mirrors and glass.
//!
//! A path that is specular at both ends (camera → mirror → wall → wall → mirror → projector) cannot be sampled by connecting surface points
//! to an endpoint. Therefore the specular chains of the far endpoint are traced once, from its pixels to the first surfaces that scatter,
//! and the ends of the chains are stored as photons. A path gathers the photons within a radius around its own points. This is a density
//! estimate (Jensen, "Global Illumination using Photon Maps", EGWR 1996). Its bias depends on how much light transport changes within the
//! radius.

use rayon::prelude::*;

use super::dispatch::{Dispatches, unfinished_paths};
use super::geometry::GpuScene;
use super::kernel::{Features, GpuEndpoint, Parameters, Pipeline};
use super::launch::Output;
use super::light_buffer::no_light_buffer;
use super::materials::NONE;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Results;

/// The maximum number of surfaces of a chain. Their number has four bits.
const MAX_CHAIN: u32 = 15;

#[derive(Clone)]
pub(super) struct PhotonMap {
    pub(super) photons: wgpu::TextureView,
    /// The first photon of each bucket.
    pub(super) buckets: wgpu::Buffer,
    /// The number of buckets minus 1; 0 if there are no photons.
    pub(super) bucket_mask: u32,
    pub(super) count: u32,
    pub(super) radius: f32,
}

/// The sampling density of specular chains, and the radius within which their photons are gathered.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Gather {
    /// Number of chains traced from each pixel.
    pub photons: u32,
    /// The radius of the density estimate, relative to the typical footprint of a pixel. Each photon has a disc with the area of a pixel's
    /// footprint through the photon's chain, and the unit is the median radius of these discs. A smaller radius reduces the bias and
    /// increases the variance.
    pub radius: f32,
}

impl Default for Gather {
    fn default() -> Self {
        Self { photons: 16, radius: 1.0 }
    }
}

#[derive(PartialEq)]
pub(super) struct ChainRequest {
    pub(super) features: Features,
    pub(super) endpoint: GpuEndpoint,
    pub(super) gather: Gather,
    pub(super) base: Parameters,
}

impl PhotonMap {
    pub(super) fn empty(gpu: &Gpu) -> Result<Self> {
        Self::upload(gpu, &[], &[], 0, 1.0)
    }

    fn upload(gpu: &Gpu, photons: &[Photon], buckets: &[u32], bucket_mask: u32, radius: f32) -> Result<Self> {
        Ok(Self {
            photons: gpu.texel_array("photons", &texels(photons))?,
            buckets: gpu.storage("photon buckets", buckets)?,
            bucket_mask,
            count: photons.len() as u32,
            radius,
        })
    }

    /// Traces the chains of `request` and sorts their photons. Fails with [`UnfinishedPaths`](crate::Error::UnfinishedPaths) if the driver
    /// dropped paths, and with [`Device`](crate::Error::Device) if it failed.
    pub(super) fn trace(
        gpu: &Gpu,
        scene: &GpuScene,
        request: &ChainRequest,
        dispatches: &mut Dispatches,
    ) -> Result<Self> {
        let ChainRequest { features, endpoint, gather, base } = *request;
        // The first and the last scattering surface of a path do not belong to this chain.
        let chain = base.max_bounces.saturating_sub(2).min(MAX_CHAIN);
        if chain == 0 || gather.photons == 0 {
            return Self::empty(gpu);
        }
        let total = endpoint.pixels() * u64::from(gather.photons);
        let kernel = Pipeline::new(gpu, "trace_photons", &features)?;
        let none = Self::empty(gpu)?;
        let words = 4 * u64::from(chain) + 1;
        let capacity = dispatches.capacity(gpu, words, 1, total);
        let results = Results::new(gpu, "path records", u64::from(capacity) * words * 16)?;
        let output = Output::new(gpu, &kernel, scene, &none, &no_light_buffer(gpu)?, results)?;
        let parameters = Parameters {
            start: endpoint,
            end: endpoint,
            samples: gather.photons,
            // The seed differs from that of the gathering paths, so the random numbers are independent.
            seed: base.seed ^ 0x5eed_f00d,
            scale: (endpoint.image_area() / total as f64) as f32,
            stride: chain,
            ..base
        };
        let mut photons: Vec<Photon> = Vec::new();
        let mut done = 0;
        while done < total {
            let paths = u64::from(capacity).min(total - done) as u32;
            let parameters = parameters.of_paths(done, paths, dispatches.mark());
            let bytes = u64::from(paths) * words * 16;
            let view = output.run(gpu, &parameters, bytes)?;
            let records: &[[u32; 4]] = bytemuck::cast_slice(&view);
            let mut unfinished = 0;
            for record in records.chunks_exact(words as usize) {
                unfinished += u64::from(record[0][0] != parameters.mark);
                let found = record[1..].as_chunks::<4>().0;
                photons.extend(found.iter().filter(|photon| photon[0][0] != NONE));
            }
            if unfinished > 0 {
                return Err(unfinished_paths(unfinished, u64::from(paths), scene));
            }
            done += u64::from(paths);
        }
        if photons.is_empty() {
            return Ok(none);
        }
        let bytes = gpu.summary.max_storage_binding.min(gpu.summary.max_buffer);
        let each = size_of::<Photon>() as u64;
        // The photons of one bucket are stored twice, so this room is left for them.
        let room = (bytes / each).min(gpu.texel_bytes() / each - MAX_BUCKET as u64);
        let photons = fitting(photons, room as usize);
        let pixel_area = endpoint.image_area() / endpoint.pixels() as f64;
        let radius = gather.radius * median_radius(&photons, pixel_area);
        let Grid { mask, start, photons } = Grid::new(photons, inverse_cell(radius));
        Self::upload(gpu, &photons, &start, mask, radius)
    }

    pub(super) fn inverse_cell(&self) -> f32 {
        inverse_cell(self.radius)
    }
}

/// The photons in the order in which the shader reads them. The first texels of all photons come first, because the shader finds nearby
/// photons with them. The three other texels of each photon follow.
fn texels(photons: &[Photon]) -> Vec<[u32; 4]> {
    let mut texels = Vec::with_capacity(4 * photons.len());
    texels.extend(photons.iter().map(|photon| photon[0]));
    texels.extend(photons.iter().flat_map(|photon| &photon[1..]));
    texels
}

/// An even selection of at most `room` photons, as many as fit the device. Their power is increased, so that the total power stays equal.
fn fitting(photons: Vec<Photon>, room: usize) -> Vec<Photon> {
    let step = photons.len().div_ceil(room.max(1)).max(1);
    if step == 1 {
        return photons;
    }
    let kept = photons.len().div_ceil(step);
    let share = photons.len() as f32 / kept as f32;
    photons.into_iter().step_by(step).map(|photon| brightened(photon, share)).collect()
}

/// 1 / width of a grid cell. The width is two radii.
fn inverse_cell(radius: f32) -> f32 {
    0.5 / radius
}

/// The median over the photons of the radius of a disc whose area is the footprint of a pixel through the photon's chain.
fn median_radius(photons: &[Photon], pixel_area: f64) -> f32 {
    let mut densities: Vec<f32> = photons.iter().map(|photon| f32::from_bits(photon[1][0])).collect();
    let middle = densities.len() / 2;
    let (_, &mut median, _) = densities.select_nth_unstable_by(middle, f32::total_cmp);
    (pixel_area / f64::from(median) / std::f64::consts::PI).sqrt() as f32
}

/// The number of maps that are kept. A rig with a separate projector needs one for each endpoint.
const CAPACITY: usize = 2;

/// The most recently traced photon maps of one scene, on the device. The newest map is the last.
#[derive(Default)]
pub(super) struct ChainCache {
    maps: Vec<(ChainRequest, PhotonMap)>,
}

impl ChainCache {
    pub(super) fn map(
        &mut self,
        gpu: &Gpu,
        scene: &GpuScene,
        request: ChainRequest,
        dispatches: &mut Dispatches,
    ) -> Result<PhotonMap> {
        if let Some((_, map)) = self.maps.iter().find(|(known, _)| *known == request) {
            return Ok(map.clone());
        }
        let map = PhotonMap::trace(gpu, scene, &request, dispatches)?;
        if self.maps.len() == CAPACITY {
            self.maps.remove(0);
        }
        self.maps.push((request, map.clone()));
        Ok(map)
    }
}

/// A photon as `trace_photons` records it: four texels, as described in `shaders/shared/photons.wgsl`.
pub(super) type Photon = [[u32; 4]; 4];

/// The maximum number of photons in one bucket, so that no invocation loops longer than the driver allows. A fuller bucket keeps an even
/// selection of its photons, whose power is increased accordingly.
const MAX_BUCKET: usize = 512;

/// Photons in the buckets of a hash grid. The photons of a cell are contiguous, and so are those of two neighbouring cells along x.
struct Grid {
    /// Number of buckets, a power of two, minus 1.
    mask: u32,
    /// The first photon of each bucket, then the end of the last bucket, and the end of the copy of the first bucket.
    start: Vec<u32>,
    photons: Vec<Photon>,
}

impl Grid {
    fn new(photons: Vec<Photon>, inverse_cell: f32) -> Self {
        let buckets = photons.len().next_power_of_two().max(2);
        let mask = buckets as u32 - 1;
        let mut keyed: Vec<(u32, Photon)> = photons
            .into_par_iter()
            .map(|photon| (hash(cell(&photon, inverse_cell)) & mask, photon))
            .collect();
        // The sort is stable, so photons of one bucket stay in the order of their paths.
        keyed.par_sort_by_key(|&(bucket, _)| bucket);
        let mut start = Vec::with_capacity(buckets + 2);
        let mut photons: Vec<Photon> = Vec::with_capacity(keyed.len());
        let mut runs = keyed.chunk_by(|a, b| a.0 == b.0).peekable();
        for bucket in 0..=mask {
            start.push(photons.len() as u32);
            if let Some(run) = runs.next_if(|run| run[0].0 == bucket) {
                thin(run, &mut photons);
            }
        }
        start.push(photons.len() as u32);
        // A copy of the first bucket follows the last one, so that the photons of any two neighbouring cells along x are contiguous.
        photons.extend_from_within(..start[1] as usize);
        start.push(photons.len() as u32);
        Self { mask, start, photons }
    }
}

fn thin(run: &[(u32, Photon)], sorted: &mut Vec<Photon>) {
    let kept = run.len().min(MAX_BUCKET);
    let share = run.len() as f32 / kept as f32;
    sorted.extend((0..kept).map(|index| brightened(run[index * run.len() / kept].1, share)));
}

fn brightened(mut photon: Photon, share: f32) -> Photon {
    for power in &mut photon[1][1..] {
        *power = (f32::from_bits(*power) * share).to_bits();
    }
    photon
}

fn cell(photon: &Photon, inverse_cell: f32) -> [i32; 3] {
    [1, 2, 3].map(|axis| (f32::from_bits(photon[0][axis]) * inverse_cell).floor() as i32)
}

/// The hash of a grid cell; `photon_hash` in `shaders/shared/photons.wgsl`.
pub(super) fn hash(cell: [i32; 3]) -> u32 {
    let [x, y, z] = cell.map(i32::cast_unsigned);
    let mixed = (y.wrapping_mul(19_349_663) ^ z.wrapping_mul(83_492_791)).wrapping_mul(0x9e37_79b1);
    (mixed ^ mixed >> 15).wrapping_add(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_texels_by_which_photons_are_found_come_first() {
        let photon = |index: u32| [0, 1, 2, 3].map(|texel| [10 * index + texel; 4]);
        let words: Vec<u32> = texels(&[photon(1), photon(2)]).iter().map(|texel| texel[0]).collect();
        assert_eq!(words, [10, 20, 11, 12, 13, 21, 22, 23]);
    }

    #[test]
    fn a_selection_of_photons_carries_the_light_of_all() {
        let photon = |index: u32| [[index; 4], [0, 1.0_f32.to_bits(), 2.0_f32.to_bits(), 0], [0; 4], [0; 4]];
        let light =
            |photons: &[Photon]| photons.iter().map(|photon| f32::from_bits(photon[1][2])).sum::<f32>();
        let photons: Vec<Photon> = (0..1000).map(photon).collect();
        assert_eq!(fitting(photons.clone(), 1000), photons);
        let fitted = fitting(photons, 300);
        assert_eq!((fitted.len(), light(&fitted)), (250, 2000.0));
    }

    #[test]
    fn the_photons_of_two_neighbouring_cells_lie_side_by_side() {
        let place = |index: u32| {
            let at = |step: u32| (f32::from((index * step % 97) as u8) / 8.0 - 6.0).to_bits();
            [[index, at(7), at(13), at(31)], [0; 4], [0; 4], [0; 4]]
        };
        let photons: Vec<Photon> = (0..97).map(place).collect();
        let grid = Grid::new(photons.clone(), 1.0);
        for y in -6..7 {
            for z in -6..7 {
                for x in -7..7 {
                    let bucket = (hash([x, y, z]) & grid.mask) as usize;
                    let found = &grid.photons[grid.start[bucket] as usize..grid.start[bucket + 2] as usize];
                    let inside = |photon: &&Photon| {
                        let [at, row @ ..] = cell(photon, 1.0);
                        row == [y, z] && (at == x || at == x + 1)
                    };
                    let indices = |photons: &[Photon]| -> Vec<u32> {
                        let mut indices: Vec<u32> = photons.iter().filter(inside).map(|p| p[0][0]).collect();
                        indices.sort_unstable();
                        indices
                    };
                    assert_eq!(indices(found), indices(&photons), "{x}, {y}, {z}");
                }
            }
        }
    }

    #[test]
    fn a_full_bucket_keeps_its_light() {
        let photon = [[0; 4], [0, 1.0_f32.to_bits(), 2.0_f32.to_bits(), 0], [0; 4], [0; 4]];
        let mut sorted = Vec::new();
        thin(&[(0, photon); 1000], &mut sorted);
        let light: f32 = sorted.iter().map(|photon| f32::from_bits(photon[1][2])).sum();
        // 1000/512 is rounded, and summed 512 times.
        assert!(sorted.len() == MAX_BUCKET && (light - 2000.0).abs() < 0.01);
    }
}
