//! Tests of scenes: loading of files, refusal of unsupported or malformed files, and built-in scenes.

#[path = "../scene_support/mod.rs"]
mod scene_support;

mod builtin;
mod camera_file;
mod gltf_errors;
mod gltf_fuzz;
mod gltf_loading;
mod gltf_materials;
mod gltf_meshes;
mod obj;
mod obj_fuzz;
