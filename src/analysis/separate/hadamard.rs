//! Separation by codes: each pixel is lit in half of the photos. The photos in which it is lit are its code, a row of a Hadamard matrix.
//!
//! Two different codes are orthogonal, so that light from a pixel with another code cancels exactly. Pixels with the same code are about `√photos`
//! pixels apart. In every second row of the picture the codes are inverted, so that even global light from pixels with the same code cancels, too.
//! What does not cancel is an error of the direct light. Pixels with other codes send light of the same size, which shows in the residuals, so that
//! the standard errors include it.
//!
//! The patterns change from pixel to pixel. Projector and camera have to be in focus.

use super::Separation;
use super::high_frequency::Fit;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::operator::Operator;

/// Separates with so many photos by `operator` (`n × n`, all of the light): a power of two, at least 4.
///
/// # Errors
/// [`Error::Option`] for another number of photos; [`Error::Dimension`] if sizes differ; any error of the operator.
pub fn codes(operator: &mut dyn Operator, resolution: Resolution, photos: usize) -> Result<Separation> {
    check(photos)?;
    let mut fit = Fit::new(operator, resolution)?;
    let step = step(photos - 1);
    let patterns = (0..photos).map(|photo| {
        let lit = |pixel: usize| {
            let (x, y) = (pixel % resolution.width, pixel / resolution.width);
            let code = (x + step * y) % (photos - 1) + 1;
            // The entry of Sylvester's Hadamard matrix is −1 where an odd number of bits is set in both indices.
            let signs = (code & photo).count_ones() + y as u32 % 2;
            f64::from(u8::from(signs.is_multiple_of(2)))
        };
        (0..resolution.pixels()).map(lit).collect()
    });
    fit.take(operator, patterns)?;
    Ok(fit.separation())
}

/// Refuses a number of photos that holds no whole set of codes.
pub(super) fn check(photos: usize) -> Result<()> {
    if !(photos.is_power_of_two() && (4..=1 << 16).contains(&photos)) {
        return Err(Error::Option {
            option: "--photos".into(),
            fault: format!(
                "codes need a power of two as the number of photos, at least 4, and this is {photos}"
            ),
            help: "give 8, 16 or 32; 16 is usual".into(),
        });
    }
    Ok(())
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
    use crate::operator::{Closure, Symmetry};

    const SIZE: Resolution = Resolution { width: 14, height: 12 };

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

    /// Direct light, light between neighbours, and light of the same strength from everywhere.
    fn seen(x: &[f64], y: &mut [f64]) {
        let even = x.iter().sum::<f64>() / x.len() as f64;
        for (pixel, y) in y.iter_mut().enumerate() {
            let (column, row) = (pixel % SIZE.width, pixel / SIZE.width);
            let mut near = 0.0;
            for (at, there) in [
                (pixel.wrapping_sub(1), column > 0),
                (pixel + 1, column + 1 < SIZE.width),
                (pixel.wrapping_sub(SIZE.width), row > 0),
                (pixel + SIZE.width, row + 1 < SIZE.height),
            ] {
                near += if there { x[at] } else { 0.0 };
            }
            *y = (1.0 + pixel as f64 / 100.0) * x[pixel] + 0.2 * near + even;
        }
    }

    fn separated(photos: usize) -> Result<Separation> {
        let n = SIZE.pixels();
        let mut operator = Closure::new(n, n, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
            seen(x, y);
            Ok(())
        });
        codes(&mut operator, SIZE, photos)
    }

    /// The largest error of the direct light, and the largest that is stated.
    fn off(found: &Separation) -> [f64; 2] {
        let error = |(pixel, direct): (usize, &f64)| (direct - 1.0 - pixel as f64 / 100.0).abs();
        let stated = found.standard_error.iter().flatten().fold(0.0, |most: f64, error| most.max(*error));
        [found.direct.iter().enumerate().map(error).fold(0.0, f64::max), stated]
    }

    #[test]
    fn light_of_neighbours_is_no_direct_light() -> Result<()> {
        let found = separated(16)?;
        assert_eq!(found.photos, 16);
        let [error, stated] = off(&found);
        // Each of four neighbours sends 0.2, and cancels. The even light is 1 from 168 pixels: 0.006 from each of some 11 with the same code.
        assert!(error < 0.03 && error < 3.0 * stated, "{error}, stated {stated}");
        Ok(())
    }

    #[test]
    fn a_number_that_is_no_power_of_two_is_refused_by_name() {
        for photos in [0, 2, 12, 40] {
            assert!(matches!(separated(photos), Err(Error::Option { option, .. }) if option == "--photos"));
        }
    }
}
