//! A minimal glTF document that loads, to be broken or widened piece by piece.

#![allow(dead_code, reason = "each test file uses a part of this module")]

pub mod editable;
pub mod fuzz;

use std::path::PathBuf;

use base64::Engine;
use krylux::error::{Error, Result};
use krylux::scene::{self, LoadOptions, Scene};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Corners of the document's one triangle.
pub const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, -2.0], [1.0, 0.0, -2.0], [0.0, 1.0, -2.0]];

/// Positions, then `u16` indices at byte 36 (8 bytes with padding), then texture coordinates at byte 44.
pub fn buffer() -> Vec<u8> {
    let mut bytes: Vec<u8> = CORNERS.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0].iter().flat_map(|index| index.to_le_bytes()));
    bytes.extend([0.0_f32, 0.0, 1.0, 0.0, 0.0, 1.0].iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

pub fn data_uri(mime: &str, bytes: &[u8]) -> String {
    format!("data:{mime};base64,{}", base64::engine::general_purpose::STANDARD.encode(bytes))
}

/// One triangle called `sheet` at node 0 and a camera called `eye` at node 1, everything in one JSON text.
pub fn document() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "name": "sheet", "mesh": 0 }, { "name": "eye", "camera": 0 }],
        "cameras": [{ "name": "rig", "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }],
        "meshes": [{
            "name": "triangle",
            "primitives": [{
                "attributes": { "POSITION": 0, "TEXCOORD_0": 2 },
                "indices": 1,
                "material": 0,
            }],
        }],
        "materials": [{ "name": "paint" }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 },
            { "bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 3 },
            { "bufferView": 2, "componentType": 5126, "type": "VEC2", "count": 3 },
        ],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 6 },
            { "buffer": 0, "byteOffset": 44, "byteLength": 24 },
        ],
        "buffers": [{ "byteLength": 68, "uri": data_uri("application/octet-stream", &buffer()) }],
    })
}

/// [`document`] with the values at these JSON pointers set; missing members of objects are made.
pub fn with(changes: &[(&str, Value)]) -> Value {
    let mut document = document();
    for (pointer, value) in changes {
        set(&mut document, pointer, value.clone());
    }
    document
}

pub fn set(document: &mut Value, pointer: &str, value: Value) {
    let mut at = document;
    for key in pointer.trim_start_matches('/').split('/') {
        at = match at {
            Value::Array(items) => {
                let index: usize = key.parse().expect("arrays are indexed by numbers");
                while items.len() <= index {
                    items.push(Value::Null);
                }
                &mut items[index]
            }
            other => {
                if !other.is_object() {
                    *other = json!({});
                }
                other.as_object_mut().expect("just made one").entry(key).or_insert(Value::Null)
            }
        };
    }
    *at = value;
}

/// The document and its file's folder, which is deleted with it.
pub struct Written {
    pub folder: TempDir,
    pub path: PathBuf,
}

pub fn write(document: &Value) -> Written {
    write_bytes("scene.gltf", document.to_string().as_bytes())
}

/// Files of these names in one folder; the path is the first one's.
pub fn write_files(files: &[(&str, &[u8])]) -> Written {
    let (first, bytes) = files[0];
    let written = write_bytes(first, bytes);
    for (name, bytes) in &files[1..] {
        std::fs::write(written.folder.path().join(name), bytes).expect("the folder is ours");
    }
    written
}

pub fn write_bytes(name: &str, bytes: &[u8]) -> Written {
    let folder = tempfile::tempdir().expect("the system's folder for temporary files is writable");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a new folder is writable");
    Written { folder, path }
}

/// Puts JSON and a binary chunk into a GLB container.
pub fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF".to_vec();
    file.extend(2_u32.to_le_bytes());
    file.extend((28 + text.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text.as_slice()), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

/// Every document that loads also loads as a scene that can be changed, and is the same after it was saved.
pub fn try_load(document: &Value) -> Result<Scene> {
    let written = write(document);
    let scene = scene::load(&written.path, None)?;
    editable::check(&written.path, &scene);
    Ok(scene)
}

pub fn load(document: &Value) -> Scene {
    try_load(document).unwrap_or_else(|error| panic!("the document should load: {error}"))
}

/// Fault and help of the error that loading ends with; the error must name the scene's file.
pub fn fault(document: &Value, camera: Option<&str>) -> (String, String) {
    let written = write(document);
    match scene::load(&written.path, camera) {
        Err(Error::Scene { path, fault, help }) => {
            assert_eq!(path, written.path, "the error names the file");
            (fault, help)
        }
        Err(other) => panic!("not an error about the scene: {other}"),
        Ok(_) => panic!("the document loads: {document}"),
    }
}

/// Like [`fault`] for a scene that is read strictly; without `strict` the fault must be a warning.
pub fn strict_fault(document: &Value, warning: &str) -> (String, String) {
    let written = write(document);
    let scene = scene::load(&written.path, None).unwrap_or_else(|error| panic!("not strictly: {error}"));
    assert!(scene.warnings.iter().any(|said| said.contains(warning)), "{warning}: {:?}", scene.warnings);
    match scene::load_with(&written.path, &LoadOptions { strict: true, ..LoadOptions::default() }) {
        Err(Error::Scene { fault, help, .. }) => (fault, help),
        other => panic!("not an error about the scene: {other:?}"),
    }
}

/// A PNG of these RGBA texels.
pub fn png(width: u32, height: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_raw(width, height, texels.as_flattened().to_vec())
        .expect("as many texels as the size says")
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("PNG holds any RGBA picture");
    bytes.into_inner()
}
