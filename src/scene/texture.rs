//! Pictures on surfaces, and how surfaces read them.

use glam::Affine2;

/// What happens to texture coordinates outside `[0, 1]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
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
    /// RGBA, 8 bits each. Who reads it knows whether RGB is sRGB-encoded (colours) or linear (all else).
    pub texels: Vec<[u8; 4]>,
    /// Wrapping of `u` and `v`.
    pub wrap: [Wrap; 2],
    /// Bilinear filtering; nearest texel otherwise.
    pub linear: bool,
}

/// A material's use of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`crate::scene::Scene::textures`].
    pub texture: u32,
    /// Which of [`crate::scene::Triangle::texcoords`] it reads: 0 or 1.
    pub set: u32,
    /// From those coordinates to the picture's (`KHR_texture_transform`).
    pub transform: Affine2,
}

impl TextureRef {
    /// Reads the texture by the first set of coordinates as they are.
    pub fn new(texture: u32) -> Self {
        Self { texture, set: 0, transform: Affine2::IDENTITY }
    }
}
