//! `KHR_draco_mesh_compression`: primitives that are decompressed before anything reads them.

use std::collections::BTreeMap;

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf_json as json;
use gltf_json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf_json::mesh::{Mode, Semantic};
use gltf_json::validation::Checked;
use serde::Deserialize;

use super::{Document, buffers, object_name};
use crate::error::Result;
use crate::scene::triangle::MAX_TRIANGLES;

pub(super) const NAME: &str = "KHR_draco_mesh_compression";

/// The largest number of bytes of all attributes of one primitive.
const MAX_BYTES: u64 = 1 << 30;

const HELP: &str = "the file is damaged or too large: export it again, or without mesh compression";

/// The extension of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Compressed {
    buffer_view: u32,
    /// The identifier of each attribute in the compressed mesh.
    attributes: BTreeMap<String, u32>,
}

/// Decompresses every compressed primitive. Its indices and attributes then refer to new accessors.
pub(super) fn decompress(document: &mut Document) -> Result<()> {
    for mesh in 0..document.root.meshes.len() {
        for primitive in 0..document.root.meshes[mesh].primitives.len() {
            let source = &document.root.meshes[mesh].primitives[primitive];
            let extension = source.extensions.as_ref().and_then(|extensions| extensions.others.get(NAME));
            let Some(extension) = extension.cloned() else { continue };
            let name = object_name("mesh", mesh, document.root.meshes[mesh].name.as_ref());
            let what = format!("{name}, primitive {primitive}");
            let compressed: Compressed = serde_json::from_value(extension).map_err(|error| {
                document.fault(format!("{what}: its {NAME} cannot be read: {error}"), HELP)
            })?;
            let decoded = decode(document, &what, &compressed)?;
            replace(document, &what, [mesh, primitive], &compressed, &decoded)?;
        }
    }
    Ok(())
}

/// The mesh that a primitive stands for.
fn decode(document: &Document, what: &str, compressed: &Compressed) -> Result<Mesh> {
    let view = json::Index::new(compressed.buffer_view);
    let (bytes, _) = buffers::view(document, what, view)?;
    let limits = DecodeLimits::default()
        .with_max_points(3 * MAX_TRIANGLES as u64)
        .with_max_faces(MAX_TRIANGLES as u64)
        .with_max_decoded_bytes(MAX_BYTES);
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh)
        .map_err(|error| document.fault(format!("{what} cannot be decompressed (Draco): {error}"), HELP))?;
    Ok(mesh)
}

/// Makes indices and attributes of a primitive refer to those of the decoded mesh.
fn replace(
    document: &mut Document,
    what: &str,
    [mesh, primitive]: [usize; 2],
    compressed: &Compressed,
    decoded: &Mesh,
) -> Result<()> {
    let indices = decoded.faces().iter().flatten().flat_map(|point| point.0.to_le_bytes()).collect();
    let like = Accessor { type_: Checked::Valid(Type::Scalar), ..empty() };
    let indices = add(document, like, indices, 3 * decoded.num_faces());
    let count = decoded.num_points();
    let attributes = document.root.meshes[mesh].primitives[primitive].attributes.clone();
    let mut replaced = attributes.clone();
    for (semantic, accessor) in attributes {
        let Checked::Valid(semantic) = semantic else { continue };
        let name = semantic.to_string();
        let Some(&id) = compressed.attributes.get(&name) else { continue };
        let found = decoded.attribute_by_unique_id(id);
        let like = document.root.accessors.get(accessor.value()).cloned();
        let (Some(found), Some(like)) = (found, like) else {
            return Err(document.fault(format!("{what}: its {name} is not in the compressed mesh"), HELP));
        };
        let (Checked::Valid(shape), Checked::Valid(component)) = (like.type_, like.component_type) else {
            return Err(document.fault(format!("{what}: its {name} has an unknown type"), HELP));
        };
        let values = found.read_f32s(count, shape.multiplicity());
        let bytes = values.into_iter().flat_map(|value| encoded(value, component.0)).collect();
        let accessor = add(document, like, bytes, count);
        replaced.insert(Checked::Valid(semantic), accessor);
    }
    if !replaced.contains_key(&Checked::Valid(Semantic::Positions)) {
        return Err(document.fault(format!("{what} has no POSITION"), HELP));
    }
    let primitive = &mut document.root.meshes[mesh].primitives[primitive];
    primitive.attributes = replaced;
    // A compressed mesh has triangles, also where the file says that it has a strip.
    (primitive.indices, primitive.mode) = (Some(indices), Checked::Valid(Mode::Triangles));
    Ok(())
}

/// An accessor of unsigned integers without data.
fn empty() -> Accessor {
    Accessor {
        buffer_view: None,
        byte_offset: None,
        count: 0_usize.into(),
        component_type: Checked::Valid(GenericComponentType(ComponentType::U32)),
        extensions: None,
        extras: None,
        type_: Checked::Invalid,
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}

/// Adds an accessor of the same type as `like` with these elements.
fn add(document: &mut Document, like: Accessor, bytes: Vec<u8>, count: usize) -> json::Index<Accessor> {
    let byte_length = bytes.len().into();
    let buffer = document.add_buffer(bytes);
    let view = json::buffer::View {
        buffer,
        byte_length,
        byte_offset: None,
        byte_stride: None,
        name: None,
        target: None,
        extensions: None,
        extras: None,
    };
    let view = document.root.push(view);
    let count = count.into();
    document.root.push(Accessor { buffer_view: Some(view), byte_offset: None, sparse: None, count, ..like })
}

/// A value in the component type of its accessor. Integers came from integers, so that the casts are exact.
fn encoded(value: f32, component: ComponentType) -> Vec<u8> {
    match component {
        ComponentType::F32 => value.to_le_bytes().to_vec(),
        ComponentType::I8 => (value as i8).to_le_bytes().to_vec(),
        ComponentType::U8 => vec![value as u8],
        ComponentType::I16 => (value as i16).to_le_bytes().to_vec(),
        ComponentType::U16 => (value as u16).to_le_bytes().to_vec(),
        ComponentType::U32 => (value as u32).to_le_bytes().to_vec(),
    }
}
