//! Rasters are 8-bit sRGB pictures for viewing. Tone mapping applies one exposure to all pixels, and then the sRGB curve (IEC 61966-2-1).

use std::path::Path;
use std::sync::LazyLock;

use png::{BitDepth, ColorType, Compression, Encoder, Filter};

use super::atomic;
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};

/// The colour of pixels that are NaN: a magenta that no colour map contains.
pub const NOT_A_NUMBER: [u8; 3] = [0xff, 0x00, 0xff];

/// A picture for viewing, in sRGB with 8 bits per channel, row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Raster {
    resolution: Resolution,
    bytes: Vec<u8>,
}

/// A picture without pixels.
impl Default for Raster {
    fn default() -> Self {
        Self::black(Resolution::new(0, 0))
    }
}

impl Raster {
    /// A picture of `w·h` pixels, given row by row from the top left. Missing pixels are black, and additional pixels are ignored.
    pub fn from_pixels(resolution: Resolution, pixels: impl IntoIterator<Item = [u8; 3]>) -> Self {
        let mut bytes = Vec::with_capacity(3 * resolution.pixels());
        pixels.into_iter().take(resolution.pixels()).for_each(|pixel| bytes.extend_from_slice(&pixel));
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

    /// All bytes. Red, green and blue are interleaved.
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

    /// Copies `other` into this picture, with its top left corner at column `x`, row `y`. Parts beyond the edges are clipped.
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

    /// The picture with each pixel enlarged to a block of `factor × factor` pixels. Viewers would blur a small picture.
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
    /// [`Error::Dimension`] if there are no pixels, or if a side is longer than PNG allows.
    pub fn encode_png(&self) -> Result<Vec<u8>> {
        let Resolution { width, height } = self.resolution;
        let refused =
            |found: String| Error::dimension("size of a PNG picture", "1 to 2^31 - 1 pixels a side", found);
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

    /// Writes a PNG file, with the errors of [`Raster::encode_png`] and [`Error::Write`].
    pub fn write_png(&self, path: &Path) -> Result<()> {
        atomic::write_bytes(path, &self.encode_png()?)
    }
}

/// The fraction of samples that must not saturate. The brightest half per cent may saturate, so that highlights do not darken the photo.
const WHITE_PERCENTILE: f64 = 0.995;

/// The factor that maps the 99.5th percentile of the positive, finite samples to white; 1 if there are no such samples. Samples that are
/// not positive are ignored, so even the photo of a single projected pixel gets a useful exposure. If this would make most of the image
/// nearly white, the factor is smaller: it maps the median of all samples to half of white.
pub fn exposure(image: &Image) -> f32 {
    let mut lit: Vec<f64> =
        image.samples().iter().filter(|sample| sample.is_finite()).map(|&sample| f64::from(sample)).collect();
    let median = percentile(lit.clone(), 0.5).unwrap_or(0.0);
    lit.retain(|&sample| sample > 0.0);
    let white = percentile(lit, WHITE_PERCENTILE).unwrap_or(1.0).max(2.0 * median);
    let scale = (1.0 / white) as f32;
    if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }
}

/// Multiplies all samples by `scale`, clips them to \[0,1\], and encodes them as sRGB. NaN becomes magenta ([`NOT_A_NUMBER`]).
pub fn develop(image: &Image, scale: f32) -> Raster {
    let rgb = image.samples().chunks_exact(image.channels()).map(|pixel| {
        if pixel.iter().any(|sample| sample.is_nan()) {
            return NOT_A_NUMBER;
        }
        let level = |channel: usize| encode_srgb(pixel[channel.min(pixel.len() - 1)] * scale);
        [level(0), level(1), level(2)]
    });
    Raster::from_pixels(image.resolution(), rgb)
}

/// The quantile `rank` (in \[0,1\]) of `values`, by the nearest-rank method; `None` if there are no values. No value may be NaN.
pub(crate) fn percentile(mut values: Vec<f64>, rank: f64) -> Option<f64> {
    let index = ((values.len() as f64 * rank).ceil() as usize).saturating_sub(1);
    if index >= values.len() {
        return None;
    }
    Some(*values.select_nth_unstable_by(index, f64::total_cmp).1)
}

/// The number of intervals with a precomputed first guess. Within one interval, the encoded value changes by less than one byte, even where
/// the curve is steepest.
const GUESSES: usize = 4096;

/// Tables for encoding. A report shows millions of pixels, and evaluating a power function for each channel would be slow.
struct Bytes {
    /// For each byte, the least linear value whose code is greater than this byte.
    next: [f32; 256],
    /// The code at the start of each interval.
    guess: [u8; GUESSES + 1],
}

static BYTES: LazyLock<Bytes> = LazyLock::new(|| {
    let mut next = [f32::INFINITY; 256];
    for (byte, next) in next.iter_mut().take(255).enumerate() {
        // The search bisects bit patterns, because positive floats have the same order as their bit patterns.
        let (mut below, mut above) = (0.0_f32.to_bits(), 1.0_f32.to_bits());
        while below + 1 < above {
            let middle = below.midpoint(above);
            if usize::from(byte_of(f32::from_bits(middle))) > byte { above = middle } else { below = middle }
        }
        *next = f32::from_bits(above);
    }
    Bytes { next, guess: std::array::from_fn(|step| byte_of(step as f32 / GUESSES as f32)) }
});

/// The sRGB byte that is nearest to a linear value. The value is clipped to \[0,1\] first. NaN gives 0.
pub fn encode_srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let byte = BYTES.guess[(linear * GUESSES as f32) as usize];
    byte + u8::from(linear >= BYTES.next[usize::from(byte)])
}

