//! Triangles and their vertex attributes.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;

/// A triangle. Its front is the side from which the corners appear counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Triangle {
    /// Corners in metres.
    pub positions: [Vec3; 3],
    /// Unit shading normals at the corners; zero if the file gives none. They affect only the BSDF: every cosine uses the geometric normal.
    pub normals: [Vec3; 3],
    /// Two sets of texture coordinates at each corner, as in the file; zero if the file gives none.
    pub texcoords: [[Vec2; 2]; 3],
    /// Linear colour and opacity at the corners. They multiply the material's colour and opacity; 65535 stands for 1.
    pub colors: [[u16; 4]; 3],
    /// Index into [`crate::scene::Scene::materials`].
    pub material: u32,
    /// Index into [`crate::scene::Scene::regions`].
    pub region: u32,
}

/// The largest number of triangles in a scene. The limit is needed because a small file can place one mesh any number of times.
pub(super) const MAX_TRIANGLES: usize = 1 << 24;

/// The largest absolute value of a coordinate, in metres. For larger values, the square of an area overflows single precision.
pub(super) const MAX_COORDINATE: f32 = 1e9;

/// The smallest ratio of a triangle's height to its longest edge. Below it, the area is lost in the rounding of single precision.
const MIN_HEIGHT_TO_EDGE: f64 = 1e-7;

impl Triangle {
    /// White with full opacity. This vertex colour leaves the material's colour unchanged.
    pub const WHITE: [u16; 4] = [u16::MAX; 4];

    /// A flat triangle without texture coordinates or colours.
    pub fn flat(positions: [Vec3; 3], material: u32, region: u32) -> Self {
        Self {
            positions,
            normals: [Vec3::ZERO; 3],
            texcoords: [[Vec2::ZERO; 2]; 3],
            colors: [Self::WHITE; 3],
            material,
            region,
        }
    }

    /// Quantizes a linear colour with its opacity to 16 bits a channel. Values outside `[0, 1]` are clamped, and NaN becomes 0.
    pub fn quantized(color: [f32; 4]) -> [u16; 4] {
        color.map(|channel| (channel.clamp(0.0, 1.0) * 65535.0).round() as u16)
    }

    pub(super) fn flipped(mut self) -> Self {
        self.positions.swap(1, 2);
        self.normals.swap(1, 2);
        self.texcoords.swap(1, 2);
        self.colors.swap(1, 2);
        self
    }

    /// Flips shading normals that point to the triangle's back. Some exporters flip only the corners, or only the normals.
    pub(super) fn with_normals_in_front(mut self) -> Self {
        let [a, b, c] = self.positions;
        let sum: Vec3 = self.normals.iter().sum();
        if sum.dot((b - a).cross(c - a)) < 0.0 {
            self.normals = self.normals.map(|normal| -normal);
        }
        self
    }

    /// Whether the triangle has an area that single precision can represent.
    pub(super) fn has_area(&self) -> bool {
        let [a, b, c] = self.positions.map(|position| position.as_dvec3());
        let longest = [b - a, c - b, a - c].map(|edge| edge.length_squared()).into_iter().fold(0.0, f64::max);
        // Twice the area is the longest edge times the height above this edge.
        (b - a).cross(c - a).length() > MIN_HEIGHT_TO_EDGE * longest
    }
}

/// The unit vector of a direction; zero if it has none. A unit vector in single precision stays as it is, so that it can be written to a
/// file and read again.
pub(super) fn unit(direction: DVec3) -> Vec3 {
    let rounded = direction.as_vec3();
    // The rounding of three components changes the squared length by less than this.
    let is_unit = (direction.length_squared() - 1.0).abs() < 5e-7;
    if is_unit && rounded.as_dvec3() == direction { rounded } else { direction.normalize_or_zero().as_vec3() }
}

