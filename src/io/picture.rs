//! Reading and writing of images in the format that the file's extension selects, as for `--pattern`,
//! `--target` and `-o`.

use std::path::Path;

use super::{atomic, exr, npy, png, tone};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};

/// The file formats of images.
enum Kind {
    Npy,
    Exr,
    Png,
    Jpeg,
}

/// Reads a pattern or a target. The values of `.npy` and `.exr` files are linear; those of `.png` and `.jpg`
/// files are decoded from sRGB to linear values in \[0,1\]. All values of the result are finite.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] when the extension is unknown, the file is malformed, or a value is NaN
/// or infinite.
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

/// As [`read`], where it is known which size the image must have. Files of another size are refused before their pixels are decoded, since
/// a few bytes can state any number of them. `whose` names in the message what has that size.
///
/// # Errors
/// As [`read`], and [`Error::Data`] when the image has another size.
pub fn read_sized(path: &Path, expected: Resolution, whose: &str) -> Result<Image> {
    let require = |found: Resolution| match found == expected {
        true => Ok(()),
        false => Err(Error::Data {
            path: path.to_path_buf(),
            fault: format!("it has {found} pixels, but {whose} has {expected}"),
            help: format!("resize it to {expected} pixels, or use --size {found}"),
        }),
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

/// The sizes that a file states of the images in it, before anything is decoded; none for `.npy` files, which are as long as their arrays.
///
/// # Errors
/// As [`read`].
pub fn stated_sizes(path: &Path) -> Result<Vec<Resolution>> {
    match kind(path) {
        Some(Kind::Png | Kind::Jpeg) => Ok(vec![png::size(path)?]),
        Some(Kind::Exr) => exr::sizes(path),
        Some(Kind::Npy) => Ok(Vec::new()),
        None => Err(unknown(path)),
    }
}

/// Writes a photo. A `.npy` or `.exr` file gets its linear values; a `.png` file is tone-mapped for viewing
/// ([`tone::exposure`], [`tone::develop`]).
///
/// # Errors
/// [`Error::Data`] when the file has another extension; [`Error::Write`].
pub fn write(path: &Path, image: &Image) -> Result<()> {
    match kind(path) {
        Some(Kind::Npy) => npy::write_image(path, image),
        Some(Kind::Exr) => exr::write_exr(path, &[("", image)]),
        Some(Kind::Png) => tone::develop(image, tone::exposure(image)).write_png(path),
        Some(Kind::Jpeg) | None => Err(unknown(path)),
    }
}

/// Checks that [`write()`] could write `path`: its extension is known, and its folder exists and is writable.
///
/// # Errors
/// As [`write()`].
pub fn check_writable(path: &Path) -> Result<()> {
    match kind(path) {
        Some(Kind::Npy | Kind::Exr | Kind::Png) => atomic::check_writable(path),
        Some(Kind::Jpeg) | None => Err(unknown(path)),
    }
}

/// Checks that an image has no NaN or infinite values. One such value in a pattern would make every later
/// photo NaN.
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
        help: "replace NaN and infinite values by finite ones".into(),
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
        fault: "its extension is not that of an image format that can be used here".into(),
        help: "name it .npy, .exr or .png (.jpg can be read, but not written)".into(),
    }
}
