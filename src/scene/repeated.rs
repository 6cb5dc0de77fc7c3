//! Triangles that repeat another one exactly. They change nothing that is seen, but a ray has to test each of them, and software
//! Vulkan ends an invocation after 65,535 tests without a word. Exporters write them where an object was duplicated in place.

use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};

use glam::Vec3;
use rayon::prelude::*;

use super::Triangle;

/// Drops every triangle that has the corners, the region and all else of an earlier one. Returns how many were dropped.
pub(super) fn drop_repeated(triangles: &mut Vec<Triangle>) -> usize {
    // One hash of 64 bits stands for the corners; triangles with the same one are compared. The list takes a tenth of the memory of the triangles,
    // which a table of them would double.
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

/// The triangle with its least corner first, so that triangles whose corners are listed from different ones on are equal.
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

/// A number that orders coordinates; which order it is does not matter, but 0 and −0 are equal.
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
    use super::*;

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
            // The back, another material, a region, a normal, and another place.
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
