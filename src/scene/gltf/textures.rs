//! Textures: decoded pictures with their samplers, and references to them by materials.

use std::collections::HashMap;
use std::path::Path;

use glam::{Affine2, Mat2, Vec2};
use gltf_json as json;
use gltf_json::extensions::texture::TextureTransform;
use gltf_json::texture::{MagFilter, WrappingMode};
use gltf_json::validation::Checked;

use super::extensions::advice;
use super::{Document, buffers, object_name};
use crate::error::Result;
use crate::scene::source::{Fault, Texels};
use crate::scene::{Texture, TextureRef, Wrap};

pub(super) const WEBP: &str = "EXT_texture_webp";

pub(super) const TRANSFORM: &str = "KHR_texture_transform";

/// The textures that materials use, in order of their first use.
#[derive(Default)]
pub(super) struct Textures {
    /// The textures. [`TextureRef::texture`] is an index into this list.
    pub list: Vec<Texture>,
    /// The index into the list for each combination of the file's image index, the wrapping, and whether the texture is interpolated.
    index_of: HashMap<(usize, [Wrap; 2], bool), u32>,
}

pub(super) struct TextureUse {
    index: usize,
    set: u32,
    transform: TextureTransform,
    /// The transform to the last bit, if krylux wrote the file.
    exact: Option<[f32; 6]>,
}

fn exact(extras: &json::Extras) -> Option<[f32; 6]> {
    let extras: json::Value = serde_json::from_str(extras.as_ref()?.get()).ok()?;
    serde_json::from_value(extras.get("krylux_exact")?.clone()).ok()
}

impl TextureUse {
    /// A reference to a texture other than the normal texture.
    pub(super) fn of(info: &json::texture::Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        let (index, set, exact) = (info.index.value(), info.tex_coord, exact(&info.extras));
        Self { index, set, transform: transform.unwrap_or_default(), exact }
    }

    /// A reference to a normal texture. `None` if its `KHR_texture_transform` is malformed.
    pub(super) fn of_normal(info: &json::material::NormalTexture) -> Option<Self> {
        let extension = info.extensions.as_ref().and_then(|extensions| extensions.others.get(TRANSFORM));
        let transform = match extension {
            Some(value) => serde_json::from_value(value.clone()).ok()?,
            None => TextureTransform::default(),
        };
        let (index, set, exact) = (info.index.value(), info.tex_coord, exact(&info.extras));
        Some(Self { index, set, transform, exact })
    }
}

impl Textures {
    /// Converts the file's reference `info` to a reference of the scene. `material` and `role` (such as `base colour`) name its position in
    /// messages. If the texture needs unsupported coordinates, a warning is added, and the result is `None`.
    pub(super) fn refer(
        &mut self,
        document: &mut Document,
        material: &str,
        role: &str,
        info: &TextureUse,
    ) -> Result<Option<TextureRef>> {
        let set = info.transform.tex_coord.unwrap_or(info.set);
        if set > 1 {
            let fault = format!(
                "{material}: its {role} texture reads TEXCOORD_{set}, and only 0 and 1 are supported"
            );
            let help = "export the scene with at most two sets of texture coordinates";
            document.file.tolerate(fault, "the texture is left out", help)?;
            return Ok(None);
        }
        let [scale, offset] = [info.transform.scale.0, info.transform.offset.0].map(Vec2::from_array);
        let transform = transform(scale, info.transform.rotation.0, offset);
        if !transform.is_finite() {
            return Err(document
                .fault(format!("{material}: the KHR_texture_transform of its {role} texture is not finite"))
                .help("correct the texture's offset, rotation or scale"));
        }
        // Another program may have changed the transform, and left the extras.
        let exact = info.exact.map(|columns| Affine2::from_cols_array(&columns));
        let transform = exact.filter(|exact| exact.abs_diff_eq(transform, 1e-5)).unwrap_or(transform);
        let texture = self.index_of(document, material, role, info.index)?;
        Ok(Some(TextureRef { texture, set, transform }))
    }

    /// The index in the scene of the file's texture `index`. `user` names the material that uses the texture as its `role`.
    fn index_of(&mut self, document: &mut Document, user: &str, role: &str, index: usize) -> Result<u32> {
        let texture = document.referred(&document.root.textures, user, "texture", index)?.clone();
        let what = object_name("texture", index, texture.name.as_ref());
        let (wrap, linear) = sampler(document, &what, &texture)?;
        let source = image_of(document, &texture);
        if let Some(&position) = self.index_of.get(&(source, wrap, linear)) {
            return Ok(position);
        }
        let found = match document.root.images.get(source).cloned() {
            Some(image) => self.picture(document, source, &image)?,
            None => Err(no_image(document, &what, &texture, source)?),
        };
        let position = self.list.len() as u32;
        match found {
            Ok((name, Texels { width, height, texels })) => {
                self.list.push(Texture { name, width, height, texels, wrap, linear });
                self.index_of.insert((source, wrap, linear), position);
            }
            Err((fault, help)) => {
                document.file.tolerate(fault, &format!("the {role} texture of {user} is left out"), help)?;
                let texels = vec![neutral(role)];
                self.list.push(Texture { name: what, width: 1, height: 1, texels, wrap, linear });
            }
        }
        Ok(position)
    }

