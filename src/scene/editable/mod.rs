//! Scenes that a program makes or changes: named meshes, materials and textures, a camera and a projector.
//!
//! ```
//! use krylux::scene::{EditableScene, Mesh};
//!
//! # fn main() -> krylux::Result<()> {
//! let mut scene = EditableScene::new("sheet");
//! let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
//! let vertices = corners.map(|[x, y]| [x, y, -2.0].into()).to_vec();
//! scene.add_mesh(Mesh { vertices, faces: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::new("sheet") }, None)?;
//! scene.place("camera", r#"{"position": [0, 0, 0], "look_at": [0, 0, -2], "vertical_fov": 40}"#)?;
//! scene.set("sheet.albedo", 0.5)?;
//! let lab = krylux::lab::Lab::builder_of_editable(scene).size(16, 16);
//! # let _ = lab;
//! # Ok(())
//! # }
//! ```
//!
//! Every number has a path such as `sheet.albedo` ([`EditableScene::parameters`]). [`EditableScene::save`] writes a `.glb` file, from which
//! [`EditableScene::load`] reads the same parameters, and which has the same photos, to the last bit.

mod mesh;
mod parameters;
mod pose;

use std::collections::HashSet;
use std::path::Path;

use glam::DVec3;

use super::bvh::KeptTree;
use super::gltf::Recorded;
use super::place::Place;
use super::triangle::{MAX_TRIANGLES, drop_repeated};
use super::{Camera, Lens, LoadOptions, Material, Scene, Texture, camera_file, gltf, load_with};
use crate::error::{Error, Result};
use crate::file;
use crate::image::Resolution;

pub use mesh::Mesh;
pub use parameters::Value;

/// A scene whose meshes, materials and cameras can be read and changed. Lengths are in metres.
///
/// Materials are two-sided and matte unless changed. [`EditableScene::to_scene`] makes the scene that is traced.
#[derive(Clone, Debug, Default)]
pub struct EditableScene {
    /// A short name, for folders and titles.
    pub name: String,
    /// The meshes. Their names differ.
    pub meshes: Vec<Mesh>,
    /// The materials, indexed by [`Mesh::material`]. Their names differ, but a mesh and a material may have the same name.
    pub materials: Vec<Material>,
    /// The textures, indexed by [`TextureRef::texture`](super::TextureRef::texture).
    pub textures: Vec<Texture>,
    /// The rig's camera.
    pub camera: Option<Camera>,
    /// The projector. `None` stands for a coaxial rig.
    pub projector: Option<Camera>,
    /// The projector's resolution, if stated.
    pub projector_resolution: Option<Resolution>,
    /// Names of the regions, indexed by [`Mesh::region`].
    pub regions: Vec<String>,
    /// Works like [`Scene::regions_are_labels`].
    pub regions_are_labels: bool,
    /// The origin of the coordinates, as [`Scene::origin`].
    pub origin: DVec3,
    /// The search tree of the scene that was traced last. Copies of the scene share it.
    pub(super) tree: KeptTree,
}

