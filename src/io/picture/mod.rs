//! Reads and writes images in the format that the file's extension selects, for `--pattern`, `--target` and `-o`.

use std::path::Path;

use super::raster::Raster;
use super::{atomic, exr, npy, raster};
use crate::error::{Error, Result};
use crate::image::codec::{Format, Metadata};
use crate::image::{Image, Resolution};
use crate::{file, machine};

mod curve;
mod icc;
pub(super) mod meaning;
mod netpbm;
mod radiance;
mod tiff;

use meaning::Stored;

enum PictureFormat {
    Npy,
    Exr,
    Png,
    /// A format that is read, but not written.
    Other,
}

/// Reads a pattern or a target as linear values, all finite. Which format of pictures it is, the content tells.
///
/// | format | values |
/// |---|---|
/// | `.npy`, `.exr`, `.hdr`, `.pic` (Radiance), `.pfm`, `.tif` of floating-point numbers | linear |
/// | `.png`, `.jpg` | in \[0,1\], by the curve that the file states; sRGB if it states none |
/// | `.tif` of integers, `.pgm`, `.ppm`, `.pnm` | in \[0,1\], by the file's colour profile; sRGB if it has none |
///
/// Orientations are honoured, and so are the windows of `.exr` files. A file that states other primaries than those of sRGB, or anything
/// else that changes the picture and cannot be honoured, is refused.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] if the extension is unknown, if the file is malformed or refused, if a pixel is transparent, or if a
/// value is NaN or infinite.
pub fn read(path: &Path) -> Result<Image> {
    let image = match kind(path) {
        Some(PictureFormat::Npy) => npy::read_image(path)?,
        Some(PictureFormat::Exr) => exr::read_exr(path, None)?,
        Some(PictureFormat::Png | PictureFormat::Other) => {
            stored(path)?.shown().map_err(|fault| unusable(path, fault))?
        }
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

/// The sizes of the images in a file, as stated in its header. The list is empty for files that are read at once: all but PNG, JPEG and
/// `.exr`.
pub fn stated_sizes(path: &Path) -> Result<Vec<Resolution>> {
    match kind(path) {
        Some(PictureFormat::Png | PictureFormat::Other) => Ok(size(path)?.into_iter().collect()),
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

/// Works like [`write()`]. `show` makes the picture of a `.png` file.
pub(crate) fn write_shown(path: &Path, image: &Image, show: impl FnOnce(&Image) -> Raster) -> Result<()> {
    match kind(path) {
        Some(PictureFormat::Npy) => npy::write_image(path, image),
        Some(PictureFormat::Exr) => exr::write_exr(path, &[("", image)]),
        Some(PictureFormat::Png) => show(image).write_png(path),
        Some(PictureFormat::Other) | None => Err(unknown(path)),
    }
}

/// Checks that [`write()`] can write to `path`: the extension is known, and the folder exists and is writable.
pub fn check_writable(path: &Path) -> Result<()> {
    match kind(path) {
        Some(PictureFormat::Npy | PictureFormat::Exr | PictureFormat::Png) => atomic::check_writable(path),
        Some(PictureFormat::Other) | None => Err(unknown(path)),
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

/// Whether the extension is that of a format that can be read.
pub fn is_known(path: &Path) -> bool {
    kind(path).is_some()
}

fn kind(path: &Path) -> Option<PictureFormat> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "npy" => Some(PictureFormat::Npy),
        "exr" => Some(PictureFormat::Exr),
        "png" => Some(PictureFormat::Png),
        "jpg" | "jpeg" | "tif" | "tiff" | "hdr" | "pic" | "pfm" | "pgm" | "ppm" | "pnm" => {
            Some(PictureFormat::Other)
        }
        _ => None,
    }
}

fn unknown(path: &Path) -> Error {
    Error::data(path, "its extension is not that of an image format that can be used here").help(
        "name it .npy, .exr or .png (.jpg, .tif, .hdr, .pfm, .pgm and .ppm can be read, but not written)",
    )
}

/// The maximum size of decoded pixels in bytes, which limits the memory for malicious headers. 8192² pixels in 16-bit RGB take less.
const MAX_BYTES: usize = 512 << 20;

/// The bytes of memory for each decoded byte. An 8-bit sample becomes a 16-bit sample, and then two 32-bit samples where the picture is turned.
const MEMORY_PER_BYTE: u64 = 8;

fn max_bytes() -> usize {
    let most = machine::memory() / 2 / MEMORY_PER_BYTE;
    MAX_BYTES.min(usize::try_from(most).unwrap_or(MAX_BYTES))
}

/// The format of a file that may be a pattern, if it is PNG or JPEG.
fn format(bytes: &[u8]) -> Option<Format> {
    Format::of(bytes).filter(|format| !matches!(format, Format::Other(_)))
}

/// The size of the picture in a PNG or JPEG file, which is shown upright. The size of other files is told when they are read.
fn size(path: &Path) -> Result<Option<Resolution>> {
    let bytes = file::read(path)?;
    let Some(format) = format(&bytes) else { return Ok(None) };
    let stated = format.size(&bytes).and_then(|(width, height)| {
        let orientation = meaning::orientation(&Metadata::of(format, &bytes, max_bytes())?);
        Ok(meaning::turned(Resolution::new(width as usize, height as usize), orientation))
    });
    stated.map(Some).map_err(|fault| unusable(path, fault))
}

/// Reads the numbers in a file as a camera or a script has stored them: no curve, no profile and no orientation is applied. Integers are
/// levels from 0. The second value is the highest level that the format can hold; `None` for floating-point numbers and `.npy` files.
///
/// # Errors
/// The errors of [`read`], but for what the file states about its curve. NaN and infinite values are refused.
pub fn read_levels(path: &Path) -> Result<(Image, Option<f32>)> {
    let (image, levels) = match kind(path) {
        Some(PictureFormat::Npy) => (npy::read_image(path)?, None),
        Some(PictureFormat::Exr) => (exr::read_exr(path, None)?, None),
        Some(PictureFormat::Png | PictureFormat::Other) => {
            let Stored { resolution, channels, samples, levels, .. } = stored(path)?;
            let full = levels.unwrap_or(1.0);
            // Levels of up to 16 bits are whole numbers again, since their quotients are rounded to 24 bits.
            let level = |sample: f32| if levels.is_some() { (sample * full).round() } else { sample };
            let colors = if channels >= 3 { 3 } else { 1 };
            let pixels = samples.chunks_exact(channels);
            let samples = pixels.flat_map(|pixel| pixel[..colors].iter().map(|sample| level(*sample)));
            (Image::new(resolution, colors, samples.collect())?, levels)
        }
        None => return Err(unknown(path)),
    };
    require_finite(path, &image)?;
    Ok((image, levels))
}

/// The picture in a file of any format but `.npy` and `.exr`.
fn stored(path: &Path) -> Result<Stored> {
    let bytes = file::read(path)?;
    let samples = max_bytes() / 2;
    let stored = if let Some(format) = format(&bytes) {
        decoded(format, &bytes)
    } else if radiance::is(&bytes) {
        radiance::read(&bytes, samples)
    } else if netpbm::is(&bytes) {
        netpbm::read(&bytes, samples)
    } else if tiff::is(&bytes) {
        // Catching a panic of the decoder is safe here, because the closure owns everything that it modifies.
        machine::unless_panics(|| tiff::read(&bytes, samples))
            .unwrap_or_else(|| Err("it is malformed".into()))
    } else {
        Err("its content is none of the formats of pictures that can be read".into())
    };
    stored.map_err(|fault| unusable(path, fault))
}

fn decoded(format: Format, bytes: &[u8]) -> std::result::Result<Stored, String> {
    let metadata = Metadata::of(format, bytes, max_bytes())?;
    let picture = format.decode(bytes, max_bytes())?;
    let (channels, resolution) =
        (picture.channels, Resolution::new(picture.width as usize, picture.height as usize));
    let (full, levels) = (f32::from(u16::MAX), if picture.is_eight_bits() { 255.0 } else { 65535.0 });
    let samples = picture.into_sixteen_bits().into_iter().map(|sample| f32::from(sample) / full).collect();
    Ok(Stored { resolution, channels, samples, levels: Some(levels), metadata })
}

fn unusable(path: &Path, fault: String) -> Error {
    Error::data(path, fault).help(
        "convert it to gray or sRGB in a PNG, JPEG, TIFF, PGM or PPM file, or give linear values as .npy, .exr, \
         .hdr or .pfm",
    )
}
