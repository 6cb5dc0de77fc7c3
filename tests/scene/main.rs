//! Tests of scenes: loading of files, refusal of unsupported or malformed files, and built-in scenes.

#![allow(clippy::panic, reason = "a failed test panics")]

#[path = "../scene_support/mod.rs"]
mod scene_support;

mod blender;
mod builtin;
mod camera_file;
mod editable;
#[cfg(feature = "compressed")]
mod gltf_compressed;
mod gltf_errors;
mod gltf_fuzz;
mod gltf_loading;
mod gltf_materials;
mod gltf_meshes;
mod gltf_textures;
mod obj;
mod obj_fuzz;
mod place;
mod wild;
