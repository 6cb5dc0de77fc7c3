//! Scenes: triangles in world space, their materials and textures, and the rig's camera and projector.
//! Lengths are in metres.

pub mod builtin;
pub mod bvh;
pub mod camera;
mod camera_file;
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
use source::fault;

pub use bvh::{SurfacePoint, first_hits};
pub use camera::{Camera, Lens};
pub use material::{AlphaMode, Material, Texture, TextureRef, Volume, Wrap};
pub use triangle::Triangle;
pub use view::predicted_direct;

/// Options for loading a scene.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadOptions<'a> {
    /// The name of the camera node at which the rig stands. It may be left out when the scene has only one
    /// camera.
    pub camera: Option<&'a str>,
    /// The path of a camera file, whose poses replace those of the scene (see [`load_with`]).
    pub camera_file: Option<&'a Path>,
    /// Places a camera in front of a scene that has none, from where all of it is seen ([`Camera::in_front_of`]). Of several perspective cameras the first is
    /// taken, and a warning says so.
    pub auto_camera: bool,
    /// Makes material libraries, pictures and texture coordinates that are missing or cannot be read errors. Otherwise their surfaces are matte or
    /// have the material's own colour, and a warning says so.
    pub strict: bool,
    /// Receives the progress of loading, and may end it.
    pub watcher: Watcher<'a>,
}

/// Loads a scene with the camera called `camera`; see [`load_with`].
///
/// # Errors
/// As [`load_with`].
pub fn load(path: &Path, camera: Option<&str>) -> Result<Scene> {
    load_with(path, &LoadOptions { camera, ..LoadOptions::default() })
}

/// Loads a scene. The file's extension selects the format: `.glb`, `.gltf` or `.obj`.
///
/// A camera file may replace the scene's own camera and projector. It is the one that the options name. If
/// they name neither a camera file nor a camera, it is `NAME.rig.toml` next to the scene `NAME.EXT`, if that
/// file exists. A camera file has a `[camera]` table, a `[projector]` table or both, each with `position`,
/// `look_at` or `forward`, `up`, `vertical_fov_degrees`, `aperture_radius` and `focus_distance`. Lengths are
/// in metres. The projector may also have `resolution = [width, height]`.
///
/// # Errors
/// [`Error::Read`] when a file cannot be read, [`Error::Scene`] when its content cannot be used. Both name
/// the file; the second also says what to do.
pub fn load_with(path: &Path, options: &LoadOptions<'_>) -> Result<Scene> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let mut scene = match extension.to_ascii_lowercase().as_str() {
        "glb" | "gltf" => gltf::load(path, options)?,
        "obj" => obj::load(path, options)?,
        // A folder of a run, most likely, whose name is misspelled.
        "" if !path.exists() => return Err(Error::reading(path)(std::io::ErrorKind::NotFound.into())),
        other => return Err(unknown(path, other)),
    };
    let repeated = triangle::drop_repeated(&mut scene.triangles);
    if repeated > 0 {
        scene.warnings.push(format!("triangles that repeat another one exactly were dropped: {repeated}"));
    }
    Ok(scene)
}

/// A scene that is ready to be traced.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Scene {
    /// The file that the scene was loaded from, or a name if the scene was made in memory.
    pub path: PathBuf,
    /// Where the origin of all coordinates here lies in those of the file, in metres. It is the file's origin, except for scenes that lie far
    /// from it: single precision would be too coarse there.
    pub origin: DVec3,
    /// All surfaces, in world space. A loaded scene has at least one triangle.
    pub triangles: Vec<Triangle>,
    /// Materials, indexed by [`Triangle::material`].
    pub materials: Vec<Material>,
    /// Textures, indexed by [`TextureRef::texture`].
    pub textures: Vec<Texture>,
    /// The rig's camera. In a coaxial rig it is the geometry of the projector, too.
    pub camera: Camera,
    /// A projector with another pose or lens than the camera's. `None` means a coaxial rig, whose transport
    /// matrix is symmetric.
    pub projector: Option<Camera>,
    /// The projector's resolution, if the scene or its camera file states one.
    pub projector_resolution: Option<Resolution>,
    /// Names of the regions, indexed by [`Triangle::region`].
    pub regions: Vec<String>,
    /// Whether the regions are ground-truth labels by the scene's author (`extras.region` in the file). If
    /// not, there is one region for each mesh node.
    pub regions_are_labels: bool,
    /// BLAKE3 hash of the scene file, of all files that it refers to, and of the camera file.
    pub hash: [u8; 32],
    /// One sentence for each thing in the files that was ignored.
    pub warnings: Vec<String>,
}

impl Scene {
    /// The least and the greatest coordinates of all surfaces.
    pub fn bounds(&self) -> [Vec3; 2] {
        let corners = || self.triangles.iter().flat_map(|triangle| triangle.positions);
        [corners().fold(Vec3::INFINITY, Vec3::min), corners().fold(Vec3::NEG_INFINITY, Vec3::max)]
    }
}

/// After how many triangles or lines the watcher is told again: a fraction of a second.
const RHYTHM: usize = 1 << 16;

/// Receives the progress of loading a scene, and decides whether it goes on. The default does nothing.
#[derive(Clone, Copy, Default)]
pub struct Watcher<'a>(Option<&'a dyn Fn(f32) -> ControlFlow<()>>);

impl<'a> Watcher<'a> {
    /// Calls `told` now and then with the share of the work that is done. [`ControlFlow::Break`] ends loading with [`Error::Interrupted`].
    pub fn new(told: &'a dyn Fn(f32) -> ControlFlow<()>) -> Self {
        Self(Some(told))
    }

    /// Tells that this share is done.
    pub(super) fn tell(self, share: f32) -> Result<()> {
        match self.0.map(|told| told(share.clamp(0.0, 1.0))) {
            Some(ControlFlow::Break(())) => Err(Error::Interrupted),
            _ => Ok(()),
        }
    }

    /// Tells the share `share()` at every 65,536th of the things that are counted by `count`.
    pub(super) fn count(self, count: usize, share: impl FnOnce() -> f32) -> Result<()> {
        if count.is_multiple_of(RHYTHM) { self.tell(share()) } else { Ok(()) }
    }
}

impl fmt::Debug for Watcher<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Watcher" } else { "none" })
    }
}

/// The error about a file whose name says another format; `extension` is in lower case.
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
    fault(path, what, help)
}
