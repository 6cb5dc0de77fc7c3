//! PNG files: 8-bit pictures out, and 8- or 16-bit pictures in as linear patterns.

use std::io::Cursor;
use std::path::Path;

use ::image::{ColorType, DynamicImage, ImageDecoder, ImageEncoder, ImageReader};

use super::{atomic, tone};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};

/// A picture for people: sRGB, 8 bits a channel, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster {
    resolution: Resolution,
    bytes: Vec<u8>,
}

impl Raster {
    /// Collects `w·h` pixels, row by row from the top left; missing ones are black, more are left out.
    pub fn from_pixels(resolution: Resolution, pixels: impl IntoIterator<Item = [u8; 3]>) -> Self {
        let mut bytes: Vec<u8> = pixels.into_iter().take(resolution.pixels()).flatten().collect();
        bytes.resize(3 * resolution.pixels(), 0);
        Self { resolution, bytes }
    }

    /// Size in pixels.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// All bytes, red, green, blue, interleaved.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Red, green and blue at column `x`, row `y`. Black outside of the picture.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = 3 * (y * self.resolution.width + x);
        match self.bytes.get(at..at + 3) {
            Some(&[red, green, blue]) if x < self.resolution.width => [red, green, blue],
            _ => [0; 3],
        }
    }

    /// Each pixel as a block of `factor × factor`, for viewers that would blur a small picture.
    pub fn enlarged(&self, factor: usize) -> Self {
        let factor = factor.max(1);
        let resolution = Resolution::new(self.resolution.width * factor, self.resolution.height * factor);
        let pixels = (0..resolution.height)
            .flat_map(|y| (0..resolution.width).map(move |x| self.pixel(x / factor, y / factor)));
        Self::from_pixels(resolution, pixels)
    }

    /// The bytes of a PNG file.
    ///
    /// # Errors
    /// [`Error::Dimension`] when there are no pixels, or more in a row than PNG can hold.
    pub fn encode_png(&self) -> Result<Vec<u8>> {
        let Resolution { width, height } = self.resolution;
        let refused = |found: String| Error::Dimension {
            what: "size of a PNG picture",
            expected: "1 to 2^31 - 1 pixels a side".into(),
            found,
        };
        let (Ok(columns @ 1..), Ok(rows @ 1..)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(refused(self.resolution.to_string()));
        };
        let mut file = Vec::new();
        ::image::codecs::png::PngEncoder::new(&mut file)
            .write_image(&self.bytes, columns, rows, ColorType::Rgb8.into())
            .map_err(|error| refused(format!("{} ({error})", self.resolution)))?;
        Ok(file)
    }

    /// Writes a PNG file.
    ///
    /// # Errors
    /// As [`Raster::encode_png`], and [`Error::Write`].
    pub fn write_png(&self, path: &Path) -> Result<()> {
        atomic::write_bytes(path, &self.encode_png()?)
    }
}

/// Reads a PNG (8 or 16 bits) or JPEG file as a pattern: sRGB decoded to linear values in \[0,1\], one channel if
/// the file is gray, else three.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] when the file is malformed, of another format, very large, or anywhere
/// transparent.
pub fn read_png(path: &Path) -> Result<Image> {
    let bytes = std::fs::read(path).map_err(Error::reading(path))?;
    let unusable =
        |fault: String, help: &str| Error::Data { path: path.to_path_buf(), fault, help: help.into() };
    let picture = decode(bytes)
        .map_err(|error| unusable(error.to_string(), "give a PNG (8 or 16 bits) or JPEG file"))?;
    let resolution = Resolution::new(picture.width() as usize, picture.height() as usize);
    if picture.color().has_alpha() && picture.to_rgba16().pixels().any(|pixel| pixel.0[3] != u16::MAX) {
        return Err(unusable(
            "some pixels are transparent, which means nothing in a pattern".into(),
            "remove the alpha channel",
        ));
    }
    let linear = |sample: u16| tone::decode_srgb(f32::from(sample) / f32::from(u16::MAX));
    if picture.color().has_color() {
        Image::new(resolution, 3, picture.into_rgb16().into_raw().into_iter().map(linear).collect())
    } else {
        Image::new(resolution, 1, picture.into_luma16().into_raw().into_iter().map(linear).collect())
    }
}

fn decode(bytes: Vec<u8>) -> ::image::ImageResult<DynamicImage> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
    let mut decoder = reader.into_decoder()?;
    // Within this bound lies a 16-bit RGB picture of 8192² pixels; a forged header beyond it reserves no memory.
    let mut limits = ::image::Limits::default();
    limits.max_alloc = Some(512 << 20);
    decoder.set_limits(limits)?;
    DynamicImage::from_decoder(decoder)
}
