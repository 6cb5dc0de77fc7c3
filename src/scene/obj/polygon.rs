//! Splits polygons of any number of corners, convex or not, into triangles.

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;
use glam::Vec3;

/// The largest fraction of a polygon's area that rounding may remove or add. If a polygon crosses itself, the difference is larger.
const ROUNDING: f64 = 1e-6;

/// The largest number of corners that are left to earcut. Its run time grows more than quadratically for polygons that cross themselves.
const MAX_EARCUT: usize = 128;

/// The largest number of corners that are examined while ears are cut off, divided by the number of corners of the polygon. This limit
/// keeps the run time proportional to the size of the file.
const MAX_LOOKS: usize = 1 << 11;

/// Splits polygons. One triangulator can be used for many polygons, so that buffers are reused.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    points: Vec<[f64; 3]>,
    /// The corners, counter-clockwise, projected onto the plane that fits the polygon best.
    flat: Vec<[f64; 2]>,
    indices: Vec<u32>,
    /// The number of polygons that cross themselves or have no area. Their triangles may not cover them exactly.
    pub(super) unclear: usize,
}

impl Triangulator {
    /// Splits a polygon with at least three corners. The triangles are indices of its corners and have its orientation.
    pub(super) fn split(&mut self, corners: impl IntoIterator<Item = Vec3>) -> Vec<[usize; 3]> {
        self.points.clear();
        self.points.extend(corners.into_iter().map(|corner| corner.as_dvec3().to_array()));
        let fan: Vec<_> = (2..self.points.len()).map(|at| [0, at - 1, at]).collect();
        if fan.len() <= 1 {
            return fan;
        }
        if !self.flatten() {
            self.unclear += 1;
            return fan;
        }
        // A convex quad keeps the diagonal at its first corner. With more corners, a fan would consist of slivers.
        if fan.len() == 2 && fan.iter().all(|&triangle| self.area(triangle) > 0.0) {
            return fan;
        }
        self.indices.clear();
        let left = self.cut_ears();
        if left.len() <= MAX_EARCUT {
            let flat: Vec<_> = left.iter().map(|&corner| self.flat[corner]).collect();
            let mut of_left: Vec<u32> = Vec::new();
            self.earcut.earcut_slice(&flat, &[], &mut of_left);
            self.indices.extend(of_left.iter().map(|&corner| left[corner as usize] as u32));
        } else {
            let fan = left.windows(2).skip(1).flat_map(|pair| [left[0], pair[0], pair[1]]);
            self.indices.extend(fan.map(|corner| corner as u32));
        }
        let difference = earcut::deviation(self.flat.iter().copied(), &[], &self.indices);
        if self.indices.is_empty() || difference > ROUNDING {
            self.unclear += 1;
        }
        if self.indices.is_empty() {
            return fan;
        }
        let triangles = self.indices.as_chunks().0.iter().map(|&[a, b, c]| {
            let triangle = [a, b, c].map(|corner| corner as usize);
            if self.area(triangle) < 0.0 { [triangle[0], triangle[2], triangle[1]] } else { triangle }
        });
        triangles.collect()
    }

