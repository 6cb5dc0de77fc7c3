//! Transforms of a mesh's vertices to world space: by its node, by instances (`EXT_mesh_gpu_instancing`), or by a skin in its rest pose.

use std::collections::HashMap;
use std::rc::Rc;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4, Vec3};
use gltf_json as json;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::Semantic;
use gltf_json::validation::Checked;
use serde::Deserialize;

use super::buffers::OpenAccessor;
use super::extensions::INSTANCING;
use super::nodes::Placed;
use super::{Document, geometry, object_name, vertices};
use crate::error::Result;
use crate::scene::triangle::unit;

/// An affine transform of points, and the corresponding transform of normals.
#[derive(Clone, Copy)]
pub(super) struct Transform {
    points: DAffine3,
    normals: DMat3,
    /// Whether the determinant is negative, which exchanges the front and the back of a triangle.
    pub mirrors: bool,
}

impl Transform {
    pub(super) fn new(points: &DAffine3) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = points.matrix3;
        // The matrix of cofactors is the inverse transpose times the determinant, and exists even for singular matrices. Normals are
        // normalized later, so the factor has no effect.
        let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
        let mirrors = points.matrix3.determinant() < 0.0;
        Self { points: *points, normals: if mirrors { -cofactors } else { cofactors }, mirrors }
    }

    pub(super) fn point(&self, point: Vec3) -> DVec3 {
        self.points.transform_point3(point.as_dvec3())
    }

    /// The largest factor by which the transform lengthens a vector along a coordinate axis.
    pub(super) fn stretch(&self) -> f64 {
        let DMat3 { x_axis, y_axis, z_axis } = self.points.matrix3;
        [x_axis, y_axis, z_axis].map(|axis| axis.length_squared()).into_iter().fold(0.0, f64::max).sqrt()
    }

    /// Transforms a normal to a unit vector, or to zero if it has no direction.
    pub(super) fn normal(&self, normal: Vec3) -> Vec3 {
        unit(self.normals * normal.as_dvec3())
    }
}

/// The pose of a mesh: one transform for all vertices, or one for each vertex.
pub(super) enum Pose {
    /// The transform of the mesh's node, or of one of its instances.
    Rigid(Transform),
    /// One matrix for each joint of the skin.
    Skinned(Rc<[DAffine3]>),
}

impl Pose {
    /// The transform of vertex `index`. `None` if the vertex has no joint, or refers to a joint that the skin does not have.
    pub(super) fn of(&self, index: usize, influences: &Influences<'_>) -> Option<Transform> {
        match self {
            Self::Rigid(transform) => Some(*transform),
            Self::Skinned(joints) => influences.matrix(index, joints).as_ref().map(Transform::new),
        }
    }
}

/// The largest number of instances at one node, which bounds the loading time.
const MAX_INSTANCES: usize = 1 << 20;

#[derive(Deserialize)]
struct Instancing {
    attributes: Attributes,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "TRANSLATION")]
    translation: Option<json::Index<json::Accessor>>,
    #[serde(rename = "ROTATION")]
    rotation: Option<json::Index<json::Accessor>>,
    #[serde(rename = "SCALE")]
    scale: Option<json::Index<json::Accessor>>,
}

