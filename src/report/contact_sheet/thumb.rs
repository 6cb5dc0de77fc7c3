//! Thumbnails of light or of signed values.

use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::io::raster::Raster;
use crate::io::raster::{develop, exposure};
use crate::report::colormap::{paint_signed, robust_range};
use crate::report::planes::mean;

/// Maximum side of a thumbnail, in pixels.
pub(super) const SIDE: usize = 64;

/// A thumbnail: one plane of values per channel, reduced by averaging square blocks of pixels.
#[derive(Clone, Debug)]
pub(super) struct Thumb {
    pub(super) size: Resolution,
    planes: Vec<Vec<f64>>,
}

impl Thumb {
    /// A black thumbnail; channels that are not set stay black.
    pub(super) fn black(size: Resolution, channels: usize) -> Self {
        let size = reduced(size, factor(size, SIDE));
        Self { size, planes: vec![vec![0.0; size.pixels()]; channels] }
    }

    pub(super) fn set(&mut self, channel: usize, size: Resolution, values: &[f64]) -> Result<()> {
        Error::check_size("pixels of a photo", size.pixels(), values.len())?;
        self.planes[channel] = averaged(size, factor(size, SIDE), values);
        Ok(())
    }

    /// The thumbnail reduced to at most `side` pixels per side.
    pub(super) fn within(&self, side: usize) -> Self {
        let factor = factor(self.size, side);
        Self {
            size: reduced(self.size, factor),
            planes: self.planes.iter().map(|plane| averaged(self.size, factor, plane)).collect(),
        }
    }

    /// The picture and the value of its brightest colour. Light is developed; if any value is negative, the signed colour map is used.
    pub(super) fn paint(&self) -> Result<(Raster, f64)> {
        if self.planes.iter().flatten().any(|&value| value < 0.0) {
            let values = mean(&self.planes);
            let range = robust_range(&values, None);
            return Ok((paint_signed(self.size, &values, None, range)?, range));
        }
        let image = Image::from_planes(self.size, &self.planes)?;
        let scale = exposure(&image);
        Ok((develop(&image, scale), 1.0 / f64::from(scale)))
    }
}

/// Number of source pixels per side of one thumbnail pixel.
fn factor(size: Resolution, side: usize) -> usize {
    size.width.max(size.height).div_ceil(side).max(1)
}

fn reduced(size: Resolution, factor: usize) -> Resolution {
    Resolution::new(size.width.div_ceil(factor), size.height.div_ceil(factor))
}

/// Means of blocks of `factor × factor` pixels; blocks at the right and lower edge may be smaller.
fn averaged(size: Resolution, factor: usize, values: &[f64]) -> Vec<f64> {
    if factor == 1 {
        return values.to_vec();
    }
    let small = reduced(size, factor);
    let mut means = vec![0.0; small.pixels()];
    for (y, row) in values.chunks(size.width.max(1)).enumerate() {
        let means = &mut means[y / factor * small.width..][..small.width];
        for (sum, values) in means.iter_mut().zip(row.chunks(factor)) {
            values.iter().for_each(|value| *sum += value);
        }
    }
    let there = |at: usize, side: usize| factor.min(side - at * factor);
    for (y, row) in means.chunks_mut(small.width.max(1)).enumerate() {
        for (x, sum) in row.iter_mut().enumerate() {
            *sum /= (there(x, size.width) * there(y, size.height)) as f64;
        }
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_averaged_and_what_hangs_over_counts_as_far_as_it_is_there() {
        let size = Resolution::new(3, 2);
        assert_eq!(averaged(size, 2, &[1.0, 3.0, 5.0, 2.0, 6.0, 7.0]), [3.0, 6.0]);
        assert_eq!(
            [(64, 64), (128, 96), (65, 10)].map(|(w, h)| factor(Resolution::new(w, h), SIDE)),
            [1, 2, 2]
        );
    }

    #[test]
    fn light_is_gray_and_signed_values_are_coloured() {
        let size = Resolution::new(2, 1);
        let mut thumb = Thumb::black(size, 1);
        thumb.set(0, size, &[0.25, 0.5]).expect("as many values as pixels");
        let (light, white) = thumb.paint().expect("finite");
        assert_eq!((light.pixel(1, 0), white), ([255; 3], 0.5));
        thumb.set(0, size, &[-0.5, 0.5]).expect("as many values as pixels");
        let (signed, range) = thumb.paint().expect("finite");
        assert_eq!(range, 0.5);
        assert!(signed.pixel(0, 0)[2] > signed.pixel(0, 0)[0], "negative is blue");
        assert!(signed.pixel(1, 0)[0] > signed.pixel(1, 0)[2], "positive is red");
        assert!(thumb.set(0, size, &[1.0]).is_err());
    }
}
