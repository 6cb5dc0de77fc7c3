//! Surface materials and their textures: glTF metallic–roughness with `KHR_materials_specular`, `ior`, `transmission`, `volume` and
//! `diffuse_transmission`.

use glam::{Affine2, Vec3};

/// A reciprocal surface material. Colours are linear, with sRGB primaries. A texture's channels multiply the factors as glTF defines.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Material {
    /// The name in the file, or `material N`.
    pub name: String,
    /// Base colour factor, `[0, 1]` per channel. It also tints transmitted light.
    pub base_color: Vec3,
    /// Coverage, `[0, 1]`: the alpha of the base colour factor. [`Material::alpha_mode`] determines its effect.
    pub opacity: f32,
    /// RGB (sRGB) for [`Material::base_color`], alpha for [`Material::opacity`].
    pub base_color_texture: Option<TextureRef>,
    /// The effect of the opacity.
    pub alpha_mode: AlphaMode,
    /// 0 for a dielectric, 1 for a metal.
    pub metallic: f32,
    /// Perceptual roughness; the microfacet `α` is its square.
    pub roughness: f32,
    /// Blue for [`Material::metallic`], green for [`Material::roughness`].
    pub metallic_roughness_texture: Option<TextureRef>,
    /// RGB encodes the shading normal in the frame of the texture coordinates.
    pub normal_texture: Option<TextureRef>,
    /// Factor for the first two components of the texture's normal.
    pub normal_scale: f32,
    /// `specularFactor`: strength of the dielectric's specular lobe. With 0 the dielectric is Lambertian.
    pub specular: f32,
    /// Alpha for [`Material::specular`].
    pub specular_texture: Option<TextureRef>,
    /// `specularColorFactor`: tint of the dielectric's reflectance at normal incidence.
    pub specular_color: Vec3,
    /// RGB (sRGB) for [`Material::specular_color`].
    pub specular_color_texture: Option<TextureRef>,
    /// Index of refraction of the dielectric.
    pub ior: f32,
    /// Emitted radiance in W/(m² sr). It is ambient light, because it does not depend on the projector.
    pub emission: Vec3,
    /// RGB (sRGB) for [`Material::emission`].
    pub emission_texture: Option<TextureRef>,
    /// Fraction of the light entering the dielectric that is transmitted instead of scattered diffusely.
    pub transmission: f32,
    /// Red for [`Material::transmission`].
    pub transmission_texture: Option<TextureRef>,
    /// Fraction of the diffuse light that leaves on the other side, as with paper that is lit from behind.
    pub diffuse_transmission: f32,
    /// Alpha for [`Material::diffuse_transmission`].
    pub diffuse_transmission_texture: Option<TextureRef>,
    /// Colour of diffusely transmitted light.
    pub diffuse_transmission_color: Vec3,
    /// RGB (sRGB) for [`Material::diffuse_transmission_color`].
    pub diffuse_transmission_color_texture: Option<TextureRef>,
    /// The medium behind the front of a closed surface. `None` means a thin wall with air on both sides.
    pub volume: Option<Volume>,
    /// Whether the back reflects (and emits) like the front. The back of a one-sided surface is black. A surface that transmits light is
    /// always treated as two-sided, because transmission from one side only would not be reciprocal.
    pub double_sided: bool,
}

/// The effect of a surface's opacity.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum AlphaMode {
    /// Opacity is ignored, and the surface covers all points.
    Opaque,
    /// The surface covers the points whose opacity is at least `cutoff`. All other points are holes.
    Mask {
        /// The smallest opacity of a covered point.
        cutoff: f32,
    },
    /// The opacity is the fraction of incident light that interacts with the surface. The remaining light passes straight on.
    Blend,
}

/// The absorbing medium inside a closed surface. Its index of refraction is [`Material::ior`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Volume {
    /// The colour of white light after it has travelled [`Volume::attenuation_distance`].
    pub attenuation_color: Vec3,
    /// The distance at which light has this colour, in metres. It is infinite if the medium does not absorb.
    pub attenuation_distance: f32,
}

impl Volume {
    /// The absorption coefficient per metre. The transmittance over `d` metres is `exp(−absorption · d)`.
    pub fn absorption(&self) -> Vec3 {
        // The colour is bounded away from zero: the logarithm of zero is infinite, and its product with a path length of zero would be NaN.
        self.attenuation_color.max(Vec3::splat(f32::MIN_POSITIVE)).map(|color| -color.ln())
            / self.attenuation_distance
    }
}

