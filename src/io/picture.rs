//! Images by their file's extension, for `--pattern`, `--target` and `-o`.

use std::path::Path;

use super::{atomic, exr, npy, png, tone};
use crate::error::{Error, Result};
use crate::image::Image;

/// The kinds of file that hold an image.
enum Kind {
    Npy,
    Exr,
    Png,
    Jpeg,
}

/// Reads a pattern or a target: `.npy` and `.exr` as the linear values that they are, `.png` and `.jpg` decoded
/// from sRGB to linear values in \[0,1\]. Every value is finite.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] when the extension is unknown, the file malformed, or a value NaN or infinite.
pub fn read(path: &Path) -> Result<Image> {
    let image = match kind(path) {
        Some(Kind::Npy) => npy::read_image(path)?,
        Some(Kind::Exr) => exr::read_exr(path, None)?,
        Some(Kind::Png | Kind::Jpeg) => png::read_png(path)?,
        None => return Err(unknown(path)),
    };
    require_finite(path, &image)?;
    Ok(image)
}

/// Writes a photo: `.npy` and `.exr` with the values that it has, `.png` tone-mapped for people
/// ([`tone::exposure`], [`tone::develop`]).
///
/// # Errors
/// [`Error::Data`] when the extension is none of these; [`Error::Write`].
pub fn write(path: &Path, image: &Image) -> Result<()> {
    match kind(path) {
        Some(Kind::Npy) => npy::write_image(path, image),
        Some(Kind::Exr) => exr::write_exr(path, &[("", image)]),
        Some(Kind::Png) => tone::develop(image, tone::exposure(image)).write_png(path),
        Some(Kind::Jpeg) | None => Err(unknown(path)),
    }
}

/// Whether [`write()`] could write `path`: it has a known extension, and its folder is there and writable.
///
/// # Errors
/// As [`write()`].
pub fn check_writable(path: &Path) -> Result<()> {
    match kind(path) {
        Some(Kind::Npy | Kind::Exr | Kind::Png) => atomic::check_writable(path),
        Some(Kind::Jpeg) | None => Err(unknown(path)),
    }
}

/// Refuses NaN and infinities: one such value in a pattern makes every photo that follows NaN.
///
/// # Errors
/// [`Error::Data`] naming the file and the first pixel at fault.
pub fn require_finite(path: &Path, image: &Image) -> Result<()> {
    let Some(at) = image.samples().iter().position(|sample| !sample.is_finite()) else {
        return Ok(());
    };
    let pixel = at / image.channels();
    let width = image.resolution().width;
    Err(Error::Data {
        path: path.to_path_buf(),
        fault: format!("pixel ({}, {}) is {}", pixel % width, pixel / width, image.samples()[at]),
        help: "replace NaN and infinite values by numbers".into(),
    })
}

fn kind(path: &Path) -> Option<Kind> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "npy" => Some(Kind::Npy),
        "exr" => Some(Kind::Exr),
        "png" => Some(Kind::Png),
        "jpg" | "jpeg" => Some(Kind::Jpeg),
        _ => None,
    }
}

fn unknown(path: &Path) -> Error {
    Error::Data {
        path: path.to_path_buf(),
        fault: "its extension tells no image format that can be used here".into(),
        help: "name it .npy, .exr or .png (.jpg can be read, but not written)".into(),
    }
}
