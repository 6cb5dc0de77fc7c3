//! The light buffer lists the pairs of triangles that are visible from the pinhole that camera and projector share. The image plane is
//! divided into a raster of texels, and each texel has a list.
//!
//! The list of a texel holds the pairs of all triangles that a ray between the pinhole and a point behind the texel could hit, up to the
//! nearest triangle that covers the whole texel. Nothing behind that triangle is visible or lit. The lists are conservative, with margins
//! far above rounding errors, so a ray finds exactly the same hit as with the search tree.
//!
//! Haines and Greenberg, *The Light Buffer: A Shadow-Testing Accelerator* (1986), doi:10.1109/MCG.1986.276832.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::geometry::GpuScene;
use super::pairs::Pair;
use crate::error::Result;
use crate::gpu::Gpu;

/// This bit marks a raster word that is the index of a list, and each word of a list except its last word. It is `LIST_CONTINUES` in
/// `shaders/shared/light_buffer.wgsl`.
const LIST_CONTINUES: u32 = 1 << 31;
/// The margin around a texel, in texels. Rays within the margin count as rays through the texel.
const MARGIN: f64 = 1.0 / 32.0;
/// The relative margin of depths. A triangle is hidden only if it lies behind another triangle by more than this.
const DEPTH_MARGIN: f64 = 1e-4;

/// The maximum number of texels that all triangles touch together. Making lists of this size takes a few seconds. A scene that exceeds this
/// number has thousands of triangles behind each other, and traces faster with a search tree than with such long lists.
const MAX_TOUCHED: usize = 1 << 26;

/// The number of texels in a row of the raster, for a scene with this number of pairs. One texel on each side lies outside the field of
/// view. A fine raster has short lists, and a coarse raster stays in the cache.
fn light_buffer_side(pairs: usize) -> u32 {
    // Measurements on software Vulkan: guide/src/right/speed.md.
    (16 * (2 * pairs).isqrt()).next_power_of_two().clamp(128, 512) as u32
}

#[derive(Default)]
pub(super) struct LightBuffers {
    made: HashMap<[u32; 2], (wgpu::TextureView, u32)>,
}

impl LightBuffers {
    /// The light buffer, which is made at first use, and the number of texels in a row of its raster. `tangent` is half the extent of the
    /// image plane at distance 1. If the lists would be too long, the light buffer is a placeholder without texels.
    pub(super) fn lists(
        &mut self,
        gpu: &Gpu,
        scene: &GpuScene,
        tangent: [f32; 2],
    ) -> Result<(wgpu::TextureView, u32)> {
        let key = tangent.map(f32::to_bits);
        if let Some(made) = self.made.get(&key) {
            return Ok(made.clone());
        }
        let made = match lists(&scene.pairs_in_order, tangent, MAX_TOUCHED) {
            Some(words) => {
                (gpu.texel_array("light buffer", &words)?, light_buffer_side(scene.pairs_in_order.len()))
            }
            None => (no_light_buffer(gpu)?, 0),
        };
        self.made.insert(key, made.clone());
        Ok(made)
    }
}

/// A placeholder for kernels without a light buffer, because a binding must not be empty.
pub(super) fn no_light_buffer(gpu: &Gpu) -> Result<wgpu::TextureView> {
    gpu.texel_array("empty light buffer", &[])
}

/// The words of a light buffer, as `shaders/shared/light_buffer.wgsl` reads them. `pairs` are in the frame of the pinhole, which looks
/// along −z, and in the order of the search tree's leaves. `tangent` is half the extent of the image plane at distance 1. The result is
/// `None` if triangles touch more than `most` texels in total.
fn lists(pairs: &[Pair], tangent: [f32; 2], most: usize) -> Option<Vec<[u32; 4]>> {
    let mut raster = Raster::new(pairs, tangent);
    for (index, pair) in (0..).zip(pairs) {
        for (_, corners) in pair.triangles() {
            raster.add(index, &corners.map(|corner| corner.as_dvec3()));
            if raster.touched > most {
                return None;
            }
        }
    }
    Some(raster.pack(pairs.len()))
}

