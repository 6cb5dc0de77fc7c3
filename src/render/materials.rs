//! Materials as the shaders read them.

use glam::Vec3;

use super::textures::GpuTexture;
use super::unit::Unit;
use crate::scene::{AlphaMode, Material, Scene};

/// A surface with a smaller microfacet width `α` counts as smooth.
pub const MIN_ALPHA: f32 = 1e-3;

/// The index that stands for no pixel, triangle, region, and so on; `NONE` in
/// `shaders/shared/parameters.wgsl`.
pub(super) const NONE: u32 = u32::MAX;

const DOUBLE_SIDED: u32 = 1;
const LETS_LIGHT_THROUGH: u32 = 2;
const BLEND: u32 = 4;
const MASK: u32 = 8;

/// A material as seven texels, in the layout of `shaders/shared/surface.wgsl`. On software Vulkan, loads from
/// storage textures are far cheaper than loads from buffers.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuMaterial {
    base_color: Vec3,
    metallic: f32,
    f0: Vec3,
    specular: f32,
    emission: Vec3,
    roughness: f32,
    diffuse_transmission_color: Vec3,
    diffuse_transmission: f32,
    absorption: Vec3,
    transmission: f32,
    cutoff: f32,
    ior: f32,
    normal_scale: f32,
    padding: u32,
    flags: u32,
    textures_begin: u32,
    textures_end: u32,
    opacity: f32,
}

impl GpuMaterial {
    /// A material whose textures are `begin..end` of the list.
    fn new(material: &Material, [begin, end]: [u32; 2]) -> Self {
        // KHR_materials_ior and KHR_materials_specular: F₀ = min(((n−1)/(n+1))² · colour, 1) · factor, F₉₀ =
        // factor. The shader applies the minimum and the factor, since both colour and factor may have a
        // texture.
        let normal_incidence = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
        let through = material.lets_light_through();
        // Light does not enter an opaque surface, so that it has no medium.
        let volume = material.volume.filter(|_| through);
        let (mode, cutoff) = match material.alpha_mode {
            AlphaMode::Opaque => (0, 0.0),
            AlphaMode::Mask { cutoff } => (MASK, cutoff),
            AlphaMode::Blend => (BLEND, 0.0),
        };
        let flag = |set, flag| if set { flag } else { 0 };
        Self {
            base_color: material.base_color,
            metallic: material.metallic,
            f0: normal_incidence * material.specular_color,
            specular: material.specular,
            emission: material.emission,
            roughness: material.roughness,
            diffuse_transmission_color: material.diffuse_transmission_color,
            diffuse_transmission: material.diffuse_transmission,
            absorption: volume.map_or(Vec3::ZERO, |volume| volume.absorption()),
            transmission: material.transmission,
            cutoff,
            // In glTF an index of 0 means a Fresnel term of 1: no light enters, and none is refracted.
            ior: if volume.is_some() && material.ior > 0.0 { material.ior } else { 1.0 },
            normal_scale: material.normal_scale,
            padding: 0,
            flags: mode | flag(material.double_sided, DOUBLE_SIDED) | flag(through, LETS_LIGHT_THROUGH),
            textures_begin: begin,
            textures_end: end,
            opacity: material.opacity,
        }
    }
}

/// All materials of a scene as texels, with absorption per unit of length, and the list of their textures in the order of the materials.
pub(super) fn pack_materials(scene: &Scene, unit: Unit) -> (Vec<[u32; 4]>, Vec<GpuTexture>) {
    let mut textures = Vec::new();
    let materials: Vec<GpuMaterial> = scene
        .materials
        .iter()
        .map(|material| {
            let begin = textures.len() as u32;
            textures.extend(GpuTexture::of(scene, material));
            let mut packed = GpuMaterial::new(material, [begin, textures.len() as u32]);
            packed.absorption *= unit.metres as f32;
            packed
        })
        .collect();
    (bytemuck::cast_slice(&materials).to_vec(), textures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::assert_constant;
    use crate::scene::Volume;
    use std::mem::{offset_of, size_of};

    #[test]
    fn materials_have_the_layout_of_the_shader() {
        let texel = |offset: usize| (offset / 16) as u32;
        for (name, value) in [
            ("MATERIAL_TEXELS", texel(size_of::<GpuMaterial>())),
            ("MATERIAL_BASE", texel(offset_of!(GpuMaterial, base_color))),
            ("MATERIAL_F0", texel(offset_of!(GpuMaterial, f0))),
            ("MATERIAL_EMISSION", texel(offset_of!(GpuMaterial, emission))),
            ("MATERIAL_DIFFUSE_TRANSMISSION", texel(offset_of!(GpuMaterial, diffuse_transmission_color))),
            ("MATERIAL_ABSORPTION", texel(offset_of!(GpuMaterial, absorption))),
            ("MATERIAL_NUMBERS", texel(offset_of!(GpuMaterial, cutoff))),
            ("MATERIAL_FLAGS", texel(offset_of!(GpuMaterial, flags))),
        ] {
            assert_constant("trace_paths", name, value);
        }
        // Position of each member within its texel.
        let within = |offset: usize| offset % 16 / 4;
        let lanes = [
            (offset_of!(GpuMaterial, metallic), 3),
            (offset_of!(GpuMaterial, specular), 3),
            (offset_of!(GpuMaterial, roughness), 3),
            (offset_of!(GpuMaterial, diffuse_transmission), 3),
            (offset_of!(GpuMaterial, transmission), 3),
            (offset_of!(GpuMaterial, cutoff), 0),
            (offset_of!(GpuMaterial, ior), 1),
            (offset_of!(GpuMaterial, normal_scale), 2),
            (offset_of!(GpuMaterial, flags), 0),
            (offset_of!(GpuMaterial, textures_begin), 1),
            (offset_of!(GpuMaterial, textures_end), 2),
            (offset_of!(GpuMaterial, opacity), 3),
        ];
        assert!(lanes.iter().all(|&(offset, lane)| within(offset) == lane));
    }

    #[test]
    fn only_a_volume_that_light_enters_refracts_and_absorbs() {
        let volume = Volume { attenuation_color: Vec3::splat(0.5), attenuation_distance: 1.0 };
        let solid = Material { volume: Some(volume), transmission: 1.0, ..Material::default() };
        let packed = GpuMaterial::new(&solid, [0; 2]);
        assert_eq!((packed.ior, packed.absorption), (1.5, volume.absorption()));
        for other in
            [Material { volume: None, ..solid.clone() }, Material { transmission: 0.0, ..solid.clone() }]
        {
            let packed = GpuMaterial::new(&other, [0; 2]);
            assert_eq!((packed.ior, packed.absorption), (1.0, Vec3::ZERO));
        }
    }
}
