//! Separation by shifted patterns of high spatial frequency.
//!
//! If a pattern lights half of all pixels and alternates faster than global light varies, a pixel sees `y = D p + G/2`, where `p` is the
//! pattern's value at the pixel. Least squares over the shifts gives `D` as the slope of `y` over `p`, and `G` as twice the intercept. For
//! patterns of two values, this is Nayar's `max − min`.
//!
//! The residuals around the line are noise, and global light that varies with the pattern. Their mean square `s²` (the sum of squares
//! divided by the number of photos minus two) gives the standard errors `s/√Σ(p − p̄)²` of `D` and `2 s √(1/m + p̄²/Σ(p − p̄)²)` of `G`.
//! They do not cover the global light that a pixel receives from its surroundings within a square, because this light follows the pattern
//! as direct light does.

use crate::analysis::probe::Homes;
use crate::analysis::separate::Separation;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::operator::{Operator, check_square, each_product};

/// Sinusoids with a period of `period` pixels and `phases` evenly spaced phases, along rows and along columns.
pub(super) fn waves(resolution: Resolution, period: f64, phases: usize) -> impl Iterator<Item = Vec<f64>> {
    (0..2 * phases).map(move |photo| {
        let (along_rows, shift) = (photo < phases, (photo % phases) as f64 / phases as f64);
        pattern(resolution, |x, y| {
            let at = if along_rows { x } else { y } as f64 + 0.5;
            0.5 + 0.5 * (std::f64::consts::TAU * (at / period + shift)).cos()
        })
    })
}

/// Refuses squares that cannot be shifted to this number of positions.
pub(super) fn check_checkerboards(square: usize, shifts: usize) -> Result<()> {
    if square == 0 || shifts < 2 || shifts > 2 * square {
        return Err(Error::option(
            "--square",
            format!("squares of {square} pixels cannot be shifted to {shifts} places"),
        )
        .help("give squares of at least 1 pixel, and from 2 to twice as many shifts"));
    }
    Ok(())
}

/// Refuses waves whose photos cannot distinguish direct from global light.
pub(super) fn check_sinusoids(period: f64, phases: usize) -> Result<()> {
    if !(period >= 2.0 && period.is_finite()) {
        return Err(Error::option("--period", format!("a period of {period} pixels"))
            .help("give at least 2 pixels; 6 is usual"));
    }
    if phases < 3 {
        return Err(Error::option("--phases", format!("{phases} phases tell no wave from an even light"))
            .help("give at least 3"));
    }
    Ok(())
}

fn pattern(resolution: Resolution, value: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let value = &value;
    (0..resolution.height).flat_map(|y| (0..resolution.width).map(move |x| value(x, y))).collect()
}

/// The sums of a camera pixel for the line `y = D p + G/2` through its values `y` in the photos so far.
#[derive(Clone, Copy, Default)]
struct Sums {
    p: f64,
    y: f64,
    pp: f64,
    py: f64,
    yy: f64,
}

impl Sums {
    /// Returns `D`, `G` and their standard errors from `count` photos.
    fn line(&self, count: f64) -> [f64; 4] {
        if self.p == 0.0 {
            let all = 2.0 * self.y / count;
            return [0.0, all, all.abs(), all.abs()];
        }
        let spread = self.pp - self.p * self.p / count;
        if spread <= 1e-9 * count {
            // If the pattern never changed, nothing can be separated. All light then counts as direct, with an equally large standard
            // error.
            let direct = self.y / self.p.max(f64::MIN_POSITIVE);
            return [direct, 2.0 * (self.y - direct * self.p) / count, direct.abs(), direct.abs()];
        }
        let shared = self.py - self.p * self.y / count;
        let direct = shared / spread;
        let around = (self.yy - self.y * self.y / count - direct * shared).max(0.0);
        let variance = around / (count - 2.0);
        let mean = self.p / count;
        [
            direct,
            2.0 * (self.y - direct * self.p) / count,
            (variance / spread).sqrt(),
            2.0 * (variance * (1.0 / count + mean * mean / spread)).sqrt(),
        ]
    }
}