struct Entry {
    texel: u32,
    pair: u32,
    /// An upper bound of 1/depth of the triangle in the texel.
    nearest: f32,
}

struct Raster {
    side: usize,
    /// The number of texels per unit of the image plane.
    scale: DVec2,
    near: f64,
    /// If a triangle comes closer to the pinhole than this, it may be visible in any texel.
    around: f64,
    entries: Vec<Entry>,
    /// The number of texels that triangles have touched so far. A texel counts once for every triangle that touches it.
    touched: usize,
    /// Pairs that belong to the list of every texel.
    everywhere: Vec<u32>,
    /// For each texel, 1/depth at the farthest point of the nearest triangle that covers it; 0 if no triangle covers it.
    covers: Vec<f32>,
}

impl Raster {
    fn new(pairs: &[Pair], tangent: [f32; 2]) -> Self {
        let corners = pairs.iter().flat_map(|pair| pair.corners);
        let extent = corners.map(|corner| corner.abs().max_element()).fold(0.0, f32::max);
        let near = 1e-5 * f64::from(extent);
        let tangent = DVec2::new(tangent[0].into(), tangent[1].into());
        let side = light_buffer_side(pairs.len()) as usize;
        Self {
            side,
            scale: 0.5 * (side - 2) as f64 / tangent,
            near,
            around: near * (1.0 + 4.0 * tangent.length_squared()).sqrt(),
            entries: Vec::new(),
            touched: 0,
            everywhere: Vec::new(),
            covers: vec![0.0; side * side],
        }
    }

    fn add(&mut self, pair: u32, corners: &[DVec3; 3]) {
        let before = corners.iter().filter(|corner| corner.z > -self.near).count();
        if before > 0 && self.touches_the_pinhole(corners) {
            self.everywhere.push(pair);
            return;
        }
        if before == corners.len() {
            return;
        }
        let seen: Vec<Corner> = clip(corners, self.near).iter().map(|corner| self.project(*corner)).collect();
        self.cover(pair, &seen);
    }

    /// Whether a triangle may come closer to the pinhole than the corners of the near plane. Its plane and its bounding box decide.
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

    /// Adds a triangle to every texel that its convex image touches.
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
            self.touched += columns.clone().count();
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

