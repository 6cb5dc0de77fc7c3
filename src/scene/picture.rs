//! Decoding of pictures, with bounds on their size.

use std::path::Path;

use crate::image::codec::Format;

/// The largest width and height of a picture in pixels.
const MAX_SIDE: u32 = 16384;

/// The largest number of texels of all pictures together. A limit is needed because a few kilobytes of PNG
/// can encode any number of pixels.
const MAX_TEXELS: u64 = 1 << 27;

/// The largest size of one decoded picture in bytes. PNG's widest pixel, 16-bit RGBA, has 8 bytes.
const MAX_BYTES: usize = 8 << 27;

/// A decoded picture.
pub(super) struct Picture {
    pub width: u32,
    pub height: u32,
    /// RGBA, row 0 at the top.
    pub texels: Vec<[u8; 4]>,
}

/// Why a picture cannot be used.
pub(super) struct Fault {
    /// The predicate of a sentence whose subject is the picture's name.
    pub fault: String,
    /// What to do about it.
    pub help: String,
    /// Whether the picture has a format that is not read. Others are damaged or too large.
    pub is_unknown: bool,
}

/// Advice for pictures of other formats, which ImageMagick reads.
const CONVERT: &str =
    "convert it (magick PICTURE picture.png) and name that, or export the scene with PNG or JPEG pictures";

/// Formats of pictures that scenes are found with, but that are not read: how a file begins, from which byte on, and what to do.
const UNREAD: [(usize, &[u8], &str, &str); 5] = [
    (
        0,
        b"\xABKTX 20\xBB",
        "KTX2",
        "convert the pictures: npx @gltf-transform/cli ktxdecompress SCENE.glb PLAIN.glb, with `ktx` of KTX-Software installed",
    ),
    (0, b"DDS ", "DDS", CONVERT),
    (4, b"ftypavif", "AVIF", CONVERT),
    (0, b"#?RADIANCE", "Radiance HDR", CONVERT),
    (0, b"\x76\x2F\x31\x01", "EXR", CONVERT),
];

/// Why the picture of a file is not read, judged by its beginning and its name; `None` where its format is read.
pub(super) fn unread(beginning: &[u8], name: &Path) -> Option<Fault> {
    let format = Format::of(beginning).or_else(|| Format::of_name(name));
    format.is_none().then(|| other_format(beginning))
}

/// What a picture is whose format is not read.
fn other_format(bytes: &[u8]) -> Fault {
    let of = |(at, beginning, ..): &&(usize, &[u8], &str, &str)| {
        bytes.get(*at..).is_some_and(|rest| rest.starts_with(beginning))
    };
    let (fault, help) = match UNREAD.iter().find(of) {
        Some((_, _, name, help)) => (format!("has the format {name}, which is not read"), *help),
        None => ("is neither PNG, JPEG, WebP, BMP, GIF nor TGA".into(), CONVERT),
    };
    Fault { fault, help: help.into(), is_unknown: true }
}

/// The decoder of one scene's pictures, which counts their texels together.
#[derive(Default)]
pub(super) struct Pictures {
    texels: u64,
}

impl Pictures {
    /// Decodes the bytes of a PNG, JPEG, WebP, BMP, GIF or TGA file; of an animation, its first picture. TGA is recognized by its
    /// file's `name` only.
    pub(super) fn decode(&mut self, bytes: &[u8], name: Option<&Path>) -> Result<Picture, Fault> {
        let Some(format) = Format::of(bytes).or_else(|| Format::of_name(name?)) else {
            return Err(other_format(bytes));
        };
        let broken = |error: String| Fault {
            fault: format!("cannot be decoded: {error}"),
            help: "convert it (magick PICTURE picture.png), or save it again as PNG or JPEG".into(),
            is_unknown: false,
        };
        let (width, height) = format.size(bytes).map_err(broken)?;
        self.texels = self.texels.saturating_add(u64::from(width) * u64::from(height));
        if width > MAX_SIDE || height > MAX_SIDE || width == 0 || height == 0 || self.texels > MAX_TEXELS {
            return Err(Fault {
                fault: format!("is {width}x{height} pixels"),
                help: format!(
                    "make it smaller: at most {MAX_SIDE} pixels a side, and {MAX_TEXELS} in all pictures together"
                ),
                is_unknown: false,
            });
        }
        let decoded = format.decode(bytes, MAX_BYTES).map_err(broken)?;
        Ok(Picture { width: decoded.width, height: decoded.height, texels: decoded.into_rgba8() })
    }
}
