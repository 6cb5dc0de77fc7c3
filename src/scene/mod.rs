//! Scenes: triangles in world space, their materials and textures, and the rig's camera and projector. Lengths are in metres.

pub mod builtin;
pub mod bvh;
pub mod camera;
mod camera_file;
mod editable;
mod epipolar;
mod gltf;
pub mod material;
mod obj;
pub(crate) mod place;
mod source;
mod triangle;
pub mod view;

use std::fmt;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::image::Resolution;

pub use bvh::{SurfacePoint, first_hits};
pub use camera::{Camera, Lens};
pub use editable::{EditableScene, Mesh, Value};
pub use epipolar::{LineNumbers, epipolar_lines};
pub use material::{AlphaMode, Material, Texture, TextureRef, Volume, Wrap};
pub use triangle::Triangle;
pub use view::predicted_direct;

/// Options for loading a scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadOptions<'a> {
    /// The name of the camera node that becomes the rig's camera. It may be omitted when the scene has only one camera.
    pub camera: Option<&'a str>,
    /// The path of a camera file. Its poses replace the scene's poses (see [`load_with`]).
    pub camera_file: Option<&'a Path>,
    /// Whether a scene without a camera gets one ([`Camera::in_front_of`]), and a scene with several perspective cameras uses the first,
    /// with a warning.
    pub auto_camera: bool,
    /// Whether missing or unreadable material libraries, pictures and texture coordinates are errors. Otherwise a warning names them, and
    /// their surfaces are matte or have the material's colour.
    pub strict: bool,
    /// Receives the progress of loading, and may end the loading.
    pub watcher: Watcher<'a>,
}

/// Loads a scene with the camera called `camera`; see [`load_with`].
pub fn load(path: &Path, camera: Option<&str>) -> Result<Scene> {
    load_with(path, &LoadOptions { camera, ..LoadOptions::default() })
}

/// Loads a scene. The file's extension selects the format: `.glb`, `.gltf` or `.obj`.
///
/// A camera file may replace the scene's own camera and projector. The options may name this file. If they name neither a camera file nor a
/// camera, the camera file is `NAME.rig.toml` next to the scene `NAME.EXT`, if that file exists. A camera file has a `[camera]` table, a
/// `[projector]` table or both, each with `position`, `look_at` or `forward`, `up`, `vertical_fov_degrees`, `aperture_radius` and
/// `focus_distance`. Lengths are in metres. The projector may also have `resolution = [width, height]`.
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, [`Error::Scene`] when its content cannot be used. Both errors name the file, and
/// [`Error::Scene`] names the remedy.
pub fn load_with(path: &Path, options: &LoadOptions<'_>) -> Result<Scene> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let mut scene = match extension.to_ascii_lowercase().as_str() {
        "glb" | "gltf" => gltf::load(path, options)?,
        "obj" => obj::load(path, options)?,
        // The path is probably a misspelled folder of a run.
        "" if !path.exists() => return Err(Error::reading(path)(std::io::ErrorKind::NotFound.into())),
        other => return Err(unknown(path, other)),
    };
    let repeated = triangle::drop_repeated(&mut scene.triangles);
    if repeated > 0 {
        scene.warnings.push(format!("triangles that repeat another one exactly were dropped: {repeated}"));
    }
    Ok(scene)
}

/// The hash that a scene loaded from these bytes of a `.glb` file has ([`Scene::hash`]).
pub(crate) fn hash_of_glb(bytes: &[u8]) -> Result<[u8; 32]> {
    gltf::read("scene", bytes).map(|(scene, _)| scene.hash)
}

/// A scene that is ready to be traced.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Scene {
    /// The file that the scene was loaded from, or a name if the scene was made in memory.
    pub path: PathBuf,
    /// The origin of the scene's coordinates, in the file's coordinates, in metres. It is zero unless the scene lies so far from the file's
    /// origin that single precision would be too coarse.
    pub origin: DVec3,
    /// All surfaces, in world space. A loaded scene has at least one triangle.
    pub triangles: Vec<Triangle>,
    /// Materials, indexed by [`Triangle::material`].
    pub materials: Vec<Material>,
    /// Textures, indexed by [`TextureRef::texture`].
    pub textures: Vec<Texture>,
    /// The rig's camera. In a coaxial rig, the projector has the same geometry.
    pub camera: Camera,
    /// A projector whose pose or lens differs from the camera's. `None` means a coaxial rig, which has a symmetric transport matrix.
    pub projector: Option<Camera>,
    /// The projector's resolution, if the scene or its camera file states one.
    pub projector_resolution: Option<Resolution>,
    /// Names of the regions, indexed by [`Triangle::region`].
    pub regions: Vec<String>,
    /// Whether the regions are ground-truth labels (`extras.region` in the file). Otherwise there is one region for each mesh node.
    pub regions_are_labels: bool,
    /// BLAKE3 hash of the scene file, of all files that it refers to, and of the camera file.
    pub hash: [u8; 32],
    /// One sentence for each part of the files that is ignored.
    pub warnings: Vec<String>,
    /// The search tree that was last built for the scene or for a copy of it.
    #[serde(skip)]
    pub tree: bvh::KeptTree,
}

