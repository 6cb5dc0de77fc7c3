//! The loader of glTF 2.0 scenes, `.glb` and `.gltf`.
//!
//! The crate `gltf-json` parses the JSON. This module checks every reference and every range where it is used. The validation of the crate
//! `gltf` is not used, because it refuses files with extensions that krylux supports. Without this validation, the readers of `gltf` would
//! panic on invalid files, so they are not used either. For any input, loading ends with a scene or an [`enum@Error`].
//!
//! The module [`extensions`] lists the supported, ignored and refused features.

mod buffers;
mod cameras;
#[cfg(feature = "compressed")]
mod compressed;
mod extensions;
mod geometry;
mod materials;
mod nodes;
mod pose;
mod textures;
mod vertices;
mod write;

use std::cell::RefCell;
use std::collections::HashSet;
use std::path::Path;

use glam::DVec3;
use gltf_json as json;
use serde::de::DeserializeOwned;

use super::camera::Posed;
use super::camera_file::Cameras;
use super::place::Place;
use super::source::SceneFile;
use super::{Camera, LoadOptions, Mesh, Scene, camera_file};
use crate::error::{Error, Result};

pub(super) use write::{write, write_without_pictures};

/// The parts of a file that a [`Scene`] does not have.
pub(super) struct Recorded {
    /// The meshes, in the order of their triangles in the scene.
    pub meshes: Vec<Mesh>,
    /// The camera, unless it was placed in front of the scene.
    pub camera: Option<Camera>,
    /// The projector, also where it coincides with the camera.
    pub projector: Option<Camera>,
}

/// Loads a `.glb` or `.gltf` file; see [`crate::scene::load`].
pub(super) fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Scene> {
    let (file, bytes) = SceneFile::read(path, options.strict)?;
    let camera_file = camera_file::find(path, options)?;
    convert(file, &bytes, (options, camera_file), false).map(|(scene, _)| scene)
}

/// Works like [`load`], with the meshes.
pub(super) fn load_recorded(path: &Path, options: &LoadOptions<'_>) -> Result<(Scene, Recorded)> {
    let (file, bytes) = SceneFile::read(path, options.strict)?;
    let camera_file = camera_file::find(path, options)?;
    convert(file, &bytes, (options, camera_file), true)
}

/// Reads the bytes of a `.glb` file. `name` stands for the file in messages.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<(Scene, Recorded)> {
    let options = LoadOptions { auto_camera: true, strict: true, ..LoadOptions::default() };
    convert(SceneFile::of(Path::new(name), true, bytes), bytes, (&options, None), true)
}

