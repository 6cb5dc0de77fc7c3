//! Textures: pictures on surfaces, with their samplers and coordinate transforms.

use glam::Affine2;

/// How texture coordinates outside `[0, 1]` are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Wrap {
    /// The picture repeats.
    Repeat,
    /// The picture repeats, and every second copy is mirrored.
    MirroredRepeat,
    /// The texel at the border extends outwards.
    ClampToEdge,
}

/// A picture with its sampler. Texel `(x, y)` is `texels[y·width + x]`; row 0 is the top (`v = 0`).
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Texture {
    /// The image's name or URI, for messages.
    pub name: String,
    /// Number of columns.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// RGBA texels, 8 bits per channel. The material's field decides whether RGB is sRGB-encoded (colours) or
    /// linear (everything else).
    pub texels: Vec<[u8; 4]>,
    /// Wrapping of `u` and `v`.
    pub wrap: [Wrap; 2],
    /// Whether the texture is interpolated bilinearly. If not, the nearest texel is read.
    pub linear: bool,
}

/// A material's reference to a texture.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct TextureRef {
    /// Index into [`crate::scene::Scene::textures`].
    pub texture: u32,
    /// Which set of [`crate::scene::Triangle::texcoords`] the texture is read with: 0 or 1.
    pub set: u32,
    /// The map from those coordinates to the picture's coordinates (`KHR_texture_transform`).
    pub transform: Affine2,
}

impl TextureRef {
    /// A reference that reads the texture with the first set of coordinates, without a transform.
    pub fn new(texture: u32) -> Self {
        Self { texture, set: 0, transform: Affine2::IDENTITY }
    }
}
