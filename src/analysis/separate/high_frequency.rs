//! Separation by shifted patterns of high spatial frequency.
//!
//! Under a half-lit pattern that alternates faster than global light varies, a pixel sees `y = D p + G/2`, where `p` is the
//! pattern at the pixel itself. Least squares over the shifts gives `D` as the slope of `y` over `p`, and `G` as twice the
//! intercept; for two-valued patterns this is Nayar's `max − min`.

use super::Separation;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::operator::{Operator, each_product};

/// Separates with `shifts²` photos by `operator` (`n × n`, all of the light) of checkerboards of `square` pixels per square,
/// shifted in steps of `2·square/shifts` pixels in both directions. Nayar et al. take 5² photos with squares of 3 or more pixels.
///
/// # Errors
/// [`Error::Option`] for an invalid `square` or `shifts`; [`Error::Dimension`] if sizes differ; any error of the operator.
pub fn checkerboards(
    operator: &mut dyn Operator,
    resolution: Resolution,
    square: usize,
    shifts: usize,
) -> Result<Separation> {
    if square == 0 || shifts < 2 || shifts > 2 * square {
        return Err(Error::Option {
            option: "--square".into(),
            fault: format!("squares of {square} pixels cannot be shifted to {shifts} places"),
            help: "give squares of at least 1 pixel, and from 2 to twice as many shifts".into(),
        });
    }
    let offset = |shift: usize| shift * 2 * square / shifts;
    let mut fit = Fit::new(operator, resolution)?;
    let patterns = (0..shifts * shifts).map(|shift| {
        let (row, column) = (shift / shifts, shift % shifts);
        pattern(resolution, |x, y| {
            let squares = (x + offset(column)) / square + (y + offset(row)) / square;
            f64::from(u8::from(squares.is_multiple_of(2)))
        })
    });
    fit.take(operator, patterns)?;
    Ok(fit.separation())
}

/// Separates with `2·phases` photos by `operator` (`n × n`) of sinusoids with a period of `period` pixels at `phases` evenly
/// spaced phases, along rows and along columns.
///
/// # Errors
/// [`Error::Option`] for a period below 2 pixels or fewer than 3 phases; [`Error::Dimension`] if sizes differ; as the operator.
pub fn sinusoids(
    operator: &mut dyn Operator,
    resolution: Resolution,
    period: f64,
    phases: usize,
) -> Result<Separation> {
    if !(period >= 2.0 && period.is_finite()) {
        return Err(Error::Option {
            option: "--period".into(),
            fault: format!("a period of {period} pixels"),
            help: "give at least 2 pixels; 6 is usual".into(),
        });
    }
    if phases < 3 {
        return Err(Error::Option {
            option: "--phases".into(),
            fault: format!("{phases} phases tell no wave from an even light"),
            help: "give at least 3".into(),
        });
    }
    let mut fit = Fit::new(operator, resolution)?;
    let patterns = (0..2 * phases).map(|photo| {
        let (along_rows, shift) = (photo < phases, (photo % phases) as f64 / phases as f64);
        pattern(resolution, |x, y| {
            let at = if along_rows { x } else { y } as f64 + 0.5;
            0.5 + 0.5 * (std::f64::consts::TAU * (at / period + shift)).cos()
        })
    });
    fit.take(operator, patterns)?;
    Ok(fit.separation())
}

fn pattern(resolution: Resolution, value: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let value = &value;
    (0..resolution.height).flat_map(|y| (0..resolution.width).map(move |x| value(x, y))).collect()
}

/// The least-squares line `y = D p + G/2` of each pixel through the photos so far.
struct Fit {
    photos: usize,
    sums: Vec<Sums>,
}

#[derive(Clone, Copy, Default)]
struct Sums {
    p: f64,
    y: f64,
    pp: f64,
    py: f64,
}

impl Fit {
    fn new(operator: &dyn Operator, resolution: Resolution) -> Result<Self> {
        let n = resolution.pixels();
        if operator.rows() != n || operator.cols() != n {
            return Err(Error::Dimension {
                what: "the transport operator of a separation",
                expected: format!("{n}x{n}"),
                found: format!("{}x{}", operator.rows(), operator.cols()),
            });
        }
        Ok(Self { photos: 0, sums: vec![Sums::default(); n] })
    }

    fn take(&mut self, operator: &mut dyn Operator, patterns: impl Iterator<Item = Vec<f64>>) -> Result<()> {
        each_product(operator, patterns, |pattern, photo| {
            self.photos += 1;
            for ((sums, p), y) in self.sums.iter_mut().zip(pattern).zip(photo) {
                sums.p += p;
                sums.y += y;
                sums.pp += p * p;
                sums.py += p * y;
            }
            Ok(())
        })
    }

    fn separation(self) -> Separation {
        let count = self.photos as f64;
        let line = |sums: &Sums| {
            let spread = sums.pp - sums.p * sums.p / count;
            // If the pattern never changed, nothing can be separated: all light counts as direct.
            let direct = if spread > 1e-9 * count {
                (sums.py - sums.p * sums.y / count) / spread
            } else {
                sums.y / sums.p.max(f64::MIN_POSITIVE)
            };
            (direct, 2.0 * (sums.y - direct * sums.p) / count)
        };
        let (direct, global) = self.sums.iter().map(line).unzip();
        Separation { direct, global, standard_error: None, photos: self.photos }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::krylov::dot;
    use crate::operator::Symmetry;

    /// `diag(d) + u uᵀ/n` with `u` of ones: constant global light, as the method assumes.
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
            checkerboards(&mut Even, resolution, 1, 2)?,
            checkerboards(&mut Even, resolution, 2, 4)?,
            // The periods divide the raster, so each wave is half lit on average.
            sinusoids(&mut Even, resolution, 4.0, 3)?,
        ];
        for (separation, photos) in found.iter().zip([4, 16, 6]) {
            assert_eq!(separation.photos, photos);
            for i in 0..96 {
                assert!((separation.direct[i] - 1.0 - i as f64).abs() < 1e-12, "direct at {i}");
                assert!((separation.global[i] - 1.0).abs() < 1e-10, "global at {i}");
            }
        }
        assert!(
            checkerboards(&mut Even, resolution, 2, 5).is_err()
                && sinusoids(&mut Even, resolution, 1.0, 3).is_err()
                && sinusoids(&mut Even, resolution, 4.0, 2).is_err()
        );
        Ok(())
    }
}
