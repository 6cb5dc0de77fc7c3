//! Tests of files as they are found: valid ones that few exporters write, and invalid ones that every viewer shows. Each kind was seen in a
//! public repository (`tests/wild`), and is made anew here.

#![allow(clippy::panic, reason = "a failed test panics")]

mod gltf;
mod obj;

use krylux::scene::{self, LoadOptions, Scene};
use serde_json::Value;

use crate::scene_support::{write, write_files};

/// The scene that a user gets who lets a camera be placed.
#[track_caller]
fn automatic(document: &Value) -> Scene {
    let options = LoadOptions { auto_camera: true, ..LoadOptions::default() };
    scene::load_with(&write(document).path, &options)
        .unwrap_or_else(|error| panic!("it should load: {error}"))
}

/// The scene of an `.obj` file with these files beside it.
#[track_caller]
fn obj(files: &[(&str, &[u8])]) -> Scene {
    let options = LoadOptions { auto_camera: true, ..LoadOptions::default() };
    scene::load_with(&write_files(files).path, &options)
        .unwrap_or_else(|error| panic!("it should load: {error}"))
}

#[track_caller]
fn warns(scene: &Scene, what: &str) {
    assert!(scene.warnings.iter().any(|warning| warning.contains(what)), "{what}: {:?}", scene.warnings);
}

/// A triangle with texture coordinates.
const FACE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n";
