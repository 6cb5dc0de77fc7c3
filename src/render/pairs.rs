//! Pairs of triangles that share an edge. A ray tests both triangles of a pair at once, with four corners instead of six.
//!
//! Embree and ray tracing hardware take quadrilaterals from the mesh for the same purpose. Here any two
//! neighbouring triangles can become a pair.

use glam::{DVec3, Vec3};

use super::materials::NONE;
use crate::scene::Triangle;

/// The pinhole sees a triangle edge-on if the sine of the angle between the line of sight and the triangle's plane is below this value.
/// Rounding would then decide which side of the triangle the pinhole sees.
const EDGE_ON: f64 = 1e-4;

/// The maximum surface area of a pair's bounding box, relative to the sum of the surface areas of both triangles' bounding boxes. The
/// halves of a parallelogram have a ratio of 0.5 to 0.6. With a limit of 1 instead of 0.6 to 0.8, rays took 3 to 7 % longer.
const CLOSE: f64 = 0.75;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Pair {
    /// The first triangle has the corners 0, 1, 2, and the second triangle the corners 0, 2, 3. For a single triangle, corner 3 equals
    /// corner 0, so the second triangle has no area and no ray hits it.
    pub(super) corners: [Vec3; 4],
    first: Rotated,
    second: Option<Rotated>,
}

/// A triangle of the scene whose corners are rotated so that corner `by` comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rotated {
    pub(super) index: usize,
    pub(super) by: usize,
}

impl Pair {
    pub(super) fn alone(index: usize, [a, b, c]: [Vec3; 3]) -> Self {
        Self { corners: [a, b, c, a], first: Rotated { index, by: 0 }, second: None }
    }

    /// The pair of two triangles that share an edge: edge `edge` of the first triangle, and edge `other_edge` of the second.
    fn across(
        (index, corners, edge): (usize, [Vec3; 3], usize),
        (other, others, other_edge): (usize, [Vec3; 3], usize),
    ) -> Self {
        // The shared edge runs from corner 2 to corner 0 of the first triangle, and from corner 0 to corner 1 of the second.
        let (first, second) =
            (Rotated { index, by: (edge + 1) % 3 }, Rotated { index: other, by: other_edge });
        let ([a, b, c], [_, _, d]) = (first.corners(corners), second.corners(others));
        Self { corners: [a, b, c, d], first, second: Some(second) }
    }

    pub(super) fn triangles(&self) -> impl Iterator<Item = (Rotated, [Vec3; 3])> {
        let [a, b, c, d] = self.corners;
        [Some((self.first, [a, b, c])), self.second.map(|second| (second, [a, c, d]))].into_iter().flatten()
    }

    pub(super) fn extent(&self) -> [Vec3; 2] {
        let [a, b, c, d] = self.corners;
        [a.min(b).min(c.min(d)), a.max(b).max(c.max(d))]
    }
}

impl Rotated {
    fn corners<T: Copy>(self, [a, b, c]: [T; 3]) -> [T; 3] {
        [[a, b, c], [b, c, a], [c, a, b]][self.by]
    }

    pub(super) fn of(self, triangles: &[Triangle]) -> Triangle {
        let triangle = triangles[self.index];
        Triangle {
            positions: self.corners(triangle.positions),
            normals: self.corners(triangle.normals),
            texcoords: self.corners(triangle.texcoords),
            colors: self.corners(triangle.colors),
            ..triangle
        }
    }
}

/// Pairs up the triangles of a scene. `corners` are their corners in the pinhole's frame.
///
/// Each triangle is paired with the unpaired neighbour that gives the smallest common bounding box, if this box is small relative to the
/// triangles' own boxes. The pinhole must see both triangles from the same side, so that neither hides the other.
pub(super) fn pair_up(triangles: &[Triangle], corners: &[[Vec3; 3]]) -> Vec<Pair> {
    let neighbours = neighbours(corners);
    let equal = |a: usize, b: usize| {
        let (a, b) = (&triangles[a], &triangles[b]);
        (a.material, a.region) == (b.material, b.region)
    };
    let mut taken = vec![false; corners.len()];
    let mut pairs = Vec::with_capacity(corners.len().div_ceil(2));
    for (index, &own) in corners.iter().enumerate() {
        if std::mem::replace(&mut taken[index], true) {
            continue;
        }
        let alone = Pair::alone(index, own);
        let candidates = (0..3).filter_map(|edge| {
            let across = neighbours[3 * index + edge];
            if across == NONE {
                return None;
            }
            let (other, other_edge) = (across as usize / 3, across as usize % 3);
            if taken[other] || !equal(index, other) || seen_from(&own) * seen_from(&corners[other]) <= 0.0 {
                return None;
            }
            let both = Pair::across((index, own, edge), (other, corners[other], other_edge));
            let room = half_area(both.extent());
            let apart = half_area(alone.extent()) + half_area(Pair::alone(other, corners[other]).extent());
            (room <= CLOSE * apart).then_some((room, other, both))
        });
        let best = candidates.min_by(|(a, ..), (b, ..)| a.total_cmp(b));
        pairs.push(match best {
            Some((_, other, both)) => {
                taken[other] = true;
                both
            }
            None => alone,
        });
    }
    pairs
}

