//! Images are patterns and photos, as dense `f32` rasters in linear radiometric units.

use rayon::prelude::*;

use crate::error::{Error, Result};

pub(crate) mod codec;

/// The weights of linear red, green and blue in luminance (Rec. 709).
pub const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// The size of a raster in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "StatedResolution")]
pub struct Resolution {
    /// The number of columns. Column 0 is at the left.
    pub width: usize,
    /// The number of rows. Row 0 is at the top.
    pub height: usize,
}

#[derive(serde::Deserialize)]
struct StatedResolution {
    width: usize,
    height: usize,
}

/// The maximum number of pixels that a file may state. No image has this many pixels, and sums of a few such numbers cannot overflow.
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

    /// The number of pixels, `n = w·h`. The pixel at column `x`, row `y` has the index `y·w + x`.
    pub fn pixels(self) -> usize {
        self.width * self.height
    }
}

impl std::fmt::Display for Resolution {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// A raster of 1 (luma) or 3 (linear RGB) channels, interleaved, row by row from the top left: sample `c` of pixel `(x, y)` is
/// `samples[(y·w + x)·channels + c]`.
///
/// In a pattern, 1 stands for an irradiance of 1 W/m² per channel on a fronto-parallel plane at 1 m. In a photo, values are radiance in
/// W/(m² sr).
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
    /// [`Error::Dimension`] when `channels` is neither 1 nor 3, or when the number of samples is not `w·h·channels`.
    pub fn new(resolution: Resolution, channels: usize, samples: Vec<f32>) -> Result<Self> {
        if channels != 1 && channels != 3 {
            return Err(Error::dimension("channels of an image", "1 or 3", channels));
        }
        if samples.len() != resolution.pixels() * channels {
            return Err(Error::dimension(
                "samples of an image",
                format!("{resolution}x{channels}"),
                samples.len(),
            ));
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

    /// The luminance of linear red, green and blue as a plane of `w·h` values; of a gray image, its values.
    pub fn luminance(&self) -> Vec<f64> {
        match self.channels {
            3 => {
                let pixels = self.samples.chunks_exact(3);
                pixels
                    .map(|pixel| pixel.iter().zip(LUMINANCE).map(|(v, share)| f64::from(*v) * share).sum())
                    .collect()
            }
            _ => self.plane(0),
        }
    }

    /// Every channel as a plane of `w·h` values.
    pub fn planes(&self) -> Vec<Vec<f64>> {
        (0..self.channels).map(|channel| self.plane(channel)).collect()
    }

    /// The image in one channel; `None` if it has colours. Drawing programs save gray pictures with three equal channels.
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

/// The radius of the blur kernel in standard deviations.
const REACH: f64 = 4.0;

/// A separable Gaussian blur `K` of images of one resolution.
///
/// Each image is extended beyond its edges by reflection at the border between pixels (`… c b a | a b c …`). Then `K = Kᵀ`, so `K A K` is
/// symmetric for a symmetric `A`. Also `K 1 = 1`, so a constant pattern stays constant.
#[derive(Clone, Debug)]
pub struct Blur {
    resolution: Resolution,
    /// The weights from the centre outwards. Together with their mirror images, they sum to 1.
    kernel: Vec<f64>,
}

impl Blur {
    /// A blur with a standard deviation of `deviation` pixels; `None` for 0, which means no blur.
    pub fn new(resolution: Resolution, deviation: f64) -> Option<Self> {
        if deviation <= 0.0 {
            return None;
        }
        let reach = (REACH * deviation).ceil() as usize;
        let half: Vec<f64> = (0..=reach).map(|at| (-0.5 * (at as f64 / deviation).powi(2)).exp()).collect();
        let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
        let kernel = half.iter().map(|weight| weight / sum).collect();
        Some(Self { resolution, kernel })
    }

    /// The resolution of the blurred images.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// The blurred image `K x`. `x` and `K x` have `n` values each.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        // Rows are convolved first, and then columns.
        let (width, height) = (self.resolution.width, self.resolution.height);
        let reach = self.kernel.len() - 1;
        let mut rows = vec![0.0; x.len()];
        rows.par_chunks_mut(width.max(1)).zip(x.par_chunks(width.max(1))).for_each(|(to, from)| {
            let padded: Vec<f64> = (0..width + 2 * reach)
                .map(|at| from[mirrored(at as isize - reach as isize, width)])
                .collect();
            add_weighted(
                to,
                self.taps().map(|(offset, weight)| (weight, &padded[reach.wrapping_add_signed(offset)..])),
            );
        });
        let mut picture = vec![0.0; x.len()];
        picture.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, to)| {
            let row = |offset: isize| &rows[mirrored(y as isize + offset, height) * width..];
            add_weighted(to, self.taps().map(|(offset, weight)| (weight, row(offset))));
        });
        picture
    }

