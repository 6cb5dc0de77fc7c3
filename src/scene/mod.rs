//! Scenes: triangles in world space, their materials, and the rig's camera. Lengths are metres.

pub mod builtin;
pub mod bvh;
pub mod camera;
mod camera_file;
mod gltf;
pub mod material;
mod obj;
mod picture;
mod shape;
mod source;
mod texture;
mod triangle;

pub use camera::{Camera, Lens};
pub use material::{AlphaMode, Material, Volume};
pub use shape::predicted_direct;
pub use texture::{Texture, TextureRef, Wrap};
pub use triangle::Triangle;

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::image::Resolution;

/// What a scene is loaded with.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadOptions<'a> {
    /// The name of the camera to stand the rig at; it may be left out when the file has only one.
    pub camera: Option<&'a str>,
    /// A rig file: a camera and a projector to see the scene by, instead of those of the file (see
    /// [`load_with`]).
    pub rig: Option<&'a Path>,
}

/// Loads a scene with the camera called `camera`; see [`load_with`].
///
/// # Errors
/// As [`load_with`].
pub fn load(path: &Path, camera: Option<&str>) -> Result<Scene> {
    load_with(path, &LoadOptions { camera, rig: None })
}

/// Loads a scene, in the format that the file's extension says: `.glb`, `.gltf` or `.obj`.
///
/// Without a rig file in the options, `NAME.rig.toml` next to the scene `NAME.EXT` is used if it exists and no camera is
/// asked for by name. A rig file has `[camera]`, `[projector]` or both, each with `position`, `look_at` or `forward`, `up`,
/// `vertical_fov_degrees`, `aperture_radius` and `focus_distance`; lengths are metres. The projector may have a
/// `resolution = [width, height]`.
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, [`Error::Scene`] when its content cannot be used: both name the file,
/// the second also what to do.
pub fn load_with(path: &Path, options: &LoadOptions<'_>) -> Result<Scene> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "glb" | "gltf" => gltf::load(path, options),
        "obj" => obj::load(path, options),
        _ => Err(Error::Scene {
            path: path.to_path_buf(),
            fault: "not a known scene format".into(),
            help: "give a .glb, .gltf or .obj file".into(),
        }),
    }
}

/// A scene ready to be traced.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The file that it came from (or a name, for scenes made in memory).
    pub path: PathBuf,
    /// All surfaces, in world space. Never empty when it comes from a loader.
    pub triangles: Vec<Triangle>,
    /// Materials, indexed by [`Triangle::material`].
    pub materials: Vec<Material>,
    /// Textures, indexed by [`TextureRef::texture`].
    pub textures: Vec<Texture>,
    /// The rig's camera, and its projector too where that is `None` below.
    pub camera: Camera,
    /// A projector apart from the camera, or with another lens. `None`: a coaxial rig, which makes transport symmetric.
    pub projector: Option<Camera>,
    /// Pixels of the projector, where the scene or its rig file says.
    pub projector_resolution: Option<Resolution>,
    /// Names of the regions, indexed by [`Triangle::region`].
    pub regions: Vec<String>,
    /// Whether the regions are the author's truth (`extras.region` in the file) or merely the mesh nodes.
    pub regions_are_labels: bool,
    /// BLAKE3 of everything that the file brought in (the scene and the files it refers to).
    pub hash: [u8; 32],
    /// What was ignored, once each, in plain words.
    pub warnings: Vec<String>,
}
