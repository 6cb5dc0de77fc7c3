//! Separation by codes ([`crate::measure::code_patterns`]): each pixel is lit in half of the photos, near pixels by different codes.
//!
//! Light from a pixel with another code cancels. What does not cancel, from pixels with the same code, is an error of the direct light. Pixels with other
//! codes send light of the same size, which shows in the residuals, so that the standard errors include it.
//!
//! The patterns change from pixel to pixel. Projector and camera have to be in focus.

use super::Separation;
use super::high_frequency::Fit;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::measure::code_patterns;
use crate::operator::Operator;

/// Separates with so many photos by `operator` (`n × n`, all of the light): a power of two, at least 4.
///
/// # Errors
/// [`Error::Option`] for another number of photos; [`Error::Dimension`] if sizes differ; any error of the operator.
pub fn codes(operator: &mut dyn Operator, resolution: Resolution, photos: usize) -> Result<Separation> {
    check(photos)?;
    let mut fit = Fit::new(operator, resolution)?;
    fit.take(operator, code_patterns(resolution, photos))?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Closure, Symmetry};

    const SIZE: Resolution = Resolution { width: 14, height: 12 };

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
