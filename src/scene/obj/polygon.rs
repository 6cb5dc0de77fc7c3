//! Splits polygons of any number of corners, convex or not, into triangles.

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;
use glam::Vec3;

/// The largest share of a polygon's area that rounding may take or add. A polygon that crosses itself differs by more.
const ROUNDING: f64 = 1e-6;

/// Splits polygons; its buffers are used again.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    points: Vec<[f64; 3]>,
    /// The corners in the plane that fits the polygon best, counter-clockwise.
    flat: Vec<[f64; 2]>,
    indices: Vec<u32>,
    /// Number of polygons that cross themselves or have no area, so that triangles may not cover them.
    pub(super) unclear: usize,
}

impl Triangulator {
    /// The triangles of a polygon with at least three corners, as indices of its corners and with its orientation.
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
        // Quads keep the diagonal at their first corner unless they are concave. A fan of many corners is all slivers.
        if fan.len() == 2 && fan.iter().all(|&triangle| self.area(triangle) > 0.0) {
            return fan;
        }
        self.earcut.earcut_slice(&self.flat, &[], &mut self.indices);
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

    /// Projects the polygon onto its plane, near the origin and about as large as 1. Returns `false` if it has no plane.
    fn flatten(&mut self) -> bool {
        let first = self.points[0];
        for point in &mut self.points {
            *point = std::array::from_fn(|axis| point[axis] - first[axis]);
        }
        let size = self.points.as_flattened().iter().fold(0.0, |size: f64, value| size.max(value.abs()));
        self.points.as_flattened_mut().iter_mut().for_each(|value| *value /= size);
        size > 0.0 && project3d_to_2d(&self.points, self.points.len(), &mut self.flat)
    }

    /// Twice the signed area of a triangle in the polygon's plane.
    fn area(&self, triangle: [usize; 3]) -> f64 {
        let [a, b, c] = triangle.map(|corner| self.flat[corner]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }
}