/// Separates by least-squares lines `y = D p + G/2` through the photos of these patterns. `p` is the pattern's value at the home of a camera
/// pixel, or at the same pixel without homes. The direct light of a pixel without a home is 0, with an error as large as all its light.
pub(super) fn lines(
    operator: &mut dyn Operator,
    homes: Option<&Homes>,
    patterns: impl Iterator<Item = Vec<f64>>,
) -> Result<Separation> {
    let mut sums = vec![Sums::default(); operator.rows()];
    match homes {
        Some(homes) => Error::check_size("homes of camera pixels", sums.len(), homes.len())?,
        None => check_square("the transport operator of a separation", sums.len(), operator)?,
    }
    let mut photos = 0;
    each_product(operator, patterns, |pattern, photo| {
        photos += 1;
        for (pixel, (sums, y)) in sums.iter_mut().zip(photo).enumerate() {
            let home = homes.map_or(Some(pixel), |homes| homes[pixel]);
            let p = home.map_or(0.0, |home| pattern[home]);
            sums.p += p;
            sums.y += y;
            sums.pp += p * p;
            sums.py += p * y;
            sums.yy += y * y;
        }
        Ok(())
    })?;
    let lines: Vec<[f64; 4]> = sums.iter().map(|sums| sums.line(photos as f64)).collect();
    let of = |which: usize| lines.iter().map(|line| line[which]).collect();
    Ok(Separation {
        direct: of(0),
        global: of(1),
        standard_error: Some(of(2)),
        global_error: Some(of(3)),
        photos,
    })
}

/// The largest standard errors of `D` and `G` that photos with these errors leave in [`lines`]: each photo's error times its share in the
/// result, added up.
pub(super) fn errors_of_lines(
    homes: Option<&Homes>,
    patterns: Vec<Vec<f64>>,
    errors: impl Fn(&[f64]) -> Vec<f64>,
) -> [Vec<f64>; 2] {
    let count = patterns.len() as f64;
    let photos: Vec<Vec<f64>> = patterns.iter().map(|pattern| errors(pattern)).collect();
    let of = |pixel: usize| -> [f64; 2] {
        let home = homes.map_or(Some(pixel), |homes| homes[pixel]);
        let seen = || patterns.iter().map(|pattern| home.map_or(0.0, |home| pattern[home]));
        let mean = seen().sum::<f64>() / count;
        let spread = seen().map(|p| (p - mean).powi(2)).sum::<f64>();
        seen().zip(&photos).fold([0.0; 2], |[direct, global], (p, errors)| {
            let share = if spread > 1e-9 * count { (p - mean) / spread } else { 0.0 };
            let error = errors[pixel];
            [direct + share.abs() * error, global + (2.0 / count - 2.0 * mean * share).abs() * error]
        })
    };
    let found: Vec<[f64; 2]> = (0..photos.first().map_or(0, Vec::len)).map(of).collect();
    [0, 1].map(|which| found.iter().map(|pair| pair[which]).collect())
}

// Separation by codes (`crate::measure::code_patterns`): each pixel is lit in half of the photos, and near pixels have different codes.
//
// Light from a pixel with another code cancels. Light from pixels with the same code does not cancel and is an error of the direct light.
// Pixels with other codes send light of the same size, which appears in the residuals, so the standard errors include it. The patterns
// change from pixel to pixel, so projector and camera must be in focus.

