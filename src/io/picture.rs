//! Reads and writes images in the format that the file's extension selects, for `--pattern`, `--target` and `-o`.

use std::path::Path;

use super::raster::{Raster, decode_srgb};
use super::{atomic, exr, npy, raster};
use crate::error::{Error, Result};
use crate::image::codec::Format;
use crate::image::{Image, Resolution};
use crate::{file, machine};

enum PictureFormat {
    Npy,
    Exr,
    Png,
    Jpeg,
}

/// Reads a pattern or a target. The values of `.npy` and `.exr` files are linear. The values of `.png` and `.jpg` files are decoded from
/// sRGB to linear values in \[0,1\]. All values of the resulting image are finite.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] if the extension is unknown, if the file is malformed, or if a value is NaN or infinite.
pub fn read(path: &Path) -> Result<Image> {
    let image = match kind(path) {
        Some(PictureFormat::Npy) => npy::read_image(path)?,
        Some(PictureFormat::Exr) => exr::read_exr(path, None)?,
        Some(PictureFormat::Png | PictureFormat::Jpeg) => read_png(path)?,
        None => return Err(unknown(path)),
    };
    require_finite(path, &image)?;
    Ok(image)
}

/// Reads an image of the size `expected`. If a file states another size, it is refused before its pixels are decoded. In the message,
/// `whose` names the thing that has the expected size.
///
/// # Errors
/// The errors of [`read`]; also [`Error::Data`] if the image has another size.
pub fn read_sized(path: &Path, expected: Resolution, whose: &str) -> Result<Image> {
    let require = |found: Resolution| match found == expected {
        true => Ok(()),
        false => Err(Error::data(path, format!("it has {found} pixels, but {whose} has {expected}"))
            .help(format!("resize it to {expected} pixels, or use --size {found}"))),
    };
    let stated = stated_sizes(path)?;
    if let Some(&first) = stated.first()
        && !stated.contains(&expected)
    {
        require(first)?;
    }
    let image = read(path)?;
    require(image.resolution()).map(|()| image)
}

/// The sizes of the images in a file, as stated in its header. For `.npy` files, which are as long as their arrays, the list is empty.
pub fn stated_sizes(path: &Path) -> Result<Vec<Resolution>> {
    match kind(path) {
        Some(PictureFormat::Png | PictureFormat::Jpeg) => Ok(vec![size(path)?]),
        Some(PictureFormat::Exr) => exr::sizes(path),
        Some(PictureFormat::Npy) => Ok(Vec::new()),
        None => Err(unknown(path)),
    }
}

/// Writes a photo. For a `.npy` or `.exr` file, the linear values are written. For a `.png` file, the photo is tone-mapped for viewing
/// ([`raster::exposure`], [`raster::develop`]).
///
/// # Errors
/// [`Error::Data`] if the file has any other extension; [`Error::Write`].
pub fn write(path: &Path, image: &Image) -> Result<()> {
    write_shown(path, image, |image| raster::develop(image, raster::exposure(image)))
}

/// As [`write()`]. `show` makes the picture of a `.png` file.
pub(crate) fn write_shown(path: &Path, image: &Image, show: impl FnOnce(&Image) -> Raster) -> Result<()> {
    match kind(path) {
        Some(PictureFormat::Npy) => npy::write_image(path, image),
        Some(PictureFormat::Exr) => exr::write_exr(path, &[("", image)]),
        Some(PictureFormat::Png) => show(image).write_png(path),
        Some(PictureFormat::Jpeg) | None => Err(unknown(path)),
    }
}

/// Checks that [`write()`] can write to `path`: the extension is known, and the folder exists and is writable.
pub fn check_writable(path: &Path) -> Result<()> {
    match kind(path) {
        Some(PictureFormat::Npy | PictureFormat::Exr | PictureFormat::Png) => atomic::check_writable(path),
        Some(PictureFormat::Jpeg) | None => Err(unknown(path)),
    }
}

