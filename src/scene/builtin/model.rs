//! Models: indexed meshes with materials and a camera. The built-in scenes are models.

use glam::Vec3;
use serde_json::{Value, json};

use crate::scene::{Camera, Lens, Material, Scene, Triangle};

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

/// A pinhole camera at `position` with a square picture. It looks along `forward`, with +X to the right.
pub(super) fn square_camera(position: Vec3, [up, forward]: [Vec3; 2], tan_half_fov: f32) -> Camera {
    let (name, right, aspect, lens) = ("camera".into(), Vec3::X, Some(1.0), Lens::PINHOLE);
    Camera { name, position, right, up, forward, tan_half_fov, aspect, lens }
}

fn content_hash(scene: &Scene) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    // Rust prints floats with the fewest digits that are read back as the same number. Different values therefore have different texts.
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

pub(super) fn matte(name: &str, color: Vec3) -> Material {
    Material { name: name.into(), base_color: color, ..Material::default() }
}

/// The white matte material (albedo 0.8) of the paper scenes.
pub(super) fn white_paper() -> Vec<Material> {
    vec![matte("white paper", Vec3::splat(0.8))]
}

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;

impl Model {
    /// The model as the bytes of a `.glb` file.
    pub fn to_glb(&self) -> Vec<u8> {
        write(self)
    }
}

/// The bytes of the `.glb` file, which are the same on every machine. Positions are `f32`. Indices are `u16` if they fit, otherwise `u32`.
fn write(model: &Model) -> Vec<u8> {
    let mut binary = Binary::default();
    let mut nodes = Vec::new();
    let mut meshes = Vec::new();
    for (index, part) in model.parts.iter().enumerate() {
        let position = binary.positions(part);
        let indices = binary.indices(part);
        meshes.push(json!({
            "name": part.name,
            "primitives": [{ "attributes": { "POSITION": position }, "indices": indices, "material": part.material }],
        }));
        let mut node = json!({ "name": part.name, "mesh": index });
        if let Some(label) = part.label {
            node["extras"] = json!({ "region": label });
        }
        nodes.push(node);
    }
    nodes.push(camera_node(&model.camera));
    let document = json!({
        "asset": { "version": "2.0", "generator": "krylux" },
        "scene": 0,
        "scenes": [{ "name": model.name, "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": model.materials.iter().map(material).collect::<Vec<_>>(),
        "cameras": [camera(&model.camera)],
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{ "byteLength": binary.bytes.len() }],
        "extensionsUsed": ["KHR_materials_specular"],
    });
    assemble(document.to_string().into_bytes(), binary.bytes)
}

/// The binary chunk while it is built, with its buffer views and accessors.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    fn positions(&mut self, part: &Part) -> usize {
        let mut minimum = Vec3::INFINITY;
        let mut maximum = Vec3::NEG_INFINITY;
        let start = self.bytes.len();
        for &position in &part.positions {
            minimum = minimum.min(position);
            maximum = maximum.max(position);
            self.bytes.extend(position.to_array().iter().flat_map(|value| value.to_le_bytes()));
        }
        self.accessor(
            start,
            json!({
                "componentType": FLOAT,
                "type": "VEC3",
                "count": part.positions.len(),
                "min": minimum.to_array(),
                "max": maximum.to_array(),
            }),
        )
    }

    fn indices(&mut self, part: &Part) -> usize {
        let start = self.bytes.len();
        // The format reserves the largest index of each integer type for primitive restart.
        let short = part.positions.len() < usize::from(u16::MAX);
        for &index in part.triangles.as_flattened() {
            if short {
                self.bytes.extend((index as u16).to_le_bytes());
            } else {
                self.bytes.extend(index.to_le_bytes());
            }
        }
        self.accessor(
            start,
            json!({
                "componentType": if short { UNSIGNED_SHORT } else { UNSIGNED_INT },
                "type": "SCALAR",
                "count": 3 * part.triangles.len(),
            }),
        )
    }

    /// Adds a buffer view for the bytes from `start` to the end, and `accessor` for that view. Returns the accessor's index.
    fn accessor(&mut self, start: usize, mut accessor: Value) -> usize {
        let length = self.bytes.len() - start;
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        accessor["bufferView"] = json!(self.views.len());
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": length }));
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }
}

fn material(material: &Material) -> Value {
    let [red, green, blue] = material.base_color.to_array();
    json!({
        "name": material.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [red, green, blue, 1.0],
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        },
        "doubleSided": material.double_sided,
        "extensions": { "KHR_materials_specular": { "specularFactor": material.specular } },
    })
}

fn camera(camera: &Camera) -> Value {
    // The format requires a near plane. The field of view is rounded to single precision, so that it is the same on every machine.
    let field = (2.0 * f64::from(camera.tan_half_fov).atan()) as f32;
    let mut perspective = json!({ "yfov": field, "znear": 0.001 });
    if let Some(aspect) = camera.aspect {
        perspective["aspectRatio"] = json!(aspect);
    }
    json!({ "name": "rig", "type": "perspective", "perspective": perspective })
}

/// The camera's node. Its pose is a matrix instead of a quaternion, so that axes such as −Y are read back exactly.
fn camera_node(camera: &Camera) -> Value {
    let columns = [
        camera.right.extend(0.0),
        camera.up.extend(0.0),
        -camera.forward.extend(0.0),
        camera.position.extend(1.0),
    ];
    let matrix: Vec<f32> =
        columns.iter().flat_map(|column| column.to_array()).map(|value| value + 0.0).collect();
    json!({ "name": camera.name, "camera": 0, "matrix": matrix })
}

/// The GLB container: a header and two chunks, each padded to a multiple of four bytes as the format requires.
fn assemble(mut text: Vec<u8>, mut binary: Vec<u8>) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let mut file = Vec::with_capacity(length);
    file.extend(b"glTF");
    file.extend(2_u32.to_le_bytes());
    file.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", binary)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}
