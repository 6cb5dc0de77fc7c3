//! Codes: patterns in which each pixel is lit in half of the photos, near pixels by different codes.
//!
//! The photos in which a pixel is lit are its code, a row of a Hadamard matrix. Two different codes are orthogonal, so that light from a pixel with
//! another code cancels exactly in the correlation of the photos with the pixel's own code. Pixels with the same code are about `√photos` pixels apart. In
//! every second row of the picture the codes are inverted, so that even global light from pixels with the same code cancels, too.

use crate::image::Resolution;

/// The patterns of so many `photos`, a power of two from 4 on: 1 where a pixel is lit, 0 elsewhere; each of `n` values.
pub fn patterns(resolution: Resolution, photos: usize) -> impl Iterator<Item = Vec<f64>> {
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
            let shown: Vec<Vec<f64>> = patterns(resolution, photos).collect();
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
