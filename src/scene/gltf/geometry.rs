//! From placed meshes to triangles in world space.

use glam::{DAffine3, Vec2, Vec3};
use gltf::json;
use gltf::json::validation::Checked;

use super::materials::Materials;
use super::nodes::Placed;
use super::primitive::Corners;
use super::regions::{self, Label};
use super::{Document, called};
use crate::error::{Error, Result};
use crate::scene::Triangle;

/// More triangles would not fit the memory of the machines that we know; a small file can ask for any number of them
/// by placing one mesh many times.
const MAX_TRIANGLES: usize = 1 << 24;

/// Metres. Beyond it the square of an area overflows single precision.
const MAX_COORDINATE: f32 = 1e9;

/// A triangle whose height is a smaller part of its longest edge has no area that single precision can tell.
const MIN_HEIGHT_TO_EDGE: f64 = 1e-7;

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
        let (material, texture_coordinates) = materials.index_of(document, what, material_index)?;
        let primitive = &document.root.meshes[placement.mesh].primitives[placement.primitive];
        let corners = Corners::open(document, what, primitive, texture_coordinates.as_ref())?;
        self.total = self.total.saturating_add(corners.triangles);
        if self.total > MAX_TRIANGLES {
            return Err(document.fault(
                format!("more than {MAX_TRIANGLES} triangles, all instances counted"),
                "simplify the meshes, or place fewer of them",
            ));
        }
        // A mirroring transform turns the order of the corners round; swapping two keeps the front where it was.
        let mirrored = placement.transform.matrix3.determinant() < 0.0;
        let mut triangles = Vec::with_capacity(corners.triangles);
        for index in 0..corners.triangles {
            let mut positions = [Vec3::ZERO; 3];
            let mut texcoords = [Vec2::ZERO; 3];
            let vertices = corners.vertices(index).ok_or_else(|| cut_short(document, what))?;
            for (corner, vertex) in vertices.into_iter().enumerate() {
                let local = corners.position(vertex).ok_or_else(|| {
                    document.fault(
                        format!(
                            "{what}: an index asks for vertex {vertex}, but there are {}",
                            corners.vertex_count
                        ),
                        "the mesh is damaged: export it again",
                    )
                })?;
                let world = placement.transform.transform_point3(local.as_dvec3()).as_vec3();
                if !world.is_finite() || world.abs().max_element() > MAX_COORDINATE {
                    return Err(bad_position(document, what, vertex, local));
                }
                positions[corner] = world;
                texcoords[corner] = corners.texcoord(vertex).ok_or_else(|| cut_short(document, what))?;
                if !texcoords[corner].is_finite() {
                    return Err(document.fault(
                        format!("{what}: texture coordinate of vertex {vertex} is not finite"),
                        "correct the mesh's texture coordinates",
                    ));
                }
            }
            if mirrored {
                positions.swap(1, 2);
                texcoords.swap(1, 2);
            }
            if has_area(&positions) {
                triangles.push(Triangle { positions, texcoords, material, region: 0 });
            } else {
                self.degenerate += 1;
            }
        }
        Ok(triangles)
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
        if primitive
            .attributes
            .keys()
            .any(|attribute| matches!(attribute, Checked::Valid(json::mesh::Semantic::Colors(_))))
        {
            warnings.push(format!("{what}: its vertex colours are ignored"));
        }
    }
    warnings.into_iter().for_each(|warning| document.warnings.add(warning));
    Ok(drawn)
}

fn has_area(positions: &[Vec3; 3]) -> bool {
    let [a, b, c] = positions.map(|position| position.as_dvec3());
    let longest = [b - a, c - b, a - c].map(|edge| edge.length_squared()).into_iter().fold(0.0, f64::max);
    // Twice the area is the longest edge times the height on it.
    (b - a).cross(c - a).length() > MIN_HEIGHT_TO_EDGE * longest
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

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::has_area;

    #[test]
    fn only_what_single_precision_can_tell_from_a_line_has_area() {
        let small = [vec3(0.0, 0.0, 0.0), vec3(1e-12, 0.0, 0.0), vec3(0.0, 1e-12, 0.0)];
        assert!(has_area(&small), "size alone does not make a triangle degenerate");
        let point = [vec3(1.0, 2.0, 3.0); 3];
        assert!(!has_area(&point));
        let collinear = [vec3(0.1, 0.1, 0.1), vec3(0.2, 0.2, 0.2), vec3(0.7, 0.7, 0.7)];
        assert!(!has_area(&collinear));
        let sliver = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.5, 1e-6, 0.0)];
        assert!(has_area(&sliver));
    }
}
