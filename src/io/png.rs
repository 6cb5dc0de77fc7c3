//! PNG files. Pictures are written with 8 bits ([`Raster`]); patterns are read from pictures of 8 or 16 bits.

use std::path::Path;

pub use super::raster::Raster;
use super::srgb;
use crate::error::{Error, Result};
use crate::file;
use crate::image::codec::Format;
use crate::image::{Image, Resolution};
use crate::machine;

/// The largest size of decoded pixels in bytes. It allows a 16-bit RGB picture of 8192² pixels, and keeps a
/// hostile header from allocating more memory.
const MAX_BYTES: usize = 512 << 20;

/// Bytes of memory for each decoded byte: an 8-bit sample becomes one of 16 bits, and then one of 32 bits.
const MEMORY_PER_BYTE: u64 = 8;

/// The size that a PNG or JPEG file states.
///
/// # Errors
/// As [`read_png`].
pub(super) fn size(path: &Path) -> Result<Resolution> {
    let bytes = file::read(path)?;
    let (width, height) = format(path, &bytes)?.size(&bytes).map_err(|fault| no_picture(path, fault))?;
    Ok(Resolution::new(width as usize, height as usize))
}

/// The largest size of decoded pixels in bytes on this machine.
fn max_bytes() -> usize {
    let most = machine::memory() / 2 / MEMORY_PER_BYTE;
    MAX_BYTES.min(usize::try_from(most).unwrap_or(MAX_BYTES))
}

fn format(path: &Path, bytes: &[u8]) -> Result<Format> {
    let found = Format::of(bytes).filter(|format| !matches!(format, Format::Other(_)));
    found.ok_or_else(|| no_picture(path, "the file is neither PNG nor JPEG".into()))
}

fn no_picture(path: &Path, fault: String) -> Error {
    unusable(path, fault, "give a PNG (8 or 16 bits) or JPEG file")
}

fn unusable(path: &Path, fault: String, help: &str) -> Error {
    Error::Data { path: path.to_path_buf(), fault, help: help.into() }
}

/// Reads a PNG (8 or 16 bits) or JPEG file as a pattern: sRGB is decoded to linear values in \[0,1\]. The
/// pattern has one channel if the file is gray, and three otherwise.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] when the file is malformed, has another format, is very large, or has a
/// transparent pixel.
pub fn read_png(path: &Path) -> Result<Image> {
    let bytes = file::read(path)?;
    let picture =
        format(path, &bytes)?.decode(&bytes, max_bytes()).map_err(|fault| no_picture(path, fault))?;
    let resolution = Resolution::new(picture.width as usize, picture.height as usize);
    let (color, alpha, channels) = (picture.has_color(), picture.has_alpha(), picture.channels);
    let samples = picture.into_sixteen_bits();
    if alpha && samples.chunks_exact(channels).any(|pixel| pixel[channels - 1] != u16::MAX) {
        return Err(unusable(
            path,
            "some pixels are transparent, which has no meaning in a pattern".into(),
            "remove the alpha channel",
        ));
    }
    let colors = if color { 3 } else { 1 };
    let linear = |&sample: &u16| srgb::decode_srgb(f32::from(sample) / f32::from(u16::MAX));
    let samples = samples.chunks_exact(channels).flat_map(|pixel| pixel[..colors].iter().map(linear));
    Image::new(resolution, colors, samples.collect())
}
