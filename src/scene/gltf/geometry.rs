//! Assembly of the scene's triangles in world space from nodes and meshes.

use std::collections::HashMap;

use glam::{DAffine3, Vec3};
use gltf_json::mesh::{Mode, Semantic};
use gltf_json::validation::Checked;

use super::extensions::Label;
use super::materials::Materials;
use super::nodes::Placed;
use super::pose::{Influences, Pose, Skins, Transform};
use super::vertices::{Corners, Vertex, Vertices};
use super::{Document, extensions, object_name, pose};
use crate::error::{Error, Result};
use crate::scene::place::Place;
use crate::scene::triangle::{MAX_COORDINATE, MAX_TRIANGLES, Triangle};
use crate::scene::{Mesh, Watcher};

const NO_AREA: &str = "points or lines, which have no area";

/// The triangles of one primitive at one node. Their region is set later.
pub(super) struct Surface {
    pub placed: usize,
    /// The label of the primitive, or else of its mesh, or else of its node.
    pub label: Option<Label>,
    /// The triangles. There is at least one.
    pub triangles: Vec<Triangle>,
    /// The same as meshes, one for each instance, on request.
    pub meshes: Vec<Mesh>,
}

/// Assembles all surfaces of the scene, in the order of the nodes. If the scene is moved, they are assembled again at the new origin.
pub(super) fn assemble(
    document: &mut Document,
    placed: &[Placed],
    materials: &mut Materials,
    (watcher, records): (Watcher<'_>, bool),
    place: &mut Place,
) -> Result<Vec<Surface>> {
    let mut assembly = assembly(document, placed, materials, (watcher, records), place)?;
    if place.settle(&document.file.path)? {
        assembly = self::assembly(document, placed, materials, (watcher, records), place)?;
    }
    document.file.warnings.extend(place.warning());
    if assembly.degenerate > 0 {
        document.file.warn(format!("{} triangles without area were dropped", assembly.degenerate));
    }
    if assembly.surfaces.is_empty() {
        let what = match document.file.warnings.iter().any(|warning| warning.contains(NO_AREA)) {
            true => "no triangles in the scene, but points or lines, which have no area and show nothing",
            false => "no triangles in the scene",
        };
        return Err(document
            .fault(what)
            .help("export meshes with faces, in the scene that the file shows by default"));
    }
    Ok(assembly.surfaces)
}

/// Assembles all surfaces of a scene in the coordinates of `place`, which notes their corners.
fn assembly(
    document: &mut Document,
    placed: &[Placed],
    materials: &mut Materials,
    (watcher, records): (Watcher<'_>, bool),
    place: &mut Place,
) -> Result<Assembly> {
    let mut assembly = Assembly {
        records,
        surfaces: Vec::new(),
        skins: Skins::new(document, placed),
        counts: Counts::default(),
        degenerate: 0,
        labels: HashMap::new(),
    };
    for (position, node) in placed.iter().enumerate() {
        let progress = Progress { watcher, position, nodes: placed.len() };
        progress.at(0, 1)?;
        let source = &document.root.nodes[node.node];
        let Some(index) = source.mesh.map(|mesh| mesh.value()) else { continue };
        let node_name = document.node_name(node.node);
        let mesh = document.referred(&document.root.meshes, &node_name, "mesh", index)?;
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
            let (triangles, meshes) =
                assembly.place(document, &placement, &poses, materials, (progress, place))?;
            if !triangles.is_empty() {
                assembly.surfaces.push(Surface { placed: position, label, triangles, meshes });
            }
        }
    }
    Ok(assembly)
}

struct Placement {
    what: String,
    node: usize,
    mesh: usize,
    primitive: usize,
}

/// The surfaces assembled so far, and the counts that bound the work.
struct Assembly {
    /// Whether surfaces have their meshes.
    records: bool,
    surfaces: Vec<Surface>,
    skins: Skins,
    counts: Counts,
    /// The number of triangles that were dropped because they have no area.
    degenerate: usize,
    /// Labels of meshes and of their primitives. Each label is parsed once, even if the mesh is placed many times.
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
        let label = extensions::label(document, what, extras)?;
        self.labels.insert((mesh, primitive), label.clone());
        Ok(label)
    }

    fn poses(&mut self, document: &Document, node_name: &str, node: &Placed) -> Result<Vec<Pose>> {
        let source = &document.root.nodes[node.node];
        if let Some(skin) = source.skin {
            let joints = self.skins.matrices(document, node_name, skin.value())?;
            return Ok(vec![Pose::Skinned(joints)]);
        }
        let rigid = |transform: DAffine3| Pose::Rigid(Transform::new(&transform));
        let Some(instances) = pose::instances(document, node_name, source)? else {
            return Ok(vec![rigid(node.transform)]);
        };
        self.counts.instances(document, instances.len())?;
        let mut poses = with_room(document, instances.len(), INSTANCES)?;
        poses.extend(instances.into_iter().map(|instance| rigid(node.transform * instance)));
        Ok(poses)
    }

    fn place(
        &mut self,
        document: &mut Document,
        placement: &Placement,
        poses: &[Pose],
        materials: &mut Materials,
        (progress, place): (Progress<'_>, &mut Place),
    ) -> Result<(Vec<Triangle>, Vec<Mesh>)> {
        let what = &placement.what;
        let primitive = &document.root.meshes[placement.mesh].primitives[placement.primitive];
        let material_index = primitive.material.map(|material| material.value());
        let has_set =
            [0, 1].map(|set| primitive.attributes.contains_key(&Checked::Valid(Semantic::TexCoords(set))));
        if !has_triangles(document, placement)? {
            return Ok(Default::default());
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
            materials.list[material as usize].texture_sets(),
            weights.map_or(&[], Vec::as_slice),
        )?;
        let corners = Corners::open(document, what, primitive, vertices.count)?;
        let influences = match poses {
            [Pose::Skinned(_)] => Influences::open(document, what, primitive, vertices.count)?,
            _ => Influences::default(),
        };
        let count = self.counts.triangles(document, corners.triangles, poses.len(), vertices.targets())?;
        let mut triangles = with_room(document, count, TRIANGLES)?;
        let mut done = 0_usize;
        for pose in poses {
            let placer =
                Placer { document, what, vertices: &vertices, pose, influences: &influences, material };
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
        let mut meshes = Vec::new();
        if self.records {
            let weights = weights.map_or(&[][..], Vec::as_slice);
            // A scene reads only the coordinates of textures. A mesh keeps all.
            let vertices = &Vertices::open(document, what, primitive, has_set, weights)?;
            for pose in poses {
                let placer = Placer { document, what, vertices, pose, influences: &influences, material };
                meshes.push(placer.mesh(&corners, place)?);
            }
        }
        Ok((triangles, meshes))
    }
}

/// Whether a primitive consists of triangles. If not, adds a warning.
fn has_triangles(document: &mut Document, placement: &Placement) -> Result<bool> {
    let what = &placement.what;
    match &document.root.meshes[placement.mesh].primitives[placement.primitive].mode {
        Checked::Invalid => Err(document.damaged(format!("{what} has an unknown mode"))),
        Checked::Valid(Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) => Ok(true),
        Checked::Valid(_) => {
            document.file.warn(format!("{what} consists of {NO_AREA}: ignored"));
            Ok(false)
        }
    }
}

fn cut_short(document: &Document, what: &str) -> Error {
    document.damaged_mesh(format!("{what}: its data ends too early"))
}

struct Placer<'a> {
    pub document: &'a Document,
    pub what: &'a str,
    pub vertices: &'a Vertices<'a>,
    pub pose: &'a Pose,
    pub influences: &'a Influences<'a>,
    pub material: u32,
}

impl Placer<'_> {
    /// The mesh in the coordinates of `place`.
    fn mesh(&self, corners: &Corners<'_>, place: &mut Place) -> Result<Mesh> {
        let count = self.vertices.count;
        // An accessor without data can have any number of vertices.
        if count > 3 * MAX_TRIANGLES {
            let fault = format!("{} has {count} vertices", self.what);
            return Err(self.document.fault(fault).help("drop the vertices that no triangle has"));
        }
        let mut mesh = Mesh { material: self.material, ..Mesh::default() };
        mesh.vertices = with_room(self.document, count, "vertices")?;
        let (has_normals, has_set, has_colors) = self.vertices.has();
        let indices = (0..corners.triangles).map(|index| corners.vertices(index));
        let faces: Option<Vec<[u32; 3]>> = indices.collect();
        let faces = faces.ok_or_else(|| cut_short(self.document, self.what))?;
        let mut is_used = vec![false; count];
        // The triangles have been made from these indices, so none is out of range.
        faces.iter().flatten().for_each(|&vertex| is_used[vertex as usize] = true);
        let mut mirrored = vec![false; count];
        for index in 0..count {
            // There are fewer vertices than 2³². A vertex that no triangle has may be anywhere.
            let (vertex, mirrors) = match self.vertex(index as u32, place) {
                Err(_) if !is_used[index] => (Vertex::default(), false),
                found => found?,
            };
            mirrored[index] = mirrors;
            mesh.vertices.push(vertex.position);
            mesh.normals.extend(has_normals.then_some(vertex.normal));
            mesh.colors.extend(has_colors.then_some(vertex.color));
            for set in (0..2).filter(|&set| has_set[set]) {
                mesh.texcoords[set].push(vertex.texcoords[set]);
            }
        }
        let face = |[a, b, c]: [u32; 3]| if mirrored[c as usize] { [a, c, b] } else { [a, b, c] };
        mesh.faces = faces.into_iter().map(face).collect();
        Ok(mesh)
    }

    /// The triangle whose corners are the vertices `indices`, in the coordinates of `place`, which notes the corners.
    pub(super) fn triangle(&self, indices: [u32; 3], place: &mut Place) -> Result<Triangle> {
        let mut triangle = Triangle::flat([Vec3::ZERO; 3], self.material, 0);
        let mut mirrors = false;
        for (corner, index) in indices.into_iter().enumerate() {
            mirrors = self.place(index, corner, &mut triangle, place)?;
        }
        // A mirroring transform reverses the orientation of the corners. Exchanging two of the corners restores the front.
        Ok(if mirrors { triangle.flipped() } else { triangle })
    }

    /// Sets corner number `corner` of `triangle` to the vertex `index`. Returns whether the transform of the vertex mirrors.
    fn place(&self, index: u32, corner: usize, triangle: &mut Triangle, place: &mut Place) -> Result<bool> {
        let (vertex, mirrors) = self.vertex(index, place)?;
        triangle.positions[corner] = vertex.position;
        triangle.normals[corner] = vertex.normal;
        triangle.texcoords[corner] = vertex.texcoords;
        triangle.colors[corner] = vertex.color;
        Ok(mirrors)
    }

    /// The vertex `index` in the coordinates of `place`, which notes it, and whether its transform mirrors.
    fn vertex(&self, index: u32, place: &mut Place) -> Result<(Vertex, bool)> {
        let Self { document, what, vertices, .. } = self;
        let vertex = vertices.vertex(index as usize).ok_or_else(|| {
            document.damaged_mesh(format!(
                "{what}: an index asks for vertex {index}, but there are {}",
                vertices.count
            ))
        })?;
        let transform = self.pose.of(index as usize, self.influences).ok_or_else(|| {
            document.damaged_mesh(format!(
                "{what}: vertex {index} is bound to no joint, or to one that the skin does not have"
            ))
        })?;
        let world = transform.point(vertex.position);
        if !world.is_finite() || world.abs().max_element() > f64::from(MAX_COORDINATE) {
            return Err(bad_position(document, what, index, vertex.position));
        }
        if !vertex.texcoords.iter().all(|coordinates| coordinates.is_finite()) {
            return Err(document
                .fault(format!("{what}: texture coordinate of vertex {index} is not finite"))
                .help("correct the mesh's texture coordinates"));
        }
        place.note(world, vertex.position.as_dvec3(), transform.stretch());
        let (position, normal) = ((world - place.origin).as_vec3(), transform.normal(vertex.normal));
        Ok((Vertex { position, normal, ..vertex }, transform.mirrors))
    }
}

