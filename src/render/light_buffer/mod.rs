//! What can be seen from the pinhole that camera and projector share: lists of pairs of triangles over a raster of the image plane.
//!
//! For each texel of the raster, the pairs of all triangles that a ray between the pinhole and a point behind that texel could meet, up to
//! the nearest one that covers the texel whole: behind that, nothing is seen and no light arrives. Conservative throughout, by
//! margins far above rounding, so that a list finds exactly what the search tree would find.
//!
//! Haines and Greenberg, *The Light Buffer: A Shadow-Testing Accelerator* (1986), doi:10.1109/MCG.1986.276832.

mod polygon;

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::geometry::GpuScene;
use super::pairs::Pair;
use crate::error::Result;
use crate::gpu::Gpu;
use polygon::{Corner, InverseDepth, clip, covers, extent_in_band};

/// Marks a word of the raster as where a list is, and one of a list as not its last. As `LIST_CONTINUES` in
/// `shaders/shared/light_buffer.wgsl`.
const LIST_CONTINUES: u32 = 1 << 31;
/// In texels: rays this near to a texel count as its own.
const MARGIN: f64 = 1.0 / 32.0;
/// Relative: a triangle that is behind another one by less is not hidden.
const DEPTH_MARGIN: f64 = 1e-4;

/// Texels in a row of the raster for a scene of so many pairs of triangles, one on each side beyond the field of view. Lists are the shorter the
/// finer the raster, and the likelier in the cache the coarser it is.
pub(super) fn side(pairs: usize) -> u32 {
    // Measured on software Vulkan: see benches/README.md.
    (16 * (2 * pairs).isqrt()).next_power_of_two().clamp(128, 512) as u32
}

/// The lists on the device, by the field of view that they were made for.
#[derive(Default)]
pub(super) struct LightBuffers {
    made: HashMap<[u32; 2], wgpu::TextureView>,
}

impl LightBuffers {
    /// Of a scene seen from its pinhole; made when they are first asked for.
    pub(super) fn lists(
        &mut self,
        gpu: &Gpu,
        scene: &GpuScene,
        tangent: [f32; 2],
    ) -> Result<wgpu::TextureView> {
        let key = tangent.map(f32::to_bits);
        if let Some(made) = self.made.get(&key) {
            return Ok(made.clone());
        }
        let made =
            gpu.texel_array("lists of what the pinhole sees", &lists(&scene.pairs_in_order, tangent))?;
        self.made.insert(key, made.clone());
        Ok(made)
    }
}

/// A stand-in where no kernel looks: bindings may not be empty.
pub(super) fn none(gpu: &Gpu) -> Result<wgpu::TextureView> {
    gpu.texel_array("no lists of what the pinhole sees", &[])
}

/// Makes the lists, as `shaders/shared/light_buffer.wgsl` reads them. `pairs` are in the pinhole's frame (looking along −z) and in the order of
/// the search tree's leaves, `tangent` is half the extent of the image plane at distance 1.
fn lists(pairs: &[Pair], tangent: [f32; 2]) -> Vec<[u32; 4]> {
    let mut raster = Raster::new(pairs, tangent);
    for (index, pair) in (0..).zip(pairs) {
        for (_, corners) in pair.triangles() {
            raster.add(index, &corners.map(|corner| corner.as_dvec3()));
        }
    }
    raster.pack(pairs.len())
}

/// A triangle in a texel.
struct Entry {
    texel: u32,
    pair: u32,
    /// At most this near: 1 over its least depth there.
    nearest: f32,
}

struct Raster {
    /// Texels in a row.
    side: usize,
    scale: DVec2,
    near: f64,
    /// Everything as near to the pinhole as this may be seen anywhere.
    around: f64,
    entries: Vec<Entry>,
    everywhere: Vec<u32>,
    /// By texel: 1 over the greatest depth of the nearest triangle that covers it.
    covers: Vec<f32>,
}

impl Raster {
    fn new(pairs: &[Pair], tangent: [f32; 2]) -> Self {
        let corners = pairs.iter().flat_map(|pair| pair.corners);
        let extent = corners.map(|corner| corner.abs().max_element()).fold(0.0, f32::max);
        let near = 1e-5 * f64::from(extent);
        let tangent = DVec2::new(tangent[0].into(), tangent[1].into());
        let side = side(pairs.len()) as usize;
        Self {
            side,
            scale: 0.5 * (side - 2) as f64 / tangent,
            near,
            around: near * (1.0 + 4.0 * tangent.length_squared()).sqrt(),
            entries: Vec::new(),
            everywhere: Vec::new(),
            covers: vec![0.0; side * side],
        }
    }

