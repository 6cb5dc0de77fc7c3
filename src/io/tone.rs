//! Tone mapping of linear radiance to a picture for viewing: one exposure for the whole photo, and the sRGB
//! curve.

use super::raster::{NOT_A_NUMBER, Raster};
pub use super::srgb::{decode_srgb, encode_srgb};
use crate::image::Image;

/// The share of samples that is not saturated. The brightest half per cent may saturate, so that a highlight
/// does not darken the rest.
const WHITE_PERCENTILE: f64 = 0.995;

/// The factor that maps the 99.5th percentile of the positive, finite samples to white.
///
/// Dark samples are not counted, so that the photo of a single projected pixel has a useful exposure, too.
/// The factor is 1 for an image without a positive, finite sample.
pub fn exposure(image: &Image) -> f32 {
    let lit: Vec<f64> =
        image.samples().iter().filter(|&&v| v > 0.0 && v.is_finite()).map(|&v| f64::from(v)).collect();
    let white = percentile(lit, WHITE_PERCENTILE).unwrap_or(1.0);
    let scale = (1.0 / white) as f32;
    if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }
}

/// Multiplies by `scale`, clips to \[0,1\] and encodes as sRGB. NaN is shown in magenta ([`NOT_A_NUMBER`]).
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

/// The quantile `rank` (in \[0,1\]) of `values` by the nearest-rank method; `None` if there are no values. No
/// value may be NaN.
pub(crate) fn percentile(mut values: Vec<f64>, rank: f64) -> Option<f64> {
    let index = ((values.len() as f64 * rank).ceil() as usize).saturating_sub(1);
    if index >= values.len() {
        return None;
    }
    Some(*values.select_nth_unstable_by(index, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn highlights_do_not_set_the_exposure() {
        let mut image = Image::filled(Resolution::new(100, 100), 1, 0.25);
        image.samples_mut()[..20].fill(1000.0);
        assert_eq!(exposure(&image), 4.0);
        image.samples_mut()[0] = f32::NAN;
        assert_eq!(develop(&image, 4.0).pixel(0, 0), NOT_A_NUMBER);
        assert_eq!(develop(&image, 4.0).pixel(50, 50), [255; 3]);
    }

    #[test]
    fn a_single_lit_pixel_is_white_and_a_dark_image_has_exposure_one() {
        let mut image = Image::filled(Resolution::new(64, 64), 3, 0.0);
        assert_eq!(exposure(&image), 1.0);
        image.samples_mut()[5] = 1e-4;
        approx::assert_relative_eq!(exposure(&image), 1e4);
    }
}