impl EditableScene {
    /// Makes a scene without meshes and without a camera.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), tree: KeptTree::keeping(), ..Self::default() }
    }

    /// Loads a scene file (`.glb`, `.gltf`, `.obj`). Meshes have the names of their nodes. A second mesh or material of the same name gets a
    /// number: `wall`, `wall_2`, … Vertices are in world space.
    ///
    /// # Errors
    /// The errors of [`load_with`].
    pub fn load(path: &Path, options: &LoadOptions<'_>) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        let (scene, meshes, projector) = if extension == "glb" || extension == "gltf" {
            let (scene, recorded) = gltf::load_recorded(path, options)?;
            (scene, recorded.meshes, recorded.projector)
        } else {
            let scene = load_with(path, options)?;
            let meshes = Mesh::of_triangles(&scene.triangles, &scene.regions);
            let projector = scene.projector.clone();
            (scene, meshes, projector)
        };
        let camera = Some(scene.camera.clone());
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self::of(&name, scene, Recorded { meshes, camera, projector }))
    }

    /// The scene from the bytes of [`EditableScene::to_glb`], which it equals except for unused materials.
    ///
    /// # Errors
    /// [`Error::Scene`] for other bytes.
    pub fn from_glb(name: &str, bytes: &[u8]) -> Result<Self> {
        let (scene, recorded) = gltf::read(name, bytes)?;
        Ok(Self::of(name, scene, recorded))
    }

    fn of(name: &str, scene: Scene, recorded: Recorded) -> Self {
        let Recorded { mut meshes, camera, projector } = recorded;
        let mut materials = scene.materials;
        make_unique(meshes.iter_mut().map(|mesh| &mut mesh.name), "mesh");
        make_unique(materials.iter_mut().map(|material| &mut material.name), "material");
        Self {
            name: name.to_owned(),
            meshes,
            materials,
            textures: scene.textures,
            camera,
            projector,
            projector_resolution: scene.projector_resolution,
            regions: scene.regions,
            regions_are_labels: scene.regions_are_labels,
            origin: scene.origin,
            tree: KeptTree::keeping(),
        }
    }

    /// Adds a mesh, which is a region of its own. With `material`, it gets the material of this name, which must exist. Otherwise it gets a
    /// new matte material of albedo 0.8, which has the mesh's name.
    ///
    /// # Errors
    /// [`Error::Option`] naming the argument, if the mesh's name is empty or taken, or if there is no such material.
    pub fn add_mesh(&mut self, mut mesh: Mesh, material: Option<&str>) -> Result<()> {
        let is_taken = self.meshes.iter().any(|other| other.name == mesh.name)
            || (material.is_none() && self.materials.iter().any(|other| other.name == mesh.name));
        if mesh.name.is_empty() || is_taken {
            let fault = match is_taken {
                true => format!("there is a mesh or a material `{}` already", mesh.name),
                false => "it is empty".to_owned(),
            };
            return Err(Error::option("name", fault).help("give the mesh a name of its own"));
        }
        let index = match material {
            Some(name) => self.materials.iter().position(|other| other.name == name).ok_or_else(|| {
                let names: Vec<_> = self.materials.iter().map(|other| other.name.as_str()).collect();
                let help = format!("give one of {}, or leave it out for a new one", names.join(", "));
                Error::option("material", format!("there is no material `{name}`")).help(help)
            })?,
            None => {
                let base_color = glam::Vec3::splat(0.8);
                self.materials.push(Material { name: mesh.name.clone(), base_color, ..Material::default() });
                self.materials.len() - 1
            }
        };
        // The number of materials is far below 2³².
        (mesh.material, mesh.region) = (index as u32, self.regions.len() as u32);
        self.regions.push(mesh.name.clone());
        self.meshes.push(mesh);
        Ok(())
    }

    /// Places the `camera` or the `projector` as a JSON object says. It has the keys of a camera file's table: `position`, `look_at` or
    /// `forward`, `up`, `vertical_fov` in degrees, `aperture_radius` and `focus_distance`; the projector also `resolution`.
    ///
    /// # Errors
    /// [`Error::Option`] naming `role` and the key.
    pub fn place(&mut self, role: &str, json: &str) -> Result<()> {
        let (camera, resolution) = camera_file::from_json(role, json)?;
        if role == "projector" {
            (self.projector, self.projector_resolution) = (Some(camera), resolution);
        } else {
            self.camera = Some(camera);
        }
        Ok(())
    }

    /// Checks that all parts fit together.
    ///
    /// # Errors
    /// [`Error::Option`] naming the parameter: an index without a vertex, arrays of different lengths, a texture without coordinates, a
    /// mesh without area.
    pub fn check(&self) -> Result<()> {
        if self.meshes.is_empty() {
            return Err(Error::option("scene", "it has no mesh").help("add a mesh"));
        }
        let count: usize = self.meshes.iter().map(|mesh| mesh.faces.len()).sum();
        if count > MAX_TRIANGLES {
            let fault = format!("its meshes have {count} triangles");
            return Err(Error::option("scene", fault).help(format!("give at most {MAX_TRIANGLES}")));
        }
        self.meshes.iter().try_for_each(|mesh| mesh.check(self.material(mesh)?))
    }

    fn material(&self, mesh: &Mesh) -> Result<&Material> {
        let material = self.materials.get(mesh.material as usize);
        material.ok_or_else(|| Error::option(&mesh.name, format!("there is no material {}", mesh.material)))
    }

    /// The scene that is traced. It equals the scene that [`load_with`] loads from the file of [`EditableScene::save`], except for path and
    /// hash. If there is no camera, `auto_camera` places one in front ([`Camera::in_front_of`]).
    ///
    /// # Errors
    /// The errors of [`EditableScene::check`]; [`Error::Option`] naming `camera` if there is none.
    pub fn to_scene(&self, auto_camera: bool) -> Result<Scene> {
        self.check()?;
        if self.camera.is_none() && !auto_camera {
            let help = "place one (camera={\"position\": …, \"look_at\": …, \"vertical_fov\": …}), or open with --auto-camera";
            return Err(Error::option("camera", "the scene has none").help(help));
        }
        let path = Path::new(&self.name);
        let mut place = Place::of(self.camera.as_ref().map(|camera| camera.position.as_dvec3()));
        for mesh in &self.meshes {
            mesh.corners().for_each(|corner| place.note(corner, corner, 1.0));
        }
        place.settle(path)?;
        let mut warnings: Vec<String> = place.warning().into_iter().collect();
        let mut triangles = Vec::new();
        let mut degenerate = 0;
        for mesh in &self.meshes {
            let (found, dropped) = mesh.triangles(self.material(mesh)?, place.origin);
            if found.is_empty() {
                let fault = "all of its triangles lie in a line, and show nothing";
                return Err(Error::option(format!("{}.vertices", mesh.name), fault)
                    .help("give triangles that have an area"));
            }
            triangles.extend(found);
            degenerate += dropped;
        }
        let repeated = drop_repeated(&mut triangles);
        for (count, what) in [(degenerate, "without area"), (repeated, "that repeat another one exactly")] {
            if count > 0 {
                warnings.push(format!("triangles {what} were dropped: {count}"));
            }
        }
        let around = |camera: &Camera| {
            let position = (camera.position.as_dvec3() - place.origin).as_vec3();
            let lens = if camera.lens.radius > 0.0 { camera.lens } else { Lens::PINHOLE };
            Camera { position, lens, ..camera.clone() }
        };
        let camera = match &self.camera {
            Some(camera) => around(camera),
            None => Camera::in_front_of(&triangles, &self.materials),
        };
        let projector = self.projector.as_ref().map(around);
        let mut scene = Scene {
            path: path.into(),
            origin: self.origin + place.origin,
            triangles,
            materials: self.materials.clone(),
            textures: self.textures.clone(),
            projector: projector.filter(|projector| !projector.coincides(&camera, place.distance() as f32)),
            camera,
            projector_resolution: self.projector_resolution,
            regions: self.regions.clone(),
            regions_are_labels: self.regions_are_labels,
            hash: [0; 32],
            warnings,
            tree: self.tree.clone(),
        };
        scene.hash = scene.content_hash();
        Ok(scene)
    }

    /// The scene as the bytes of a `.glb` file, which are the same on every machine.
    ///
    /// # Errors
    /// The errors of [`EditableScene::check`]; [`Error::Option`] if the file would have 4 GiB or more.
    pub fn to_glb(&self) -> Result<Vec<u8>> {
        self.check()?;
        gltf::write(self)
    }

    /// Writes the scene to a `.glb` file.
    ///
    /// # Errors
    /// The errors of [`EditableScene::to_glb`]; [`Error::Option`] naming `path` for another extension; [`Error::Write`].
    pub fn save(&self, path: &Path) -> Result<()> {
        if path.extension().is_none_or(|extension| !extension.eq_ignore_ascii_case("glb")) {
            let fault = format!("{} is no .glb file", path.display());
            return Err(Error::option("path", fault).help("scenes are written as .glb"));
        }
        file::atomic::write_bytes(path, &self.to_glb()?)
    }
}

/// Gives each name that is empty the name `otherwise`, and each that occurred before a number.
fn make_unique<'a>(names: impl Iterator<Item = &'a mut String>, otherwise: &str) {
    let mut taken = HashSet::new();
    for name in names {
        if name.is_empty() {
            otherwise.clone_into(name);
        }
        let mut number = 2;
        let stem = name.clone();
        while !taken.insert(name.clone()) {
            *name = format!("{stem}_{number}");
            number += 1;
        }
    }
}