/// The transforms from each instance's frame to the frame of `node`. `None` if the node is not instanced. `what` names the node.
pub(super) fn instances(document: &Document, what: &str, node: &json::Node) -> Result<Option<Vec<DAffine3>>> {
    let extensions = node.extensions.as_ref().map(|extensions| &extensions.others);
    let Some(Instancing { attributes }) = document.extension(what, extensions, INSTANCING)? else {
        return Ok(None);
    };
    let Attributes { translation, rotation, scale } = attributes;
    let open = |name: &str, accessor, array| {
        vertices::open(document, (what, &format!("{name} of its instances")), accessor, array, 0)
    };
    const FLOATS: &[ComponentType] = &[ComponentType::F32];
    let translations = open("TRANSLATION", translation, (Type::Vec3, FLOATS))?;
    let turns = [ComponentType::F32, ComponentType::I8, ComponentType::I16];
    let rotations = open("ROTATION", rotation, (Type::Vec4, &turns))?;
    let scales = open("SCALE", scale, (Type::Vec3, FLOATS))?;
    let counts = [&translations, &rotations, &scales].into_iter().flatten().map(|array| array.count);
    let (Some(least), Some(most)) = (counts.clone().min(), counts.max()) else { return Ok(Some(Vec::new())) };
    if least != most || most > MAX_INSTANCES {
        return Err(document
            .fault(format!("{what} has {most} instances, and {least} in another list of them"))
            .help(format!("give all lists the same length, of at most {MAX_INSTANCES} instances")));
    }

    let vector = |array: &Option<OpenAccessor<'_>>, index: usize, default: DVec3| match array {
        None => Some(default),
        Some(array) => array.vector(index).map(|value: [f32; 3]| DVec3::from_array(value.map(f64::from))),
    };
    let place = |index: usize| {
        let rotation = match &rotations {
            None => DQuat::IDENTITY,
            Some(array) => DQuat::from_array(array.vector::<4>(index)?.map(f64::from)),
        };
        let scale = vector(&scales, index, DVec3::ONE)?;
        let translation = vector(&translations, index, DVec3::ZERO)?;
        let usable = rotation.length() > 1e-6 && rotation.is_finite();
        let place = DAffine3::from_scale_rotation_translation(
            scale,
            if usable { rotation.normalize() } else { return None },
            translation,
        );
        place.is_finite().then_some(place)
    };
    let mut places = geometry::with_room(document, most, geometry::INSTANCES)?;
    for index in 0..most {
        places.push(place(index).ok_or_else(|| {
            document
                .fault(format!(
                    "{what}: the transform of its instance {index} is not finite, or its rotation is zero"
                ))
                .help("correct the instance's translation, rotation and scale")
        })?);
    }
    Ok(Some(places))
}

/// The largest number of attribute pairs `JOINTS_n` and `WEIGHTS_n`, of four joints each.
const MAX_SETS: u32 = 4;

/// The joint matrices of the skins, computed at their first use.
pub(super) struct Skins {
    /// The transform of each node of the file to world space. `None` if the node is not in the scene.
    placed: Vec<Option<DAffine3>>,
    matrices: HashMap<usize, Rc<[DAffine3]>>,
}

impl Skins {
    /// Prepares the skins of a document whose scene has the nodes `placed`.
    pub(super) fn new(document: &Document, placed: &[Placed]) -> Self {
        let mut transforms = vec![None; document.root.nodes.len()];
        for node in placed {
            transforms[node.node] = Some(node.transform);
        }
        Self { placed: transforms, matrices: HashMap::new() }
    }

    /// The matrices of skin `index`, one for each joint, which map the mesh's frame to world space. They exclude the transform of the
    /// mesh's node, because only the joints place a skinned mesh. `user` names the node.
    pub(super) fn matrices(
        &mut self,
        document: &Document,
        user: &str,
        index: usize,
    ) -> Result<Rc<[DAffine3]>> {
        if let Some(matrices) = self.matrices.get(&index) {
            return Ok(Rc::clone(matrices));
        }
        let skin = document.referred(&document.root.skins, user, "skin", index)?;
        let what = object_name("skin", index, skin.name.as_ref());
        let array = (Type::Mat4, [ComponentType::F32].as_slice());
        let inverse_bind =
            vertices::open(document, (&what, "inverseBindMatrices"), skin.inverse_bind_matrices, array, 0)?;
        let mut matrices = Vec::new();
        for (position, joint) in skin.joints.iter().enumerate() {
            let Some(&Some(transform)) = self.placed.get(joint.value()) else {
                return Err(document
                    .fault(format!("{what}: its joint {} is not a node of the scene", joint.value()))
                    .help("export the skeleton in the same scene as the mesh"));
            };
            let bound = match &inverse_bind {
                None => DAffine3::IDENTITY,
                Some(array) => array.vector::<16>(position).and_then(affine).ok_or_else(|| {
                    let fault = "is missing or not affine";
                    document.damaged(format!("{what}: its inverse bind matrix {position} {fault}"))
                })?,
            };
            matrices.push(transform * bound);
        }
        let matrices: Rc<[DAffine3]> = matrices.into();
        self.matrices.insert(index, Rc::clone(&matrices));
        Ok(matrices)
    }
}

