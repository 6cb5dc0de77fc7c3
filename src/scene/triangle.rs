//! Triangles with what their corners carry.

use glam::{Vec2, Vec3};

/// One triangle. Its front is the side from which the corners run counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Corners in metres.
    pub positions: [Vec3; 3],
    /// Unit normals of the smooth surface at the corners; zero where the file gives none. They shade, and nothing else:
    /// every cosine is that of the flat triangle.
    pub normals: [Vec3; 3],
    /// Two sets of texture coordinates at each corner, as in the file; zero where it has none.
    pub texcoords: [[Vec2; 2]; 3],
    /// Linear colour and opacity at the corners, which multiply those of the material; 65535 is 1.
    pub colors: [[u16; 4]; 3],
    /// Index into [`crate::scene::Scene::materials`].
    pub material: u32,
    /// Index into [`crate::scene::Scene::regions`].
    pub region: u32,
}

/// A triangle whose height is a smaller part of its longest edge has no area that single precision can tell.
const MIN_HEIGHT_TO_EDGE: f64 = 1e-7;

impl Triangle {
    /// The colour that changes nothing.
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

    /// The same surface with its front on the other side.
    pub(super) fn turned(mut self) -> Self {
        self.positions.swap(1, 2);
        self.normals.swap(1, 2);
        self.texcoords.swap(1, 2);
        self.colors.swap(1, 2);
        self
    }

    /// With its normals on the front's side: some exporters turn the one and not the other.
    pub(super) fn with_normals_in_front(mut self) -> Self {
        let [a, b, c] = self.positions;
        let sum: Vec3 = self.normals.iter().sum();
        if sum.dot((b - a).cross(c - a)) < 0.0 {
            self.normals = self.normals.map(|normal| -normal);
        }
        self
    }

    /// Whether single precision can tell it from a line.
    pub(super) fn has_area(&self) -> bool {
        let [a, b, c] = self.positions.map(|position| position.as_dvec3());
        let longest = [b - a, c - b, a - c].map(|edge| edge.length_squared()).into_iter().fold(0.0, f64::max);
        // Twice the area is the longest edge times the height on it.
        (b - a).cross(c - a).length() > MIN_HEIGHT_TO_EDGE * longest
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn only_what_single_precision_can_tell_from_a_line_has_area() {
        let has_area = |positions| Triangle::flat(positions, 0, 0).has_area();
        let small = [vec3(0.0, 0.0, 0.0), vec3(1e-12, 0.0, 0.0), vec3(0.0, 1e-12, 0.0)];
        assert!(has_area(small), "size alone does not make a triangle degenerate");
        let point = [vec3(1.0, 2.0, 3.0); 3];
        assert!(!has_area(point));
        let collinear = [vec3(0.1, 0.1, 0.1), vec3(0.2, 0.2, 0.2), vec3(0.7, 0.7, 0.7)];
        assert!(!has_area(collinear));
        let sliver = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.5, 1e-6, 0.0)];
        assert!(has_area(sliver));
    }
}