/// Works like [`encode_srgb`], but without tables, for a value in \[0,1\].
fn byte_of(linear: f32) -> u8 {
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

/// The linear value of an sRGB-encoded value, both in \[0,1\] (IEC 61966-2-1).
pub fn decode_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn highlights_do_not_set_the_exposure() {
        let mut image = Image::filled(Resolution::new(100, 100), 1, 0.25);
        assert_eq!(exposure(&image), 2.0, "an image of one value is gray");
        image.samples_mut()[..5100].fill(0.0);
        image.samples_mut()[..20].fill(1000.0);
        assert_eq!(exposure(&image), 4.0);
        image.samples_mut()[0] = f32::NAN;
        assert_eq!(develop(&image, 4.0).pixel(0, 0), NOT_A_NUMBER);
        assert_eq!(develop(&image, 4.0).pixel(50, 60), [255; 3]);
    }

    #[test]
    fn a_single_lit_pixel_is_white_and_a_dark_image_has_exposure_one() {
        let mut image = Image::filled(Resolution::new(64, 64), 3, 0.0);
        assert_eq!(exposure(&image), 1.0);
        image.samples_mut()[5] = 1e-4;
        approx::assert_relative_eq!(exposure(&image), 1e4);
    }

    #[test]
    fn the_tables_give_the_bytes_of_the_curve() {
        let of_bits = (0..=1.0_f32.to_bits()).step_by(1009).map(f32::from_bits);
        let steps = (0..=4 * GUESSES).map(|step| step as f32 / (4 * GUESSES) as f32);
        let least = BYTES.next.into_iter().take(255).flat_map(|next| [next, next.next_down()]);
        for linear in of_bits.chain(steps).chain(least) {
            assert_eq!(encode_srgb(linear), byte_of(linear), "{linear}");
        }
        assert_eq!([-1.0, 2.0, f32::INFINITY, f32::NAN].map(encode_srgb), [0, 255, 255, 0]);
    }

    #[test]
    fn encoding_inverts_decoding_for_every_byte() {
        for byte in 0..=255_u8 {
            assert_eq!(encode_srgb(decode_srgb(f32::from(byte) / 255.0)), byte);
        }
    }
}