/// Refuses a number of photos that does not make a complete set of codes.
pub(super) fn check_codes(photos: usize) -> Result<()> {
    if !(photos.is_power_of_two() && (4..=1 << 16).contains(&photos)) {
        return Err(Error::option(
            "--photos",
            format!("codes need a power of two as the number of photos, at least 4, and this is {photos}"),
        )
        .help("give 8, 16 or 32; 16 is usual"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::separate::{SeparateBy, separate};
    use crate::krylov::dot;
    use crate::operator::{Closure, Symmetry};

    /// `diag(d) + u uᵀ/n`, where all entries of `u` are 1: constant global light, as the method assumes.
    struct Even;

    impl Operator for Even {
        fn rows(&self) -> usize {
            8 * 12
        }

        fn cols(&self) -> usize {
            8 * 12
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            let global = dot(x, &vec![1.0; x.len()]) / x.len() as f64;
            for (i, y) in y.iter_mut().enumerate() {
                *y = (1.0 + i as f64) * x[i] + global;
            }
            Ok(())
        }
    }

    #[test]
    fn under_even_global_light_both_are_exact() -> Result<()> {
        let resolution = Resolution::new(12, 8);
        let found = [
            SeparateBy::Checkerboards { square: 1, shifts: 2 }.measure(&mut Even, resolution, 0)?,
            SeparateBy::Checkerboards { square: 2, shifts: 4 }.measure(&mut Even, resolution, 0)?,
            // The periods divide the raster, so each wave lights half of the pixels on average.
            SeparateBy::Sinusoids { period: 4.0, phases: 3 }.measure(&mut Even, resolution, 0)?,
        ];
        for (separation, photos) in found.iter().zip([4, 16, 6]) {
            assert_eq!(separation.photos, photos);
            for i in 0..96 {
                assert!((separation.direct[i] - 1.0 - i as f64).abs() < 1e-12, "direct at {i}");
                assert!((separation.global[i] - 1.0).abs() < 1e-10, "global at {i}");
                // The photos lie on the line, up to the rounding of squares, which is the root of 1e-16 × 96².
                let errors = [&separation.standard_error, &separation.global_error];
                assert!(errors.iter().all(|of| of.as_ref().is_some_and(|of| of[i] < 1e-5)), "errors at {i}");
            }
        }
        assert!(
            SeparateBy::Checkerboards { square: 2, shifts: 5 }.measure(&mut Even, resolution, 0).is_err()
                && SeparateBy::Sinusoids { period: 1.0, phases: 3 }
                    .measure(&mut Even, resolution, 0)
                    .is_err()
                && SeparateBy::Sinusoids { period: 4.0, phases: 2 }
                    .measure(&mut Even, resolution, 0)
                    .is_err()
        );
        Ok(())
    }

    /// Camera and projector have different sizes, and one camera pixel sees nothing of the projector directly.
    #[test]
    fn between_two_sizes_both_are_exact_by_the_map() -> Result<()> {
        let (camera, projector) = (Resolution::new(7, 5), Resolution::new(12, 8));
        let home = |pixel: usize| (pixel > 0).then_some(pixel * 37 % projector.pixels());
        let homes: Vec<Option<usize>> = (0..camera.pixels()).map(home).collect();
        let photo = |x: &[f64], y: &mut [f64]| {
            let global = x.iter().sum::<f64>() / x.len() as f64;
            let direct = |pixel: usize| homes[pixel].map_or(0.0, |home| (1.0 + pixel as f64) * x[home]);
            y.iter_mut().enumerate().for_each(|(pixel, y)| *y = direct(pixel) + global);
            Ok(())
        };
        let mut operator = Closure::new(camera.pixels(), projector.pixels(), Symmetry::General, photo);
        for by in [
            SeparateBy::Checkerboards { square: 2, shifts: 4 },
            SeparateBy::Sinusoids { period: 4.0, phases: 3 },
        ] {
            let found = separate(&mut operator, (projector, Some(&homes)), by, 0)?;
            for pixel in 1..camera.pixels() {
                assert!((found.direct[pixel] - 1.0 - pixel as f64).abs() < 1e-10, "direct at {pixel}");
                assert!((found.global[pixel] - 1.0).abs() < 1e-9, "global at {pixel}");
            }
            let errors = found.standard_error.unwrap_or_default();
            assert!(found.direct[0] == 0.0 && (found.global[0] - errors[0]).abs() < 1e-12);
        }
        for (by, homes) in [
            (SeparateBy::Random { photos: 4 }, Some(&homes[..])),
            (SeparateBy::Checkerboards { square: 2, shifts: 4 }, None),
        ] {
            let refused = separate(&mut operator, (projector, homes), by, 0);
            assert!(matches!(refused, Err(Error::Option { option, .. }) if option == "--by"));
        }
        Ok(())
    }

    /// Errors with the signs of a photo's share in the result reach the stated error.
    #[test]
    fn the_errors_of_predicted_photos_bound_what_they_change() -> Result<()> {
        let resolution = Resolution::new(12, 8);
        let by = SeparateBy::Checkerboards { square: 2, shifts: 4 };
        let exact = by.measure(&mut Even, resolution, 0)?;
        let stated = exact.clone().of_model(by, (resolution, None), |x| vec![0.1; x.len()]);
        let errors = [stated.standard_error.unwrap_or_default(), stated.global_error.unwrap_or_default()];
        let mut largest = [0.0_f64; 2];
        for sign in [1.0, -1.0] {
            for which in [0.0, 1.0] {
                // Errors that follow the pattern change the direct light most, and errors where it is dark the global light.
                let n = resolution.pixels();
                let mut wrong = Closure::new(n, n, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
                    Even.apply(x, y)?;
                    let error = |x: f64| if which == 0.0 { 0.1 * (2.0 * x - 1.0) } else { 0.1 };
                    y.iter_mut().zip(x).for_each(|(y, x)| *y += sign * error(*x));
                    Ok(())
                });
                let found = by.measure(&mut wrong, resolution, 0)?;
                for (at, (a, b)) in
                    [(&found.direct, &exact.direct), (&found.global, &exact.global)].into_iter().enumerate()
                {
                    for (pixel, (a, b)) in a.iter().zip(b).enumerate() {
                        assert!((a - b).abs() <= errors[at][pixel] * (1.0 + 1e-6), "{at} at {pixel}");
                        largest[at] = largest[at].max((a - b).abs() / errors[at][pixel]);
                    }
                }
            }
        }
        assert!(largest.iter().all(|largest| *largest > 0.99), "{largest:?}");
        let random = SeparateBy::Random { photos: 4 };
        let found = random
            .measure(&mut Even, resolution, 0)?
            .of_model(random, (resolution, None), |x| vec![0.1; x.len()]);
        assert!(found.standard_error.is_none() && found.global_error.is_none());
        Ok(())
    }

    /// The light of `Even`, with noise of a standard deviation of 0.5 in each pixel of each photo.
    struct Noisy(u64);

    impl Operator for Noisy {
        fn rows(&self) -> usize {
            Even.rows()
        }

        fn cols(&self) -> usize {
            Even.cols()
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            Even.apply(x, y)?;
            self.0 += 1;
            let noise = crate::krylov::Start::Gaussian { seed: self.0 }.vector(y.len());
            y.iter_mut().zip(noise).for_each(|(y, noise)| *y += 0.5 * noise);
            Ok(())
        }
    }

    #[test]
    fn standard_errors_are_those_of_direct_and_global_light() -> Result<()> {
        let resolution = Resolution::new(12, 8);
        let mut noisy = Noisy(0);
        let mut squares = [0.0; 2];
        let runs = 50;
        for _ in 0..runs {
            let found =
                SeparateBy::Checkerboards { square: 2, shifts: 4 }.measure(&mut noisy, resolution, 0)?;
            let errors = [found.standard_error.unwrap_or_default(), found.global_error.unwrap_or_default()];
            let direct = found.direct.iter().enumerate().map(|(pixel, value)| value - 1.0 - pixel as f64);
            let global = found.global.iter().map(|value| value - 1.0);
            let square = |(off, error): (f64, &f64)| (off / error).powi(2);
            squares[0] += direct.zip(&errors[0]).map(square).sum::<f64>();
            squares[1] += global.zip(&errors[1]).map(square).sum::<f64>();
        }
        for square in squares {
            // Student's t of 14 degrees of freedom has the variance 14/12. Its rms over 4800 draws has a standard deviation of 1.2 %, and
            // four of these deviations are allowed.
            let rms = (square / (96 * runs) as f64).sqrt();
            assert!((rms - (14.0_f64 / 12.0).sqrt()).abs() < 0.05, "{rms}");
        }
        Ok(())
    }

    const SIZE: Resolution = Resolution { width: 14, height: 12 };

    /// Under white, direct light of 1 or more, light of 0.2 from each neighbour, and even light of 1 from all pixels together.
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
        SeparateBy::Codes { photos }.measure(&mut operator, SIZE, 0)
    }

    /// The largest error of the direct light, and the largest stated error.
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
        // The light of 0.2 from each of the four neighbours cancels. The even light is 1 from 168 pixels: 0.006 each from about 11 pixels
        // with equal codes.
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
