//! Models: indexed meshes with materials and a camera, from which the built-in scenes are made.

use glam::Vec3;

use crate::scene::{Camera, Lens, Material, Scene, Triangle};

/// A scene in the form of indexed meshes, which can be written to a file.
#[derive(Clone, Debug)]
pub struct Model {
    /// The scene's name. It is the name of its folder, and the path of its [`Scene`].
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
    /// The label of its region. Labels are numbered from 0 without gaps. Either all parts of a model have a
    /// label or none has.
    pub label: Option<u32>,
    /// Vertices in metres.
    pub positions: Vec<Vec3>,
    /// Vertex indices of each triangle, counter-clockwise as seen from its front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`Model::materials`].
    pub material: u32,
}

impl Part {
    /// A part of material 0 without vertices.
    pub fn new(name: impl Into<String>, label: Option<u32>) -> Self {
        Self { name: name.into(), label, positions: Vec::new(), triangles: Vec::new(), material: 0 }
    }

    /// Adds a quadrilateral. Its front is the side from which the corners run counter-clockwise.
    pub fn quad(&mut self, corners: [Vec3; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// Adds a grid of `columns` × `rows` cells of two triangles, which share their vertices. `at(i, j)` is
    /// the vertex in column `i ≤ columns` and row `j ≤ rows`. The front is the side from which columns run to
    /// the right and rows upwards.
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
    /// The model as a scene in memory. For a shipped model it equals the scene loaded from the file, except
    /// for path and hash.
    pub fn to_scene(&self) -> Scene {
        let labelled = self.parts.iter().any(|part| part.label.is_some());
        let regions = if labelled {
            let count = self.parts.iter().filter_map(|part| part.label).max().map_or(0, |last| last + 1);
            (0..count).map(|label| label.to_string()).collect()
        } else {
            self.parts.iter().map(|part| part.name.clone()).collect()
        };
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
            regions_are_labels: labelled,
            hash: [0; 32],
            warnings: Vec::new(),
        };
        scene.hash = content_hash(&scene);
        scene
    }
}

/// The hash of a scene without a file, computed from its content.
fn content_hash(scene: &Scene) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    // Rust prints floats with the shortest digits that read back as the same number, so different values have
    // different texts.
    hasher.update(
        format!(
            "{:?} {:?} {:?} {:?} {:?}",
            scene.camera, scene.projector, scene.projector_resolution, scene.materials, scene.regions
        )
        .as_bytes(),
    );
    for triangle in &scene.triangles {
        hasher.update(bytemuck::bytes_of(&triangle.positions));
        hasher.update(bytemuck::bytes_of(&triangle.normals));
        hasher.update(bytemuck::bytes_of(&triangle.texcoords));
        hasher.update(bytemuck::bytes_of(&triangle.colors));
        hasher.update(&triangle.material.to_le_bytes());
        hasher.update(&triangle.region.to_le_bytes());
    }
    *hasher.finalize().as_bytes()
}

/// A square camera at `position` that looks along −Z with +Y up. `tan_half_fov` is the tangent of half its
/// field of view.
pub(super) fn camera_along_z(position: Vec3, tan_half_fov: f32) -> Camera {
    Camera {
        name: "camera".into(),
        position,
        right: Vec3::X,
        up: Vec3::Y,
        forward: Vec3::NEG_Z,
        tan_half_fov,
        aspect: Some(1.0),
        lens: Lens::PINHOLE,
    }
}

/// A two-sided Lambertian material of albedo `color`.
pub(super) fn matte(name: &str, color: Vec3) -> Material {
    Material { name: name.into(), base_color: color, ..Material::default() }
}

/// The white matte material (albedo 0.8) of the paper scenes.
pub(super) fn white_paper() -> Vec<Material> {
    vec![matte("white paper", Vec3::splat(0.8))]
}
