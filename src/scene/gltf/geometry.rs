//! From placed meshes to triangles in world space.

use glam::{DAffine3, DMat3, Vec3};
use gltf::json;
use gltf::json::validation::Checked;

use super::materials::Materials;
use super::nodes::Placed;
use super::primitive::Corners;
use super::regions::{self, Label};
use super::vertices::Vertices;
use super::{Document, called};
use crate::error::{Error, Result};
use crate::scene::Triangle;

/// More triangles would not fit the memory of the machines that we know; a small file can ask for any number of them
/// by placing one mesh many times.
const MAX_TRIANGLES: usize = 1 << 24;

/// Metres. Beyond it the square of an area overflows single precision.
const MAX_COORDINATE: f32 = 1e9;

/// The triangles of one primitive at one node, their region still to be filled in.
pub(super) struct Surface {
    /// Index into the placed nodes.
    pub placed: usize,
    /// `extras.region` of the primitive, else of its mesh, else what the node has.
    pub label: Option<Label>,
    /// Never empty.
    pub triangles: Vec<Triangle>,
}

/// All surfaces of the scene, in the order of the nodes.
pub(super) fn assemble(
    document: &mut Document,
    placed: &[Placed],
    materials: &mut Materials,
) -> Result<Vec<Surface>> {
    let mut assembly = Assembly::default();
    for (position, node) in placed.iter().enumerate() {
        let source = &document.root.nodes[node.node];
        let Some(index) = source.mesh.map(|mesh| mesh.value()) else { continue };
        let Some(mesh) = document.root.meshes.get(index) else {
            return Err(document.fault(
                format!(
                    "{} refers to mesh {index}, which does not exist",
                    called("node", node.node, source.name.as_ref())
                ),
                "the file is damaged: export it again",
            ));
        };
        let mesh_name = called("mesh", index, mesh.name.as_ref());
        let mesh_label = regions::label(document, &mesh_name, &mesh.extras)?;
        for primitive in 0..mesh.primitives.len() {
            let placement = Placement {
                what: format!("{mesh_name}, primitive {primitive}"),
                mesh: index,
                primitive,
                transform: &node.transform,
            };
            let extras = &document.root.meshes[index].primitives[primitive].extras;
            let label = regions::label(document, &placement.what, extras)?
                .or_else(|| mesh_label.clone())
                .or_else(|| node.label.clone());
            let triangles = assembly.place(document, &placement, materials)?;
            if !triangles.is_empty() {
                assembly.surfaces.push(Surface { placed: position, label, triangles });
            }
        }
    }
    if assembly.degenerate > 0 {
        document.warnings.add(format!("{} triangles without area were dropped", assembly.degenerate));
    }
    if assembly.surfaces.is_empty() {
        return Err(document.fault(
            "no triangles in the scene",
            "export meshes with faces, in the scene that the file shows by default",
        ));
    }
    Ok(assembly.surfaces)
}

/// One primitive of one mesh, at one node.
struct Placement<'a> {
    what: String,
    mesh: usize,
    primitive: usize,
    transform: &'a DAffine3,
}

#[derive(Default)]
struct Assembly {
    surfaces: Vec<Surface>,
    /// Triangles met, the dropped ones included.
    total: usize,
    degenerate: usize,
}

impl Assembly {
    fn place(
        &mut self,
        document: &mut Document,
        placement: &Placement,
        materials: &mut Materials,
    ) -> Result<Vec<Triangle>> {
        let what = &placement.what;
        let primitive = &document.root.meshes[placement.mesh].primitives[placement.primitive];
        let material_index = primitive.material.map(|material| material.value());
        if !warn_of_ignored(document, placement)? {
            return Ok(Vec::new());
        }
        let material = materials.index_of(document, what, material_index)?;
        let primitive = &document.root.meshes[placement.mesh].primitives[placement.primitive];
        let vertices = Vertices::open(document, what, primitive, &materials.list[material as usize])?;
        let corners = Corners::open(document, what, primitive, vertices.count)?;
        self.total = self.total.saturating_add(corners.triangles);
        if self.total > MAX_TRIANGLES {
            return Err(document.fault(
                format!("more than {MAX_TRIANGLES} triangles, all instances counted"),
                "simplify the meshes, or place fewer of them",
            ));
        }
        let placer = Placer { document, what, transform: Transform::new(placement.transform) };
        let mut triangles = Vec::with_capacity(corners.triangles);
        for index in 0..corners.triangles {
            let mut triangle = Triangle::flat([Vec3::ZERO; 3], material, 0);
            let indices = corners.vertices(index).ok_or_else(|| cut_short(document, what))?;
            for (corner, vertex) in indices.into_iter().enumerate() {
                placer.place(&vertices, vertex, corner, &mut triangle)?;
            }
            // A mirroring transform turns the order of the corners round; swapping two keeps the front where it was.
            if placer.transform.mirrors {
                triangle = triangle.turned();
            }
            if triangle.has_area() {
                triangles.push(triangle.with_normals_in_front());
            } else {
                self.degenerate += 1;
            }
        }
        Ok(triangles)
    }
}

