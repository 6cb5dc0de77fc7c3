//! The displacement of a photo relative to a known pattern, to fractions of a pixel.
//!
//! The photo at `x` shows the pattern at `x + d(x)`, where the displacement `d` is an affine function of `x`. Photo and pattern are blurred
//! equally. Gauss–Newton iteration then finds `d` (Lucas and Kanade, *An iterative image registration technique*, 1981), starting from the
//! best whole-pixel shift.

use super::least_squares::Normal;
use crate::error::{Error, Result};
use crate::image::{Blur, Resolution};

/// The largest whole-pixel shift that is searched. In a small field, the limit is a quarter of the shorter side.
const REACH: i32 = 8;

/// The fit of all unknowns needs at least this many independent residuals per unknown. With fewer residuals, only a shift is fitted.
const EVIDENCE: f64 = 12.0;

/// The shifted pattern must overlap at least this fraction of the photo.
const COMMON: f64 = 0.5;

/// This many pixels count as one independent residual, because the blur correlates neighbouring pixels. A Gaussian blur of standard
/// deviation `σ` gives `4π σ²`.
const CORRELATED: f64 = 4.0 * std::f64::consts::PI * BLUR * BLUR;

/// The largest number of iterations. A few suffice, because the iteration starts from the best whole-pixel shift.
const STEPS: usize = 12;

/// The number of unknowns: two for offset and contrast of the photo, and six for `d` (two of the shift, four of rotation, scale and shear).
const UNKNOWNS: usize = 8;

/// The number of unknowns without rotation, scale and shear.
const SHIFT: usize = 4;

/// The displacement of a photo.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Displacement {
    /// The largest displacement over the field's corners and centre, in projector pixels.
    pub off: f64,
    /// The standard error of `off`.
    pub error: f64,
    /// The displacement at the centre, in projector pixels to the right and down.
    pub shift: [f64; 2],
    /// The correlation of pattern and photo after the displacement is corrected. It is 1 for equal pictures.
    pub agreement: f64,
}

/// Measures the displacement of photos relative to their patterns. `pairs` holds pairs of pattern and photo. Only pixels that are `used`
/// count. Fails with [`Error::Numerical`] when the photos do not show the patterns.
pub(crate) fn displacement(
    size: Resolution,
    pairs: &[(Vec<f64>, Vec<f64>)],
    used: &[bool],
) -> Result<Displacement> {
    let whole = vec![true; size.pixels()];
    let mut pictures = Pictures { size, patterns: Vec::new(), points: Vec::new() };
    for (number, (pattern, seen)) in pairs.iter().enumerate() {
        let (Some(pattern), Some(seen)) = (band(size, pattern, &whole), band(size, seen, used)) else {
            return Err(unseen());
        };
        pictures.patterns.push(pattern);
        pictures.points.extend((0..size.pixels()).filter(|&pixel| used[pixel]).map(|pixel| Point {
            pattern: number,
            at: [(pixel % size.width) as f64, (pixel / size.width) as f64],
            seen: seen[pixel],
        }));
    }
    let mut d = Affine { size, by: [0.0; 6] };
    [d.by[0], d.by[1]] = pictures.best_shift();
    let covariance = pictures.refine(&mut d)?;
    let last = [size.width as f64 - 1.0, size.height as f64 - 1.0];
    let centre = last.map(|last| 0.5 * last);
    let sizes = [[0.0, 0.0], [last[0], 0.0], [0.0, last[1]], last, centre].map(|at| {
        let [right, down] = d.at(at);
        (right.hypot(down), d.error(at, &covariance))
    });
    let larger = |worst: (f64, f64), found: (f64, f64)| if found.0 >= worst.0 { found } else { worst };
    let (off, error) = sizes.into_iter().fold((0.0, 0.0), larger);
    Ok(Displacement { off, error, shift: d.at(centre), agreement: pictures.agreement(|at| d.at(at)) })
}

/// The affine displacement `d(x)`. The first two coefficients are the shift. Two coefficients per axis describe the linear part, which
/// grows from the centre to the corners.
struct Affine {
    size: Resolution,
    by: [f64; 6],
}

impl Affine {
    /// Converts to coordinates that are 0 at the centre and about 1 at the corner.
    fn relative(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [width, height] = [self.size.width as f64, self.size.height as f64];
        let unit = 0.5 * width.hypot(height);
        [(x - 0.5 * (width - 1.0)) / unit, (y - 0.5 * (height - 1.0)) / unit]
    }

