//! Textures in the form that the shaders read.

use glam::{Vec2, Vec3};

use crate::scene::{Material, Scene, TextureRef, Wrap};

/// The factor of the material that a texture multiplies. The numbers are those of
/// `shaders/shared/texture.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
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

impl Role {
    /// Whether RGB is sRGB-encoded.
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
    /// Rows of the affine map from the surface's texture coordinates to those of the picture.
    u: Vec3,
    first_texel: u32,
    v: Vec3,
    width: u32,
    height: u32,
    flags: u32,
    padding: [u32; 2],
}

impl GpuTexture {
    /// All textures of one material.
    pub(super) fn of(scene: &Scene, material: &Material) -> Vec<Self> {
        [
            (&material.base_color_texture, Role::BaseColor),
            (&material.metallic_roughness_texture, Role::MetallicRoughness),
            (&material.normal_texture, Role::Normal),
            (&material.specular_texture, Role::Specular),
            (&material.specular_color_texture, Role::SpecularColor),
            (&material.emission_texture, Role::Emission),
            (&material.transmission_texture, Role::Transmission),
            (&material.diffuse_transmission_texture, Role::DiffuseTransmission),
            (&material.diffuse_transmission_color_texture, Role::DiffuseTransmissionColor),
        ]
        .into_iter()
        .filter_map(|(texture, role)| texture.as_ref().map(|texture| Self::new(scene, texture, role)))
        .collect()
    }

    /// One use of a texture.
    pub(super) fn new(scene: &Scene, reference: &TextureRef, role: Role) -> Self {
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
            // The texture array's size limit is far below u32::MAX texels, and is checked when it is made.
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

/// The index of a texture's first texel in the array of [`pack_texels`].
fn first_texel(scene: &Scene, texture: u32) -> usize {
    scene.textures[..texture as usize].iter().map(|texture| texture.texels.len()).sum()
}

/// The texels of all textures, one texture after the other, with four texels in each element.
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

/// A direction in 32 bits: octahedral coordinates (Cigolla et al., "A Survey of Efficient Representations for
/// Independent Unit Vectors", JCGT 3(2), 2014), 16 bits each. The zero vector, for a corner without a normal,
/// has its own word.
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
    use super::*;
    use crate::gpu::layout::{assert_layout, offsets};
    use std::mem::size_of;

    #[test]
    fn textures_have_the_layout_of_the_shader() {
        let members = offsets!(GpuTexture: u, first_texel, v, width, height, flags, padding);
        assert_layout("trace_paths", "Texture", members, size_of::<GpuTexture>());
    }
}
