//! Surface materials: glTF metallic–roughness with `KHR_materials_specular` and `KHR_materials_ior`.

use glam::Vec3;

/// A reciprocal surface. Colours are linear (sRGB primaries).
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file, or `material N`.
    pub name: String,
    /// Base colour factor, `[0, 1]` per channel.
    pub base_color: Vec3,
    /// A texture that multiplies the base colour: index into [`crate::scene::Scene::textures`].
    pub base_color_texture: Option<u32>,
    /// 0 is a dielectric, 1 a metal.
    pub metallic: f32,
    /// Perceptual roughness; the microfacet `α` is its square.
    pub roughness: f32,
    /// `specularFactor`: strength of the dielectric's specular lobe; 0 leaves a pure Lambertian.
    pub specular: f32,
    /// `specularColorFactor`: tint of the dielectric's reflectance at normal incidence.
    pub specular_color: Vec3,
    /// Index of refraction of the dielectric.
    pub ior: f32,
    /// Emitted radiance in W/(m² sr): ambient light, there without the projector.
    pub emission: Vec3,
    /// Whether the back reflects (and emits) like the front. The back of a one-sided surface is black: letting light
    /// through from one side only would not be reciprocal.
    pub double_sided: bool,
}

impl Default for Material {
    /// glTF's default material made Lambertian and white: what a primitive without a material does *not* have (that
    /// one has `metallic` 1), but a clean start for scenes made in code.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec3::ONE,
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            specular: 0.0,
            specular_color: Vec3::ONE,
            ior: 1.5,
            emission: Vec3::ZERO,
            double_sided: true,
        }
    }
}

/// What happens to texture coordinates outside `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The picture repeats.
    Repeat,
    /// The picture repeats, every second time mirrored.
    MirroredRepeat,
    /// The border texel goes on.
    ClampToEdge,
}

/// A picture with its sampler. Texel `(x, y)`, row 0 at the top (`v = 0`), is `texels[y·width + x]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The image's name or URI, for messages.
    pub name: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// sRGB-encoded RGBA, 8 bits each.
    pub texels: Vec<[u8; 4]>,
    /// Wrapping of `u` and `v`.
    pub wrap: [Wrap; 2],
    /// Bilinear filtering; nearest texel otherwise.
    pub linear: bool,
}