/// Makes the scene of a file with these bytes. The meshes are recorded on request.
fn convert(
    file: SceneFile,
    bytes: &[u8],
    (options, camera_file): (&LoadOptions<'_>, Option<Cameras>),
    records: bool,
) -> Result<(Scene, Recorded)> {
    let mut document = Document::parse(file, bytes)?;
    if let Some(file) = &camera_file {
        document.file.hash.add(&file.bytes);
    }
    extensions::check(&mut document)?;
    buffers::load(&mut document)?;
    #[cfg(feature = "compressed")]
    {
        compressed::decompress_views(&mut document)?;
        compressed::decompress_primitives(&mut document)?;
    }

    let placed = nodes::walk(&mut document)?;
    // The cameras are completed before the slow work on the meshes, so that errors about them are reported early.
    let cameras = cameras::complete(&mut document, &placed, options, camera_file.unwrap_or_default())?;
    let mut materials = materials::Materials::default();
    let mut place = Place::of(cameras.camera.as_ref().map(|camera| camera.position));
    let surfaces =
        geometry::assemble(&mut document, &placed, &mut materials, (options.watcher, records), &mut place)?;
    let (triangles, meshes, (regions, regions_are_labels)) =
        nodes::name_regions(&mut document, &placed, surfaces)?;
    let around = |camera: &Option<Posed>| camera.clone().map(|camera| camera.around(place.origin));
    let recorded =
        Recorded { meshes, camera: around(&cameras.camera), projector: around(&cameras.projector) };
    // The hash is part of cache keys. The camera's name is included, because another camera of the same file gives another matrix.
    let name = cameras.camera.as_ref().map_or(Camera::PLACED, |camera| &camera.camera.name);
    document.file.hash.add(name.as_bytes());
    let materials = (materials.list, materials.textures.list);
    let scene = document.file.scene(&place, cameras, triangles, materials, (regions, regions_are_labels));
    Ok((scene, recorded))
}

/// A parsed file with the buffers that it refers to.
struct Document {
    file: SceneFile,
    root: json::Root,
    translations: Vec<Option<DVec3>>,
    /// The binary chunk of a `.glb` file, until [`buffers::load`] moves it to the first buffer.
    chunk: Option<Vec<u8>>,
    buffers: Vec<Vec<u8>>,
    /// Sparse accessors whose indices have been checked to increase.
    checked_sparse: RefCell<HashSet<usize>>,
}

impl Document {
    /// Parses a file, but not the files that it refers to.
    fn parse(file: SceneFile, bytes: &[u8]) -> Result<Self> {
        let path = &file.path;
        let (text, chunk) = split(path, bytes)?;
        // Some exporters write a byte order mark.
        let text = text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text);
        let (root, translations) = (read_root(path, text)?, nodes::translations(text));
        let chunk = chunk.map(<[u8]>::to_vec);
        let (buffers, checked_sparse) = Default::default();
        Ok(Self { file, root, translations, chunk, buffers, checked_sparse })
    }

    fn node_name(&self, index: usize) -> String {
        object_name("node", index, self.root.nodes[index].name.as_ref())
    }

    /// Element `index` of a list of the file's objects. `user` names the object that refers to it.
    fn referred<'a, T>(&self, list: &'a [T], user: &str, kind: &str, index: usize) -> Result<&'a T> {
        list.get(index)
            .ok_or_else(|| self.damaged(format!("{user} refers to {kind} {index}, which does not exist")))
    }

    /// The extension `name` of the object `what`. `None` if `extensions` do not contain it.
    fn extension<T: DeserializeOwned>(
        &self,
        what: &str,
        extensions: Option<&serde_json::Map<String, json::Value>>,
        name: &str,
    ) -> Result<Option<T>> {
        let value = extensions.and_then(|extensions| extensions.get(name));
        value.map(|value| serde_json::from_value(value.clone())).transpose().map_err(|error| {
            self.fault(format!("{what}: {name} cannot be read: {error}")).help("export the scene again")
        })
    }

    fn damaged(&self, fault: impl Into<String>) -> Error {
        self.fault(fault).help("the file is damaged: export it again")
    }

    fn damaged_mesh(&self, fault: impl Into<String>) -> Error {
        self.fault(fault).help("the mesh is damaged: export it again")
    }

    fn fault(&self, fault: impl Into<String>) -> Error {
        self.file.fault(fault)
    }
}

fn read_root(path: &Path, text: &[u8]) -> Result<json::Root> {
    let error = match json::Root::from_slice(text) {
        Ok(root) if root.asset.version.starts_with("2.") => return Ok(root),
        Ok(root) => return Err(other_version(path, &root.asset.version)),
        Err(error) => error,
    };
    let broken = Error::scene(path, format!("not a valid glTF document: {error}"))
        .help("export the scene again as glTF 2.0");
    // The document may have another glTF version, whose JSON does not match the crate's structure.
    let Ok(mut value) = serde_json::from_slice::<json::Value>(text) else { return Err(broken) };
    match value.pointer("/asset/version").and_then(json::Value::as_str) {
        Some(other) if !other.starts_with("2.") => return Err(other_version(path, other)),
        // glTF 1.0 refers to objects by names instead of numbers. Some glTF 1.0 files do not state the version as a string.
        _ if value.get("scenes").is_some_and(json::Value::is_object) => {
            return Err(other_version(path, "1.0"));
        }
        _ => {}
    }
    // The value is converted to text and parsed again. This is rarely needed, and a parser of JSON values would add code to compile.
    if complete(&mut value) {
        json::Root::from_str(&value.to_string()).map_err(|_| broken)
    } else {
        Err(broken)
    }
}