/// Drops every triangle that equals an earlier triangle. Exporters write such triangles for an object that was duplicated in place. A ray
/// would have to test each copy, and software Vulkan silently ends an invocation after 65,535 tests. Returns the number of dropped
/// triangles.
pub(super) fn drop_repeated(triangles: &mut Vec<Triangle>) -> usize {
    // Only triangles with the same 64-bit hash of the corners are compared. The list of hashes needs a tenth of the triangles' memory. A
    // hash table of triangles would need as much memory as the triangles.
    let mut order: Vec<(u64, u32)> = triangles
        .par_iter()
        .enumerate()
        // A loaded scene has fewer triangles than 2³².
        .map(|(index, triangle)| (hash(&turned(triangle).positions), index as u32))
        .collect();
    order.par_sort_unstable();
    let mut is_repeated = vec![false; triangles.len()];
    for alike in order.chunk_by(|a, b| a.0 == b.0) {
        let [(_, first), rest @ ..] = alike else { continue };
        let first = turned(&triangles[*first as usize]);
        for &(_, index) in rest {
            is_repeated[index as usize] = turned(&triangles[index as usize]) == first;
        }
    }
    let before = triangles.len();
    let mut is_repeated = is_repeated.into_iter();
    triangles.retain(|_| is_repeated.next() != Some(true));
    before - triangles.len()
}

/// Rotates the corners so that the smallest corner is first. Triangles with the same cyclic order of corners are then equal.
fn turned(triangle: &Triangle) -> Triangle {
    let key = |corner: usize| triangle.positions[corner].to_array().map(order);
    let least = (0..3).min_by_key(|&corner| key(corner)).unwrap_or_default();
    Triangle {
        positions: from(least, triangle.positions),
        normals: from(least, triangle.normals),
        texcoords: from(least, triangle.texcoords),
        colors: from(least, triangle.colors),
        ..*triangle
    }
}

fn from<T: Copy>(first: usize, values: [T; 3]) -> [T; 3] {
    [0, 1, 2].map(|at| values[(first + at) % 3])
}

/// A number that orders coordinates. Any order is suitable in which 0 and −0 are equal.
fn order(coordinate: f32) -> u32 {
    (coordinate + 0.0).to_bits()
}

fn hash(corners: &[Vec3; 3]) -> u64 {
    let mut hasher = DefaultHasher::new();
    corners.map(|corner| corner.to_array().map(order)).hash(&mut hasher);
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn a_triangle_whose_corners_are_collinear_in_single_precision_has_no_area() {
        let has_area = |positions| Triangle::flat(positions, 0, 0).has_area();
        let small = [vec3(0.0, 0.0, 0.0), vec3(1e-12, 0.0, 0.0), vec3(0.0, 1e-12, 0.0)];
        assert!(has_area(small), "a small triangle is not degenerate");
        let point = [vec3(1.0, 2.0, 3.0); 3];
        assert!(!has_area(point));
        let collinear = [vec3(0.1, 0.1, 0.1), vec3(0.2, 0.2, 0.2), vec3(0.7, 0.7, 0.7)];
        assert!(!has_area(collinear));
        let sliver = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.5, 1e-6, 0.0)];
        assert!(has_area(sliver));
    }

    const CORNERS: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn only_triangles_that_are_equal_in_all_are_dropped() {
        let [a, b, c] = CORNERS;
        let flat = |corners, material, region| Triangle::flat(corners, material, region);
        let bent = Triangle { normals: [Vec3::Z; 3], ..flat(CORNERS, 0, 0) };
        let mut triangles = vec![
            flat(CORNERS, 0, 0),
            flat([b, c, a], 0, 0),
            flat([c, a, b], 0, 0),
            // The variants differ from the first triangle in orientation, material, region, a normal, and position.
            flat([a, c, b], 0, 0),
            flat(CORNERS, 1, 0),
            flat(CORNERS, 0, 7),
            bent,
            flat([a, b, c + Vec3::Z], 0, 0),
            flat([a, b, Vec3::new(-0.0, 1.0, 0.0)], 0, 0),
        ];
        let kept: Vec<Triangle> = [0, 3, 4, 5, 6, 7].map(|at: usize| triangles[at]).to_vec();
        assert_eq!(drop_repeated(&mut triangles), 3);
        assert_eq!(triangles, kept);
    }

    #[test]
    fn attributes_turn_with_the_corners() {
        let [a, b, c] = CORNERS;
        let colors = [[1, 0, 0, 9], [2, 0, 0, 9], [3, 0, 0, 9]];
        let painted = Triangle { colors, ..Triangle::flat([a, b, c], 0, 0) };
        let [red, green, blue] = colors;
        let turned = Triangle { colors: [green, blue, red], ..Triangle::flat([b, c, a], 0, 0) };
        let swapped = Triangle { colors: [red, green, blue], ..Triangle::flat([b, c, a], 0, 0) };
        let mut triangles = vec![painted, turned, swapped];
        assert_eq!(drop_repeated(&mut triangles), 1);
        assert_eq!(triangles, [painted, swapped]);
    }
}