/// The error about a vertex with an unusable world position. `local` is its position in the mesh's frame.
fn bad_position(document: &Document, what: &str, vertex: u32, local: Vec3) -> Error {
    if local.is_finite() {
        document
            .fault(format!("{what}: vertex {vertex} lies more than {MAX_COORDINATE:e} m from the origin"))
            .help("glTF lengths are metres: scale the scene")
    } else {
        document
            .fault(format!("{what}: vertex {vertex} has a position that is not finite: {local}"))
            .help("correct the mesh: look for a division by zero where it was made")
    }
}

/// The largest number of placed primitives. The limit is needed because a small file can place any number of primitives without triangles.
const MAX_PLACEMENTS: usize = 1 << 20;

/// The largest number of triangles, counted once for each morph target.
const MAX_MORPHS: usize = 1 << 28;

/// The numbers of placements, instances and triangles so far. They are limited because a small file can place one mesh any number of times.
#[derive(Default)]
struct Counts {
    placements: usize,
    instances: usize,
    /// The number of triangles, including dropped triangles.
    total: usize,
    /// The number of triangles, counted once for each morph target.
    morphs: usize,
}

impl Counts {
    /// Adds `more` to `number`. Fails if the sum exceeds `most`. `what` names the counted objects in the error.
    fn add(
        document: &Document,
        number: &mut usize,
        more: usize,
        (most, what, help): (usize, &str, &str),
    ) -> Result<()> {
        *number = number.saturating_add(more);
        match *number > most {
            true => Err(document.fault(format!("more than {most} {what}")).help(help)),
            false => Ok(()),
        }
    }