    fn add(&mut self, pair: u32, corners: &[DVec3; 3]) {
        if corners.iter().all(|corner| corner.z > -self.near) {
            if self.touches_the_pinhole(corners) {
                self.everywhere.push(pair);
            }
            return;
        }
        let is_cut = corners.iter().any(|corner| corner.z > -self.near);
        if is_cut && self.touches_the_pinhole(corners) {
            self.everywhere.push(pair);
            return;
        }
        let seen: Vec<Corner> = clip(corners, self.near).iter().map(|corner| self.project(*corner)).collect();
        self.cover(pair, &seen);
    }

    /// Whether a triangle may come nearer to the pinhole than the near plane's corners: by its plane and its box.
    fn touches_the_pinhole(&self, [a, b, c]: &[DVec3; 3]) -> bool {
        let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
        let (low, high) = (a.min(*b).min(*c), a.max(*b).max(*c));
        let boxed =
            low.cmple(DVec3::splat(self.around)).all() && high.cmpge(DVec3::splat(-self.around)).all();
        boxed && normal.dot(*a).abs() <= self.around
    }

    fn project(&self, point: DVec3) -> Corner {
        let inverse = -1.0 / point.z;
        let image = DVec2::new(point.x, point.y) * inverse;
        Corner { at: image * self.scale + DVec2::splat(0.5 * self.side as f64), inverse }
    }

    /// Enters a convex polygon into every texel that it touches.
    fn cover(&mut self, pair: u32, polygon: &[Corner]) {
        let Some(plane) = InverseDepth::through(polygon) else { return };
        let vertices = || polygon.iter().map(|corner| corner.inverse);
        let (deepest, nearest) = (vertices().fold(f64::INFINITY, f64::min), vertices().fold(0.0, f64::max));
        let ys = || polygon.iter().map(|corner| corner.at.y);
        let Some(rows) =
            texels(self.side, ys().fold(f64::INFINITY, f64::min), ys().fold(f64::NEG_INFINITY, f64::max))
        else {
            return;
        };
        for row in rows {
            let Some((left, right)) = extent_in_band(polygon, row as f64 - MARGIN, row as f64 + 1.0 + MARGIN)
            else {
                continue;
            };
            let Some(columns) = texels(self.side, left, right) else { continue };
            for column in columns {
                let texel = row * self.side + column;
                let (low, high) = plane.over(column, row);
                if covers(polygon, column, row) {
                    let farthest = (low.max(deepest) * (1.0 - DEPTH_MARGIN)) as f32;
                    self.covers[texel] = self.covers[texel].max(farthest);
                }
                let nearest = (high.min(nearest) * (1.0 + DEPTH_MARGIN)) as f32;
                if nearest >= self.covers[texel] {
                    self.entries.push(Entry { texel: texel as u32, pair, nearest });
                }
            }
        }
    }

    /// The lists without what is hidden, nearest first, each of `pairs` pairs once.
    fn pack(mut self, pairs: usize) -> Vec<[u32; 4]> {
        self.entries.retain(|entry| entry.nearest >= self.covers[entry.texel as usize]);
        self.entries.sort_unstable_by(|a, b| {
            (a.texel, b.nearest, a.pair)
                .partial_cmp(&(b.texel, a.nearest, b.pair))
                // Depths are finite: vertices lie behind the near plane.
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        let raster = self.side * self.side;
        let mut words = vec![0_u32; raster];
        let mut entries = self.entries.iter().peekable();
        let mut list = Vec::new();
        // By pair: the last texel, counted from 1, whose list has it.
        let mut listed_in = vec![0; pairs];
        for texel in 0..raster {
            list.clear();
            while let Some(entry) = entries.next_if(|entry| entry.texel as usize == texel) {
                list.push(entry.pair);
            }
            list.extend(&self.everywhere);
            list.retain(|&pair| std::mem::replace(&mut listed_in[pair as usize], texel + 1) <= texel);
            words[texel] = match list[..] {
                [] => LIST_CONTINUES,
                [only] => only,
                [ref others @ .., last] => {
                    // The texture's limit is far below 2³¹ words, and is checked when it is made.
                    let begin = words.len() as u32;
                    words.extend(others.iter().map(|pair| pair | LIST_CONTINUES));
                    words.push(last);
                    begin | LIST_CONTINUES
                }
            };
        }
        words.resize(words.len().next_multiple_of(4), 0);
        words.as_chunks::<4>().0.to_vec()
    }
}

/// The texels of one axis that a stretch touches, with the margin; none where it lies beside the raster.
fn texels(side: usize, low: f64, high: f64) -> Option<std::ops::RangeInclusive<usize>> {
    let (low, high) = (low - MARGIN, high + MARGIN);
    if !(low < side as f64 && high >= 0.0) {
        return None;
    }
    Some(low.max(0.0) as usize..=(high as usize).min(side - 1))
}
