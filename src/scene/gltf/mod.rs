//! Loading glTF 2.0, as `.glb` or `.gltf`.
//!
//! The `gltf` crate parses the JSON; every reference and every range in it is checked here, where it is used, because
//! the crate's own validation refuses files that name extensions which we do support, and its readers panic on what
//! validation would have caught. Whatever the bytes, loading ends with a scene or an [`enum@Error`].
//!
//! What a file may use, and what is refused or ignored, stands in [`extensions`].

mod accessor;
mod buffers;
mod cameras;
mod checks;
mod container;
mod extensions;
mod geometry;
mod materials;
mod nodes;
mod primitive;
mod regions;
mod textures;
mod through;
mod uri;
mod vertices;

use std::path::{Path, PathBuf};

use gltf::json;

use super::Scene;
use crate::error::{Error, Result};

/// Loads a `.glb` or `.gltf` file; see [`crate::scene::load`].
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, [`Error::Scene`] when its content cannot be used.
pub(super) fn load(path: &Path, camera: Option<&str>) -> Result<Scene> {
    let bytes = std::fs::read(path).map_err(Error::reading(path))?;
    let mut document = Document::parse(path, &bytes)?;
    extensions::check(&mut document)?;
    buffers::load(&mut document)?;

    let placed = nodes::walk(&mut document)?;
    let camera = cameras::choose(&document, &placed, camera)?;
    let mut materials = materials::Materials::default();
    let surfaces = geometry::assemble(&mut document, &placed, &mut materials)?;
    let (triangles, regions, regions_are_labels) = regions::name(&mut document, &placed, surfaces)?;

    // Two cameras of one file are two rigs: a cache keyed by the hash must tell them apart.
    document.hash.add(camera.name.as_bytes());
    Ok(Scene {
        path: path.to_path_buf(),
        triangles,
        materials: materials.list,
        textures: materials.textures.list,
        camera,
        projector: None,
        projector_resolution: None,
        regions,
        regions_are_labels,
        hash: document.hash.finish(),
        warnings: document.warnings.list,
    })
}

/// A parsed file with everything that it brought in.
struct Document {
    path: PathBuf,
    root: json::Root,
    /// The binary chunk of a `.glb`, until it becomes the first buffer.
    chunk: Option<Vec<u8>>,
    /// The bytes of `root.buffers`, in that order.
    buffers: Vec<Vec<u8>>,
    hash: ContentHash,
    warnings: Warnings,
}

impl Document {
    fn parse(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut hash = ContentHash::default();
        hash.add(bytes);
        let (text, chunk) = container::split(path, bytes)?;
        let root: json::Root = json::deserialize::from_slice(text).map_err(|error| {
            fault(path, format!("not a valid glTF document: {error}"), "export the scene again as glTF 2.0")
        })?;
        if !root.asset.version.starts_with("2.") {
            return Err(fault(
                path,
                format!("glTF version `{}` is not supported", root.asset.version),
                "export the scene as glTF 2.0",
            ));
        }
        let chunk = chunk.map(<[u8]>::to_vec);
        Ok(Self {
            path: path.to_path_buf(),
            root,
            chunk,
            buffers: Vec::new(),
            hash,
            warnings: Warnings::default(),
        })
    }

    /// An error about this file.
    fn fault(&self, fault: impl Into<String>, help: impl Into<String>) -> Error {
        self::fault(&self.path, fault, help)
    }
}

/// An error about the file at `path`.
fn fault(path: &Path, fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::Scene { path: path.to_path_buf(), fault: fault.into(), help: help.into() }
}

/// `mesh 3 "lamp"`: how messages call an object of the file.
fn called(kind: &str, index: usize, name: Option<&String>) -> String {
    match name {
        Some(name) if !name.is_empty() => format!("{kind} {index} \"{name}\""),
        _ => format!("{kind} {index}"),
    }
}

/// What was ignored, once each, in the order met.
#[derive(Default)]
struct Warnings {
    list: Vec<String>,
    seen: std::collections::HashSet<String>,
}

impl Warnings {
    fn add(&mut self, warning: impl Into<String>) {
        let warning = warning.into();
        if self.seen.insert(warning.clone()) {
            self.list.push(warning);
        }
    }
}

/// BLAKE3 over a sequence of byte strings; each is preceded by its length, so that no two sequences collide by
/// moving a boundary.
#[derive(Default)]
struct ContentHash(blake3::Hasher);

impl ContentHash {
    fn add(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    fn finish(&self) -> [u8; 32] {
        *self.0.finalize().as_bytes()
    }
}
