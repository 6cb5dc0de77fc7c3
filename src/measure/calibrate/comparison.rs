//! Pictures to be compared: freed of what does not count, read between pixels, correlated.

use crate::image::{Blur, Resolution};

/// Standard deviation of the blur, in pixels. Edges then are as wide as steps of the iteration must be able
/// to see.
pub(super) const BLUR: f64 = 1.2;

/// Standard deviation of the blur that is taken off, in pixels: what varies more slowly is indirect light.
const SLOW: f64 = 3.0;

/// A picture without what is finer than can be followed, and without what is slower than direct light; by the
/// pixels that are `used` alone.
pub(super) fn band(size: Resolution, picture: &[f64], used: &[bool]) -> Option<Vec<f64>> {
    let of_used = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..size.pixels()).map(|pixel| if used[pixel] { of(pixel) } else { 0.0 }).collect()
    };
    let [values, weights] = [of_used(&|pixel| picture[pixel]), of_used(&|_| 1.0)];
    let [fine, slow] = [BLUR, SLOW].map(|deviation| {
        let blur = Blur::new(size, deviation)?;
        let pairs = blur.apply(&values).into_iter().zip(blur.apply(&weights));
        // Far from all that is used there is nothing to be known.
        Some(pairs.map(|(sum, weight)| sum / weight.max(1e-6)).collect::<Vec<f64>>())
    });
    Some(fine?.iter().zip(slow?).map(|(fine, slow)| fine - slow).collect())
}

/// The picture's value at a point in pixels from the centre of the first, linear between pixels; none
/// outside.
pub(super) fn value(picture: &[f64], size: Resolution, [x, y]: [f64; 2]) -> Option<f64> {
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

/// Pearson's; −∞ of what has no spread.
pub(super) fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
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
    fn between_pixels_a_picture_is_linear_and_outside_there_is_none() {
        let size = Resolution::new(2, 2);
        let picture = [0.0, 1.0, 2.0, 3.0];
        assert_eq!(value(&picture, size, [0.5, 0.5]), Some(1.5));
        assert_eq!(value(&picture, size, [1.0, 1.0]), Some(3.0));
        assert_eq!((value(&picture, size, [1.1, 0.0]), value(&picture, size, [0.0, -0.1])), (None, None));
    }

    #[test]
    fn what_varies_slowly_is_taken_off_also_beside_what_is_not_used() {
        let size = Resolution::new(48, 32);
        let slow: Vec<f64> = (0..size.pixels()).map(|pixel| 5.0 + 0.1 * (pixel % 48) as f64).collect();
        let used: Vec<bool> = (0..size.pixels()).map(|pixel| pixel % 48 < 24).collect();
        let left = band(size, &slow, &used).expect("both blurs are wider than 0");
        // A ramp that ends is bent by the wider blur, by no more than what it rises over its width.
        assert!((0..size.pixels()).filter(|&pixel| used[pixel]).all(|pixel| left[pixel].abs() < 0.3));
        assert!(left[16 * 48 + 12].abs() < 1e-3, "{}", left[16 * 48 + 12]);
        let pairs = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)];
        assert!((correlation(pairs.into_iter()) - 1.0).abs() < 1e-12);
        assert_eq!(correlation([(1.0, 2.0), (1.0, 3.0)].into_iter()), f64::NEG_INFINITY);
    }
}
