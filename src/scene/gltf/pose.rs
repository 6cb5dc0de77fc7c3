//! How the vertices of a mesh get into the world.

use std::rc::Rc;

use glam::{DAffine3, DMat3, Vec3};

use super::skin::Influences;

/// A map of points, with the one of normals that belongs to it.
#[derive(Clone, Copy)]
pub(super) struct Transform {
    points: DAffine3,
    normals: DMat3,
    /// Whether it turns the front of a triangle to the other side.
    pub mirrors: bool,
}

impl Transform {
    pub(super) fn new(points: &DAffine3) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = points.matrix3;
        // The inverse transposed but for its length, which exists for a map that flattens, too.
        let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
        let mirrors = points.matrix3.determinant() < 0.0;
        Self { points: *points, normals: if mirrors { -cofactors } else { cofactors }, mirrors }
    }

    pub(super) fn point(&self, point: Vec3) -> Vec3 {
        self.points.transform_point3(point.as_dvec3()).as_vec3()
    }

    /// A unit vector, or zero for what has no direction.
    pub(super) fn normal(&self, normal: Vec3) -> Vec3 {
        (self.normals * normal.as_dvec3()).normalize_or_zero().as_vec3()
    }
}

/// The same map for all vertices, or one for each.
pub(super) enum Pose<'a> {
    /// Where the mesh's node, or an instance of it, stands.
    Rigid(Transform),
    /// Where the joints of its skin stand.
    Skinned {
        /// Each joint's map.
        joints: Rc<[DAffine3]>,
        /// Which joints each vertex hangs on.
        influences: Influences<'a>,
    },
}

impl Pose<'_> {
    /// The map of vertex `index`. `None` when its skin has no such joint.
    pub(super) fn of(&self, index: usize) -> Option<Transform> {
        match self {
            Self::Rigid(transform) => Some(*transform),
            Self::Skinned { joints, influences } => {
                influences.matrix(index, joints).as_ref().map(Transform::new)
            }
        }
    }
}
