//! PNG files. Pictures are written with 8 bits ([`Raster`]); patterns are read from pictures of 8 or 16 bits.

use std::io::Cursor;
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageReader};

pub use super::raster::Raster;
use super::srgb;
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};

/// Reads a PNG (8 or 16 bits) or JPEG file as a pattern: sRGB is decoded to linear values in \[0,1\]. The
/// pattern has one channel if the file is gray, and three otherwise.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] when the file is malformed, has another format, is very large, or has a
/// transparent pixel.
pub fn read_png(path: &Path) -> Result<Image> {
    let bytes = std::fs::read(path).map_err(Error::reading(path))?;
    let unusable =
        |fault: String, help: &str| Error::Data { path: path.to_path_buf(), fault, help: help.into() };
    let picture = decode(bytes)
        .map_err(|error| unusable(error.to_string(), "give a PNG (8 or 16 bits) or JPEG file"))?;
    let resolution = Resolution::new(picture.width() as usize, picture.height() as usize);
    if picture.color().has_alpha() && picture.to_rgba16().pixels().any(|pixel| pixel.0[3] != u16::MAX) {
        return Err(unusable(
            "some pixels are transparent, which has no meaning in a pattern".into(),
            "remove the alpha channel",
        ));
    }
    let linear = |sample: u16| srgb::decode_srgb(f32::from(sample) / f32::from(u16::MAX));
    if picture.color().has_color() {
        Image::new(resolution, 3, picture.into_rgb16().into_raw().into_iter().map(linear).collect())
    } else {
        Image::new(resolution, 1, picture.into_luma16().into_raw().into_iter().map(linear).collect())
    }
}

fn decode(bytes: Vec<u8>) -> ::image::ImageResult<DynamicImage> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let mut decoder = reader.into_decoder()?;
    // The limit allows a 16-bit RGB picture of 8192² pixels. It keeps a hostile header from allocating more
    // memory.
    let mut limits = ::image::Limits::default();
    limits.max_alloc = Some(512 << 20);
    decoder.set_limits(limits)?;
    DynamicImage::from_decoder(decoder)
}