    /// Adds a copy of texture `of` with changed texels. The change is applied before any interpolation. Returns the index of the copy.
    pub(super) fn derive(&mut self, of: u32, change: impl Fn([u8; 4]) -> [u8; 4]) -> Option<u32> {
        let mut texture = self.list.get(of as usize)?.clone();
        texture.texels.iter_mut().for_each(|texel| *texel = change(*texel));
        self.list.push(texture);
        Some(self.list.len() as u32 - 1)
    }

    /// Decodes image `index` of the file. Returns its name and texels. If it is missing or unsupported, returns the reason and the remedy.
    fn picture(
        &mut self,
        document: &mut Document,
        index: usize,
        image: &json::Image,
    ) -> Result<std::result::Result<(String, Texels), Absence>> {
        let file_name = image.uri.as_ref().filter(|uri| !uri.starts_with("data:"));
        let what = object_name("image", index, image.name.as_ref().or(file_name));
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => match buffers::absence(document, uri) {
                Some(why) => {
                    let help = "put the picture where the scene names it".into();
                    return Ok(Err((format!("the picture {uri} {why}"), help)));
                }
                None => buffers::read_uri(document, &what, uri)?,
            },
            (None, Some(view)) => buffers::view(document, &what, view)?.0.to_vec(),
            (None, None) => {
                return Err(document
                    .fault(format!("{what} has no data"))
                    .help("the file is incomplete: export it again"));
            }
        };
        match document.file.decode(&bytes, file_name.map(Path::new)) {
            Ok(picture) => Ok(Ok((what, picture))),
            Err(Fault { fault, help, is_unknown: true }) => Ok(Err((format!("{what} {fault}"), help))),
            Err(Fault { fault, help, .. }) => Err(document.fault(format!("{what} {fault}")).help(help)),
        }
    }
}

type Absence = (String, String);

/// The reason why a texture has no image. A reference to a missing image is an error.
fn no_image(document: &Document, what: &str, texture: &json::Texture, source: usize) -> Result<Absence> {
    let alternative =
        texture.extensions.as_ref().and_then(|extensions| extensions.others.keys().next().cloned());
    match alternative {
        Some(name) => Ok((
            format!("{what} has its picture only as {name}, which is not supported"),
            advice(&name).into(),
        )),
        // The specification allows a texture without an image.
        None if source == u32::MAX as usize => {
            Ok((format!("{what} has no picture"), "export the scene with its pictures".into()))
        }
        None => Err(document.damaged(format!("{what} refers to image {source}, which does not exist"))),
    }
}

/// The index of a texture's image: its core image, which every reader supports, or else its WebP image.
fn image_of(document: &Document, texture: &json::Texture) -> usize {
    let own = texture.source.value();
    let webp = texture.extensions.as_ref().and_then(|extensions| extensions.others.get(WEBP));
    let webp = webp.and_then(|webp| webp.get("source")).and_then(json::Value::as_u64);
    let is_there = document.root.images.get(own).is_some();
    webp.filter(|_| !is_there).and_then(|index| usize::try_from(index).ok()).unwrap_or(own)
}

/// A texel that does not change the material. For an emissive texture, the texel is black.
fn neutral(role: &str) -> [u8; 4] {
    match role {
        "normal" => [128, 128, 255, 255],
        "emissive" => [0, 0, 0, 255],
        _ => [255; 4],
    }
}

/// The wrapping of `u` and `v` of a texture, and whether it is interpolated. Without a sampler, glTF's defaults are used.
fn sampler(document: &Document, what: &str, texture: &json::Texture) -> Result<([Wrap; 2], bool)> {
    let Some(index) = texture.sampler.map(|sampler| sampler.value()) else {
        return Ok(([Wrap::Repeat; 2], true));
    };
    let sampler = document.referred(&document.root.samplers, what, "sampler", index)?;
    let wrap = |mode: Checked<WrappingMode>| match mode {
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::MirroredRepeat),
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::ClampToEdge),
        Checked::Invalid => Err(document.damaged(format!("sampler {index} has an unknown wrapping mode"))),
    };
    let linear = match sampler.mag_filter {
        None | Some(Checked::Valid(MagFilter::Linear)) => true,
        Some(Checked::Valid(MagFilter::Nearest)) => false,
        Some(Checked::Invalid) => {
            return Err(document.damaged(format!("sampler {index} has an unknown magFilter")));
        }
    };
    Ok(([wrap(sampler.wrap_s)?, wrap(sampler.wrap_t)?], linear))
}

/// The map of texture coordinates by `KHR_texture_transform`: scale, then rotation, then offset. The rotation is counter-clockwise in the
/// picture, where `v` points downwards.
pub(super) fn transform(scale: Vec2, rotation: f32, offset: Vec2) -> Affine2 {
    let (sine, cosine) = rotation.sin_cos();
    Affine2::from_mat2_translation(
        Mat2::from_cols(Vec2::new(cosine, -sine) * scale.x, Vec2::new(sine, cosine) * scale.y),
        offset,
    )
}