impl Material {
    /// Whether the surface transmits any light. The back of such a surface is not black.
    pub fn lets_light_through(&self) -> bool {
        self.transmission > 0.0
            || self.diffuse_transmission > 0.0
            || matches!(self.alpha_mode, AlphaMode::Blend)
    }

    /// Whether light may pass straight on, through the holes of the surface or through a smooth thin wall.
    pub fn lets_light_straight_through(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque || (self.transmission > 0.0 && self.volume.is_none())
    }

    /// Whether the microfacet width `roughness²` may be below `alpha`. This is always true with a roughness texture.
    pub fn may_be_smoother_than(&self, alpha: f32) -> bool {
        self.metallic_roughness_texture.is_some() || self.roughness * self.roughness < alpha
    }

    /// Whether a texture reads the first and the second set of texture coordinates.
    pub(super) fn texture_sets(&self) -> [bool; 2] {
        [0, 1].map(|set| self.textures().any(|(_, texture)| texture.set == set))
    }

    /// Drops the textures for which `is_kept` is false. If the emission's texture is dropped, the emission becomes black.
    pub(super) fn retain_textures(&mut self, is_kept: impl Fn(&TextureRef) -> bool) {
        let is_lit = self.emission_texture.as_ref().is_none_or(&is_kept);
        if !is_lit {
            self.emission = Vec3::ZERO;
        }
        for (_, slot) in self.texture_slots() {
            *slot = slot.filter(&is_kept);
        }
    }

    /// The slots of all textures, each with its role in glTF's terms.
    pub(super) fn texture_slots(&mut self) -> [(&'static str, &mut Option<TextureRef>); 9] {
        [
            ("base colour", &mut self.base_color_texture),
            ("metallic-roughness", &mut self.metallic_roughness_texture),
            ("normal", &mut self.normal_texture),
            ("emissive", &mut self.emission_texture),
            ("specular", &mut self.specular_texture),
            ("specular colour", &mut self.specular_color_texture),
            ("transmission", &mut self.transmission_texture),
            ("diffuse transmission", &mut self.diffuse_transmission_texture),
            ("diffuse transmission colour", &mut self.diffuse_transmission_color_texture),
        ]
    }

    /// The textures of the material, each with its role in glTF's terms.
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
    /// A white, two-sided Lambertian. It differs from glTF's default material, which has `metallic` 1.
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

/// The handling of texture coordinates outside `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Wrap {
    /// The picture repeats.
    Repeat,
    /// The picture repeats, and every second copy is mirrored.
    MirroredRepeat,
    /// The texel at the border extends outwards.
    ClampToEdge,
}

/// A picture with its sampler. Texel `(x, y)` is `texels[y·width + x]`. Row 0 is at the top (`v = 0`).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Texture {
    /// The image's name or URI, for messages.
    pub name: String,
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// RGBA texels, 8 bits per channel. RGB is sRGB-encoded in colour textures of materials, otherwise linear.
    pub texels: Vec<[u8; 4]>,
    /// Wrapping of `u` and `v`.
    pub wrap: [Wrap; 2],
    /// Whether the texture is interpolated bilinearly. Otherwise the nearest texel is read.
    pub linear: bool,
}

/// A material's reference to a texture.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TextureRef {
    /// Index into [`crate::scene::Scene::textures`].
    pub texture: u32,
    /// The set of [`crate::scene::Triangle::texcoords`] that the texture uses: 0 or 1.
    pub set: u32,
    /// The map from these texture coordinates to the picture's coordinates (`KHR_texture_transform`).
    pub transform: Affine2,
}

impl TextureRef {
    /// A reference that uses the first set of coordinates, without a transform.
    pub fn new(texture: u32) -> Self {
        Self { texture, set: 0, transform: Affine2::IDENTITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transmittance_over_the_attenuation_distance_is_the_attenuation_colour() {
        let color = Vec3::new(0.25, 0.5, 1.0);
        let volume = Volume { attenuation_color: color, attenuation_distance: 0.1 };
        let left = (-volume.absorption() * 0.1).exp();
        // The tolerance allows for the rounding of a logarithm and an exponential in single precision.
        assert!(left.abs_diff_eq(color, 1e-6), "{left}");
        let clear = Volume { attenuation_distance: f32::INFINITY, ..volume };
        assert_eq!(clear.absorption(), Vec3::ZERO);
        let black = Volume { attenuation_color: Vec3::ZERO, ..volume };
        assert_eq!((-black.absorption() * 0.0).exp(), Vec3::ONE);
    }
}
