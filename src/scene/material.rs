//! Surface materials: glTF metallic–roughness with `KHR_materials_specular`, `ior`, `transmission`, `volume` and
//! `diffuse_transmission`.

use glam::Vec3;

use super::texture::TextureRef;

/// A reciprocal surface. Colours are linear (sRGB primaries); a texture multiplies the factor that it belongs to, by the
/// channels that glTF names.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file, or `material N`.
    pub name: String,
    /// Base colour factor, `[0, 1]` per channel. It tints what is transmitted, too.
    pub base_color: Vec3,
    /// Coverage, `[0, 1]`: the alpha of the base colour factor. [`Material::alpha_mode`] says what it does.
    pub opacity: f32,
    /// RGB (sRGB) for [`Material::base_color`], alpha for [`Material::opacity`].
    pub base_color_texture: Option<TextureRef>,
    /// What the opacity does.
    pub alpha_mode: AlphaMode,
    /// 0 is a dielectric, 1 a metal.
    pub metallic: f32,
    /// Perceptual roughness; the microfacet `α` is its square.
    pub roughness: f32,
    /// Blue for [`Material::metallic`], green for [`Material::roughness`].
    pub metallic_roughness_texture: Option<TextureRef>,
    /// RGB is the shading normal in the frame of the texture coordinates.
    pub normal_texture: Option<TextureRef>,
    /// Multiplies the first two components of that normal.
    pub normal_scale: f32,
    /// `specularFactor`: strength of the dielectric's specular lobe; 0 leaves a pure Lambertian.
    pub specular: f32,
    /// Alpha for [`Material::specular`].
    pub specular_texture: Option<TextureRef>,
    /// `specularColorFactor`: tint of the dielectric's reflectance at normal incidence.
    pub specular_color: Vec3,
    /// RGB (sRGB) for [`Material::specular_color`].
    pub specular_color_texture: Option<TextureRef>,
    /// Index of refraction of the dielectric.
    pub ior: f32,
    /// Emitted radiance in W/(m² sr): ambient light, there without the projector.
    pub emission: Vec3,
    /// RGB (sRGB) for [`Material::emission`].
    pub emission_texture: Option<TextureRef>,
    /// Share of the light entering the dielectric that goes through instead of being scattered back.
    pub transmission: f32,
    /// Red for [`Material::transmission`].
    pub transmission_texture: Option<TextureRef>,
    /// Share of the diffuse light that leaves on the other side, as of paper lit from behind.
    pub diffuse_transmission: f32,
    /// Alpha for [`Material::diffuse_transmission`].
    pub diffuse_transmission_texture: Option<TextureRef>,
    /// Colour of the light that is transmitted diffusely.
    pub diffuse_transmission_color: Vec3,
    /// RGB (sRGB) for [`Material::diffuse_transmission_color`].
    pub diffuse_transmission_color_texture: Option<TextureRef>,
    /// What lies behind the front of a closed surface. `None`: the surface is a thin wall, with air on both sides.
    pub volume: Option<Volume>,
    /// Whether the back reflects (and emits) like the front. The back of a one-sided surface is black: letting light
    /// through from one side only would not be reciprocal. A surface that lets light through has two sides in any case.
    pub double_sided: bool,
}

/// What a surface's opacity does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Nothing: the surface is there.
    Opaque,
    /// It is there where the opacity is at least `cutoff`, and a hole elsewhere.
    Mask {
        /// The least opacity of what is there.
        cutoff: f32,
    },
    /// It covers this share of every spot; the rest is a hole.
    Blend,
}

/// The medium inside a closed surface; its index of refraction is [`Material::ior`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// What is left of white light after [`Volume::attenuation_distance`].
    pub attenuation_color: Vec3,
    /// Metres; infinite where nothing is absorbed.
    pub attenuation_distance: f32,
}

impl Volume {
    /// The absorption coefficient per metre: after `d` metres `exp(−absorption · d)` is left.
    pub fn absorption(&self) -> Vec3 {
        // The logarithm of zero would make NaN of a path of no length.
        self.attenuation_color.max(Vec3::splat(f32::MIN_POSITIVE)).map(|color| -color.ln())
            / self.attenuation_distance
    }
}

impl Material {
    /// Whether light gets to the other side, wholly or in part. Such a surface is never black from behind.
    pub fn lets_light_through(&self) -> bool {
        self.transmission > 0.0
            || self.diffuse_transmission > 0.0
            || matches!(self.alpha_mode, AlphaMode::Blend)
    }

    /// Whether light may go straight through: past what covers the surface in part, or through a smooth thin wall.
    pub fn lets_light_straight_through(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque || (self.transmission > 0.0 && self.volume.is_none())
    }

    /// Whether the microfacet width `roughness²` may be below `alpha` somewhere; a texture may make it so anywhere.
    pub fn may_be_smoother_than(&self, alpha: f32) -> bool {
        self.metallic_roughness_texture.is_some() || self.roughness * self.roughness < alpha
    }

    /// The textures with what each one is for, in glTF's words.
    pub fn textures(&self) -> impl Iterator<Item = (&'static str, &TextureRef)> {
        [
            ("base colour", &self.base_color_texture),
            ("metallic-roughness", &self.metallic_roughness_texture),
            ("normal", &self.normal_texture),
            ("specular", &self.specular_texture),
            ("specular colour", &self.specular_color_texture),
            ("emissive", &self.emission_texture),
            ("transmission", &self.transmission_texture),
            ("diffuse transmission", &self.diffuse_transmission_texture),
            ("diffuse transmission colour", &self.diffuse_transmission_color_texture),
        ]
        .into_iter()
        .filter_map(|(role, texture)| texture.as_ref().map(|texture| (role, texture)))
    }
}

impl Default for Material {
    /// glTF's default material made Lambertian, white and two-sided: what a primitive without a material does *not* have
    /// (that one has `metallic` 1), but a clean start for scenes made in code.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec3::ONE,
            opacity: 1.0,
            base_color_texture: None,
            alpha_mode: AlphaMode::Opaque,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            specular: 0.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            ior: 1.5,
            emission: Vec3::ZERO,
            emission_texture: None,
            transmission: 0.0,
            transmission_texture: None,
            diffuse_transmission: 0.0,
            diffuse_transmission_texture: None,
            diffuse_transmission_color: Vec3::ONE,
            diffuse_transmission_color_texture: None,
            volume: None,
            double_sided: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_the_attenuation_distance_its_colour_is_left() {
        let color = Vec3::new(0.25, 0.5, 1.0);
        let volume = Volume { attenuation_color: color, attenuation_distance: 0.1 };
        let left = (-volume.absorption() * 0.1).exp();
        // A logarithm and an exponential in single precision.
        assert!(left.abs_diff_eq(color, 1e-6), "{left}");
        let clear = Volume { attenuation_distance: f32::INFINITY, ..volume };
        assert_eq!(clear.absorption(), Vec3::ZERO);
        let black = Volume { attenuation_color: Vec3::ZERO, ..volume };
        assert_eq!((-black.absorption() * 0.0).exp(), Vec3::ONE);
    }
}
