//! A scene in the device's memory: geometry in the camera's frame, materials, textures.

use glam::{DMat3, DVec3, Vec3};

use super::kernel::SceneFeatures;
use super::materials::{MIN_ALPHA, NONE, pack_materials, pack_normal, pack_texels, srgb_table};
use super::pairs::{Pair, pair_up};
use super::strategy::axes;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::TEXTURE_WIDTH;
use crate::scene::place::Distances;
use crate::scene::{AlphaMode, Camera, Material, Scene, Triangle};

/// The maximum number of triangles of a scene that is traced without a search tree. Visiting a node of the tree takes as long as testing
/// several triangles.
const FEW_TRIANGLES: usize = 8;

/// A scene on the device. The first seven members are bindings 1 to 7 of group 0, in this order.
pub(super) struct GpuScene {
    pub(super) nodes: wgpu::TextureView,
    pub(super) pairs: wgpu::TextureView,
    pub(super) materials: wgpu::TextureView,
    pub(super) corners: wgpu::TextureView,
    pub(super) textures: wgpu::Buffer,
    pub(super) texels: wgpu::TextureView,
    pub(super) srgb_table: wgpu::Buffer,
    /// The pairs of triangles in the camera's frame, in the order of the tree's leaves.
    pub(super) pairs_in_order: Vec<Pair>,
    pub(super) unit: Unit,
    pub(super) ambient: bool,
    pub(super) features: SceneFeatures,
}

impl GpuScene {
    /// Builds the search tree and moves the scene to the device. Fails with [`crate::Error::Device`] if the scene does not fit.
    pub(super) fn upload(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let unit = Unit::of(scene);
        let frame = CameraFrame::of(&scene.camera, unit);
        let positions: Vec<[Vec3; 3]> =
            scene.triangles.iter().map(|t| t.positions.map(|p| frame.point(p))).collect();
        let pairs = pair_up(&scene.triangles, &positions);
        let boxes: Vec<[Vec3; 2]> = pairs.iter().map(Pair::extent).collect();
        let bvh = scene.tree.of(&boxes);
        let pairs: Vec<Pair> = bvh.order.iter().map(|&index| pairs[index as usize].clone()).collect();

        let (texels, corners) = pack_pairs(scene, &frame, &pairs);
        let (materials, textures) = pack_materials(scene, unit);
        let mut features = features(scene, pairs.len(), !corners.is_empty());
        let spread_out = (8 * bvh.nodes.len() / 5).max(texels.len());
        let (mut spread_nodes, mut row) = (Vec::new(), TEXTURE_WIDTH);
        if spread_out <= gpu.summary.max_texture_side as usize {
            features.small_tree = true;
            spread_nodes = spread::<5, 8>(&bvh.nodes);
            // The value is at most the device's limit, which is a 32-bit number.
            row = spread_out as u32;
        }
        let nodes = if features.small_tree { &spread_nodes } else { &bvh.nodes };

        Ok(Self {
            nodes: gpu.texel_rows("search tree's nodes", nodes, row)?,
            pairs: gpu.texel_rows("triangles", &texels, row)?,
            materials: gpu.texel_array("materials", &materials)?,
            corners: gpu.texel_array("normals, texture coordinates and colours", &corners)?,
            textures: gpu.storage("texture descriptions", &textures)?,
            texels: gpu.texel_array("textures", &pack_texels(scene))?,
            srgb_table: gpu.storage("sRGB table", &srgb_table())?,
            pairs_in_order: pairs,
            unit,
            ambient: scene.materials.iter().any(|m| m.emission != Vec3::ZERO),
            features,
        })
    }
}

/// Pads each record of `FROM` texels with zeros to `TO` texels. If `TO` is a power of two, a shift gives the first texel of a record.
fn spread<const FROM: usize, const TO: usize>(texels: &[[u32; 4]]) -> Vec<[u32; 4]> {
    let records = texels.as_chunks::<FROM>().0.iter();
    records.flat_map(|record| (0..TO).map(|at| record.get(at).copied().unwrap_or_default())).collect()
}

fn features(scene: &Scene, pairs: usize, corners: bool) -> SceneFeatures {
    let mirrors = |m: &Material| {
        (m.metallic > 0.0 || m.specular > 0.0 || m.transmission > 0.0) && m.may_be_smoother_than(MIN_ALPHA)
    };
    let matte = |m: &Material| {
        m.metallic == 0.0 && m.specular == 0.0 && !m.lets_light_through() && m.alpha_mode == AlphaMode::Opaque
    };
    let transmits = scene.materials.iter().any(Material::lets_light_through);
    // A rough surface needs microfacets if it is not matte, if its normal may be turned, or if it may border on a medium. Textures cannot
    // make a surface rougher.
    let facets = |m: &Material| m.roughness * m.roughness >= MIN_ALPHA && (corners || transmits || !matte(m));
    SceneFeatures {
        // Normals at the corners turn even the shading normal of a Lambertian surface.
        matte: !corners && scene.materials.iter().all(matte),
        corners,
        facets: scene.materials.iter().any(facets),
        transmits,
        chains: scene.materials.iter().any(mirrors),
        passable: scene.materials.iter().any(Material::lets_light_straight_through),
        media: scene.materials.iter().any(|m| m.lets_light_through() && m.volume.is_some()),
        small_tree: false,
        few_pairs: if scene.triangles.len() <= FEW_TRIANGLES { pairs as u32 } else { 0 },
    }
}