    fn at(&self, at: [f64; 2]) -> [f64; 2] {
        let ([u, v], d) = (self.relative(at), &self.by);
        [d[0] + d[2] * u + d[3] * v, d[1] + d[4] * u + d[5] * v]
    }

    /// The standard error of the displacement along the axis that has the larger error. `covariance` is the covariance of all unknowns.
    fn error(&self, at: [f64; 2], covariance: &[f64]) -> f64 {
        let [u, v] = self.relative(at);
        let variance = |first: usize| {
            let row = [(first, 1.0), (2 * first, u), (2 * first + 1, v)];
            let along = |(i, a): (usize, f64)| {
                row.iter().map(|&(j, b)| a * b * covariance[i * UNKNOWNS + j]).sum::<f64>()
            };
            row.into_iter().map(along).sum::<f64>()
        };
        variance(2).max(variance(3)).max(0.0).sqrt()
    }
}

/// All patterns and photos after the band-pass.
struct Pictures {
    size: Resolution,
    patterns: Vec<Vec<f64>>,
    points: Vec<Point>,
}

/// A pixel of a photo: the index of its pattern, its place and its value.
struct Point {
    pattern: usize,
    at: [f64; 2],
    seen: f64,
}

impl Pictures {
    /// The correlation of the photos with the displaced patterns. It is −∞ when photos and patterns overlap too little.
    fn agreement(&self, d: impl Fn([f64; 2]) -> [f64; 2]) -> f64 {
        let pair = |point: &Point| {
            let [right, down] = d(point.at);
            let at = [point.at[0] + right, point.at[1] + down];
            Some((value(&self.patterns[point.pattern], self.size, at)?, point.seen))
        };
        let pairs: Vec<(f64, f64)> = self.points.iter().filter_map(pair).collect();
        if (pairs.len() as f64) < COMMON * self.points.len() as f64 {
            return f64::NEG_INFINITY;
        }
        correlation(pairs.into_iter())
    }

    fn best_shift(&self) -> [f64; 2] {
        let reach = REACH.min(self.size.width.min(self.size.height) as i32 / 4);
        let shifts = (-reach..=reach).flat_map(|down| (-reach..=reach).map(move |right| [right, down]));
        let shifts = shifts.map(|shift| shift.map(f64::from)).map(|shift| (self.agreement(|_| shift), shift));
        let better =
            |best: (f64, [f64; 2]), found: (f64, [f64; 2])| if found.0 > best.0 { found } else { best };
        shifts.fold((f64::NEG_INFINITY, [0.0; 2]), better).1
    }

    /// Improves `d` by Gauss–Newton iteration. Returns the covariance of all unknowns, in pixels².
    fn refine(&self, d: &mut Affine) -> Result<Vec<f64>> {
        let mut covariance = vec![0.0; UNKNOWNS * UNKNOWNS];
        let is_rich = self.points.len() as f64 > EVIDENCE * UNKNOWNS as f64 * CORRELATED;
        let unknowns = if is_rich { UNKNOWNS } else { SHIFT };
        for _ in 0..STEPS {
            let rows: Vec<([f64; UNKNOWNS], f64)> =
                self.points.iter().filter_map(|point| Some((self.row(d, point)?, point.seen))).collect();
            let mut normal = Normal::new(unknowns);
            rows.iter().for_each(|(row, seen)| normal.add_full(&row[..unknowns], *seen, 1.0));
            let found = normal.damped(1e-9).solve()?;
            let amplitude = found.values[1];
            if amplitude <= 0.0 {
                return Err(unseen());
            }
            let residual = |(row, seen): &([f64; UNKNOWNS], f64)| {
                seen - row.iter().zip(&found.values).map(|(a, x)| a * x).sum::<f64>()
            };
            let squares: f64 = rows.iter().map(|row| residual(row).powi(2)).sum();
            let scale = squares / rows.len() as f64 * CORRELATED / amplitude.powi(2);
            for (number, entry) in found.covariance.iter().enumerate() {
                covariance[number / unknowns * UNKNOWNS + number % unknowns] = entry * scale;
            }
            // The gradients are valid only within one pixel, so no step is longer.
            let step: Vec<f64> =
                found.values[2..].iter().map(|value| (value / amplitude).clamp(-1.0, 1.0)).collect();
            d.by.iter_mut().zip(&step).for_each(|(d, step)| *d += step);
            if step.iter().all(|step| step.abs() < 1e-5) {
                break;
            }
        }
        Ok(covariance)
    }