/// A map of points, with the one of normals that belongs to it.
struct Transform {
    points: DAffine3,
    normals: DMat3,
    mirrors: bool,
}

impl Transform {
    fn new(points: &DAffine3) -> Self {
        let DMat3 { x_axis, y_axis, z_axis } = points.matrix3;
        // The inverse transposed but for its length, which exists for a map that flattens, too.
        let cofactors = DMat3::from_cols(y_axis.cross(z_axis), z_axis.cross(x_axis), x_axis.cross(y_axis));
        let mirrors = points.matrix3.determinant() < 0.0;
        Self { points: *points, normals: if mirrors { -cofactors } else { cofactors }, mirrors }
    }
}

/// Brings vertices of a primitive into the world.
struct Placer<'a> {
    document: &'a Document,
    what: &'a str,
    transform: Transform,
}

impl Placer<'_> {
    fn place(
        &self,
        vertices: &Vertices<'_>,
        index: u32,
        corner: usize,
        triangle: &mut Triangle,
    ) -> Result<()> {
        let Self { document, what, transform } = self;
        let vertex = vertices.vertex(index as usize).ok_or_else(|| {
            document.fault(
                format!("{what}: an index asks for vertex {index}, but there are {}", vertices.count),
                "the mesh is damaged: export it again",
            )
        })?;
        let world = transform.points.transform_point3(vertex.position.as_dvec3()).as_vec3();
        if !world.is_finite() || world.abs().max_element() > MAX_COORDINATE {
            return Err(bad_position(document, what, index, vertex.position));
        }
        if !vertex.texcoords.iter().all(|coordinates| coordinates.is_finite()) {
            return Err(document.fault(
                format!("{what}: texture coordinate of vertex {index} is not finite"),
                "correct the mesh's texture coordinates",
            ));
        }
        triangle.positions[corner] = world;
        triangle.normals[corner] =
            (transform.normals * vertex.normal.as_dvec3()).normalize_or_zero().as_vec3();
        triangle.texcoords[corner] = vertex.texcoords;
        triangle.colors[corner] = vertex.color;
        Ok(())
    }
}

/// Warns of what a primitive has beside its triangles; whether it has triangles at all.
fn warn_of_ignored(document: &mut Document, placement: &Placement) -> Result<bool> {
    let what = &placement.what;
    let primitive = &document.root.meshes[placement.mesh].primitives[placement.primitive];
    let mut warnings = Vec::new();
    let drawn = match &primitive.mode {
        Checked::Invalid => {
            return Err(
                document.fault(format!("{what} has an unknown mode"), "the file is damaged: export it again")
            );
        }
        Checked::Valid(
            json::mesh::Mode::Triangles | json::mesh::Mode::TriangleStrip | json::mesh::Mode::TriangleFan,
        ) => true,
        Checked::Valid(_) => {
            warnings.push(format!("{what} consists of points or lines, which have no area: ignored"));
            false
        }
    };
    if drawn {
        if primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
            warnings.push(format!("{what}: its morph targets are ignored; the mesh is taken at rest"));
        }
    }
    warnings.into_iter().for_each(|warning| document.warnings.add(warning));
    Ok(drawn)
}

fn cut_short(document: &Document, what: &str) -> Error {
    document.fault(format!("{what}: its data ends too early"), "the mesh is damaged: export it again")
}

fn bad_position(document: &Document, what: &str, vertex: u32, local: Vec3) -> Error {
    if local.is_finite() {
        document.fault(
            format!("{what}: vertex {vertex} lies more than {MAX_COORDINATE:e} m from the origin"),
            "glTF lengths are metres: scale the scene",
        )
    } else {
        document.fault(
            format!("{what}: vertex {vertex} has a position that is not finite: {local}"),
            "correct the mesh: look for a division by zero where it was made",
        )
    }
}
