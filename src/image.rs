//! Images: patterns and photos as dense `f32` rasters in linear radiometric units.

mod blur;
pub(crate) mod codec;
mod percentile;

pub use blur::Blur;
pub(crate) use percentile::percentile;

use crate::error::{Error, Result};

/// The shares of linear red, green and blue in luminance, by Rec. 709.
pub const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The size of a raster in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "StatedResolution")]
pub struct Resolution {
    /// Columns; column 0 is the left.
    pub width: usize,
    /// Rows; row 0 is the top.
    pub height: usize,
}

/// A size as a file states it.
#[derive(serde::Deserialize)]
struct StatedResolution {
    width: usize,
    height: usize,
}

/// The most pixels of a size that a file states. No image has as many, and sums of a few images' pixels do not overflow.
const MAX_STATED_PIXELS: usize = 1 << 40;

impl TryFrom<StatedResolution> for Resolution {
    type Error = String;

    fn try_from(StatedResolution { width, height }: StatedResolution) -> std::result::Result<Self, String> {
        match width.checked_mul(height) {
            Some(pixels) if pixels <= MAX_STATED_PIXELS && width.max(height) <= MAX_STATED_PIXELS => {
                Ok(Self { width, height })
            }
            _ => Err(format!("{width}x{height} pixels are more than any image has")),
        }
    }
}

impl Resolution {
    /// `width` × `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height }
    }

    /// The number of pixels, `n = w·h`; the pixel at column `x`, row `y` has index `y·w + x`.
    pub fn pixels(self) -> usize {
        self.width * self.height
    }
}

impl std::fmt::Display for Resolution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// A raster of 1 (luma) or 3 (linear RGB) channels, interleaved, row by row from the top left:
/// sample `c` of pixel `(x, y)` is `samples[(y·w + x)·channels + c]`.
///
/// In a pattern, 1 stands for an irradiance of 1 W/m² per channel on a fronto-parallel plane at 1 m. In a
/// photo, values are radiance in W/(m² sr).
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    resolution: Resolution,
    channels: usize,
    samples: Vec<f32>,
}

impl Image {
    /// An image with these samples, in the order that [`Image`] describes.
    ///
    /// # Errors
    /// [`Error::Dimension`] when `channels` is neither 1 nor 3, or when the number of samples is not
    /// `w·h·channels`.
    pub fn new(resolution: Resolution, channels: usize, samples: Vec<f32>) -> Result<Self> {
        if channels != 1 && channels != 3 {
            return Err(Error::Dimension {
                what: "channels of an image",
                expected: "1 or 3".into(),
                found: channels.to_string(),
            });
        }
        if samples.len() != resolution.pixels() * channels {
            return Err(Error::Dimension {
                what: "samples of an image",
                expected: format!("{resolution}x{channels}"),
                found: samples.len().to_string(),
            });
        }
        Ok(Self { resolution, channels, samples })
    }

    /// An image with every sample equal to `value`.
    pub fn filled(resolution: Resolution, channels: usize, value: f32) -> Self {
        debug_assert!(channels == 1 || channels == 3);
        Self { resolution, channels, samples: vec![value; resolution.pixels() * channels] }
    }

    /// An image from planes of `w·h` values, one plane for each channel. The values are rounded to `f32`.
    ///
    /// # Errors
    /// [`Error::Dimension`] as from [`Image::new`], also when a plane is too short.
    pub fn from_planes(resolution: Resolution, planes: &[Vec<f64>]) -> Result<Self> {
        let samples = (0..resolution.pixels()).flat_map(|pixel| {
            planes.iter().filter_map(move |plane| plane.get(pixel)).map(|&value| value as f32)
        });
        Self::new(resolution, planes.len(), samples.collect())
    }

    /// The size in pixels.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// The number of channels: 1 (luma) or 3 (linear RGB).
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All samples, interleaved.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// All samples, interleaved, for writing.
    pub fn samples_mut(&mut self) -> &mut [f32] {
        &mut self.samples
    }

    /// One channel as a plane of `w·h` values, converted to `f64`.
    pub fn plane(&self, channel: usize) -> Vec<f64> {
        self.samples.iter().skip(channel).step_by(self.channels).map(|&v| f64::from(v)).collect()
    }

    /// Every channel as a plane of `w·h` values.
    pub fn planes(&self) -> Vec<Vec<f64>> {
        (0..self.channels).map(|channel| self.plane(channel)).collect()
    }

    /// The image in one channel; `None` where it has colours. Drawing programs save gray pictures with three equal channels.
    pub fn gray(&self) -> Option<Self> {
        let pixels = self.samples.chunks_exact(self.channels);
        let is_gray = pixels.clone().all(|pixel| pixel.iter().all(|sample| *sample == pixel[0]));
        is_gray.then(|| Self {
            resolution: self.resolution,
            channels: 1,
            samples: pixels.map(|pixel| pixel[0]).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_equal_channels_are_gray_and_others_are_colours() {
        let size = Resolution::new(2, 1);
        let image = |samples: &[f32]| Image::new(size, 3, samples.to_vec()).expect("well formed");
        let gray = image(&[0.1, 0.1, 0.1, 0.9, 0.9, 0.9]).gray().expect("it has no colours");
        assert_eq!((gray.channels(), gray.samples()), (1, &[0.1, 0.9][..]));
        assert_eq!(gray.gray().as_ref().map(Image::samples), Some(gray.samples()));
        assert!(image(&[0.1, 0.1, 0.1, 0.9, 0.9, 0.8]).gray().is_none());
    }
}