/// The affine transform of a 4×4 matrix given by columns. `None` if the last row differs from 0 0 0 1 by more than the rounding of
/// exporters.
pub(super) fn affine(columns: [f32; 16]) -> Option<DAffine3> {
    let matrix = DMat4::from_cols_array(&columns.map(f64::from));
    let is_affine = matrix.row(3).abs_diff_eq(DVec4::W, 1e-6);
    is_affine.then(|| DAffine3 { matrix3: DMat3::from_mat4(matrix), translation: matrix.w_axis.truncate() })
}

/// The joints of each vertex of a primitive, with their weights; empty if the primitive has no skin.
#[derive(Default)]
pub(super) struct Influences<'a> {
    sets: Vec<(OpenAccessor<'a>, OpenAccessor<'a>)>,
}

impl<'a> Influences<'a> {
    /// Opens `JOINTS_n` and `WEIGHTS_n` of a primitive with `count` vertices.
    pub(super) fn open(
        document: &'a Document,
        what: &str,
        primitive: &json::mesh::Primitive,
        count: usize,
    ) -> Result<Self> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let mut sets = Vec::new();
        for set in 0.. {
            let open = |name: &str, semantic, components: &[ComponentType]| {
                let name = format!("{name}_{set}");
                vertices::open(document, (what, &name), attribute(semantic), (Type::Vec4, components), count)
            };
            let joints = open("JOINTS", Semantic::Joints(set), &[ComponentType::U8, ComponentType::U16])?;
            let weights = open(
                "WEIGHTS",
                Semantic::Weights(set),
                &[ComponentType::F32, ComponentType::U8, ComponentType::U16],
            )?;
            match (joints, weights) {
                (Some(joints), Some(weights)) if set < MAX_SETS => sets.push((joints, weights)),
                (None, None) if set > 0 => break,
                (Some(_), Some(_)) => {
                    return Err(document
                        .fault(format!("{what} has more than {} joints to a vertex", 4 * MAX_SETS))
                        .help("limit the number of influences in the exporter"));
                }
                _ => {
                    return Err(document.damaged_mesh(format!(
                        "{what} is skinned, but lacks JOINTS_{set} or WEIGHTS_{set}"
                    )));
                }
            }
        }
        Ok(Self { sets })
    }

    /// The transform of vertex `index` from the mesh's frame to world space: the weighted mean of its joints' matrices. `None` if the
    /// vertex has no joint, or refers to a joint that the skin does not have.
    pub(super) fn matrix(&self, index: usize, joints: &[DAffine3]) -> Option<DAffine3> {
        let mut sum = DAffine3::ZERO;
        let mut total = 0.0;
        for (set, weights) in &self.sets {
            let joint_indices = set.integers::<4>(index)?;
            for (joint, weight) in joint_indices.into_iter().zip(weights.vector::<4>(index)?) {
                let weight = f64::from(weight);
                if weight != 0.0 {
                    let matrix = joints.get(joint as usize)?;
                    sum.matrix3 += weight * matrix.matrix3;
                    sum.translation += weight * matrix.translation;
                    total += weight;
                }
            }
        }
        // The weights add up to 1 only up to rounding. The division corrects this.
        (total > 0.0).then(|| DAffine3 { matrix3: sum.matrix3 / total, translation: sum.translation / total })
    }
}
