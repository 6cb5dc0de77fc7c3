//! `--pattern`: the projected pattern.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::io::picture;
use crate::lab::Lab;

/// A pattern by name, or an image file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Pattern {
    /// Every pixel is lit.
    White,
    /// No pixel is lit.
    Black,
    /// A checkerboard whose squares are this many pixels wide. The square at the top left is lit.
    Checker(usize),
    /// Vertical stripes that are this many pixels wide. The leftmost stripe is lit.
    Stripes(usize),
    /// The left half is lit.
    Left,
    /// A single lit pixel, by column and row.
    Pixel(usize, usize),
    /// An image.
    File(PathBuf),
}

impl FromStr for Pattern {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (name, argument) = text.split_once(':').unwrap_or((text, ""));
        let period = || match argument.parse() {
            Ok(period @ 1..) => Ok(period),
            _ => Err(format!("`{text}` needs its size in pixels, e.g. {name}:8")),
        };
        match name {
            "white" | "black" | "left" if !argument.is_empty() => Err(format!("`{name}` takes no argument")),
            "white" => Ok(Self::White),
            "black" => Ok(Self::Black),
            "left" => Ok(Self::Left),
            "checker" => Ok(Self::Checker(period()?)),
            "stripes" => Ok(Self::Stripes(period()?)),
            "pixel" => argument
                .split_once(',')
                .and_then(|(x, y)| Some(Self::Pixel(x.trim().parse().ok()?, y.trim().parse().ok()?)))
                .ok_or_else(|| format!("`{text}` needs a column and a row, e.g. pixel:64,32")),
            _ if Path::new(text).extension().is_some() => Ok(Self::File(text.into())),
            _ => Err(
                "expected white, black, left, checker:N, stripes:N, pixel:X,Y, or an image file (.npy, .exr, .png, .tif …)"
                    .into(),
            ),
        }
    }
}

impl TryFrom<String> for Pattern {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl From<Pattern> for String {
    fn from(pattern: Pattern) -> Self {
        pattern.to_string()
    }
}

/// Writes a pattern in the syntax of the command line.
impl std::fmt::Display for Pattern {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::White => f.write_str("white"),
            Self::Black => f.write_str("black"),
            Self::Left => f.write_str("left"),
            Self::Checker(period) => write!(f, "checker:{period}"),
            Self::Stripes(period) => write!(f, "stripes:{period}"),
            Self::Pixel(x, y) => write!(f, "pixel:{x},{y}"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

impl Pattern {
    /// The pattern for the projector of a laboratory. Fails as [`Self::image`], and if a matrix does not know the pictures in which the
    /// pattern has a place.
    pub fn image_for(&self, lab: &Lab) -> Result<Image> {
        if !matches!(self, Self::White | Self::Black | Self::File(_)) {
            lab.require_pictures(&format!("the pattern `{self}`"))?;
        }
        self.image(lab.projector_resolution())
    }

    /// The pattern at this resolution. Fails if a file cannot be read or has another size, or if the pixel is outside the picture.
    pub fn image(&self, resolution: Resolution) -> Result<Image> {
        let Resolution { width, height } = resolution;
        let lit: Box<dyn Fn(usize, usize) -> bool> = match *self {
            Self::White => Box::new(|_, _| true),
            Self::Black => Box::new(|_, _| false),
            Self::Checker(period) => Box::new(move |x, y| (x / period + y / period).is_multiple_of(2)),
            Self::Stripes(period) => Box::new(move |x, _| (x / period).is_multiple_of(2)),
            Self::Left => Box::new(move |x, _| x < width / 2),
            Self::Pixel(column, row) if column < width && row < height => {
                Box::new(move |x, y| (x, y) == (column, row))
            }
            Self::Pixel(column, row) => {
                let fault = format!("pixel {column},{row} lies outside of {resolution} pixels");
                let help = "columns and rows count from 0, at the top left";
                return Err(Error::option("--pattern", fault).help(help));
            }
            Self::File(ref path) => return read_sized(path, resolution),
        };
        let values = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Image::new(resolution, 1, values.map(|(x, y)| f32::from(u8::from(lit(x, y)))).collect())
    }
}

/// An image file that must have the projector's `resolution`. Fails if it cannot be read or has another size.
pub(crate) fn read_sized(path: &Path, resolution: Resolution) -> Result<Image> {
    picture::read_sized(path, resolution, "the projector")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_named_or_files() {
        assert_eq!("checker:8".parse(), Ok(Pattern::Checker(8)));
        assert_eq!("pixel:3,5".parse(), Ok(Pattern::Pixel(3, 5)));
        assert_eq!("a/b.npy".parse(), Ok(Pattern::File("a/b.npy".into())));
        for wrong in ["checker", "checker:0", "pixel:3", "white:2", "wihte"] {
            assert!(wrong.parse::<Pattern>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_checkers_top_left_square_is_lit() {
        let image = Pattern::Checker(2).image(Resolution::new(4, 4)).map(|image| image.samples().to_vec());
        let rows = [[1., 1., 0., 0.], [1., 1., 0., 0.], [0., 0., 1., 1.], [0., 0., 1., 1.]];
        assert_eq!(image.ok(), Some(rows.concat()));
    }
}
