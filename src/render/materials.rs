//! Materials and textures in the form that the shaders read.

use glam::{Vec2, Vec3};

use super::geometry::Unit;
use crate::scene::{AlphaMode, Material, Scene, TextureRef, Wrap};

/// A surface with a smaller microfacet width `α` counts as smooth.
pub const MIN_ALPHA: f32 = 1e-3;

/// The index that means "no pixel", "no triangle", "no region" and so on; `NONE` in `shaders/shared/parameters.wgsl`.
pub(super) const NONE: u32 = u32::MAX;

const DOUBLE_SIDED: u32 = 1;
const LETS_LIGHT_THROUGH: u32 = 2;
const BLEND: u32 = 4;
const MASK: u32 = 8;

/// A material as seven texels, in the layout of `shaders/shared/surface.wgsl`. Software Vulkan loads textures far faster than buffers.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct GpuMaterial {
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
    fn new(material: &Material, [begin, end]: [u32; 2]) -> Self {
        // KHR_materials_ior and KHR_materials_specular define F₀ = min(((n−1)/(n+1))² · colour, 1) · factor and F₉₀ = factor. The shader
        // applies the minimum and the factor, because textures may change both colour and factor.
        let normal_incidence = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
        let through = material.lets_light_through();
        // Light does not enter an opaque surface, so an opaque surface has no medium.
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
            // In glTF, a refractive index of 0 means a Fresnel term of 1. No light enters such a surface, so none is refracted.
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

/// All materials of a scene as texels, with absorption per unit of length; and the list of their textures, in the order of the materials.
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

/// The property of a material that a texture multiplies. `shaders/shared/texture.wgsl` defines the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TextureRole {
    BaseColor,
    MetallicRoughness,
    Normal,
    Specular,
    SpecularColor,
    Emission,
    Transmission,
    DiffuseTransmission,
    DiffuseTransmissionColor,
}

impl TextureRole {
    fn is_color(self) -> bool {
        matches!(
            self,
            Self::BaseColor | Self::SpecularColor | Self::Emission | Self::DiffuseTransmissionColor
        )
    }
}

/// One use of a texture by a material, in the layout of `Texture` in `shaders/shared/texture.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuTexture {
    /// Rows of the affine map from the surface's texture coordinates to coordinates of the picture.
    u: Vec3,
    first_texel: u32,
    v: Vec3,
    width: u32,
    height: u32,
    flags: u32,
    padding: [u32; 2],
}

impl GpuTexture {
    pub(super) fn of(scene: &Scene, material: &Material) -> Vec<Self> {
        [
            (&material.base_color_texture, TextureRole::BaseColor),
            (&material.metallic_roughness_texture, TextureRole::MetallicRoughness),
            (&material.normal_texture, TextureRole::Normal),
            (&material.specular_texture, TextureRole::Specular),
            (&material.specular_color_texture, TextureRole::SpecularColor),
            (&material.emission_texture, TextureRole::Emission),
            (&material.transmission_texture, TextureRole::Transmission),
            (&material.diffuse_transmission_texture, TextureRole::DiffuseTransmission),
            (&material.diffuse_transmission_color_texture, TextureRole::DiffuseTransmissionColor),
        ]
        .into_iter()
        .filter_map(|(texture, role)| texture.as_ref().map(|texture| Self::new(scene, texture, role)))
        .collect()
    }

    pub(super) fn new(scene: &Scene, reference: &TextureRef, role: TextureRole) -> Self {
        let texture = &scene.textures[reference.texture as usize];
        let wrap = texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::MirroredRepeat => 1,
            Wrap::ClampToEdge => 2,
        });
        let [x, y] = [reference.transform.x_axis, reference.transform.y_axis];
        let offset = reference.transform.translation;
        Self {
            u: Vec3::new(x.x, y.x, offset.x),
            // The size limit of the texture array is far below u32::MAX texels, and is checked when the array is created.
            first_texel: first_texel(scene, reference.texture) as u32,
            v: Vec3::new(x.y, y.y, offset.y),
            width: texture.width,
            height: texture.height,
            flags: wrap[0]
                | wrap[1] << 2
                | u32::from(texture.linear) << 4
                | u32::from(role.is_color()) << 5
                | reference.set << 6
                | (role as u32) << 8,
            padding: [0; 2],
        }
    }
}

fn first_texel(scene: &Scene, texture: u32) -> usize {
    scene.textures[..texture as usize].iter().map(|texture| texture.texels.len()).sum()
}

/// The texels of all textures, one texture after the other. Each element of the result holds four texels.
pub(super) fn pack_texels(scene: &Scene) -> Vec<[u32; 4]> {
    let total: usize = scene.textures.iter().map(|texture| texture.texels.len()).sum();
    let mut packed = vec![[0; 4]; total.div_ceil(4)];
    let texels = scene.textures.iter().flat_map(|texture| &texture.texels);
    packed
        .as_flattened_mut()
        .iter_mut()
        .zip(texels)
        .for_each(|(word, texel)| *word = u32::from_le_bytes(*texel));
    packed
}

/// The linear value of each sRGB byte (IEC 61966-2-1).
pub(super) fn srgb_table() -> Vec<f32> {
    let decode = |byte: u32| {
        let c = f64::from(byte) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    (0..256).map(|byte| decode(byte) as f32).collect()
}

/// A direction in 32 bits: two octahedral coordinates of 16 bits (Cigolla et al., "A Survey of Efficient Representations for Independent
/// Unit Vectors", JCGT 3(2), 2014). A corner without a normal has the zero vector, which has a word of its own.
pub(super) fn pack_normal(normal: Vec3) -> u32 {
    let sum = normal.abs().element_sum();
    if sum.is_nan() || sum <= 0.0 {
        return 0x8000_8000;
    }
    let [x, y] = [normal.x / sum, normal.y / sum];
    let folded = if normal.z >= 0.0 {
        Vec2::new(x, y)
    } else {
        Vec2::new((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y))
    };
    let [x, y] = (folded * 32767.0).round().to_array().map(|value| (value as i16).cast_unsigned());
    u32::from(x) | u32::from(y) << 16
}

#[cfg(test)]
mod tests {
    use std::mem::{offset_of, size_of};

    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout};
    use crate::scene::Volume;

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

    #[test]
    fn textures_have_the_layout_of_the_shader() {
        assert_layout!("trace_paths", "Texture", GpuTexture: u, first_texel, v, width, height, flags, padding);
    }
}
