//! How far a picture of a known pattern is displaced, to parts of a pixel.
//!
//! The picture shows the pattern at `x + d(x)`, with a `d` that is affine over the field. It is found by
//! Gauss and Newton's method on both, blurred alike (Lucas and Kanade, *An iterative image registration
//! technique*, 1981), from the best whole-pixel shift on.

use super::comparison::{BLUR, band, correlation, value};
use super::least_squares::Normal;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// Pixels that the rig may have moved by, to be found; of a small field a quarter at most.
const REACH: i32 = 8;

/// With fewer pieces of evidence than so many for each unknown, only a shift is looked for.
const EVIDENCE: f64 = 12.0;

/// What is compared must be of so much of what is seen.
const COMMON: f64 = 0.5;

/// Pixels that the projector's own blur and the camera's see as one: residuals of so many are one piece of
/// evidence, `4π σ²` of a Gaussian.
const CORRELATED: f64 = 4.0 * std::f64::consts::PI * BLUR * BLUR;

/// Steps at most: a few suffice from the nearest whole pixel on.
const STEPS: usize = 12;

/// Unknowns: how much darker and lighter the pattern is seen, and `d`: two of a shift, four of a turn, scale
/// and shear.
const UNKNOWNS: usize = 8;

/// Those without the latter four.
const SHIFT: usize = 4;

/// How far a picture is displaced.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Displacement {
    /// The largest displacement over the field's corners and centre, in projector pixels.
    pub off: f64,
    /// Its standard error.
    pub error: f64,
    /// The displacement at the centre, to the right and down.
    pub shift: [f64; 2],
    /// Correlation of pattern and photo with the displacement undone: 1 is the same picture.
    pub agreement: f64,
}

/// How far pictures are displaced from their patterns (pairs of pattern and what is seen), where they are
/// `used`.
///
/// # Errors
/// [`Error::Numerical`] where the patterns are not in them.
pub(super) fn displacement(
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

/// `d(x)`: two unknowns of a shift, and for each axis two that grow from the centre to the corner.
struct Affine {
    size: Resolution,
    by: [f64; 6],
}

impl Affine {
    /// 0 at the centre, about 1 at the corner.
    fn relative(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [width, height] = [self.size.width as f64, self.size.height as f64];
        let unit = 0.5 * width.hypot(height);
        [(x - 0.5 * (width - 1.0)) / unit, (y - 0.5 * (height - 1.0)) / unit]
    }

    fn at(&self, at: [f64; 2]) -> [f64; 2] {
        let ([u, v], d) = (self.relative(at), &self.by);
        [d[0] + d[2] * u + d[3] * v, d[1] + d[4] * u + d[5] * v]
    }

    /// The standard error along the axis where it is the larger; `covariance` is that of all unknowns.
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

/// All pictures, within the band.
struct Pictures {
    size: Resolution,
    patterns: Vec<Vec<f64>>,
    points: Vec<Point>,
}

/// What is seen somewhere of a pattern.
struct Point {
    pattern: usize,
    at: [f64; 2],
    seen: f64,
}

impl Pictures {
    /// Correlation of what is seen with the pattern displaced.
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

    /// Moves `d` to where both agree best; the covariance of all unknowns in pixels².
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
            // Beyond a pixel the slopes say nothing.
            let step: Vec<f64> =
                found.values[2..].iter().map(|value| (value / amplitude).clamp(-1.0, 1.0)).collect();
            d.by.iter_mut().zip(&step).for_each(|(d, step)| *d += step);
            if step.iter().all(|step| step.abs() < 1e-5) {
                break;
            }
        }
        Ok(covariance)
    }

    /// The slopes of what should be seen at a point with respect to the unknowns; none where that lies
    /// outside.
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
        "nothing is seen of a pattern where the calibration's map has it\n  help: calibrate the rig again: krylux rig calibrate"
            .into(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: Resolution = Resolution { width: 64, height: 48 };

    /// Squares of four pixels, light or dark as a hash of their place says.
    fn squares() -> Vec<f64> {
        let bit = |x: usize, y: usize| ((x * 7919 + y * 104_729 + x * y * 31) / 7).is_multiple_of(2);
        let light = |pixel: usize| bit(pixel % SIZE.width / 4, pixel / SIZE.width / 4);
        (0..SIZE.pixels()).map(|pixel| if light(pixel) { 1.0 } else { -1.0 }).collect()
    }

    /// The pattern moved by `d`, as a map that is off by that much has it.
    fn seen(d: impl Fn([f64; 2]) -> [f64; 2]) -> (Vec<f64>, Vec<bool>) {
        let pattern = squares();
        let looks = |pixel: usize| {
            let at = [(pixel % SIZE.width) as f64, (pixel / SIZE.width) as f64];
            let [right, down] = d(at);
            value(&pattern, SIZE, [at[0] + right, at[1] + down])
        };
        let values: Vec<Option<f64>> = (0..SIZE.pixels()).map(looks).collect();
        // Half as much contrast, as with indirect light; what lies outside is dark.
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
    fn what_has_not_moved_is_where_it_was() {
        let found = found(|_| [0.0, 0.0]);
        assert!(found.off < 1e-3 && found.agreement > 0.999, "{found:?}");
    }

    #[test]
    fn a_shift_is_found_to_a_twentieth_of_a_pixel_and_whole_pixels_too() {
        for shift in [[0.3, -0.2], [-5.6, 3.4], [0.05, 0.0]] {
            let found = found(|_| shift);
            // Linear between pixels is another blur than the Gaussian, which is where the rest comes from.
            let off = (found.shift[0] - shift[0]).hypot(found.shift[1] - shift[1]);
            assert!(off < 0.05, "{shift:?}: {found:?}");
            assert!((found.off - shift[0].hypot(shift[1])).abs() < 0.1, "{found:?}");
        }
    }

    #[test]
    fn a_turn_shows_at_the_corners() {
        let turn = 0.01;
        let found = found(|[x, y]| [-turn * (y - 23.5), turn * (x - 31.5)]);
        let corner = turn * 31.5_f64.hypot(23.5);
        assert!(
            (found.off - corner).abs() < 0.05 && found.shift[0].hypot(found.shift[1]) < 0.05,
            "{found:?}"
        );
    }

    #[test]
    fn another_scene_does_not_agree() {
        let pattern = squares();
        let other: Vec<f64> = pattern.iter().rev().copied().collect();
        let found = displacement(SIZE, &[(pattern, other)], &vec![true; SIZE.pixels()]);
        assert!(found.is_err() || found.as_ref().is_ok_and(|found| found.agreement < 0.5), "{found:?}");
    }
}
