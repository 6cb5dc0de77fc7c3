//! A scene on the device: geometry in the pinhole's frame, materials, textures.

use glam::{DMat3, DVec3, Vec2, Vec3};

use super::materials::{GpuMaterial, pack_textures, srgb_table};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::scene::bvh::Bvh;
use crate::scene::{Camera, Scene};

/// Bindings 1 to 7 of group 0, in that order.
pub(super) struct GpuScene {
    pub(super) nodes: wgpu::TextureView,
    pub(super) triangles: wgpu::TextureView,
    pub(super) materials: wgpu::Buffer,
    pub(super) texcoords: wgpu::Buffer,
    pub(super) texture_infos: wgpu::Buffer,
    pub(super) texels: wgpu::Buffer,
    pub(super) srgb_table: wgpu::Buffer,
    /// Whether any surface emits light of its own.
    pub(super) ambient: bool,
    /// Whether any surface mirrors or refracts in single directions.
    pub(super) specular: bool,
    /// Whether any surface lets light straight through.
    pub(super) passable: bool,
}

impl GpuScene {
    pub(super) fn upload(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let corners: Vec<[Vec3; 3]> = in_pinhole_frame(scene);
        let bvh = Bvh::build(&corners).ok_or_else(|| Error::Scene {
            path: scene.path.clone(),
            fault: "its triangles lie so close together that no search tree of bounded depth holds them"
                .into(),
            help: "remove duplicate geometry (merge by distance) and export again".into(),
        })?;

        let mut triangles = Vec::with_capacity(3 * bvh.order.len());
        let mut texcoords: Vec<Vec2> = Vec::new();
        let textured = scene.materials.iter().any(|m| m.base_color_texture.is_some());
        for &index in &bvh.order {
            let triangle = &scene.triangles[index as usize];
            let [a, b, c] = corners[index as usize];
            let texel = |v: Vec3, word: u32| [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), word];
            triangles.extend([texel(a, triangle.material), texel(b - a, triangle.region), texel(c - a, 0)]);
            if textured {
                texcoords.extend(triangle.texcoords);
            }
        }
        let materials: Vec<GpuMaterial> = scene.materials.iter().map(GpuMaterial::from).collect();
        let (infos, texels) = pack_textures(scene);

        Ok(Self {
            nodes: gpu.texel_array("search tree's nodes", &bvh.nodes)?,
            triangles: gpu.texel_array("triangles", &triangles)?,
            materials: gpu.storage("materials", &materials)?,
            texcoords: gpu.storage("texture coordinates", &texcoords)?,
            texture_infos: gpu.storage("texture descriptions", &infos)?,
            texels: gpu.storage("textures", &texels)?,
            srgb_table: gpu.storage("sRGB table", &srgb_table())?,
            ambient: scene.materials.iter().any(|m| m.emission != Vec3::ZERO),
            specular: scene.materials.iter().any(|m| {
                m.roughness * m.roughness < super::materials::MIN_ALPHA
                    && (m.metallic > 0.0 || m.specular > 0.0)
            }),
            passable: false,
        })
    }
}

/// Corners of all triangles with the pinhole at the origin, looking along −z: precision is best near it, and a scene far
/// from its origin loses none. Through f64, so that the shift itself costs nothing.
fn in_pinhole_frame(scene: &Scene) -> Vec<[Vec3; 3]> {
    let Camera { position, right, up, forward, .. } = &scene.camera;
    let to_pinhole = DMat3::from_cols(right.as_dvec3(), up.as_dvec3(), -forward.as_dvec3()).transpose();
    let pinhole: DVec3 = position.as_dvec3();
    let corner = |p: Vec3| (to_pinhole * (p.as_dvec3() - pinhole)).as_vec3();
    scene.triangles.iter().map(|t| t.positions.map(corner)).collect()
}