    /// The words of all lists, without hidden triangles. Each list starts with its nearest pair, and contains each pair at most once.
    fn pack(mut self, pairs: usize) -> Vec<[u32; 4]> {
        self.entries.retain(|entry| entry.nearest >= self.covers[entry.texel as usize]);
        self.entries.sort_unstable_by(|a, b| {
            (a.texel, b.nearest, a.pair)
                .partial_cmp(&(b.texel, a.nearest, b.pair))
                // All depths are finite, because all vertices lie behind the near plane.
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        let raster = self.side * self.side;
        let mut words = vec![0_u32; raster];
        let mut entries = self.entries.iter().peekable();
        let mut list = Vec::new();
        // For each pair, the last texel whose list contains it. Texels are counted from 1.
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
                    // The size limit of the texture is far below 2³¹ words, and is checked when the texture is made.
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

/// The range of texels along one axis that an interval with the margin touches; `None` if it lies outside the raster.
fn texels(side: usize, low: f64, high: f64) -> Option<std::ops::RangeInclusive<usize>> {
    let (low, high) = (low - MARGIN, high + MARGIN);
    if !(low < side as f64 && high >= 0.0) {
        return None;
    }
    Some(low.max(0.0) as usize..=(high as usize).min(side - 1))
}

#[derive(Clone, Copy)]
struct Corner {
    at: DVec2,
    /// 1/depth of the corner. Over the image of a plane, 1/depth is linear.
    inverse: f64,
}

/// The part of a triangle with a depth of at least `near`.
fn clip(corners: &[DVec3; 3], near: f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(4);
    for (index, &from) in corners.iter().enumerate() {
        let to = corners[(index + 1) % 3];
        let inside = |point: DVec3| point.z <= -near;
        if inside(from) {
            kept.push(from);
        }
        if inside(from) != inside(to) {
            kept.push(from.lerp(to, (-near - from.z) / (to.z - from.z)));
        }
    }
    kept
}

/// The least and the greatest x of a convex polygon within `low ≤ y ≤ high`; `None` if the polygon does not reach that band.
fn extent_in_band(polygon: &[Corner], low: f64, high: f64) -> Option<(f64, f64)> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut reach = |x: f64| {
        left = left.min(x);
        right = right.max(x);
    };
    for (index, corner) in polygon.iter().enumerate() {
        let (from, to) = (corner.at, polygon[(index + 1) % polygon.len()].at);
        if (low..=high).contains(&from.y) {
            reach(from.x);
        }
        for level in [low, high] {
            if (from.y < level) != (to.y < level) {
                reach(from.x + (to.x - from.x) * (level - from.y) / (to.y - from.y));
            }
        }
    }
    (left <= right).then_some((left, right))
}

/// Whether a texel, including its margin, lies inside a convex polygon.
fn covers(polygon: &[Corner], column: usize, row: usize) -> bool {
    let [left, top] = [column, row].map(|index| index as f64 - MARGIN);
    let [right, bottom] = [column, row].map(|index| index as f64 + 1.0 + MARGIN);
    let (mut all_left, mut all_right) = (true, true);
    for (index, corner) in polygon.iter().enumerate() {
        let edge = polygon[(index + 1) % polygon.len()].at - corner.at;
        for (x, y) in [(left, top), (right, top), (left, bottom), (right, bottom)] {
            // NaN counts for neither side, so the texel is then not covered.
            let side = edge.perp_dot(DVec2::new(x, y) - corner.at);
            all_left &= side < 0.0;
            all_right &= side > 0.0;
        }
    }
    all_left || all_right
}

/// 1/depth of a plane, as a linear function of raster coordinates.
struct InverseDepth {
    at: DVec2,
    value: f64,
    gradient: DVec2,
}

impl InverseDepth {
    /// The function through the corners of a polygon. Seen edge-on, the polygon has an infinite gradient and covers no texel.
    fn through(polygon: &[Corner]) -> Option<Self> {
        let first = polygon.first()?;
        let mut best = Self { at: first.at, value: first.inverse, gradient: DVec2::ZERO };
        let mut largest = 0.0;
        for pair in polygon[1..].windows(2) {
            let [a, b] = [pair[0].at - first.at, pair[1].at - first.at];
            let area = a.perp_dot(b);
            if area.abs() > largest {
                largest = area.abs();
                let [da, db] = [pair[0].inverse - first.inverse, pair[1].inverse - first.inverse];
                best.gradient = DVec2::new(da * b.y - db * a.y, db * a.x - da * b.x) / area;
            }
        }
        if largest < 1e-9 || !best.gradient.is_finite() {
            // The polygon is seen nearly edge-on, so its gradient has no meaning. The depth of its nearest corner is used everywhere.
            best.gradient = DVec2::splat(f64::INFINITY);
        }
        Some(best)
    }

    /// The least and the greatest value of 1/depth over a texel with its margin.
    fn over(&self, column: usize, row: usize) -> (f64, f64) {
        if !self.gradient.is_finite() {
            return (0.0, f64::INFINITY);
        }
        let centre = DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
        let middle = self.value + self.gradient.dot(centre - self.at);
        let reach = (self.gradient.x.abs() + self.gradient.y.abs()) * (0.5 + MARGIN);
        (middle - reach, middle + reach)
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn too_many_triangles_behind_each_other_get_no_lists() {
        let triangle = [vec3(0.0, 0.0, -1.0), vec3(1.0, 0.0, -1.0), vec3(0.0, 1.0, -1.0)];
        let one = [Pair::alone(0, triangle)];
        let touched = {
            let mut raster = Raster::new(&one, [1.0; 2]);
            raster.add(0, &triangle.map(|corner| corner.as_dvec3()));
            raster.touched
        };
        assert!(touched > 1000, "a quarter of 128x128 texels, halved: {touched}");
        assert!(lists(&one, [1.0; 2], touched).is_some());
        assert!(lists(&one, [1.0; 2], touched - 1).is_none());
    }
}
