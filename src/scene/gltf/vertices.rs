//! A primitive's vertices: positions, normals, texture coordinates and colours.

use glam::{Vec2, Vec3};
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::Document;
use super::accessor::{self, Array};
use crate::error::Result;
use crate::scene::{Material, Triangle};

/// Floats, and what `KHR_mesh_quantization` adds.
pub(super) const COORDINATES: [ComponentType; 5] =
    [ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];

const COLORS: [ComponentType; 3] = [ComponentType::F32, ComponentType::U8, ComponentType::U16];

/// A vertex in the mesh's frame.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    pub position: Vec3,
    /// As in the file; zero without one.
    pub normal: Vec3,
    pub texcoords: [Vec2; 2],
    pub color: [u16; 4],
}

/// Arrays of a primitive, open for reading vertex by vertex.
pub(super) struct Vertices<'a> {
    positions: Array<'a>,
    normals: Option<Array<'a>>,
    texcoords: [Option<Array<'a>>; 2],
    colors: Option<(Array<'a>, Type)>,
    /// Number of vertices that an index may ask for.
    pub count: usize,
}

impl<'a> Vertices<'a> {
    /// Opens what `material` needs of the primitive's attributes.
    pub(super) fn open(
        document: &'a Document,
        what: &str,
        primitive: &json::mesh::Primitive,
        material: &Material,
    ) -> Result<Self> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = attribute(Semantic::Positions) else {
            return Err(
                document.fault(format!("{what} has no POSITION"), "the mesh is damaged: export it again")
            );
        };
        let positions =
            accessor::open(document, &format!("{what}: POSITION"), positions, Type::Vec3, &COORDINATES)?;
        let count = positions.count;
        let open = |name: &str, semantic, shape, components| {
            let Some(accessor) = attribute(semantic) else { return Ok(None) };
            open_for(document, &format!("{what}: {name}"), accessor, shape, components, count).map(Some)
        };
        let normals = open("NORMAL", Semantic::Normals, Type::Vec3, &COORDINATES)?;
        let mut texcoords = [None; 2];
        for (role, texture) in material.textures() {
            let set = texture.set;
            let array = open(&format!("TEXCOORD_{set}"), Semantic::TexCoords(set), Type::Vec2, &COORDINATES)?;
            if array.is_none() {
                return Err(document.fault(
                    format!("{what} has no TEXCOORD_{set}, but its material's {role} texture reads it"),
                    "unwrap the mesh, or remove the texture from the material",
                ));
            }
            texcoords[set as usize] = array;
        }
        let colors = match attribute(Semantic::Colors(0)) {
            None => None,
            Some(accessor) => {
                let source = document.root.accessors.get(accessor.value());
                let shape = match source.map(|source| source.type_) {
                    Some(Checked::Valid(Type::Vec3)) => Type::Vec3,
                    _ => Type::Vec4,
                };
                open("COLOR_0", Semantic::Colors(0), shape, &COLORS)?.map(|array| (array, shape))
            }
        };
        Ok(Self { positions, normals, texcoords, colors, count })
    }

    /// `None` when there is no such vertex.
    pub(super) fn vertex(&self, index: usize) -> Option<Vertex> {
        let position = Vec3::from_array(self.positions.vector(index)?);
        let normal = match &self.normals {
            Some(normals) => Vec3::from_array(normals.vector(index)?),
            None => Vec3::ZERO,
        };
        let mut texcoords = [Vec2::ZERO; 2];
        for (coordinates, array) in texcoords.iter_mut().zip(&self.texcoords) {
            if let Some(array) = array {
                *coordinates = Vec2::from_array(array.vector(index)?);
            }
        }
        let color = match &self.colors {
            None => Triangle::WHITE,
            Some((array, Type::Vec3)) => {
                let [red, green, blue] = array.vector(index)?;
                quantized([red, green, blue, 1.0])
            }
            Some((array, _)) => quantized(array.vector(index)?),
        };
        Some(Vertex { position, normal, texcoords, color })
    }
}

/// Opens an attribute that must have an element for each of `count` vertices.
fn open_for<'a>(
    document: &'a Document,
    what: &str,
    accessor: json::Index<json::Accessor>,
    shape: Type,
    components: &[ComponentType],
    count: usize,
) -> Result<Array<'a>> {
    let array = accessor::open(document, what, accessor, shape, components)?;
    if array.count < count {
        return Err(document.fault(
            format!("{what} has {} elements for {count} vertices", array.count),
            "the mesh is damaged: export it again",
        ));
    }
    Ok(array)
}

/// A colour in 16 bits a channel; what lies outside 0 to 1 is brought to the nearest end, and NaN to 0.
fn quantized(color: [f32; 4]) -> [u16; 4] {
    color.map(|channel| (channel.clamp(0.0, 1.0) * 65535.0).round() as u16)
}
