//! A primitive's triangles and vertices, with morph targets at their rest weights.

use glam::{Vec2, Vec3};
use gltf_json as json;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::mesh::{Mode, Semantic};
use gltf_json::validation::Checked;

use super::buffers::OpenAccessor;
use super::{Document, buffers};
use crate::error::Result;
use crate::scene::Triangle;

/// The component types of coordinates: floats, and the integer types that `KHR_mesh_quantization` adds.
const COORDINATES: [ComponentType; 5] =
    [ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];

const COLORS: [ComponentType; 3] = [ComponentType::F32, ComponentType::U8, ComponentType::U16];

#[derive(Clone, Copy, Default)]
pub(super) struct Vertex {
    pub position: Vec3,
    /// The normal from the file. It is zero if the file states none.
    pub normal: Vec3,
    pub texcoords: [Vec2; 2],
    pub color: [u16; 4],
}

/// The attributes of a primitive, opened for reading vertex by vertex.
pub(super) struct Vertices<'a> {
    positions: OpenAccessor<'a>,
    normals: Option<OpenAccessor<'a>>,
    texcoords: [Option<OpenAccessor<'a>>; 2],
    colors: Option<(OpenAccessor<'a>, Type)>,
    targets: Vec<MorphTarget<'a>>,
    pub count: usize,
}

/// A morph target with its rest weight.
struct MorphTarget<'a> {
    weight: f32,
    positions: Option<OpenAccessor<'a>>,
    normals: Option<OpenAccessor<'a>>,
}

impl<'a> Vertices<'a> {
    /// Opens the attributes, the morph targets with the rest weights `weights`, and the sets of texture coordinates `has_set`.
    pub(super) fn open(
        document: &'a Document,
        what: &str,
        primitive: &json::mesh::Primitive,
        has_set: [bool; 2],
        weights: &[f32],
    ) -> Result<Self> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
        let position = attribute(Semantic::Positions);
        let Some(positions) = open(document, (what, "POSITION"), position, (Type::Vec3, &COORDINATES), 0)?
        else {
            return Err(document.damaged_mesh(format!("{what} has no POSITION")));
        };
        let count = positions.count;
        let open =
            |name: &str, semantic, array| open(document, (what, name), attribute(semantic), array, count);
        let normals = open("NORMAL", Semantic::Normals, (Type::Vec3, &COORDINATES))?;
        let mut texcoords = [None; 2];
        for set in (0..2).filter(|&set| has_set[set as usize]) {
            let name = format!("TEXCOORD_{set}");
            texcoords[set as usize] = open(&name, Semantic::TexCoords(set), (Type::Vec2, &COORDINATES))?;
        }
        let color = attribute(Semantic::Colors(0));
        let color = color.and_then(|accessor| document.root.accessors.get(accessor.value()));
        let shape = match color.map(|source| source.type_) {
            Some(Checked::Valid(Type::Vec3)) => Type::Vec3,
            _ => Type::Vec4,
        };
        let colors = open("COLOR_0", Semantic::Colors(0), (shape, &COLORS))?.map(|array| (array, shape));
        let targets = open_targets(document, what, primitive, weights, count)?;
        Ok(Self { positions, normals, texcoords, colors, targets, count })
    }

    /// Whether there are normals, texture coordinates of each set, and colours.
    pub(super) fn has(&self) -> (bool, [bool; 2], bool) {
        let [first, second] = &self.texcoords;
        (self.normals.is_some(), [first.is_some(), second.is_some()], self.colors.is_some())
    }

    /// The number of morph targets whose weight is not zero.
    pub(super) fn targets(&self) -> usize {
        self.targets.len()
    }

    pub(super) fn vertex(&self, index: usize) -> Option<Vertex> {
        let mut position = Vec3::from_array(self.positions.vector(index)?);
        let mut normal = match &self.normals {
            Some(normals) => Vec3::from_array(normals.vector(index)?),
            None => Vec3::ZERO,
        };
        for target in &self.targets {
            if let Some(positions) = &target.positions {
                position += target.weight * Vec3::from_array(positions.vector(index)?);
            }
            if let (Some(normals), Some(_)) = (&target.normals, &self.normals) {
                normal += target.weight * Vec3::from_array(normals.vector(index)?);
            }
        }
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
                Triangle::quantized([red, green, blue, 1.0])
            }
            Some((array, _)) => Triangle::quantized(array.vector(index)?),
        };
        Some(Vertex { position, normal, texcoords, color })
    }
}

fn open_targets<'a>(
    document: &'a Document,
    what: &str,
    primitive: &json::mesh::Primitive,
    weights: &[f32],
    count: usize,
) -> Result<Vec<MorphTarget<'a>>> {
    let mut targets = Vec::new();
    for (index, (target, &weight)) in primitive.targets.iter().flatten().zip(weights).enumerate() {
        if weight == 0.0 {
            continue;
        }
        if !weight.is_finite() {
            return Err(document
                .fault(format!("{what}: the weight of its morph target {index} is {weight}"))
                .help("correct the weights of the mesh or the node"));
        }
        let open = |name: &str, accessor: Option<json::Index<json::Accessor>>| {
            let source = accessor.and_then(|accessor| document.root.accessors.get(accessor.value()));
            // An accessor without data has only zeros, which move no vertex.
            let is_zero =
                source.is_some_and(|source| source.buffer_view.is_none() && source.sparse.is_none());
            let name = format!("{name} of its morph target {index}");
            open(document, (what, &name), accessor.filter(|_| !is_zero), (Type::Vec3, &COORDINATES), count)
        };
        let positions = open("POSITION", target.positions)?;
        let normals = open("NORMAL", target.normals)?;
        if positions.is_some() || normals.is_some() {
            targets.push(MorphTarget { weight, positions, normals });
        }
    }
    Ok(targets)
}

/// Opens an optional array, and checks that it has at least `least` elements. `what` names its user in messages, and `name` the array.
pub(super) fn open<'a>(
    document: &'a Document,
    (what, name): (&str, &str),
    accessor: Option<json::Index<json::Accessor>>,
    (shape, components): (Type, &[ComponentType]),
    least: usize,
) -> Result<Option<OpenAccessor<'a>>> {
    let Some(accessor) = accessor else { return Ok(None) };
    let what = format!("{what}: {name}");
    let array = buffers::open_accessor(document, &what, accessor, shape, components)?;
    if array.count < least {
        return Err(
            document.damaged_mesh(format!("{what} has {} elements for {least} vertices", array.count))
        );
    }
    Ok(Some(array))
}

const INDICES: [ComponentType; 3] = [ComponentType::U8, ComponentType::U16, ComponentType::U32];

pub(super) struct Corners<'a> {
    mode: Mode,
    indices: Option<OpenAccessor<'a>>,
    /// The number of triangles, including degenerate ones.
    pub triangles: usize,
}

impl<'a> Corners<'a> {
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
        let indices =
            open(document, (what, "its index list"), primitive.indices, (Type::Scalar, &INDICES), 0)?;
        let corners = indices.map_or(vertices, |indices| indices.count);
        let triangles = match mode {
            Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
            _ if corners % 3 == 0 => corners / 3,
            _ => {
                return Err(document
                    .damaged_mesh(format!("{what} has {corners} corners, which is not a multiple of 3")));
            }
        };
        Ok(Self { mode, indices, triangles })
    }

    /// The vertices of triangle `index`, counter-clockwise as seen from its front. `None` past the end.
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
