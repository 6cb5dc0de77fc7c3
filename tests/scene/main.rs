//! Scenes from files and from memory: what is in them comes out, and what is not supported is refused by name.

#[path = "../scene_support/mod.rs"]
mod scene_support;

mod builtin;
mod gltf_errors;
mod gltf_fuzz;
mod gltf_loading;
mod gltf_materials;
mod gltf_meshes;
mod obj;
mod obj_fuzz;
mod rig;