/// Checks that an image has no NaN or infinite values. One such value in a pattern would make every later photo NaN.
///
/// # Errors
/// [`Error::Data`], which names the file and the first invalid pixel.
pub fn require_finite(path: &Path, image: &Image) -> Result<()> {
    let Some(at) = image.samples().iter().position(|sample| !sample.is_finite()) else {
        return Ok(());
    };
    let pixel = at / image.channels();
    let width = image.resolution().width;
    Err(Error::data(path, format!("pixel ({}, {}) is {}", pixel % width, pixel / width, image.samples()[at]))
        .help("replace NaN and infinite values by finite ones"))
}

fn kind(path: &Path) -> Option<PictureFormat> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "npy" => Some(PictureFormat::Npy),
        "exr" => Some(PictureFormat::Exr),
        "png" => Some(PictureFormat::Png),
        "jpg" | "jpeg" => Some(PictureFormat::Jpeg),
        _ => None,
    }
}

fn unknown(path: &Path) -> Error {
    Error::data(path, "its extension is not that of an image format that can be used here")
        .help("name it .npy, .exr or .png (.jpg can be read, but not written)")
}

/// The maximum size of decoded pixels in bytes, which limits the memory for malicious headers. 8192² pixels in 16-bit RGB take less.
const MAX_BYTES: usize = 512 << 20;

/// The bytes of memory for each decoded byte. An 8-bit sample becomes a 16-bit sample, and then a 32-bit sample.
const MEMORY_PER_BYTE: u64 = 8;

pub(super) fn size(path: &Path) -> Result<Resolution> {
    let bytes = file::read(path)?;
    let (width, height) = format(path, &bytes)?.size(&bytes).map_err(|fault| no_picture(path, fault))?;
    Ok(Resolution::new(width as usize, height as usize))
}

fn max_bytes() -> usize {
    let most = machine::memory() / 2 / MEMORY_PER_BYTE;
    MAX_BYTES.min(usize::try_from(most).unwrap_or(MAX_BYTES))
}

fn format(path: &Path, bytes: &[u8]) -> Result<Format> {
    let found = Format::of(bytes).filter(|format| !matches!(format, Format::Other(_)));
    found.ok_or_else(|| no_picture(path, "the file is neither PNG nor JPEG".into()))
}

fn no_picture(path: &Path, fault: String) -> Error {
    unusable_picture(path, fault, "give a PNG (8 or 16 bits) or JPEG file")
}

fn unusable_picture(path: &Path, fault: String, help: &str) -> Error {
    Error::data(path, fault).help(help)
}

/// Reads a PNG (8 or 16 bits) or JPEG file as a pattern. sRGB is decoded to linear values in \[0,1\]. The pattern has one channel if the
/// file is gray, and three channels otherwise.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] if the file is malformed, has another format, is too large, or has a transparent pixel.
pub fn read_png(path: &Path) -> Result<Image> {
    let bytes = file::read(path)?;
    let picture =
        format(path, &bytes)?.decode(&bytes, max_bytes()).map_err(|fault| no_picture(path, fault))?;
    let resolution = Resolution::new(picture.width as usize, picture.height as usize);
    let (color, alpha, channels) = (picture.has_color(), picture.has_alpha(), picture.channels);
    let samples = picture.into_sixteen_bits();
    if alpha && samples.chunks_exact(channels).any(|pixel| pixel[channels - 1] != u16::MAX) {
        return Err(unusable_picture(
            path,
            "some pixels are transparent, which has no meaning in a pattern".into(),
            "remove the alpha channel",
        ));
    }
    let colors = if color { 3 } else { 1 };
    let linear = |&sample: &u16| decode_srgb(f32::from(sample) / f32::from(u16::MAX));
    let samples = samples.chunks_exact(channels).flat_map(|pixel| pixel[..colors].iter().map(linear));
    Image::new(resolution, colors, samples.collect())
}
