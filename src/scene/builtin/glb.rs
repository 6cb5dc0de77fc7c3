//! Writing of models as `.glb` files. It supports what the shipped scenes need, and the bytes are the same on
//! every machine.

use serde_json::{Value, json};

use super::model::{Model, Part};
use crate::scene::{Camera, Material};

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;

impl Model {
    /// The model as a `.glb` file.
    pub fn to_glb(&self) -> Vec<u8> {
        write(self)
    }
}

/// The bytes of the file: positions are `f32`, indices `u16` if they fit and `u32` otherwise.
fn write(model: &Model) -> Vec<u8> {
    let mut binary = Binary::default();
    let mut nodes = Vec::new();
    let mut meshes = Vec::new();
    for (index, part) in model.parts.iter().enumerate() {
        let position = binary.positions(part);
        let indices = binary.indices(part);
        meshes.push(json!({
            "name": part.name,
            "primitives": [{ "attributes": { "POSITION": position }, "indices": indices, "material": part.material }],
        }));
        let mut node = json!({ "name": part.name, "mesh": index });
        if let Some(label) = part.label {
            node["extras"] = json!({ "region": label });
        }
        nodes.push(node);
    }
    nodes.push(camera_node(&model.camera));
    let document = json!({
        "asset": { "version": "2.0", "generator": "krylux" },
        "scene": 0,
        "scenes": [{ "name": model.name, "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": model.materials.iter().map(material).collect::<Vec<_>>(),
        "cameras": [camera(&model.camera)],
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{ "byteLength": binary.bytes.len() }],
        "extensionsUsed": ["KHR_materials_specular"],
    });
    assemble(document.to_string().into_bytes(), binary.bytes)
}

/// The binary chunk that is being written, with its buffer views and accessors.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    /// Appends the vertices of a part. Returns the index of their accessor.
    fn positions(&mut self, part: &Part) -> usize {
        let mut minimum = glam::Vec3::INFINITY;
        let mut maximum = glam::Vec3::NEG_INFINITY;
        let start = self.bytes.len();
        for &position in &part.positions {
            minimum = minimum.min(position);
            maximum = maximum.max(position);
            self.bytes.extend(position.to_array().iter().flat_map(|value| value.to_le_bytes()));
        }
        self.accessor(
            start,
            json!({
                "componentType": FLOAT,
                "type": "VEC3",
                "count": part.positions.len(),
                "min": minimum.to_array(),
                "max": maximum.to_array(),
            }),
        )
    }

    /// Appends the triangles of a part. Returns the index of their accessor.
    fn indices(&mut self, part: &Part) -> usize {
        let start = self.bytes.len();
        // The largest index of each width is reserved for primitive restart.
        let short = part.positions.len() < usize::from(u16::MAX);
        for &index in part.triangles.as_flattened() {
            if short {
                self.bytes.extend((index as u16).to_le_bytes());
            } else {
                self.bytes.extend(index.to_le_bytes());
            }
        }
        self.accessor(
            start,
            json!({
                "componentType": if short { UNSIGNED_SHORT } else { UNSIGNED_INT },
                "type": "SCALAR",
                "count": 3 * part.triangles.len(),
            }),
        )
    }

    /// Adds a buffer view for the bytes from `start` on, and `accessor` for that view. Returns the accessor's
    /// index.
    fn accessor(&mut self, start: usize, mut accessor: Value) -> usize {
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        accessor["bufferView"] = json!(self.views.len());
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length }));
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

fn material(material: &Material) -> Value {
    let [red, green, blue] = material.base_color.to_array();
    json!({
        "name": material.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [red, green, blue, 1.0],
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        },
        "doubleSided": material.double_sided,
        "extensions": { "KHR_materials_specular": { "specularFactor": material.specular } },
    })
}

fn camera(camera: &Camera) -> Value {
    // A pinhole has no clipping planes, but the format requires a near one. The field of view is rounded to
    // single precision, so that the last digit does not depend on the machine.
    let field = (2.0 * f64::from(camera.tan_half_fov).atan()) as f32;
    let mut perspective = json!({ "yfov": field, "znear": 0.001 });
    if let Some(aspect) = camera.aspect {
        perspective["aspectRatio"] = json!(aspect);
    }
    json!({ "name": "rig", "type": "perspective", "perspective": perspective })
}

/// The camera's node. Its pose is a matrix and not a quaternion, so that axes such as −Y are read back
/// exactly.
fn camera_node(camera: &Camera) -> Value {
    let columns = [
        camera.right.extend(0.0),
        camera.up.extend(0.0),
        -camera.forward.extend(0.0),
        camera.position.extend(1.0),
    ];
    let matrix: Vec<f32> =
        columns.iter().flat_map(|column| column.to_array()).map(|value| value + 0.0).collect();
    json!({ "name": camera.name, "camera": 0, "matrix": matrix })
}

/// The GLB container: a header and two chunks, each padded to a multiple of four bytes as the format
/// requires.
fn assemble(mut text: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut file = Vec::with_capacity(length);
    file.extend(b"glTF");
    file.extend(2_u32.to_le_bytes());
    file.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}
