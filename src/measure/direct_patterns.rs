//! The patterns from whose photos direct light is fitted.
//!
//! A blur keeps the shape of a checkerboard of two pixels: it is an eigenvector of every blur, away from the raster's border, and its lower contrast looks the
//! same as less direct light. [Codes](code_patterns) hold all frequencies, so that their photos tell the blur, and tell light of near pixels
//! from the pixel's own. Their patterns change from pixel to pixel, which the camera must resolve. Where it does not, or where the spread of its pixels is not
//! known, squares of four pixels serve, whose edges show the blur.

use super::calibration::Registration;
use crate::image::Resolution;

/// With so many camera pixels for each of the projector's, the camera resolves single pixels.
const RESOLVES: usize = 4;

/// Photos of codes: as many as of shifted squares.
const CODES: usize = 8;

/// A set of patterns for direct light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DirectPatterns {
    /// Near pixels are lit by different codes.
    Codes,
    /// A checkerboard of squares with this side, shifted step by step.
    Squares(usize),
}

impl DirectPatterns {
    /// What suits a pixel map. Runs by calibrations that know no map of the lens were taken with squares of four pixels, and can still be asked.
    pub(crate) fn of(registration: &Registration) -> Self {
        let finer = registration.camera.pixels() >= RESOLVES * registration.projector.pixels();
        if finer && registration.lens.is_some() { Self::Codes } else { Self::Squares(4) }
    }

    /// The patterns. Each pixel is lit in about half of them. Pixels that are not `lit` stay dark.
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

/// The shifted checkerboards.
fn squares(resolution: Resolution, side: usize) -> Vec<Vec<f64>> {
    // The shift is half a square: each pixel is at least once well inside a bright square, and once well
    // inside a dark one.
    let step = side.div_ceil(2);
    let shifts = |to: usize| (0..to).step_by(step);
    let pattern = |right: usize, down: usize| {
        (0..resolution.pixels())
            .map(|pixel| {
                let (x, y) = (pixel % resolution.width + right, pixel / resolution.width + down);
                f64::from(u8::from((x / side + y / side).is_multiple_of(2)))
            })
            .collect()
    };
    shifts(side)
        .flat_map(|down| shifts(2 * side).map(move |right| (right, down)))
        .map(|(x, y)| pattern(x, y))
        .collect()
}

// Codes: patterns in which each pixel is lit in half of the photos, near pixels by different codes.
//
// The photos in which a pixel is lit are its code, a row of a Hadamard matrix. Two different codes are orthogonal, so that light from a pixel with
// another code cancels exactly in the correlation of the photos with the pixel's own code. Pixels with the same code are about `√photos` pixels apart. In
// every second row of the picture the codes are inverted, so that even global light from pixels with the same code cancels, too.

/// The patterns of so many `photos`, a power of two from 4 on: 1 where a pixel is lit, 0 elsewhere; each of `n` values.
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

/// The difference between the codes of a pixel and of the pixel below it, for which pixels with the same code are farthest from each other. There are
/// so many `codes`, which are numbered along each row of the picture.
fn step(codes: usize) -> usize {
    let nearest = |step: usize| {
        let below = |y: usize| {
            let x = step * y % codes;
            (x.min(codes - x)).pow(2) + y * y
        };
        (1..=codes.isqrt() + 1).map(below).min().unwrap_or(0).min(codes * codes)
    };
    // Of equally good ones, the smallest.
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

    /// A blur only takes contrast from a checkerboard of two pixels, and changes the shape of codes.
    #[test]
    fn codes_show_a_blur_that_squares_of_two_pixels_hide() {
        let resolution = Resolution::new(24, 24);
        let blur = Blur::new(resolution, 0.6).expect("a blur");
        let inside = |pixel: &usize| (4..20).contains(&(pixel % 24)) && (4..20).contains(&(pixel / 24));
        // The largest part of a blurred pattern, less its mean, that is no multiple of the pattern.
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
        // The neighbours of a pixel on both sides of a square of two differ, and cancel.
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
            // A square lattice with one point in so many pixels has its nearest points at the root of that number.
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