    /// The derivatives of the expected value at a point with respect to the unknowns. It is `None` when the displaced point lies outside.
    fn row(&self, d: &Affine, point: &Point) -> Option<[f64; UNKNOWNS]> {
        let [right, down] = d.at(point.at);
        let [x, y] = [point.at[0] + right, point.at[1] + down];
        let near = |dx: f64, dy: f64| value(&self.patterns[point.pattern], self.size, [x + dx, y + dy]);
        let [gx, gy] =
            [near(1.0, 0.0)? - near(-1.0, 0.0)?, near(0.0, 1.0)? - near(0.0, -1.0)?].map(|two| 0.5 * two);
        let [u, v] = d.relative(point.at);
        Some([1.0, near(0.0, 0.0)?, gx, gy, gx * u, gx * v, gy * u, gy * v])
    }
}

fn unseen() -> Error {
    Error::Numerical(
        "a pattern is not seen where the calibration's map expects it\n  help: calibrate the rig again: krylux rig calibrate"
            .into(),
    )
}

/// The standard deviation of the narrow blur, in pixels. It widens edges so much that the iteration converges from a pixel away.
pub(crate) const BLUR: f64 = 1.2;

/// The standard deviation of the wide blur, in pixels. Global light varies over longer distances than this.
const SLOW: f64 = 3.0;

/// The band-pass of a picture: the difference of a narrow and a wide blur of the `used` pixels. It is `None` when a blur has no width.
pub(crate) fn band(size: Resolution, picture: &[f64], used: &[bool]) -> Option<Vec<f64>> {
    let of_used = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..size.pixels()).map(|pixel| if used[pixel] { of(pixel) } else { 0.0 }).collect()
    };
    let [values, weights] = [of_used(&|pixel| picture[pixel]), of_used(&|_| 1.0)];
    let [fine, slow] = [BLUR, SLOW].map(|deviation| {
        let blur = Blur::new(size, deviation)?;
        let pairs = blur.apply(&values).into_iter().zip(blur.apply(&weights));
        // The weight is 0 far from all used pixels. The quotient is not used there.
        Some(pairs.map(|(sum, weight)| sum / weight.max(1e-6)).collect::<Vec<f64>>())
    });
    Some(fine?.iter().zip(slow?).map(|(fine, slow)| fine - slow).collect())
}

/// The bilinear value of a picture at a point, in pixels from the centre of the first pixel. It is `None` outside the picture.
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

