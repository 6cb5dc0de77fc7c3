//! Transforms of a mesh's vertices to world space, rigid or by a skin.

use std::rc::Rc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::skin::Influences;

/// An affine transform of points, with the corresponding transform of normals.
#[derive(Clone, Copy)]
pub(super) struct Transform {
    points: DAffine3,
    normals: DMat3,
    /// Whether the determinant is negative, which exchanges the front and the back of a triangle.
    pub mirrors: bool,
}

impl Transform {
    /// The transform whose map of points is `points`.
    pub(super) fn new(points: &DAffine3) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = points.matrix3;
        // Cofactors are the inverse transpose times the determinant. They exist for singular matrices, too,
        // and normals are normalized anyway.
        let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
        let mirrors = points.matrix3.determinant() < 0.0;
        Self { points: *points, normals: if mirrors { -cofactors } else { cofactors }, mirrors }
    }

    /// Transforms a point.
    pub(super) fn point(&self, point: Vec3) -> DVec3 {
        self.points.transform_point3(point.as_dvec3())
    }

    /// How much longer a vector can become.
    pub(super) fn stretch(&self) -> f64 {
        let DMat3 { x_axis, y_axis, z_axis } = self.points.matrix3;
        [x_axis, y_axis, z_axis].map(|axis| axis.length_squared()).into_iter().fold(0.0, f64::max).sqrt()
    }

    /// Transforms a normal to a unit vector, or to zero if it has no direction.
    pub(super) fn normal(&self, normal: Vec3) -> Vec3 {
        (self.normals * normal.as_dvec3()).normalize_or_zero().as_vec3()
    }
}

/// The pose of a mesh: one transform for all vertices, or one for each.
pub(super) enum Pose<'a> {
    /// The transform of the mesh's node, or of one of its instances.
    Rigid(Transform),
    /// Transforms by the joints of a skin.
    Skinned {
        /// The matrix of each joint.
        joints: Rc<[DAffine3]>,
        /// The joints and weights of each vertex.
        influences: Influences<'a>,
    },
}

impl Pose<'_> {
    /// The transform of vertex `index`. `None` if the vertex is bound to no joint, or to one that the skin
    /// does not have.
    pub(super) fn of(&self, index: usize) -> Option<Transform> {
        match self {
            Self::Rigid(transform) => Some(*transform),
            Self::Skinned { joints, influences } => {
                influences.matrix(index, joints).as_ref().map(Transform::new)
            }
        }
    }
}
