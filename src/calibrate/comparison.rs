//! Tools to compare pictures: a band-pass filter, interpolation between pixels, and correlation.

use crate::image::{Blur, Resolution};

/// The standard deviation of the narrow blur, in pixels. It makes edges so wide that the iteration sees them
/// from a pixel away.
pub(crate) const BLUR: f64 = 1.2;

/// The standard deviation of the wide blur, in pixels. Global light varies more slowly than that.
const SLOW: f64 = 3.0;

/// The band-pass of a picture: the difference of a narrow and a wide blur. Only the pixels that are `used`
/// count. `None` when a blur has no width.
pub(crate) fn band(size: Resolution, picture: &[f64], used: &[bool]) -> Option<Vec<f64>> {
    let of_used = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..size.pixels()).map(|pixel| if used[pixel] { of(pixel) } else { 0.0 }).collect()
    };
    let [values, weights] = [of_used(&|pixel| picture[pixel]), of_used(&|_| 1.0)];
    let [fine, slow] = [BLUR, SLOW].map(|deviation| {
        let blur = Blur::new(size, deviation)?;
        let pairs = blur.apply(&values).into_iter().zip(blur.apply(&weights));
        // The weight is 0 far from all used pixels, where the value is of no interest.
        Some(pairs.map(|(sum, weight)| sum / weight.max(1e-6)).collect::<Vec<f64>>())
    });
    Some(fine?.iter().zip(slow?).map(|(fine, slow)| fine - slow).collect())
}

/// The value of a picture at a point, bilinear between pixels. Coordinates are in pixels from the centre of
/// the first pixel. `None` outside of the picture.
pub(crate) fn value(picture: &[f64], size: Resolution, [x, y]: [f64; 2]) -> Option<f64> {
    let inside = x >= 0.0 && y >= 0.0 && x <= size.width as f64 - 1.0 && y <= size.height as f64 - 1.0;
    if !inside {
        return None;
    }
    let [column, row] =
        [(x as usize).min(size.width.saturating_sub(2)), (y as usize).min(size.height.saturating_sub(2))];
    let [right, down] = [x - column as f64, y - row as f64];
    let at = |dx: usize, dy: usize| {
        picture[(row + dy).min(size.height - 1) * size.width + (column + dx).min(size.width - 1)]
    };
    let upper = at(0, 0) + right * (at(1, 0) - at(0, 0));
    let lower = at(0, 1) + right * (at(1, 1) - at(0, 1));
    Some(upper + down * (lower - upper))
}

/// Pearson's correlation; −∞ when one of the two is constant.
pub(crate) fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (mut n, mut a, mut b, mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for (x, y) in pairs {
        n += 1.0;
        a += x;
        b += y;
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    let spread = (aa * n - a * a) * (bb * n - b * b);
    if spread > 0.0 { (ab * n - a * b) / spread.sqrt() } else { f64::NEG_INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_between_pixels_is_interpolated_and_there_is_none_outside() {
        let size = Resolution::new(2, 2);
        let picture = [0.0, 1.0, 2.0, 3.0];
        assert_eq!(value(&picture, size, [0.5, 0.5]), Some(1.5));
        assert_eq!(value(&picture, size, [1.0, 1.0]), Some(3.0));
        for outside in [[1.1, 0.0], [-0.1, 0.0], [0.0, 1.1], [0.0, -0.1]] {
            assert_eq!(value(&picture, size, outside), None, "{outside:?}");
        }
    }

    #[test]
    fn slow_variation_is_removed_even_beside_unused_pixels() {
        let size = Resolution::new(48, 32);
        let slow: Vec<f64> = (0..size.pixels()).map(|pixel| 5.0 + 0.1 * (pixel % 48) as f64).collect();
        let used: Vec<bool> = (0..size.pixels()).map(|pixel| pixel % 48 < 24).collect();
        let left = band(size, &slow, &used).expect("both blurs are wider than 0");
        // Where the used part of the ramp ends, the wide blur changes it by no more than its rise over the
        // width of the blur.
        assert!((0..size.pixels()).filter(|&pixel| used[pixel]).all(|pixel| left[pixel].abs() < 0.3));
        assert!(left[16 * 48 + 12].abs() < 1e-3, "{}", left[16 * 48 + 12]);
        let pairs = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)];
        assert!((correlation(pairs.into_iter()) - 1.0).abs() < 1e-12);
        assert_eq!(correlation([(1.0, 2.0), (1.0, 3.0)].into_iter()), f64::NEG_INFINITY);
    }
}
