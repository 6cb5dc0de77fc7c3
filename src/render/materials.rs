//! Materials and textures as the shaders read them.

use glam::Vec3;

use crate::scene::{Material, Scene, Wrap};

/// The smallest microfacet width `α` that is traced; a smaller one is raised to it.
pub const MIN_ALPHA: f32 = 1e-3;

pub(super) const NONE: u32 = u32::MAX;

/// Laid out as `Material` in `shaders/shared/surface.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuMaterial {
    base_color: Vec3,
    metallic: f32,
    f0: Vec3,
    f90: f32,
    emission: Vec3,
    alpha: f32,
    texture: u32,
    double_sided: u32,
    padding: [u32; 2],
}

impl From<&Material> for GpuMaterial {
    fn from(material: &Material) -> Self {
        // KHR_materials_ior and KHR_materials_specular: F₀ = min(((n−1)/(n+1))² · colour, 1) · factor, F₉₀ = factor.
        let normal_incidence = ((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
        let f0 = (normal_incidence * material.specular_color).min(Vec3::ONE) * material.specular;
        Self {
            base_color: material.base_color,
            metallic: material.metallic,
            f0,
            f90: material.specular,
            emission: material.emission,
            alpha: (material.roughness * material.roughness).max(MIN_ALPHA),
            texture: material.base_color_texture.unwrap_or(NONE),
            double_sided: u32::from(material.double_sided),
            padding: [0; 2],
        }
    }
}

/// Laid out as `TextureInfo` in `shaders/shared/texture.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct GpuTexture {
    offset: u32,
    width: u32,
    height: u32,
    flags: u32,
}

/// All textures of a scene: their descriptions, and their texels one after the other.
pub(super) fn pack_textures(scene: &Scene) -> (Vec<GpuTexture>, Vec<[u8; 4]>) {
    let mut infos = Vec::with_capacity(scene.textures.len());
    let mut texels = Vec::new();
    for texture in &scene.textures {
        let wrap = texture.wrap.map(|wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::MirroredRepeat => 1,
            Wrap::ClampToEdge => 2,
        });
        infos.push(GpuTexture {
            // The buffer's size limit is far below u32::MAX texels, and is checked when it is made.
            offset: texels.len() as u32,
            width: texture.width,
            height: texture.height,
            flags: wrap[0] | wrap[1] << 2 | u32::from(texture.linear) << 4,
        });
        texels.extend_from_slice(&texture.texels);
    }
    (infos, texels)
}

/// The linear value of each sRGB byte (IEC 61966-2-1).
pub(super) fn srgb_table() -> Vec<f32> {
    let decode = |byte: u32| {
        let c = f64::from(byte) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    (0..256).map(|byte| decode(byte) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::parameters::tests::{assert_layout, offsets};
    use std::mem::{offset_of, size_of};

    #[test]
    fn materials_lie_as_the_shader_reads_them() {
        let members = offsets!(GpuMaterial: base_color, metallic, f0, f90, emission, alpha, texture, double_sided, padding);
        assert_layout("trace_paths", "Material", members, size_of::<GpuMaterial>());
    }

    #[test]
    fn textures_lie_as_the_shader_reads_them() {
        let members = offsets!(GpuTexture: offset, width, height, flags);
        assert_layout("trace_paths", "TextureInfo", members, size_of::<GpuTexture>());
    }

    #[test]
    fn a_lambertian_has_no_specular_lobe() {
        let material = GpuMaterial::from(&Material { specular: 0.0, ..Material::default() });
        assert_eq!((material.f0, material.f90), (Vec3::ZERO, 0.0));
    }
}