impl Scene {
    /// A BLAKE3 hash of everything that is traced.
    pub(crate) fn content_hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        let Self { camera, projector, projector_resolution, materials, regions, .. } = self;
        // Rust prints floats with the fewest digits that are read back as the same number. Different values therefore have different texts.
        hasher.update(
            format!("{camera:?} {projector:?} {projector_resolution:?} {materials:?} {regions:?}").as_bytes(),
        );
        for triangle in &self.triangles {
            hasher.update(bytemuck::bytes_of(&triangle.positions));
            hasher.update(bytemuck::bytes_of(&triangle.normals));
            hasher.update(bytemuck::bytes_of(&triangle.texcoords));
            hasher.update(bytemuck::bytes_of(&triangle.colors));
            hasher.update(&triangle.material.to_le_bytes());
            hasher.update(&triangle.region.to_le_bytes());
        }
        for Texture { width, height, texels, wrap, linear, .. } in &self.textures {
            hasher.update(format!("{width} {height} {wrap:?} {linear}").as_bytes());
            hasher.update(texels.as_flattened());
        }
        *hasher.finalize().as_bytes()
    }

    /// The least and the greatest coordinates of all surfaces.
    pub fn bounds(&self) -> [Vec3; 2] {
        let corners = || self.triangles.iter().flat_map(|triangle| triangle.positions);
        [corners().fold(Vec3::INFINITY, Vec3::min), corners().fold(Vec3::NEG_INFINITY, Vec3::max)]
    }
}

/// The number of triangles or lines between two calls of the watcher. They take a fraction of a second.
const RHYTHM: usize = 1 << 16;

/// Receives the progress of loading a scene, and decides whether loading continues. The default ignores the progress.
#[derive(Clone, Copy, Default)]
pub struct Watcher<'a>(Option<&'a dyn Fn(f32) -> ControlFlow<()>>);

impl<'a> Watcher<'a> {
    /// Makes a watcher. It regularly calls `told` with the completed fraction; [`ControlFlow::Break`] causes [`Error::Interrupted`].
    pub fn new(told: &'a dyn Fn(f32) -> ControlFlow<()>) -> Self {
        Self(Some(told))
    }

    pub(super) fn tell(self, share: f32) -> Result<()> {
        match self.0.map(|told| told(share.clamp(0.0, 1.0))) {
            Some(ControlFlow::Break(())) => Err(Error::Interrupted),
            _ => Ok(()),
        }
    }

    /// Reports `share()` when `count` is a multiple of 65,536.
    pub(super) fn count(self, count: usize, share: impl FnOnce() -> f32) -> Result<()> {
        if count.is_multiple_of(RHYTHM) { self.tell(share()) } else { Ok(()) }
    }
}

impl fmt::Debug for Watcher<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Watcher" } else { "none" })
    }
}

/// The error for a file whose name has the extension of another format. `extension` is in lower case.
pub(super) fn unknown(path: &Path, extension: &str) -> Error {
    let (what, help) = match extension {
        "xml" => (
            "a scene of Mitsuba, as it seems, and not of krylux",
            "give a .glb, .gltf or .obj file: import the meshes (.ply, .obj) that it names into Blender and export them as .glb, \
             with the camera; bidirectional materials have no counterpart but metallic-roughness and specular",
        ),
        "blend" => (
            "a file of Blender, which only Blender reads",
            "export it as .glb: blender -b FILE.blend --python-expr \"import bpy; \
             bpy.ops.export_scene.gltf(filepath='scene.glb', export_cameras=True)\"",
        ),
        "fbx" | "dae" | "ply" | "stl" | "usd" | "usda" | "usdc" | "usdz" | "abc" | "3ds" | "x3d" | "pbrt" => {
            (
                "a format of scenes that krylux does not read",
                "import it into Blender and export it as .glb, with the camera; or give a .gltf or .obj file",
            )
        }
        _ => ("not a known scene format", "give a .glb, .gltf or .obj file"),
    };
    Error::scene(path, what).help(help)
}
