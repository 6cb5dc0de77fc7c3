//! Decompression of buffer views (`EXT_meshopt_compression`, `KHR_meshopt_compression`) and primitives (`KHR_draco_mesh_compression`).

use std::collections::BTreeMap;

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf_json as json;
use gltf_json::accessor::{Accessor, ComponentType, GenericComponentType, Type};
use gltf_json::mesh::{Mode, Semantic};
use gltf_json::validation::Checked;
use meshoptimizer_rs::{Limits, Workspace, codec};
use serde::Deserialize;

use super::buffers::compression;
use super::extensions::DRACO;
use super::{Document, buffers, object_name};
use crate::error::Result;
use crate::scene::triangle::MAX_TRIANGLES;

/// The largest total size of a file's decompressed views, in bytes. A few kilobytes can encode any number of equal vertices.
const MAX_BYTES: usize = 1 << 30;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct CompressedView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: usize,
    count: usize,
    mode: String,
    #[serde(default = "none")]
    filter: String,
}

fn none() -> String {
    "NONE".into()
}

/// Decompresses every compressed buffer view into a new buffer, and makes the view refer to this buffer.
pub(super) fn decompress_views(document: &mut Document) -> Result<()> {
    let mut workspace = Workspace::new(Limits { max_bytes: MAX_BYTES, ..Limits::default() });
    let mut total = 0_usize;
    for index in 0..document.root.buffer_views.len() {
        let Some(value) = compression(&document.root.buffer_views[index]).cloned() else { continue };
        let bytes = parse(value)
            .and_then(|compressed| {
                total = total.saturating_add(compressed.count.saturating_mul(compressed.byte_stride));
                if total > MAX_BYTES {
                    return Err(format!("the views have more than {MAX_BYTES} bytes"));
                }
                decoded_view(document, &compressed, &mut workspace)
            })
            .map_err(|why| {
                document
                    .fault(format!("buffer view {index} cannot be decompressed (meshopt): {why}"))
                    .help("the file is damaged or too large: export it again, or without mesh compression")
            })?;
        let buffer = add_buffer(document, bytes);
        let view = &mut document.root.buffer_views[index];
        view.byte_length = document.buffers[buffer.value()].len().into();
        (view.buffer, view.byte_offset) = (buffer, None);
    }
    Ok(())
}

fn parse(value: json::Value) -> std::result::Result<CompressedView, String> {
    serde_json::from_value(value).map_err(|error| error.to_string())
}

fn decoded_view(
    document: &Document,
    of: &CompressedView,
    workspace: &mut Workspace,
) -> std::result::Result<Vec<u8>, String> {
    let end = of.byte_offset.checked_add(of.byte_length);
    let source = document.buffers.get(of.buffer).zip(end).and_then(|(all, end)| all.get(of.byte_offset..end));
    let source = source.ok_or_else(|| format!("its data end outside buffer {}", of.buffer))?;
    let (count, stride) = (of.count, of.byte_stride);
    let message = |error: meshoptimizer_rs::Error| error.to_string();
    let mut bytes = match of.mode.as_str() {
        "ATTRIBUTES" => codec::decode_vertex_buffer(count, stride, source, workspace),
        "TRIANGLES" => codec::decode_index_buffer(count, stride, source, workspace),
        "INDICES" => codec::decode_index_sequence(count, stride, source, workspace),
        other => return Err(format!("its mode is {other}")),
    }
    .map_err(message)?;
    let data = &mut bytes;
    match of.filter.as_str() {
        "NONE" => Ok(()),
        "OCTAHEDRAL" => codec::decode_filter_oct(data, count, stride, workspace),
        "QUATERNION" => codec::decode_filter_quat(data, count, stride, workspace),
        "EXPONENTIAL" => codec::decode_filter_exp(data, count, stride, workspace),
        "COLOR" => codec::decode_filter_color(data, count, stride, workspace),
        other => return Err(format!("its filter is {other}")),
    }
    .map_err(message)?;
    Ok(bytes)
}

fn add_buffer(document: &mut Document, bytes: Vec<u8>) -> json::Index<json::Buffer> {
    document.buffers.push(bytes);
    // The cast is exact, because memory cannot hold 2³² buffers.
    json::Index::new(document.buffers.len() as u32 - 1)
}

const HELP: &str = "the file is damaged or too large: export it again, or without mesh compression";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct CompressedPrimitive {
    buffer_view: u32,
    /// The identifier of each attribute in the compressed mesh.
    attributes: BTreeMap<String, u32>,
}

/// Decompresses every compressed primitive, and makes its indices and attributes refer to new accessors.
pub(super) fn decompress_primitives(document: &mut Document) -> Result<()> {
    for mesh in 0..document.root.meshes.len() {
        for primitive in 0..document.root.meshes[mesh].primitives.len() {
            let source = &document.root.meshes[mesh].primitives[primitive];
            let extension = source.extensions.as_ref().and_then(|extensions| extensions.others.get(DRACO));
            let Some(extension) = extension.cloned() else { continue };
            let name = object_name("mesh", mesh, document.root.meshes[mesh].name.as_ref());
            let what = format!("{name}, primitive {primitive}");
            let compressed: CompressedPrimitive = serde_json::from_value(extension).map_err(|error| {
                document.fault(format!("{what}: its {DRACO} cannot be read: {error}")).help(HELP)
            })?;
            let decoded = decode(document, &what, &compressed)?;
            replace(document, &what, [mesh, primitive], &compressed, &decoded)?;
        }
    }
    Ok(())
}

fn decode(document: &Document, what: &str, compressed: &CompressedPrimitive) -> Result<Mesh> {
    let view = json::Index::new(compressed.buffer_view);
    let (bytes, _) = buffers::view(document, what, view)?;
    let limits = DecodeLimits::default()
        .with_max_points(3 * MAX_TRIANGLES as u64)
        .with_max_faces(MAX_TRIANGLES as u64)
        .with_max_decoded_bytes(MAX_BYTES as u64);
    let mut mesh = Mesh::new();
    MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh).map_err(
        |error| document.fault(format!("{what} cannot be decompressed (Draco): {error}")).help(HELP),
    )?;
    Ok(mesh)
}

/// Makes the indices and attributes of a primitive refer to the decoded mesh.
fn replace(
    document: &mut Document,
    what: &str,
    [mesh, primitive]: [usize; 2],
    compressed: &CompressedPrimitive,
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
            return Err(document
                .fault(format!("{what}: its {name} is not in the compressed mesh"))
                .help(HELP));
        };
        let (Checked::Valid(shape), Checked::Valid(component)) = (like.type_, like.component_type) else {
            return Err(document.fault(format!("{what}: its {name} has an unknown type")).help(HELP));
        };
        let values = found.read_f32s(count, shape.multiplicity());
        let bytes = values.into_iter().flat_map(|value| encoded(value, component.0)).collect();
        let accessor = add(document, like, bytes, count);
        replaced.insert(Checked::Valid(semantic), accessor);
    }
    if !replaced.contains_key(&Checked::Valid(Semantic::Positions)) {
        return Err(document.fault(format!("{what} has no POSITION")).help(HELP));
    }
    let primitive = &mut document.root.meshes[mesh].primitives[primitive];
    primitive.attributes = replaced;
    // A compressed mesh has separate triangles, even if the file states a strip.
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
    let buffer = add_buffer(document, bytes);
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

/// A value as bytes of its accessor's component type. The casts are exact, because values for integer types are integers.
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
