//! The patterns for the fit of direct light.
//!
//! Away from the raster's border, a checkerboard of two pixels is an eigenvector of every blur. A blur thus keeps its shape, and its lower
//! contrast looks like less direct light. [Codes](code_patterns) hold all frequencies. Their photos therefore determine the blur, and
//! separate light of near pixels from the pixel's own light. Codes change from pixel to pixel, which the camera must resolve. Where it does
//! not, or where the spread of its pixels is unknown, squares of four pixels serve, whose edges show the blur.

use super::calibration::Registration;
use crate::image::Resolution;

/// The camera resolves single pixels when it has this many camera pixels per projector pixel.
const RESOLVES: usize = 4;

/// The number of photos of codes. It equals the number of photos of shifted squares.
const CODES: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DirectPatterns {
    /// Near pixels are lit by different codes.
    Codes,
    /// A checkerboard of squares with this side, shifted step by step.
    Squares(usize),
}

impl DirectPatterns {
    /// The patterns that suit a pixel map. Runs with a calibration without a lens map used squares of four pixels and can still be queried.
    pub(crate) fn of(registration: &Registration) -> Self {
        let finer = registration.camera.pixels() >= RESOLVES * registration.projector.pixels();
        if finer && registration.lens.is_some() { Self::Codes } else { Self::Squares(4) }
    }

    /// Makes the patterns. Each pixel is lit in about half of them. Pixels that are not `lit` stay dark.
    pub(crate) fn shown(self, resolution: Resolution, lit: &[bool]) -> Vec<Vec<f64>> {
        let mut shown = match self {
            Self::Codes => code_patterns(resolution, CODES).collect(),
            Self::Squares(side) => squares(resolution, side),
        };
        for pattern in &mut shown {
            pattern.iter_mut().zip(lit).filter(|(_, lit)| !**lit).for_each(|(light, _)| *light = 0.0);
        }
        shown
    }
}

/// A checkerboard with squares of `side` pixels, moved to the left and up by `shift`. It is 1 where a pixel is lit, 0 elsewhere.
pub fn checkerboard(resolution: Resolution, side: usize, [right, down]: [usize; 2]) -> Vec<f64> {
    let lit = |pixel: usize| {
        let (x, y) = (pixel % resolution.width + right, pixel / resolution.width + down);
        f64::from(u8::from((x / side + y / side).is_multiple_of(2)))
    };
    (0..resolution.pixels()).map(lit).collect()
}

/// The checkerboards, shifted by half a square: each pixel is well inside a bright square and well inside a dark one at least once.
fn squares(resolution: Resolution, side: usize) -> Vec<Vec<f64>> {
    let shifts = |to: usize| (0..to).step_by(side.div_ceil(2));
    shifts(side)
        .flat_map(|down| shifts(2 * side).map(move |right| checkerboard(resolution, side, [right, down])))
        .collect()
}

// Codes are patterns in which each pixel is lit in half of the photos, and near pixels are lit by different codes.
//
// The code of a pixel is the set of photos in which it is lit, a row of a Hadamard matrix. Two different codes are orthogonal. Light from a
// pixel with another code therefore cancels exactly in the correlation of the photos with the pixel's code. Pixels with the same code are
// about `√photos` pixels apart. Every second row has inverted codes, so that even global light from pixels with the same code cancels.

/// The patterns of `photos` photos, a power of two of at least 4. Each pattern has `n` values: 1 where a pixel is lit, 0 elsewhere.
pub fn code_patterns(resolution: Resolution, photos: usize) -> impl Iterator<Item = Vec<f64>> {
    let step = step(photos - 1);
    (0..photos).map(move |photo| {
        let lit = |pixel: usize| {
            let (x, y) = (pixel % resolution.width, pixel / resolution.width);
            let code = (x + step * y) % (photos - 1) + 1;
            // The entry of Sylvester's Hadamard matrix is −1 where an odd number of bits is set in both indices.
            let signs = (code & photo).count_ones() + y as u32 % 2;
            f64::from(u8::from(signs.is_multiple_of(2)))
        };
        (0..resolution.pixels()).map(lit).collect()
    })
}

