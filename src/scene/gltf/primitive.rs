//! One primitive: the vertices of its triangles, and their positions and texture coordinates.

use glam::{Vec2, Vec3};
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;

use super::Document;
use super::accessor::{self, Array};
use super::textures::Coordinates;
use crate::error::Result;

/// Floats, and what `KHR_mesh_quantization` adds.
const COORDINATES: [ComponentType; 5] =
    [ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];

const INDICES: [ComponentType; 3] = [ComponentType::U8, ComponentType::U16, ComponentType::U32];

/// A primitive's arrays, open for reading triangle by triangle.
pub(super) struct Corners<'a> {
    mode: Mode,
    indices: Option<Array<'a>>,
    positions: Array<'a>,
    texcoords: Option<(Array<'a>, &'a Coordinates)>,
    /// Number of triangles, degenerate ones included.
    pub triangles: usize,
    /// Number of vertices that an index may ask for.
    pub vertex_count: usize,
}

impl<'a> Corners<'a> {
    /// Opens the arrays; `texture` says which texture coordinates its material reads.
    pub(super) fn open(
        document: &'a Document,
        what: &str,
        primitive: &json::mesh::Primitive,
        texture: Option<&'a Coordinates>,
    ) -> Result<Self> {
        let mode = match primitive.mode {
            Checked::Valid(mode) => mode,
            Checked::Invalid => Mode::Triangles,
        };
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let Some(positions) = attribute(Semantic::Positions) else {
            return Err(
                document.fault(format!("{what} has no POSITION"), "the mesh is damaged: export it again")
            );
        };
        let positions =
            accessor::open(document, &format!("{what}: POSITION"), positions, Type::Vec3, &COORDINATES)?;
        let indices = primitive
            .indices
            .map(|indices| {
                accessor::open(document, &format!("{what}: its index list"), indices, Type::Scalar, &INDICES)
            })
            .transpose()?;
        let texcoords = match texture {
            None => None,
            Some(coordinates) => {
                let set = coordinates.set;
                let Some(accessor) = attribute(Semantic::TexCoords(set)) else {
                    return Err(document.fault(
                        format!(
                            "{what} has no TEXCOORD_{set}, but its material's base colour texture reads it"
                        ),
                        "unwrap the mesh, or remove the texture from the material",
                    ));
                };
                let what = format!("{what}: TEXCOORD_{set}");
                let array = accessor::open(document, &what, accessor, Type::Vec2, &COORDINATES)?;
                if array.count < positions.count {
                    return Err(document.fault(
                        format!("{what} has {} elements for {} vertices", array.count, positions.count),
                        "the mesh is damaged: export it again",
                    ));
                }
                Some((array, coordinates))
            }
        };
        let corners = indices.map_or(positions.count, |indices| indices.count);
        let triangles = match mode {
            Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
            _ if corners % 3 == 0 => corners / 3,
            _ => {
                return Err(document.fault(
                    format!("{what} has {corners} corners, which is no multiple of 3"),
                    "the mesh is damaged: export it again",
                ));
            }
        };
        Ok(Self { mode, indices, positions, texcoords, triangles, vertex_count: positions.count })
    }

    /// The vertices of triangle `index`, counter-clockwise around its front. `None` past the end.
    pub(super) fn vertices(&self, index: usize) -> Option<[u32; 3]> {
        let corners = match self.mode {
            // Every second triangle of a strip is wound the other way round.
            Mode::TriangleStrip if index % 2 == 1 => [index, index + 2, index + 1],
            Mode::TriangleStrip => [index, index + 1, index + 2],
            Mode::TriangleFan => [index + 1, index + 2, 0],
            _ => [3 * index, 3 * index + 1, 3 * index + 2],
        };
        let vertex = |corner: usize| match &self.indices {
            Some(indices) => indices.integer(corner),
            None => u32::try_from(corner).ok(),
        };
        Some([vertex(corners[0])?, vertex(corners[1])?, vertex(corners[2])?])
    }

    /// In the mesh's frame. `None` when there is no such vertex.
    pub(super) fn position(&self, vertex: u32) -> Option<Vec3> {
        self.positions.vector::<3>(vertex as usize).map(Vec3::from_array)
    }

    /// As the texture reads it, or zero without a texture. `None` when there is no such vertex.
    pub(super) fn texcoord(&self, vertex: u32) -> Option<Vec2> {
        match &self.texcoords {
            None => Some(Vec2::ZERO),
            Some((array, coordinates)) => {
                array.vector::<2>(vertex as usize).map(|uv| coordinates.transform(Vec2::from_array(uv)))
            }
        }
    }
}