/// The side of a triangle that the pinhole at the origin sees: 1 or −1, or 0 if the pinhole sees the triangle edge-on.
fn seen_from(corners: &[Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let sine = a.normalize_or_zero().dot((b - a).cross(c - a).normalize_or_zero());
    if sine.abs() < EDGE_ON { 0.0 } else { sine.signum() }
}

fn half_area([low, high]: [Vec3; 2]) -> f64 {
    let DVec3 { x, y, z } = (high - low).as_dvec3();
    x * y + y * z + z * x
}

/// For each edge, an edge of another triangle that runs in the opposite direction, or `NONE`. Edge `3 · triangle + corner` runs from this
/// corner to the next corner of the triangle.
fn neighbours(corners: &[[Vec3; 3]]) -> Vec<u32> {
    let ends = |edge: u32| {
        let (corners, from) = (corners[edge as usize / 3], edge as usize % 3);
        [corners[from], corners[(from + 1) % 3]]
    };
    // Three times the maximum number of triangles is far below 2³².
    let count = 3 * corners.len() as u32;
    let mut edges: Vec<(u64, u32)> = (0..count)
        .map(|edge| {
            let [from, to] = ends(edge).map(hash);
            (from.wrapping_add(to), edge)
        })
        .collect();
    edges.sort_unstable();
    let mut neighbours = vec![NONE; edges.len()];
    for both in edges.windows(2) {
        let [one, other] = [both[0].1, both[1].1];
        let [from, to] = ends(one);
        if ends(other) == [to, from] && neighbours[one as usize] == NONE {
            neighbours[one as usize] = other;
            neighbours[other as usize] = one;
        }
    }
    neighbours
}

/// A hash of the bits of a point. It is used only to sort equal edges next to each other.
fn hash(point: Vec3) -> u64 {
    let word = |value: f32| u64::from(value.to_bits());
    // The odd multipliers come from linear congruential generators (Steele and Vigna 2021). Then the upper half is folded into the lower.
    let mixed = (word(point.x).wrapping_mul(0xd134_2543_de82_ef95))
        .wrapping_add(word(point.y))
        .wrapping_mul(0xaf25_1af3_b0f0_25b5)
        .wrapping_add(word(point.z))
        .wrapping_mul(0xd134_2543_de82_ef95);
    mixed ^ (mixed >> 32)
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, vec3};

    use super::*;

    /// A triangle in front of the pinhole. The pinhole looks along −z.
    fn triangle(corners: [[f32; 2]; 3]) -> Triangle {
        Triangle::flat(corners.map(|[x, y]| vec3(x, y, -2.0)), 0, 0)
    }

    fn paired(triangles: &[Triangle]) -> Vec<Pair> {
        let corners: Vec<_> = triangles.iter().map(|triangle| triangle.positions).collect();
        pair_up(triangles, &corners)
    }

    const LOWER: [[f32; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]];
    const UPPER: [[f32; 2]; 3] = [[1.0, 1.0], [0.0, 1.0], [0.0, 0.0]];

    #[test]
    fn neighbours_make_a_pair_whichever_corner_comes_first() {
        for turn in 0..3 {
            let mut lower = LOWER;
            lower.rotate_left(turn);
            let triangles = [triangle(lower), triangle(UPPER)];
            let pairs = paired(&triangles);
            assert_eq!(pairs.len(), 1);
            let pair = &pairs[0];
            assert_eq!(pair.triangles().count(), 2);
            for (rotated, corners) in pair.triangles() {
                assert_eq!(rotated.of(&triangles).positions, corners);
            }
            let square = [LOWER[0], LOWER[1], LOWER[2], UPPER[1]];
            assert_eq!(pair.corners.map(|corner| corner.truncate().to_array()), square);
        }
    }

    #[test]
    fn no_pair_of_what_is_not_alike_or_lies_apart_or_may_hide_each_other() {
        let lower = triangle(LOWER);
        let alone = |what: &str, other: Triangle| {
            let pairs = paired(&[lower, other]);
            assert!(pairs.len() == 2 && pairs.iter().all(|pair| pair.second.is_none()), "{what}: {pairs:?}");
        };
        let upper = triangle(UPPER);
        alone("another material", Triangle { material: 1, ..upper });
        alone("another region", Triangle { region: 1, ..upper });
        alone("the front on the other side", triangle([UPPER[0], UPPER[2], UPPER[1]]));
        alone("one corner in common", triangle([UPPER[0], UPPER[1], [-0.1, 0.0]]));
        alone("much room", triangle([UPPER[0], [-9.0, 9.0], UPPER[2]]));
        let mut folded = upper;
        folded.positions[1] = vec3(0.9, 0.1, -3.0);
        alone("the pinhole sees one from behind, before the other", folded);
        let mut edge_on = upper;
        edge_on.positions[1] = 2.0 * upper.positions[0];
        alone("the pinhole sees one edge-on", edge_on);
    }

    #[test]
    fn each_triangle_is_in_one_pair_with_all_its_corner_attributes() {
        let mut triangles = crate::scene::builtin::tessellated_box(1000).triangles;
        for (index, triangle) in triangles.iter_mut().enumerate() {
            triangle.texcoords = [0, 1, 2].map(|corner| [Vec2::new(index as f32, corner as f32); 2]);
        }
        let pairs = paired(&triangles);
        assert!(pairs.len() < 520, "{} pairs of {} triangles", pairs.len(), triangles.len());
        let mut seen = vec![0; triangles.len()];
        for pair in &pairs {
            for (rotated, corners) in pair.triangles() {
                seen[rotated.index] += 1;
                let (before, after) = (triangles[rotated.index], rotated.of(&triangles));
                assert_eq!(after.positions, corners);
                for corner in 0..3 {
                    let was = (corner + rotated.by) % 3;
                    assert_eq!(after.positions[corner], before.positions[was]);
                    assert_eq!(after.texcoords[corner], before.texcoords[was]);
                }
            }
        }
        assert!(seen.iter().all(|&times| times == 1));
    }
}