/// Adapts a valid document to the crate's structure, which demands more than the specification. Returns whether the document was changed.
fn complete(value: &mut json::Value) -> bool {
    let Some(members) = value.as_object_mut() else { return false };
    // Animations are not used, and some contain an extension that does not match the crate's structure.
    let mut is_changed = members.remove("animations").is_some();
    // A scene may lack the list of nodes.
    for scene in members.get_mut("scenes").and_then(json::Value::as_array_mut).into_iter().flatten() {
        if let Some(scene) = scene.as_object_mut().filter(|scene| !scene.contains_key("nodes")) {
            scene.insert("nodes".into(), json::Value::Array(Vec::new()));
            is_changed = true;
        }
    }
    is_changed
}

/// The name of an object of the file in messages, such as `mesh 3 "lamp"`.
fn object_name(kind: &str, index: usize, name: Option<&String>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} \"{name}\""),
        _ => format!("{kind} {index}"),
    }
}

const MAGIC: &[u8; 4] = b"glTF";
const HEADER_BYTES: usize = 12;
const CHUNK_HEADER_BYTES: usize = 8;
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";

/// Splits a file into its JSON text and its binary chunk. If a file does not begin with the GLB magic number, all of it is JSON text.
pub(super) fn split<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>)> {
    let extension_is_glb = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
    if !bytes.starts_with(MAGIC) {
        if extension_is_glb {
            return Err(damaged(path, "not a GLB file: it does not begin with `glTF`"));
        }
        return Ok((bytes, None));
    }
    let version = word(bytes, 4).ok_or_else(|| damaged(path, "the GLB header is cut short"))?;
    let length = word(bytes, 8).ok_or_else(|| damaged(path, "the GLB header is cut short"))?;
    if version != 2 {
        return Err(other_version(path, &format!("{version}.0")));
    }
    if length as usize > bytes.len() || (length as usize) < HEADER_BYTES {
        return Err(damaged(
            path,
            format!("the GLB header says {length} bytes, but the file has {}", bytes.len()),
        ));
    }
    let (kind, text, rest) = chunk(path, &bytes[HEADER_BYTES..length as usize])?;
    if kind != JSON_CHUNK {
        return Err(damaged(path, "the first GLB chunk is not JSON"));
    }
    // Chunks of other kinds belong to extensions. The specification requires that they are skipped.
    let mut rest = rest;
    while !rest.is_empty() {
        let (kind, content, after) = chunk(path, rest)?;
        if kind == BINARY_CHUNK {
            return Ok((text, Some(content)));
        }
        rest = after;
    }
    Ok((text, None))
}

/// The kind and the content of the chunk at the start of `bytes`, and the bytes after it.
fn chunk<'a>(path: &Path, bytes: &'a [u8]) -> Result<(&'a [u8], &'a [u8], &'a [u8])> {
    let length = word(bytes, 0).map(|length| length as usize);
    let kind = bytes.get(4..CHUNK_HEADER_BYTES);
    let (Some(length), Some(kind)) = (length, kind) else {
        return Err(damaged(path, "a GLB chunk header is cut short"));
    };
    let content = bytes[CHUNK_HEADER_BYTES..]
        .split_at_checked(length)
        .ok_or_else(|| damaged(path, format!("a GLB chunk says {length} bytes, but the file ends before")))?;
    Ok((kind, content.0, content.1))
}

/// The GLB container: a header and two chunks, each padded to a multiple of four bytes as the format requires.
fn assemble_chunks(mut text: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = HEADER_BYTES + 2 * CHUNK_HEADER_BYTES + text.len() + binary.len();
    let mut file = Vec::with_capacity(length);
    file.extend(MAGIC);
    file.extend(2_u32.to_le_bytes());
    file.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(JSON_CHUNK, text), (BINARY_CHUNK, binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|&four| u32::from_le_bytes(four))
}

fn other_version(path: &Path, version: &str) -> Error {
    let help = if version.starts_with("1.") {
        "convert it: npx gltf-pipeline -i OLD.gltf -o NEW.glb (or export the scene again as glTF 2.0)"
    } else {
        "export the scene as glTF 2.0"
    };
    Error::scene(path, format!("glTF version `{version}` is not supported")).help(help)
}

fn damaged(path: &Path, what: impl Into<String>) -> Error {
    Error::scene(path, what).help("the file is damaged or not glTF 2.0: copy or export it again")
}
