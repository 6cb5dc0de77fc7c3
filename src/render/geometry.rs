//! A scene on the device: geometry in the pinhole's frame, materials, textures.

use glam::{DMat3, DVec3, Vec3};

use super::features::SceneFeatures;
use super::materials::{MIN_ALPHA, NONE, pack_materials};
use super::pairs::{Pair, pair_up};
use super::textures::{pack_normal, pack_texels, srgb_table};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::buffers::TEXTURE_WIDTH;
use crate::scene::bvh::Bvh;
use crate::scene::{AlphaMode, Camera, Material, Scene, Triangle};

/// Scenes of at most so many triangles are traced without the search tree: a node costs a ray as much as several triangles.
const FEW_TRIANGLES: usize = 8;

/// Bindings 1 to 7 of group 0, in that order.
pub(super) struct GpuScene {
    pub(super) nodes: wgpu::TextureView,
    pub(super) pairs: wgpu::TextureView,
    pub(super) materials: wgpu::TextureView,
    pub(super) corners: wgpu::TextureView,
    pub(super) textures: wgpu::Buffer,
    pub(super) texels: wgpu::TextureView,
    pub(super) srgb_table: wgpu::Buffer,
    /// The triangles in the pinhole's frame, in leaf order.
    pub(super) pairs_in_order: Vec<Pair>,
    /// Whether any surface emits light of its own.
    pub(super) ambient: bool,
    /// What the surfaces need of a kernel.
    pub(super) features: SceneFeatures,
}

impl GpuScene {
    pub(super) fn upload(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let frame = PinholeFrame::of(&scene.camera);
        let positions: Vec<[Vec3; 3]> =
            scene.triangles.iter().map(|t| t.positions.map(|p| frame.point(p))).collect();
        let pairs = pair_up(&scene.triangles, &positions);
        let bvh = Bvh::build(pairs.iter().map(Pair::extent)).ok_or_else(|| Error::Scene {
            path: scene.path.clone(),
            fault: "its triangles lie so close together that no search tree of bounded depth holds them"
                .into(),
            help: "remove duplicate geometry (merge by distance) and export again".into(),
        })?;
        let pairs: Vec<Pair> = bvh.order.iter().map(|&index| pairs[index as usize].clone()).collect();

        let (texels, corners) = pack_pairs(scene, &frame, &pairs);
        let (materials, textures) = pack_materials(scene);
        let mut features = features(scene, pairs.len(), !corners.is_empty());
        let (mut nodes, mut row) = (bvh.nodes, TEXTURE_WIDTH);
        let spread_out = (8 * nodes.len() / 5).max(texels.len());
        if spread_out <= gpu.summary.max_texture_side as usize {
            features.small_tree = true;
            nodes = spread::<5, 8>(&nodes);
            // Not more than the device's limit, which has 32 bits.
            row = spread_out as u32;
        }

        Ok(Self {
            nodes: gpu.texel_rows("search tree's nodes", &nodes, row)?,
            pairs: gpu.texel_rows("triangles", &texels, row)?,
            materials: gpu.texel_array("materials", &materials)?,
            corners: gpu.texel_array("normals, texture coordinates and colours", &corners)?,
            textures: gpu.storage("texture descriptions", &textures)?,
            texels: gpu.texel_array("textures", &pack_texels(scene))?,
            srgb_table: gpu.storage("sRGB table", &srgb_table())?,
            pairs_in_order: pairs,
            ambient: scene.materials.iter().any(|m| m.emission != Vec3::ZERO),
            features,
        })
    }
}

/// Each `FROM` texels, and zeros after them up to `TO`: where things of a power of two texels begin, a shift tells.
fn spread<const FROM: usize, const TO: usize>(texels: &[[u32; 4]]) -> Vec<[u32; 4]> {
    let things = texels.as_chunks::<FROM>().0.iter();
    things.flat_map(|thing| (0..TO).map(|at| thing.get(at).copied().unwrap_or_default())).collect()
}

fn features(scene: &Scene, pairs: usize, corners: bool) -> SceneFeatures {
    let mirrors = |m: &Material| {
        (m.metallic > 0.0 || m.specular > 0.0 || m.transmission > 0.0) && m.may_be_smoother_than(MIN_ALPHA)
    };
    let matte = |m: &Material| {
        m.metallic == 0.0 && m.specular == 0.0 && !m.lets_light_through() && m.alpha_mode == AlphaMode::Opaque
    };
    SceneFeatures {
        // Normals at the corners make even a Lambertian shade.
        matte: !corners && scene.materials.iter().all(matte),
        corners,
        chains: scene.materials.iter().any(mirrors),
        passable: scene.materials.iter().any(Material::lets_light_straight_through),
        media: scene.materials.iter().any(|m| m.lets_light_through() && m.volume.is_some()),
        small_tree: false,
        few_pairs: if scene.triangles.len() <= FEW_TRIANGLES { pairs as u32 } else { 0 },
    }
}

/// The pinhole at the origin, looking along −z: precision is best near it, and a scene far from its origin loses none.
/// Through f64, so that the shift itself costs nothing.
struct PinholeFrame {
    rotation: DMat3,
    origin: DVec3,
}

impl PinholeFrame {
    fn of(camera: &Camera) -> Self {
        let Camera { position, right, up, forward, .. } = camera;
        let rotation = DMat3::from_cols(right.as_dvec3(), up.as_dvec3(), -forward.as_dvec3()).transpose();
        Self { rotation, origin: position.as_dvec3() }
    }

    fn point(&self, point: Vec3) -> Vec3 {
        (self.rotation * (point.as_dvec3() - self.origin)).as_vec3()
    }

    fn direction(&self, direction: Vec3) -> Vec3 {
        (self.rotation * direction.as_dvec3()).as_vec3()
    }
}

/// Whether a triangle's corners say nothing that its material and its plane do not say: white, and as flat as 16-bit
/// normals can tell.
fn is_plain(triangle: &Triangle) -> bool {
    let [a, b, c] = triangle.positions;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let flat = |n: &Vec3| *n == Vec3::ZERO || n.distance_squared(normal) < 1e-9;
    triangle.colors == [Triangle::WHITE; 3] && triangle.normals.iter().all(flat)
}

/// As `shaders/shared/pairs.wgsl` reads them, and what their corners carry, where that is more than material and plane say.
fn pack_pairs(scene: &Scene, frame: &PinholeFrame, pairs: &[Pair]) -> (Vec<[u32; 4]>, Vec<[u32; 4]>) {
    let textured: Vec<bool> =
        scene.materials.iter().map(|material| material.textures().next().is_some()).collect();
    let mut texels = Vec::with_capacity(4 * pairs.len());
    let mut corners = Vec::new();
    for pair in pairs {
        let triangles: Vec<Triangle> =
            pair.triangles().map(|(rotated, _)| rotated.of(&scene.triangles)).collect();
        // Both have the same.
        let Triangle { material, region, .. } = triangles[0];
        let needs_corners = textured[material as usize] || !triangles.iter().all(is_plain);
        // Six texels a triangle; the array's size limit is far below u32::MAX, and is checked when it is made.
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

/// Two texels a corner: both sets of texture coordinates; normal and colour.
fn pack_corners(triangle: &Triangle, frame: &PinholeFrame) -> [[[u32; 4]; 2]; 3] {
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