/// Pearson's correlation. It is −∞ when one of the two variables is constant.
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

    const SIZE: Resolution = Resolution { width: 64, height: 48 };

    /// Squares of four pixels that are bright or dark, depending on a hash of their position.
    fn squares() -> Vec<f64> {
        let bit = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) / 7).is_multiple_of(2);
        let light = |pixel: usize| bit(pixel % SIZE.width / 4, pixel / SIZE.width / 4);
        (0..SIZE.pixels()).map(|pixel| if light(pixel) { 1.0 } else { -1.0 }).collect()
    }

    /// The photo of the pattern, resampled by a map whose error is `d`.
    fn seen(d: impl Fn([f64; 2]) -> [f64; 2]) -> (Vec<f64>, Vec<bool>) {
        let pattern = squares();
        let looks = |pixel: usize| {
            let at = [(pixel % SIZE.width) as f64, (pixel / SIZE.width) as f64];
            let [right, down] = d(at);
            value(&pattern, SIZE, [at[0] + right, at[1] + down])
        };
        let values: Vec<Option<f64>> = (0..SIZE.pixels()).map(looks).collect();
        // Global light halves the contrast. Pixels outside the pattern are dark.
        (
            values.iter().map(|value| 0.1 + 0.5 * value.unwrap_or(0.0)).collect(),
            values.iter().map(Option::is_some).collect(),
        )
    }

    fn found(d: impl Fn([f64; 2]) -> [f64; 2]) -> Displacement {
        let (seen, used) = seen(d);
        displacement(SIZE, &[(squares(), seen)], &used).expect("the pattern is seen")
    }

    #[test]
    fn a_photo_that_has_not_moved_has_no_displacement() {
        let found = found(|_| [0.0, 0.0]);
        assert!(found.off < 1e-3 && found.agreement > 0.999, "{found:?}");
    }

    #[test]
    fn a_shift_is_found_to_a_twentieth_of_a_pixel() {
        for shift in [[0.3, -0.2], [-5.6, 3.4], [0.05, 0.0]] {
            let found = found(|_| shift);
            // The photo is interpolated bilinearly, which blurs differently from a Gaussian. The tolerance covers the resulting error.
            let off = (found.shift[0] - shift[0]).hypot(found.shift[1] - shift[1]);
            assert!(off < 0.05, "{shift:?}: {found:?}");
            assert!((found.off - shift[0].hypot(shift[1])).abs() < 0.1, "{found:?}");
        }
    }

    /// The standard error along one axis is the error of `d₀ + d₂ u + d₃ v` at the coordinates `(u, v)` of the point.
    #[test]
    fn the_error_of_a_displacement_follows_from_the_covariance_of_its_coefficients() {
        let d = Affine { size: SIZE, by: [0.0; 6] };
        // Half a diagonal is 40 pixels.
        let at = [31.5 + 40.0 * 0.6, 23.5 - 40.0 * 0.5];
        let [u, v] = d.relative(at);
        assert!((u - 0.6).abs() < 1e-12 && (v + 0.5).abs() < 1e-12, "{u} {v}");
        let mut covariance = vec![0.0; UNKNOWNS * UNKNOWNS];
        let mut set = |i: usize, j: usize, value: f64| {
            covariance[i * UNKNOWNS + j] = value;
            covariance[j * UNKNOWNS + i] = value;
        };
        // The first axis has the unknowns 2, 4 and 5.
        for (i, j, value) in [(2, 2, 4.0), (4, 4, 9.0), (5, 5, 16.0), (2, 4, 1.0), (2, 5, -2.0), (4, 5, 0.5)]
        {
            set(i, j, value);
        }
        let expected = 4.0 + 9.0 * u * u + 16.0 * v * v + 2.0 * (1.0 * u - 2.0 * v + 0.5 * u * v);
        assert!((d.error(at, &covariance) - expected.sqrt()).abs() < 1e-12);
        // The second axis (unknowns 3, 6 and 7) determines the result when its error is larger.
        covariance[3 * UNKNOWNS + 3] = 400.0;
        assert!((d.error(at, &covariance) - 20.0).abs() < 1e-12);
    }

    #[test]
    fn stated_errors_of_a_shift_are_those_of_repeated_photos() {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_pcg::Pcg64::seed_from_u64(5);
        let (clean, used) = seen(|_| [0.2, -0.1]);
        let mut off = Vec::new();
        for _ in 0..40 {
            let noisy = clean.iter().map(|value| {
                let sum: f64 = (0..12).map(|_| random.random::<f64>() - 0.5).sum();
                value + 0.1 * sum
            });
            let found = displacement(SIZE, &[(squares(), noisy.collect())], &used).expect("it is seen");
            off.push((found.shift[0] - 0.2, found.error));
        }
        let mean = off.iter().map(|off| off.0).sum::<f64>() / 40.0;
        let spread = (off.iter().map(|off| (off.0 - mean).powi(2)).sum::<f64>() / 39.0).sqrt();
        let stated = off.iter().map(|off| off.1).sum::<f64>() / 40.0;
        // The stated error is for the corner, and allows for correlation. It may be several times the scatter, but not smaller.
        assert!(stated > 0.8 * spread && stated < 20.0 * spread, "{stated} {spread}");
    }

    #[test]
    fn a_rotation_displaces_the_corners() {
        let turn = 0.01;
        let found = found(|[x, y]| [-turn * (y - 23.5), turn * (x - 31.5)]);
        let corner = turn * 31.5_f64.hypot(23.5);
        assert!(
            (found.off - corner).abs() < 0.05 && found.shift[0].hypot(found.shift[1]) < 0.05,
            "{found:?}"
        );
    }

    #[test]
    fn another_picture_does_not_correlate() {
        let pattern = squares();
        let other: Vec<f64> = pattern.iter().rev().copied().collect();
        let found = displacement(SIZE, &[(pattern, other)], &vec![true; SIZE.pixels()]);
        assert!(found.is_err() || found.as_ref().is_ok_and(|found| found.agreement < 0.5), "{found:?}");
    }

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
        // At the end of the used part, the wide blur changes the ramp by at most the ramp's rise over the width of the blur.
        assert!((0..size.pixels()).filter(|&pixel| used[pixel]).all(|pixel| left[pixel].abs() < 0.3));
        assert!(left[16 * 48 + 12].abs() < 1e-3, "{}", left[16 * 48 + 12]);
        let pairs = [(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)];
        assert!((correlation(pairs.into_iter()) - 1.0).abs() < 1e-12);
        assert_eq!(correlation([(1.0, 2.0), (1.0, 3.0)].into_iter()), f64::NEG_INFINITY);
    }
}