/// The camera's frame, in the tracer's units: the camera is at the origin and looks along −z. The change of frame is computed in `f64`, so
/// coordinates are rounded only once.
struct CameraFrame {
    rotation: DMat3,
    origin: DVec3,
    unit: Unit,
}

impl CameraFrame {
    fn of(camera: &Camera, unit: Unit) -> Self {
        Self { rotation: axes(camera).transpose(), origin: camera.position.as_dvec3(), unit }
    }

    fn point(&self, point: Vec3) -> Vec3 {
        self.unit.vector(self.rotation * (point.as_dvec3() - self.origin))
    }

    fn direction(&self, direction: Vec3) -> Vec3 {
        (self.rotation * direction.as_dvec3()).as_vec3()
    }
}

/// Whether a triangle needs no corner attributes beside its material and its plane: its colours are white, and its normals equal the
/// plane's normal, to the precision of 16-bit coordinates.
fn is_plain(triangle: &Triangle) -> bool {
    // The computation is in double precision, because the square of a small area underflows single precision.
    let [a, b, c] = triangle.positions.map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
    let flat = |n: &Vec3| *n == Vec3::ZERO || n.distance_squared(normal) < 1e-9;
    triangle.colors == [Triangle::WHITE; 3] && triangle.normals.iter().all(flat)
}

/// The texels of all pairs, as `shaders/shared/pairs.wgsl` reads them, and the texels of the corner attributes of pairs that have any.
fn pack_pairs(scene: &Scene, frame: &CameraFrame, pairs: &[Pair]) -> (Vec<[u32; 4]>, Vec<[u32; 4]>) {
    let textured: Vec<bool> =
        scene.materials.iter().map(|material| material.textures().next().is_some()).collect();
    let mut texels = Vec::with_capacity(4 * pairs.len());
    let mut corners = Vec::new();
    for pair in pairs {
        let triangles: Vec<Triangle> =
            pair.triangles().map(|(rotated, _)| rotated.of(&scene.triangles)).collect();
        // Both triangles of a pair have the same material and region.
        let Triangle { material, region, .. } = triangles[0];
        let needs_corners = textured[material as usize] || !triangles.iter().all(is_plain);
        // Each triangle has six texels of corner attributes. The array's size limit is far below u32::MAX, and is checked at its creation.
        let first_corner = if needs_corners { corners.len() as u32 } else { NONE };
        if needs_corners {
            corners.extend(triangles.iter().flat_map(|triangle| pack_corners(triangle, frame)).flatten());
        }
        let [a, b, c, d] = pair.corners;
        let words = [a, b - a, c - a, d - a].map(|v| v.to_array().map(f32::to_bits));
        texels.extend_from_slice(words.as_flattened().as_chunks::<4>().0);
        texels.push([material, region, first_corner, 0]);
    }
    (texels, corners)
}

/// For each corner, one texel with both sets of texture coordinates, and one texel with normal and colour.
fn pack_corners(triangle: &Triangle, frame: &CameraFrame) -> [[[u32; 4]; 2]; 3] {
    [0, 1, 2].map(|corner| {
        let [first, second] = triangle.texcoords[corner];
        let [red, green, blue, alpha] = triangle.colors[corner].map(u32::from);
        [
            [first.x, first.y, second.x, second.y].map(f32::to_bits),
            [
                pack_normal(frame.direction(triangle.normals[corner])),
                red | green << 16,
                blue | alpha << 16,
                0,
            ],
        ]
    })
}

/// The fraction of the surfaces, nearest first, whose distance determines the unit.
const NEAR: f64 = 0.25;

/// The tracer's unit of length, a power of two of metres.
///
/// Offsets of rays, products of lengths and thresholds in the code are suited to distances of about 1. Therefore all geometry on the device
/// has a unit that suits the scene. A quarter of the surfaces, measured by solid angle at the camera, lies within a certain distance. The
/// unit is this distance, rounded down to a power of two. Ray offsets on far surfaces follow from the coordinates there, so a small unit
/// does not harm far surfaces. A large unit would harm near surfaces. Photos of a scene that is `2^k` times as large have the same bits,
/// times `2^-2k`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    pub(super) metres: f64,
}

impl Unit {
    pub(super) fn of(scene: &Scene) -> Self {
        let camera = scene.camera.position.as_dvec3();
        let mut distances = Distances::new();
        for triangle in &scene.triangles {
            let corners = triangle.positions.map(|corner| corner.as_dvec3() - camera);
            let [a, b, c] = corners;
            let (area, middle) = (0.5 * (b - a).cross(c - a).length(), (a + b + c) / 3.0);
            // The solid angle, computed without the slope of the surface, is limited to that of the whole sphere.
            let angle = (area / middle.length_squared()).min(4.0 * std::f64::consts::PI);
            corners.iter().for_each(|corner| distances.add(corner.length(), angle));
        }
        Self { metres: 2_f64.powi(distances.power(NEAR)) }
    }

    pub(super) fn length(self, metres: f32) -> f32 {
        (f64::from(metres) / self.metres) as f32
    }

    pub(super) fn vector(self, metres: DVec3) -> Vec3 {
        (metres / self.metres).as_vec3()
    }

    /// Converts radiance from W/(unit² sr) to W/(m² sr).
    pub(super) fn radiance(self) -> f32 {
        self.metres.powi(-2) as f32
    }
}
