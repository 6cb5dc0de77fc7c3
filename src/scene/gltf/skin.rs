//! Skins in their rest pose: transforms of vertices by the joints that they are bound to.

use std::collections::HashMap;
use std::rc::Rc;

use glam::{DAffine3, DMat3, DVec3};
use gltf_json as json;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::Semantic;
use gltf_json::validation::Checked;

use super::accessor::{self, Array};
use super::nodes::Placed;
use super::{Document, called};
use crate::error::Result;

/// The largest number of attribute pairs `JOINTS_n` and `WEIGHTS_n`, of four joints each.
const MAX_SETS: u32 = 4;

/// The joint matrices of the skins, computed at their first use.
pub(super) struct Skins {
    /// The world transform of each node of the file; `None` if the node is not in the scene.
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

    /// The matrices of skin `index`, which map the mesh's frame to the world: one for each joint. The
    /// transform of the mesh's node is not part of them, since only the joints place a skinned mesh. `user`
    /// names the node.
    pub(super) fn matrices(
        &mut self,
        document: &Document,
        user: &str,
        index: usize,
    ) -> Result<Rc<[DAffine3]>> {
        if let Some(matrices) = self.matrices.get(&index) {
            return Ok(Rc::clone(matrices));
        }
        let help = "the file is damaged: export it again";
        let Some(skin) = document.root.skins.get(index) else {
            return Err(document.fault(format!("{user} refers to skin {index}, which does not exist"), help));
        };
        let what = called("skin", index, skin.name.as_ref());
        let inverse_bind = match skin.inverse_bind_matrices {
            None => None,
            Some(accessor) => {
                let name = format!("{what}: inverseBindMatrices");
                Some(accessor::open(document, &name, accessor, Type::Mat4, &[ComponentType::F32])?)
            }
        };
        let mut matrices = Vec::new();
        for (position, joint) in skin.joints.iter().enumerate() {
            let Some(&Some(transform)) = self.placed.get(joint.value()) else {
                return Err(document.fault(
                    format!("{what}: its joint {} is not a node of the scene", joint.value()),
                    "export the skeleton in the same scene as the mesh",
                ));
            };
            let bound = match &inverse_bind {
                None => DAffine3::IDENTITY,
                Some(array) => array.vector::<16>(position).and_then(affine).ok_or_else(|| {
                    document.fault(
                        format!("{what}: its inverse bind matrix {position} is missing or not affine"),
                        help,
                    )
                })?,
            };
            matrices.push(transform * bound);
        }
        let matrices: Rc<[DAffine3]> = matrices.into();
        self.matrices.insert(index, Rc::clone(&matrices));
        Ok(matrices)
    }
}

/// The affine transform of a 4×4 matrix given by columns; `None` if its last row is not 0 0 0 1.
fn affine(columns: [f32; 16]) -> Option<DAffine3> {
    let columns = columns.map(f64::from);
    let last = [columns[3], columns[7], columns[11], columns[15]];
    // The tolerance is for exporters that round.
    let is_affine = last.iter().zip([0.0, 0.0, 0.0, 1.0]).all(|(value, exact)| (value - exact).abs() < 1e-6);
    let column = |first: usize| DVec3::new(columns[first], columns[first + 1], columns[first + 2]);
    is_affine.then(|| DAffine3 {
        matrix3: DMat3::from_cols(column(0), column(4), column(8)),
        translation: column(12),
    })
}

/// The joints and weights of a primitive's vertices.
pub(super) struct Influences<'a> {
    sets: Vec<(Array<'a>, Array<'a>)>,
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
            let pair = (attribute(Semantic::Joints(set)), attribute(Semantic::Weights(set)));
            let (joints, weights) = match pair {
                (Some(joints), Some(weights)) if set < MAX_SETS => (joints, weights),
                (None, None) if set > 0 => break,
                (Some(_), Some(_)) => {
                    return Err(document.fault(
                        format!("{what} has more than {} joints to a vertex", 4 * MAX_SETS),
                        "limit the number of influences in the exporter",
                    ));
                }
                _ => {
                    return Err(document.fault(
                        format!("{what} is skinned, but lacks JOINTS_{set} or WEIGHTS_{set}"),
                        "the mesh is damaged: export it again",
                    ));
                }
            };
            let open = |name: &str, accessor, components: &[ComponentType]| {
                let what = format!("{what}: {name}_{set}");
                super::vertices::open_for(document, &what, accessor, Type::Vec4, components, count)
            };
            sets.push((
                open("JOINTS", joints, &[ComponentType::U8, ComponentType::U16])?,
                open("WEIGHTS", weights, &[ComponentType::F32, ComponentType::U8, ComponentType::U16])?,
            ));
        }
        Ok(Self { sets })
    }

    /// The transform of vertex `index` from the mesh's frame to the world: the weighted mean of the matrices
    /// of its joints. `None` if the vertex is bound to no joint, or to one that the skin does not have.
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
        // The weights sum to 1 up to rounding; the division removes the rounding error.
        (total > 0.0).then(|| DAffine3 { matrix3: sum.matrix3 / total, translation: sum.translation / total })
    }
}