    /// The offsets of the kernel from the centre outwards, on both sides, with their weights.
    fn taps(&self) -> impl Iterator<Item = (isize, f64)> {
        self.kernel.iter().enumerate().flat_map(|(at, &weight)| {
            let offset = at as isize;
            [Some((offset, weight)), (at > 0).then_some((-offset, weight))].into_iter().flatten()
        })
    }

    /// The variances of the `n` entries of `K x`, if the entries of `x` are independent and have the given `n` variances.
    pub fn variance(&self, variance: &[f64]) -> Vec<f64> {
        let (width, height) = (self.resolution.width, self.resolution.height);
        // Near an edge, a pixel contributes more than once. Its weights are therefore summed before they are squared.
        let [across, down] = [width, height]
            .map(|length| (0..length).map(|at| self.weights(at, length)).collect::<Vec<Vec<(usize, f64)>>>());
        let sum = |row: &[(usize, f64)], of: &dyn Fn(usize) -> f64| {
            row.iter().map(|&(at, weight)| weight * weight * of(at)).sum::<f64>()
        };
        let rows: Vec<f64> = (0..width * height)
            .map(|pixel| sum(&across[pixel % width], &|x| variance[pixel / width * width + x]))
            .collect();
        (0..width * height)
            .map(|pixel| sum(&down[pixel / width], &|y| rows[y * width + pixel % width]))
            .collect()
    }

    /// The row of `K` for one pixel: the pixels that contribute to it, and their weights.
    pub(crate) fn row(&self, pixel: usize) -> Vec<(usize, f64)> {
        let Resolution { width, height } = self.resolution;
        let across = self.weights(pixel % width, width);
        let down = self.weights(pixel / width, height).into_iter();
        down.flat_map(|(y, b)| across.iter().map(move |&(x, a)| (y * width + x, a * b))).collect()
    }

    /// The weights of the pixels that contribute to pixel `at` of a row of `length` pixels.
    fn weights(&self, at: usize, length: usize) -> Vec<(usize, f64)> {
        let mut weights = std::collections::BTreeMap::new();
        for (offset, weight) in self.taps() {
            *weights.entry(mirrored(at as isize + offset, length)).or_insert(0.0) += weight;
        }
        weights.into_iter().collect()
    }
}

/// `sum ← sum + Σ weight · values`, with the terms added one after the other. The values may be more than the sums.
pub(crate) fn add_weighted<'a>(sum: &mut [f64], terms: impl Iterator<Item = (f64, &'a [f64])>) {
    for (weight, values) in terms {
        sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
    }
}

/// The index of the pixel at position `at`, if a row of `length` pixels is extended by repeated reflection at its ends.
fn mirrored(at: isize, length: usize) -> usize {
    let within = at.rem_euclid(2 * length as isize) as usize;
    if within < length { within } else { 2 * length - 1 - within }
}

/// The sorted value at the index nearest to the quantile `rank`, from 0 to 1. Without values, the result is 0. No value may be NaN.
pub(crate) fn percentile(values: impl IntoIterator<Item = f64>, rank: f64) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    if values.is_empty() {
        return 0.0;
    }
    let index = ((values.len() - 1) as f64 * rank).round() as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
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

    #[test]
    fn the_blur_is_symmetric_keeps_constants_and_predicts_variances() {
        // The kernel is wider than the height of the image, so positions are reflected more than once.
        let resolution = Resolution::new(7, 3);
        let blur = Blur::new(resolution, 1.3).expect("wider than 0");
        let n = resolution.pixels();
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|k| blur.apply(&(0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<_>>()))
            .collect();
        let variance = blur.variance(&(0..n).map(|k| 1.0 + k as f64).collect::<Vec<_>>());
        for i in 0..n {
            assert!((columns.iter().map(|column| column[i]).sum::<f64>() - 1.0).abs() < 1e-14);
            let expected: f64 = (0..n).map(|k| columns[k][i].powi(2) * (1.0 + k as f64)).sum();
            assert!((variance[i] - expected).abs() < 1e-12);
            let row = columns.iter().map(|column| column[i]);
            assert!(row.zip(&columns[i]).all(|(across, down)| (across - down).abs() < 1e-16));
        }
        assert!(Blur::new(resolution, 0.0).is_none());
    }
}
