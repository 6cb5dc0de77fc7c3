//! Rasters: 8-bit sRGB pictures for viewing, and their PNG files.

use std::path::Path;

use png::{BitDepth, ColorType, Compression, Encoder, Filter};

use super::atomic;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// The colour of pixels that are NaN: a magenta that no colour map contains.
pub const NOT_A_NUMBER: [u8; 3] = [0xff, 0x00, 0xff];

/// A picture for viewing: sRGB, 8 bits a channel, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster {
    resolution: Resolution,
    bytes: Vec<u8>,
}

impl Raster {
    /// Collects `w·h` pixels, row by row from the top left. Missing pixels are black; additional ones are
    /// ignored.
    pub fn from_pixels(resolution: Resolution, pixels: impl IntoIterator<Item = [u8; 3]>) -> Self {
        let mut bytes: Vec<u8> = pixels.into_iter().take(resolution.pixels()).flatten().collect();
        bytes.resize(3 * resolution.pixels(), 0);
        Self { resolution, bytes }
    }

    /// A black picture.
    pub fn black(resolution: Resolution) -> Self {
        Self { resolution, bytes: vec![0; 3 * resolution.pixels()] }
    }

    /// The size in pixels.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// All bytes; red, green and blue are interleaved.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Red, green and blue at column `x`, row `y`; black outside the picture.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = 3 * (y * self.resolution.width + x);
        match self.bytes.get(at..at + 3) {
            Some(&[red, green, blue]) if x < self.resolution.width => [red, green, blue],
            _ => [0; 3],
        }
    }

    /// Copies `other` into this picture, with its top left corner at column `x`, row `y`. Parts beyond the
    /// edges are clipped.
    pub fn paste(&mut self, other: &Self, x: usize, y: usize) {
        let columns = other.resolution.width.min(self.resolution.width.saturating_sub(x));
        if columns == 0 {
            return;
        }
        let rows = self.bytes.chunks_exact_mut(3 * self.resolution.width).skip(y);
        for (to, from) in rows.zip(other.bytes.chunks_exact(3 * other.resolution.width)) {
            to[3 * x..3 * (x + columns)].copy_from_slice(&from[..3 * columns]);
        }
    }

    /// The picture with each pixel enlarged to a block of `factor × factor`, for viewers that would blur a
    /// small picture.
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
    /// [`Error::Dimension`] when there are no pixels, or when a side is longer than PNG allows.
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
        let mut encoder = Encoder::new(&mut file, columns, rows);
        encoder.set_color(ColorType::Rgb);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::Fast);
        encoder.set_filter(Filter::Adaptive);
        encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&self.bytes))
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
