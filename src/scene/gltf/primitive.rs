//! The triangles of a primitive as triples of vertex indices.

use gltf_json as json;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::Mode;
use gltf_json::validation::Checked;

use super::Document;
use super::accessor::{self, Array};
use crate::error::Result;

const INDICES: [ComponentType; 3] = [ComponentType::U8, ComponentType::U16, ComponentType::U32];

/// A primitive's index list and mode.
pub(super) struct Corners<'a> {
    mode: Mode,
    indices: Option<Array<'a>>,
    /// The number of triangles, degenerate ones included.
    pub triangles: usize,
}

impl<'a> Corners<'a> {
    /// Opens the index list of a primitive with `vertices` vertices.
    pub(super) fn open(
        document: &'a Document,
        what: &str,
        primitive: &json::mesh::Primitive,
        vertices: usize,
    ) -> Result<Self> {
        let mode = match primitive.mode {
            Checked::Valid(mode) => mode,
            Checked::Invalid => Mode::Triangles,
        };
        let indices = primitive
            .indices
            .map(|indices| {
                accessor::open(document, &format!("{what}: its index list"), indices, Type::Scalar, &INDICES)
            })
            .transpose()?;
        let corners = indices.map_or(vertices, |indices| indices.count);
        let triangles = match mode {
            Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
            _ if corners % 3 == 0 => corners / 3,
            _ => {
                return Err(document.fault(
                    format!("{what} has {corners} corners, which is not a multiple of 3"),
                    "the mesh is damaged: export it again",
                ));
            }
        };
        Ok(Self { mode, indices, triangles })
    }

    /// The vertices of triangle `index`, counter-clockwise around its front. `None` past the end.
    pub(super) fn vertices(&self, index: usize) -> Option<[u32; 3]> {
        let corners = match self.mode {
            // Every second triangle of a strip has the opposite orientation.
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
}