    /// Cuts off ears of a large polygon until few corners are left, or no ear is found. Returns the remaining corners.
    fn cut_ears(&mut self) -> Vec<usize> {
        let count = self.flat.len();
        if count <= MAX_EARCUT {
            return (0..count).collect();
        }
        let mut around: Vec<_> = (0..count).map(|at| [(at + count - 1) % count, (at + 1) % count]).collect();
        let ear = |around: &[[usize; 2]], at: usize| [around[at][0], at, around[at][1]];
        let mut is_left = vec![true; count];
        let x = |corner: usize| self.flat[corner][0];
        // Only reflex corners can lie inside an ear. They are sorted by x, so that few of them are examined.
        let mut reflex: Vec<_> = (0..count).filter(|&at| self.area(ear(&around, at)) <= 0.0).collect();
        reflex.sort_by(|&a, &b| x(a).total_cmp(&x(b)));
        let (mut at, mut left, mut since, mut looks) = (0, count, 0, MAX_LOOKS.saturating_mul(count));
        let mut is_narrow = false;
        while left > MAX_EARCUT && since < 2 * left && looks > 0 {
            let [before, _, after] = ear(&around, at);
            let area = self.area([before, at, after]);
            let low = x(before).min(x(at)).min(x(after));
            let high = x(before).max(x(at)).max(x(after));
            let mut near = reflex[reflex.partition_point(|&other| x(other) < low)..].iter();
            looks -= 1;
            let is_blocked = area > 0.0
                && near.by_ref().take_while(|&&other| x(other) <= high).any(|&other| {
                    looks = looks.saturating_sub(1);
                    let blocks = is_left[other] && self.contains([before, at, after], other);
                    blocks && self.area(ear(&around, other)) <= 0.0
                });
            // A corner on a straight line is not an ear. It is removed when no other corner can be removed.
            let is_cut = area > 0.0 && !is_blocked;
            if is_cut || (area == 0.0 && since >= left) {
                (around[before][1], around[after][0], is_left[at]) = (after, before, false);
                left -= 1;
                since = if is_cut { 0 } else { left };
                if is_cut {
                    self.indices.extend([before, at, after].map(|corner| corner as u32));
                }
                if left.is_power_of_two() {
                    reflex.retain(|&other| is_left[other]);
                }
                // The next corner is skipped, so that convex parts are not cut into slivers. If ears are rare, the search goes back
                // instead.
                at = if is_narrow { before } else { around[after][1] };
            } else {
                (since, at) = (since + 1, after);
                is_narrow |= since > MAX_EARCUT;
            }
        }
        std::iter::successors(Some(at), |&at| Some(around[at][1])).take(left).collect()
    }

    /// Whether the triangle contains the polygon's corner `other`, which is not one of its corners and not at the place of its first
    /// corner.
    fn contains(&self, triangle: [usize; 3], other: usize) -> bool {
        let [a, b, c] = triangle;
        !triangle.contains(&other)
            && self.flat[other] != self.flat[a]
            && [[a, b], [b, c], [c, a]].iter().all(|&[from, to]| self.area([from, to, other]) >= 0.0)
    }

    /// Projects the polygon onto its plane, near the origin and scaled to a size of about 1. Returns `false` if the polygon has no plane.
    fn flatten(&mut self) -> bool {
        let first = self.points[0];
        for point in &mut self.points {
            *point = std::array::from_fn(|axis| point[axis] - first[axis]);
        }
        let size = self.points.as_flattened().iter().fold(0.0, |size: f64, value| size.max(value.abs()));
        self.points.as_flattened_mut().iter_mut().for_each(|value| *value /= size);
        size > 0.0 && project3d_to_2d(&self.points, self.points.len(), &mut self.flat)
    }

    fn area(&self, triangle: [usize; 3]) -> f64 {
        let [a, b, c] = triangle.map(|corner| self.flat[corner]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn large_polygons_are_covered_by_triangles_of_their_orientation(
            radii in prop::collection::vec(0.2_f32..1.0, 3..700),
        ) {
            let step = std::f32::consts::TAU / radii.len() as f32;
            let corner = |(at, &radius): (usize, &f32)| (radius * Vec2::from_angle(at as f32 * step)).extend(0.0);
            let corners: Vec<Vec3> = radii.iter().enumerate().map(corner).collect();
            let mut triangulator = Triangulator::default();
            let triangles = triangulator.split(corners.iter().copied());
            prop_assert_eq!((triangles.len(), triangulator.unclear), (radii.len() - 2, 0));
            for [a, b, c] in triangles.iter().map(|triangle| triangle.map(|at| corners[at])) {
                prop_assert!((b - a).cross(c - a).z >= 0.0, "{a} {b} {c}");
            }
        }
    }
}