    fn placements(&mut self, document: &Document, primitives: usize) -> Result<()> {
        let help = "join the meshes, or place fewer of them";
        let limit = (MAX_PLACEMENTS, "primitives, all instances counted", help);
        Self::add(document, &mut self.placements, primitives, limit)
    }

    fn instances(&mut self, document: &Document, count: usize) -> Result<()> {
        let limit = (MAX_TRIANGLES, INSTANCES, "place fewer of them, or join their meshes");
        Self::add(document, &mut self.instances, count, limit)
    }

    /// Counts the triangles of a primitive. Returns their number over all poses.
    fn triangles(&mut self, document: &Document, mesh: usize, poses: usize, targets: usize) -> Result<usize> {
        let count = mesh.saturating_mul(poses);
        let help = "simplify the meshes, or place fewer of them";
        let limit = (MAX_TRIANGLES, TRIANGLES, help);
        Self::add(document, &mut self.total, count, limit)?;
        let what = "triangles, counted once for each of their morph targets";
        let limit = (MAX_MORPHS, what, "apply the morph targets before the export");
        Self::add(document, &mut self.morphs, count.saturating_mul(targets), limit)?;
        Ok(count)
    }
}

/// The name of triangles in errors about their number.
pub(super) const TRIANGLES: &str = "triangles, all instances counted";
/// The name of instances in errors about their number.
pub(super) const INSTANCES: &str = "instances";

/// An empty vector with room for `count` items. Fails if there is no memory for them; `what` names the items.
pub(super) fn with_room<T>(document: &Document, count: usize, what: &str) -> Result<Vec<T>> {
    let mut items = Vec::new();
    items.try_reserve_exact(count).map_err(|_| {
        document
            .fault(format!("there is no memory for {count} {what}"))
            .help("simplify the meshes, place fewer of them, or use a machine with more memory")
    })?;
    Ok(items)
}

#[derive(Clone, Copy)]
struct Progress<'a> {
    pub watcher: Watcher<'a>,
    /// The index of the current node, and the number of nodes.
    pub position: usize,
    pub nodes: usize,
}

impl Progress<'_> {
    /// Regularly tells the watcher that `done` of the node's `of` triangles are finished.
    fn at(self, done: usize, of: usize) -> Result<()> {
        self.watcher.count(done, || (self.position as f32 + done as f32 / of as f32) / self.nodes as f32)
    }
}
