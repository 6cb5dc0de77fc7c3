//! Assembly of the scene's triangles in world space from its nodes and meshes.

use std::collections::HashMap;
use std::rc::Rc;

use glam::DAffine3;
use gltf_json::mesh::{Mode, Semantic};
use gltf_json::validation::Checked;

use super::counts::{Counts, Progress, too_many};
use super::labels::{self, Label};
use super::materials::Materials;
use super::nodes::Placed;
use super::placer::Placer;
use super::pose::{Pose, Transform};
use super::primitive::Corners;
use super::skin::{Influences, Skins};
use super::vertices::Vertices;
use super::{Document, instancing, object_name};
use crate::error::{Error, Result};
use crate::scene::Watcher;
use crate::scene::place::Place;
use crate::scene::triangle::Triangle;

/// What primitives without triangles consist of.
const NO_AREA: &str = "points or lines, which have no area";

/// The triangles of one primitive at one node. Their region index is set later.
pub(super) struct Surface {
    /// Index into the placed nodes.
    pub placed: usize,
    /// The label of the primitive, else of its mesh, else of its node.
    pub label: Option<Label>,
    /// Never empty.
    pub triangles: Vec<Triangle>,
}

/// Assembles all surfaces of the scene, in the order of the nodes. A scene that moves is assembled again, around its new origin.
pub(super) fn assemble(
    document: &mut Document,
    placed: &[Placed],
    materials: &mut Materials,
    watcher: Watcher<'_>,
    place: &mut Place,
) -> Result<Vec<Surface>> {
    let mut assembly = assembly(document, placed, materials, watcher, place)?;
    if place.settle(&document.path)? {
        assembly = self::assembly(document, placed, materials, watcher, place)?;
    }
    document.warnings.list.extend(place.warning());
    if assembly.degenerate > 0 {
        document.warnings.add(format!("{} triangles without area were dropped", assembly.degenerate));
    }
    if assembly.surfaces.is_empty() {
        let what = match document.warnings.list.iter().any(|warning| warning.contains(NO_AREA)) {
            true => "no triangles in the scene, but points or lines, which have no area and show nothing",
            false => "no triangles in the scene",
        };
        return Err(
            document.fault(what, "export meshes with faces, in the scene that the file shows by default")
        );
    }
    Ok(assembly.surfaces)
}

/// All surfaces of a scene at `place`, which notes their corners.
fn assembly(
    document: &mut Document,
    placed: &[Placed],
    materials: &mut Materials,
    watcher: Watcher<'_>,
    place: &mut Place,
) -> Result<Assembly> {
    let mut assembly = Assembly {
        surfaces: Vec::new(),
        skins: Skins::new(document, placed),
        counts: Counts::default(),
        degenerate: 0,
        labels: HashMap::new(),
    };
    for (position, node) in placed.iter().enumerate() {
        let progress = Progress { watcher, position, nodes: placed.len() };
        progress.begin()?;
        let source = &document.root.nodes[node.node];
        let Some(index) = source.mesh.map(|mesh| mesh.value()) else { continue };
        let node_name = object_name("node", node.node, source.name.as_ref());
        let Some(mesh) = document.root.meshes.get(index) else {
            return Err(document.fault(
                format!("{node_name} refers to mesh {index}, which does not exist"),
                "the file is damaged: export it again",
            ));
        };
        let mesh_name = object_name("mesh", index, mesh.name.as_ref());
        let primitives = mesh.primitives.len();
        let mesh_label = assembly.label(document, &mesh_name, index, None)?;
        assembly.counts.placements(document, primitives)?;
        let poses = assembly.poses(document, &node_name, node)?;
        for primitive in 0..primitives {
            let placement = Placement {
                what: format!("{mesh_name}, primitive {primitive}"),
                node: node.node,
                mesh: index,
                primitive,
            };
            let label = assembly
                .label(document, &placement.what, index, Some(primitive))?
                .or_else(|| mesh_label.clone())
                .or_else(|| node.label.clone());
            let triangles = assembly.place(document, &placement, &poses, materials, (progress, place))?;
            if !triangles.is_empty() {
                assembly.surfaces.push(Surface { placed: position, label, triangles });
            }
        }
    }
    Ok(assembly)
}

/// One primitive of one mesh at one node.
struct Placement {
    /// The primitive's name in messages.
    what: String,
    node: usize,
    mesh: usize,
    primitive: usize,
}

/// The poses of a mesh at a node.
enum Poses {
    /// One transform for each instance.
    Rigid(Vec<Transform>),
    /// One matrix for each joint of the skin.
    Skinned(Rc<[DAffine3]>),
}

