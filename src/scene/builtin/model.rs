//! Models: indexed meshes with materials and a camera. The built-in scenes are models.

use glam::Vec3;

use crate::scene::bvh::KeptTree;
use crate::scene::gltf::write_without_pictures;
use crate::scene::{Camera, EditableScene, Lens, Material, Mesh, Scene, Triangle};

/// A scene in the form of indexed meshes, which can be written to a file.
#[derive(Clone, Debug)]
pub struct Model {
    /// The scene's name. It names the scene's folder and is the path of its [`Scene`].
    pub name: &'static str,
    /// The objects.
    pub parts: Vec<Part>,
    /// Materials, indexed by [`Part::material`].
    pub materials: Vec<Material>,
    /// The camera of the coaxial rig.
    pub camera: Camera,
}

/// An object of one material, in world space.
#[derive(Clone, Debug)]
pub struct Part {
    /// The part's name. It is also the name of its region, unless the parts have labels.
    pub name: String,
    /// The label of the part's region. Labels are numbered from 0 without gaps. Either all parts of a model have a label, or none has.
    pub label: Option<u32>,
    /// Vertices in metres.
    pub positions: Vec<Vec3>,
    /// Vertex indices of each triangle, counter-clockwise as seen from its front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Model::materials`].
    pub material: u32,
}

impl Part {
    /// Makes a part with material 0 and without vertices.
    pub fn new(name: impl Into<String>, label: Option<u32>) -> Self {
        Self { name: name.into(), label, positions: Vec::new(), triangles: Vec::new(), material: 0 }
    }

    /// Adds a quadrilateral. Its front is the side from which the corners appear counter-clockwise.
    pub fn quad(&mut self, corners: [Vec3; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// Adds a grid of `columns` × `rows` cells. Each cell has two triangles, and neighbouring cells share vertices. `at(i, j)` is the
    /// vertex in column `i ≤ columns` and row `j ≤ rows`. On the front, columns run to the right and rows upwards.
    pub fn grid(&mut self, columns: usize, rows: usize, at: impl Fn(usize, usize) -> Vec3) {
        let first = self.positions.len();
        for row in 0..=rows {
            self.positions.extend((0..=columns).map(|column| at(column, row)));
        }
        let vertex = |column: usize, row: usize| (first + row * (columns + 1) + column) as u32;
        for row in 0..rows {
            for column in 0..columns {
                let [a, b] = [vertex(column, row), vertex(column + 1, row)];
                let [c, d] = [vertex(column + 1, row + 1), vertex(column, row + 1)];
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
}

impl Model {
    /// A model with a square camera at `(0, 0, z)` that looks along −Z with +Y up. `tan_half_fov` is the tangent of half the field of view.
    pub(super) fn along_z(
        name: &'static str,
        parts: Vec<Part>,
        materials: Vec<Material>,
        (z, tan_half_fov): (f32, f32),
    ) -> Self {
        let camera = square_camera(z * Vec3::Z, [Vec3::Y, Vec3::NEG_Z], tan_half_fov);
        Self { name, parts, materials, camera }
    }

    /// Converts the model to a scene in memory. For a shipped model, it equals the scene loaded from the file, except for path and hash.
    pub fn to_scene(&self) -> Scene {
        let (regions, regions_are_labels) = self.regions();
        let mut triangles = Vec::with_capacity(self.parts.iter().map(|part| part.triangles.len()).sum());
        for (index, part) in self.parts.iter().enumerate() {
            let region = part.label.unwrap_or(index as u32);
            triangles.extend(part.triangles.iter().map(|corners| {
                let positions = corners.map(|corner| part.positions[corner as usize]);
                Triangle::flat(positions, part.material, region)
            }));
        }
        let mut scene = Scene {
            path: self.name.into(),
            origin: glam::DVec3::ZERO,
            triangles,
            materials: self.materials.clone(),
            textures: Vec::new(),
            camera: self.camera.clone(),
            projector: None,
            projector_resolution: None,
            regions,
            regions_are_labels,
            hash: [0; 32],
            warnings: Vec::new(),
            tree: KeptTree::default(),
        };
        scene.hash = scene.content_hash();
        scene
    }
}

/// A pinhole camera at `position` with a square picture. It looks along `forward`, with +X to the right.
pub(super) fn square_camera(position: Vec3, [up, forward]: [Vec3; 2], tan_half_fov: f32) -> Camera {
    let (name, right, aspect, lens) = ("camera".into(), Vec3::X, Some(1.0), Lens::PINHOLE);
    Camera { name, position, right, up, forward, tan_half_fov, aspect, lens }
}

pub(super) fn matte(name: &str, color: Vec3) -> Material {
    Material { name: name.into(), base_color: color, ..Material::default() }
}

/// The white matte material (albedo 0.8) of sheets and cartons.
pub(super) fn white_paper() -> Vec<Material> {
    vec![matte("white paper", Vec3::splat(0.8))]
}

impl Model {
    /// The model as the bytes of a `.glb` file.
    pub fn to_glb(&self) -> Vec<u8> {
        write_without_pictures(&self.editable())
    }

    /// The model as a scene that can be changed.
    pub fn editable(&self) -> EditableScene {
        let mesh = |(index, part): (usize, &Part)| Mesh {
            material: part.material,
            region: part.label.unwrap_or(index as u32),
            vertices: part.positions.clone(),
            faces: part.triangles.clone(),
            ..Mesh::new(part.name.clone())
        };
        let (regions, regions_are_labels) = self.regions();
        EditableScene {
            meshes: self.parts.iter().enumerate().map(mesh).collect(),
            materials: self.materials.clone(),
            camera: Some(self.camera.clone()),
            regions,
            regions_are_labels,
            ..EditableScene::new(self.name)
        }
    }

    /// The names of the regions, and whether they are labels.
    fn regions(&self) -> (Vec<String>, bool) {
        let last = self.parts.iter().filter_map(|part| part.label).max();
        match last {
            Some(last) => ((0..=last).map(|label| label.to_string()).collect(), true),
            None => (self.parts.iter().map(|part| part.name.clone()).collect(), false),
        }
    }
}