/// The difference between the codes of a pixel and of the pixel below it. It puts pixels with the same code as far apart as possible.
/// `codes` is the number of codes, which are numbered along each row of the picture.
fn step(codes: usize) -> usize {
    let nearest = |step: usize| {
        let below = |y: usize| {
            let x = step * y % codes;
            (x.min(codes - x)).pow(2) + y * y
        };
        (1..=codes.isqrt() + 1).map(below).min().unwrap_or(0).min(codes * codes)
    };
    // Among equally good steps, the smallest is returned.
    (1..codes).rev().max_by_key(|&step| nearest(step)).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Blur;

    #[test]
    fn each_pixel_is_lit_in_half_of_the_patterns() {
        let resolution = Resolution::new(9, 7);
        for side in 1..6 {
            let patterns = DirectPatterns::Squares(side).shown(resolution, &[true; 63]);
            for pixel in 0..63 {
                let light: f64 = patterns.iter().map(|pattern| pattern[pixel]).sum();
                // When the step does not divide the square, one side has one more pattern.
                assert!((2.0 * light - patterns.len() as f64).abs() <= 2.0 * side as f64, "{side} {pixel}");
                assert!(light > 0.0 && light < patterns.len() as f64);
            }
        }
    }

    #[test]
    fn codes_show_a_blur_that_squares_of_two_pixels_hide() {
        let resolution = Resolution::new(24, 24);
        let blur = Blur::new(resolution, 0.6).expect("a blur");
        let inside = |pixel: &usize| (4..20).contains(&(pixel % 24)) && (4..20).contains(&(pixel / 24));
        // The largest part of a blurred pattern, minus its mean, that is not a multiple of the pattern.
        let reshaped = |patterns: DirectPatterns| {
            let of = |pattern: &Vec<f64>| {
                let blurred = blur.apply(pattern);
                let pairs: Vec<[f64; 2]> = (0..576)
                    .filter(inside)
                    .map(|pixel| [pattern[pixel] - 0.5, blurred[pixel] - 0.5])
                    .collect();
                let sum = |of: &dyn Fn(&[f64; 2]) -> f64| pairs.iter().map(of).sum::<f64>();
                let factor = sum(&|[x, y]| x * y) / sum(&|[x, _]| x * x);
                sum(&|[x, y]| (y - factor * x).powi(2)) / sum(&|[_, y]| y * y)
            };
            patterns.shown(resolution, &[true; 576]).iter().map(of).fold(0.0, f64::max)
        };
        // The two neighbours of a pixel across a square of two differ, so they cancel.
        assert!(reshaped(DirectPatterns::Squares(2)) < 1e-20, "rounding");
        assert!(reshaped(DirectPatterns::Codes) > 0.1);
    }

    #[test]
    fn pixels_of_the_same_code_are_about_the_root_of_their_number_apart() {
        for codes in [7, 15, 31] {
            let step = step(codes);
            let offsets = (0..codes)
                .flat_map(|y| (0..2 * codes - 1).map(move |x| [x as i64 - codes as i64 + 1, y as i64]));
            let same = offsets
                .filter(|&[x, y]| [x, y] != [0, 0] && (x + step as i64 * y).rem_euclid(codes as i64) == 0);
            let nearest = same.map(|[x, y]| x * x + y * y).min().unwrap_or(0);
            // A square lattice with one point in `codes` pixels has its nearest points at distance `√codes`.
            assert!(nearest as f64 >= 0.7 * codes as f64, "{codes}: {nearest}");
        }
    }

    #[test]
    fn each_pixel_is_lit_in_half_of_the_photos_and_by_no_code_of_a_neighbour() {
        let resolution = Resolution::new(9, 7);
        for photos in [8_usize, 16] {
            let shown: Vec<Vec<f64>> = code_patterns(resolution, photos).collect();
            let along = |a: usize, b: usize| -> f64 {
                shown.iter().map(|pattern| (pattern[a] - 0.5) * (pattern[b] - 0.5)).sum()
            };
            for pixel in 0..63 {
                assert_eq!(shown.iter().map(|pattern| pattern[pixel]).sum::<f64>(), photos as f64 / 2.0);
                assert_eq!(along(pixel, pixel), photos as f64 / 4.0);
                if pixel % 9 < 8 {
                    assert_eq!(along(pixel, pixel + 1), 0.0, "the pixel to the right");
                }
                if pixel / 9 < 6 {
                    assert_eq!(along(pixel, pixel + 9), 0.0, "the pixel below");
                }
            }
        }
    }
}