/// The surfaces assembled so far, with the counts that bound the work.
struct Assembly {
    surfaces: Vec<Surface>,
    skins: Skins,
    counts: Counts,
    /// Number of triangles dropped because they have no area.
    degenerate: usize,
    /// Labels of meshes and of their primitives. They are parsed once, however often the mesh is placed.
    labels: HashMap<(usize, Option<usize>), Option<Label>>,
}

impl Assembly {
    /// The label of a mesh, or of one of its primitives, from `extras.region`.
    fn label(
        &mut self,
        document: &Document,
        what: &str,
        mesh: usize,
        primitive: Option<usize>,
    ) -> Result<Option<Label>> {
        if let Some(label) = self.labels.get(&(mesh, primitive)) {
            return Ok(label.clone());
        }
        let source = &document.root.meshes[mesh];
        let extras = primitive.map_or(&source.extras, |primitive| &source.primitives[primitive].extras);
        let label = labels::label(document, what, extras)?;
        self.labels.insert((mesh, primitive), label.clone());
        Ok(label)
    }

    /// The poses of the mesh of a node.
    fn poses(&mut self, document: &Document, node_name: &str, node: &Placed) -> Result<Poses> {
        let source = &document.root.nodes[node.node];
        if let Some(skin) = source.skin {
            return self.skins.matrices(document, node_name, skin.value()).map(Poses::Skinned);
        }
        let instances = instancing::instances(document, node_name, source)?;
        Ok(Poses::Rigid(match instances {
            None => vec![Transform::new(&node.transform)],
            Some(instances) => {
                self.counts.instances(document, instances.len())?;
                instances.iter().map(|instance| Transform::new(&(node.transform * *instance))).collect()
            }
        }))
    }

    /// The triangles of a primitive at all its poses.
    fn place(
        &mut self,
        document: &mut Document,
        placement: &Placement,
        poses: &Poses,
        materials: &mut Materials,
        (progress, place): (Progress<'_>, &mut Place),
    ) -> Result<Vec<Triangle>> {
        let what = &placement.what;
        let primitive = &document.root.meshes[placement.mesh].primitives[placement.primitive];
        let material_index = primitive.material.map(|material| material.value());
        let has_set =
            [0, 1].map(|set| primitive.attributes.contains_key(&Checked::Valid(Semantic::TexCoords(set))));
        if !has_triangles(document, placement)? {
            return Ok(Vec::new());
        }
        let material = materials.index_of(document, what, material_index)?;
        let material = materials.with_coordinates(document, what, material, has_set)?;
        let document = &*document;
        let mesh = &document.root.meshes[placement.mesh];
        let primitive = &mesh.primitives[placement.primitive];
        let weights = document.root.nodes[placement.node].weights.as_ref().or(mesh.weights.as_ref());
        let vertices = Vertices::open(
            document,
            what,
            primitive,
            &materials.list[material as usize],
            weights.map_or(&[], Vec::as_slice),
        )?;
        let corners = Corners::open(document, what, primitive, vertices.count)?;
        let poses: Vec<Pose<'_>> = match poses {
            Poses::Rigid(transforms) => transforms.iter().map(|transform| Pose::Rigid(*transform)).collect(),
            Poses::Skinned(joints) => {
                let influences = Influences::open(document, what, primitive, vertices.count)?;
                vec![Pose::Skinned { joints: Rc::clone(joints), influences }]
            }
        };
        let count = self.counts.triangles(document, corners.triangles, poses.len(), vertices.targets())?;
        let mut triangles = Vec::new();
        triangles.try_reserve_exact(count).map_err(|_| too_many(document, count))?;
        let mut done = 0_usize;
        for pose in &poses {
            let placer = Placer { document, what, vertices: &vertices, pose, material };
            for index in 0..corners.triangles {
                done += 1;
                progress.at(done, count)?;
                let indices = corners.vertices(index).ok_or_else(|| cut_short(document, what))?;
                let triangle = placer.triangle(indices, place)?;
                if triangle.has_area() {
                    triangles.push(triangle.with_normals_in_front());
                } else {
                    self.degenerate += 1;
                }
            }
        }
        Ok(triangles)
    }
}

/// Whether a primitive consists of triangles. Adds a warning if it does not.
fn has_triangles(document: &mut Document, placement: &Placement) -> Result<bool> {
    let what = &placement.what;
    match &document.root.meshes[placement.mesh].primitives[placement.primitive].mode {
        Checked::Invalid => {
            Err(document.fault(format!("{what} has an unknown mode"), "the file is damaged: export it again"))
        }
        Checked::Valid(Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) => Ok(true),
        Checked::Valid(_) => {
            document.warnings.add(format!("{what} consists of {NO_AREA}: ignored"));
            Ok(false)
        }
    }
}

fn cut_short(document: &Document, what: &str) -> Error {
    document.fault(format!("{what}: its data ends too early"), "the mesh is damaged: export it again")
}
