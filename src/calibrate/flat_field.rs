//! The brightness of the projector relative to the camera's, by the symmetry of the light transport.
//!
//! In a coaxial rig, let `p` be the vignetting of the projector and `c` the vignetting of the camera. The transport matrix is then `M =
//! diag(c) A diag(p)` with a symmetric `A`. So `diag(q) M` is symmetric for the ratio `q = p / c`. The photos `y_j = M x_j` of smooth
//! patterns `x_j` then satisfy
//!
//! ```text
//! Σ_i q_i (x_j(i) y_k(i) − x_k(i) y_j(i)) = 0        for each pair of patterns j, k
//! ```
//!
//! With `q = 1 + Σ a_l φ_l` for a few polynomials `φ_l`, these are linear equations for the coefficients `a`. Direct light cancels in the
//! equations, so they are informative only where distant pixels exchange light. Otherwise the prior, which expects small `a`, sets `q` to
//! 1.
//!
//! Most light is direct, so it must cancel precisely. The camera's pixels shift and spread the direct light by the matrix `S`. On the left
//! side of the equation, `x_j` is therefore replaced by `w_j` with `Sᵀ w_j = x_j`. An error of the pixel map also shifts the direct light.
//! This shift is included in the standard error of the equation.

use super::MeasuredValue;
use super::least_squares::Normal;
use super::session::{CalibrationSession, CameraModel};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::measure::display::PatternDisplay;
use crate::measure::spread::PixelSpread;
use crate::measure::{DitherBy, FlatField, Measurement, Registration};
use crate::transport::Part;

/// The number of half periods of each pattern along both axes. The first pattern is white.
const WAVES: [[u32; 2]; 11] =
    [[0, 0], [1, 0], [0, 1], [1, 1], [2, 0], [0, 2], [2, 1], [1, 2], [2, 2], [3, 0], [0, 3]];

const TERMS: usize = 6;

/// The prior standard deviation of the coefficients. Vignetting darkens corners by 0.1 to 0.3.
const EXPECTED: f64 = 0.2;

/// The error of the responses, as a fraction of the light that enters an equation.
const RESPONSE_ERROR: f64 = 5e-4;

pub(crate) struct BrightnessRatio {
    /// The ratio at each of the projector's pixels.
    pub(crate) values: Vec<f64>,
    /// The smallest ratio divided by the largest, with its standard error.
    pub(crate) range: MeasuredValue,
}

/// Measures the ratio by photos of smooth patterns. `curves` are the projector's responses. `map_error` is the standard error of the pixel
/// map, in projector pixels.
pub(crate) fn ratio(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel,
    curves: &[Vec<f64>],
    (registration, map_error): (&Registration, f64),
) -> Result<BrightnessRatio> {
    let photos = Photos::take(session, model, curves, (registration, map_error))?;
    let size = registration.projector;
    let terms: Vec<[f64; TERMS]> = (0..size.pixels()).map(|pixel| polynomials(pixel, size)).collect();
    let mut normal = Normal::new(TERMS);
    for term in 0..TERMS {
        normal.add(&[(term, 1.0)], 0.0, EXPECTED.powi(-2));
    }
    for k in 0..WAVES.len() {
        for j in 0..k {
            photos.add(j, k, &terms, &mut normal);
        }
    }
    let solution = normal.solve()?;
    let at = |terms: &[f64; TERMS]| terms.iter().zip(&solution.values).map(|(t, a)| t * a).sum::<f64>();
    let error = |terms: &[f64; TERMS]| {
        let pairs = (0..TERMS * TERMS).map(|at| (at / TERMS, at % TERMS));
        pairs.map(|(i, j)| terms[i] * terms[j] * solution.covariance[i * TERMS + j]).sum::<f64>().sqrt()
    };
    // A ratio below 0.05 is implausible: each device is at least a twentieth as bright at all visible pixels as at its centre.
    let values: Vec<f64> = terms.iter().map(|terms| (1.0 + at(terms)).max(0.05)).collect();
    let [least, most] =
        [f64::min, f64::max].map(|choose| values.iter().copied().reduce(choose).unwrap_or(1.0));
    let corner = terms.first().map_or(0.0, error);
    Ok(BrightnessRatio { values, range: MeasuredValue::new(least / most, corner) })
}

/// Photos of the patterns, resampled to the projector's pixels.
struct Photos {
    /// The patterns `w_j`, before the spread by the camera's pixels.
    before: Vec<Vec<f64>>,
    /// The length of the gradient of each pattern, per pixel.
    slopes: Vec<Vec<f64>>,
    /// The standard error of the pixel map, in projector pixels.
    map_error: f64,
    photos: Vec<Vec<f64>>,
    variance: Vec<Vec<f64>>,
}

impl Photos {
    fn take(
        session: &mut CalibrationSession<'_>,
        model: &CameraModel,
        curves: &[Vec<f64>],
        (registration, map_error): (&Registration, f64),
    ) -> Result<Self> {
        let exposure = unsaturated(session, model)?;
        let channels = session.camera().channels;
        let dark = session.mean(&session.filled(0), exposure, 4 * model.takes)?;
        let (mut patterns, mut photos, mut variance) = (Vec::new(), Vec::new(), Vec::new());
        let (seen, size) = (registration.seen(), registration.projector);
        let display = PatternDisplay::new(session.projector(), curves, true, DitherBy::None, 0)?;
        for wave in WAVES {
            let pattern = (0..size.pixels())
                .map(|pixel| if seen[pixel] { smooth(centred(pixel, size), wave) } else { 0.0 });
            let shown = display.show(&[pattern.collect()], Part::Full)?;
            let mean = session.mean(&shown.frame, exposure, model.takes)?;
            let light = |sample: usize| [&mean, &dark].map(|mean| model.linear.of(mean.counts[sample]));
            let of_camera: Vec<[f64; 2]> = (0..mean.counts.len() / channels)
                .map(|pixel| {
                    let samples = pixel * channels..(pixel + 1) * channels;
                    samples.fold([0.0, 0.0], |[sum, square], sample| {
                        let [lit, dark_light] = light(sample);
                        let more = model.variance(lit, mean.takes) + model.variance(dark_light, dark.takes);
                        [sum + lit - dark_light, square + more]
                    })
                })
                .collect();
            let rows = 0..registration.projector.pixels();
            let sum = |pixel: usize| {
                registration.row(pixel).fold([0.0, 0.0], |[value, square], (camera, weight)| {
                    [value + weight * of_camera[camera][0], square + weight * weight * of_camera[camera][1]]
                })
            };
            let (photo, of_photo) = rows.map(sum).map(|[value, square]| (value, square)).unzip();
            patterns.push(shown.seen_by(0, 1));
            photos.push(photo);
            variance.push(of_photo);
        }
        let spread = registration.lens.as_ref().map(|lens| PixelSpread::new(registration, lens));
        let before = patterns.iter().map(|x| unspread(x, spread.as_ref())).collect();
        let slopes = patterns.iter().map(|x| slope(x, registration.projector)).collect();
        Ok(Self { before, slopes, map_error, photos, variance })
    }

    fn add(&self, j: usize, k: usize, terms: &[[f64; TERMS]], normal: &mut Normal) {
        let (mut row, mut value, mut variance) = ([0.0; TERMS], 0.0, 0.0);
        let (mut scale, mut shifted) = (0.0, 0.0);
        for (pixel, terms) in terms.iter().enumerate() {
            let of = |planes: &[Vec<f64>]| [planes[j][pixel], planes[k][pixel]];
            let ([x_j, x_k], [y_j, y_k]) = (of(&self.before), of(&self.photos));
            let difference = x_j * y_k - x_k * y_j;
            row.iter_mut().zip(terms).for_each(|(entry, term)| *entry += term * difference);
            value -= difference;
            let [noise_j, noise_k] = of(&self.variance);
            variance += x_j * x_j * noise_k + x_k * x_k * noise_j;
            scale += (x_j * y_k).abs();
            let [slope_j, slope_k] = of(&self.slopes);
            shifted += slope_j * y_k.abs() + slope_k * y_j.abs();
        }
        let error = (RESPONSE_ERROR * scale).hypot(self.map_error * shifted);
        normal.add_full(&row, value, 1.0 / (variance + error * error).max(f64::MIN_POSITIVE));
    }
}

/// Solves `Sᵀ w = x` for a smooth `x`, by two steps of fixed-point iteration.
fn unspread(x: &[f64], spread: Option<&PixelSpread>) -> Vec<f64> {
    let Some(spread) = spread else { return x.to_vec() };
    let mut w = x.to_vec();
    for _ in 0..2 {
        let left: Vec<f64> = x.iter().zip(spread.apply_transposed(&w)).map(|(x, seen)| x - seen).collect();
        w.iter_mut().zip(left).for_each(|(w, left)| *w += left);
    }
    w
}

/// The length of an image's gradient at each pixel, from differences to the next pixels.
fn slope(x: &[f64], Resolution { width, height }: Resolution) -> Vec<f64> {
    let at = |column: usize, row: usize| x[row.min(height - 1) * width + column.min(width - 1)];
    let of = |pixel: usize| {
        let (column, row) = (pixel % width, pixel / width);
        (at(column + 1, row) - x[pixel]).hypot(at(column, row + 1) - x[pixel])
    };
    (0..x.len()).map(of).collect()
}

/// The longest exposure at which no sample of white is saturated. The search descends from the exposure at which white fills the range.
fn unsaturated(session: &mut CalibrationSession<'_>, model: &CameraModel) -> Result<f64> {
    let white = session.filled(session.top());
    let mut exposure = model.exposure;
    for _ in 0..6 {
        let mean = session.mean(&white, exposure, 1)?;
        if mean.peaks.iter().all(|&peak| f64::from(peak) < model.limit) {
            break;
        }
        exposure = session.allowed(0.5 * exposure);
    }
    Ok(exposure)
}

/// The value of a smooth pattern, from 0 to 1, at a point from −1 to 1 along both axes.
fn smooth(at: [f64; 2], waves: [u32; 2]) -> f64 {
    let wave = |axis: usize| {
        let phase = 0.5 * std::f64::consts::PI * f64::from(waves[axis]) * (at[axis] + 1.0);
        phase.cos()
    };
    0.5 + 0.5 * wave(0) * wave(1)
}

/// The centre of a pixel, from −1 to 1 along both axes.
pub(crate) fn centred(pixel: usize, size: Resolution) -> [f64; 2] {
    let at = |index: usize, of: usize| (2 * index + 1) as f64 / of as f64 - 1.0;
    [at(pixel % size.width, size.width), at(pixel / size.width, size.height)]
}

/// The values of the polynomials `φ_l` at a pixel: tilts, and terms that grow towards the edges.
fn polynomials(pixel: usize, size: Resolution) -> [f64; TERMS] {
    let [x, y] = centred(pixel, size);
    let square = 0.5 * (x * x + y * y);
    [x, y, x * y, 0.5 * (x * x - y * y), square, square * square]
}

/// The highest power of a coordinate in the polynomial that is fitted to the sheet's photo.
const DEGREE: usize = 6;

/// The largest residual of the polynomial fit to the photo of an even sheet: root mean square, as a fraction of the light.
const EVEN: f64 = 0.05;

/// Computes the brightness of both devices from a photo of a sheet under white. The sheet is matte, has one colour, fills the view and
/// stands square to the camera. `measurement` must not correct uneven brightness. `known` gives the projector's brightness relative to the
/// camera's.
///
/// # Errors
/// [`Error::Rig`] when the photo does not show an even sheet, and the errors of taking the photo.
pub fn flat_field_of_sheet(measurement: &mut Measurement, known: &FlatField) -> Result<FlatField> {
    let white = measurement.white()?;
    let size = white.resolution;
    let light: Vec<f64> =
        (0..size.pixels()).map(|pixel| white.planes.iter().map(|plane| plane.values[pixel]).sum()).collect();
    let seen: Vec<bool> = measurement.seen().to_vec();
    let smooth = polynomial(&light, &seen, size)?;
    let (mut off, mut all) = (0.0, 0.0);
    for pixel in (0..size.pixels()).filter(|&pixel| seen[pixel]) {
        off += (light[pixel] - smooth[pixel]).powi(2);
        all += light[pixel].powi(2);
    }
    if !(off <= EVEN * EVEN * all && smooth.iter().all(|light| *light > 0.0)) {
        let percent = 100.0 * (off / all).sqrt();
        let fault =
            format!("its photo departs by {percent:.1} % from a smooth one, so this is no even sheet");
        let help = "fill the view with one matte sheet of one colour, square to the camera, and keep other light away";
        return Err(Error::rig("sheet", fault).help(help));
    }
    known.with_sheet(&smooth)
}

/// Fits a polynomial in both coordinates to the pixels that are `seen`, and evaluates the polynomial at every pixel.
fn polynomial(light: &[f64], seen: &[bool], size: Resolution) -> Result<Vec<f64>> {
    let powers: Vec<(i32, i32)> =
        (0..=DEGREE as i32).flat_map(|x| (0..=DEGREE as i32 - x).map(move |y| (x, y))).collect();
    let terms = |pixel: usize| -> Vec<f64> {
        let [x, y] = centred(pixel, size);
        // Chebyshev polynomials are used, because powers would be nearly linearly dependent.
        let wave = |x: f64, power: i32| (f64::from(power) * x.acos()).cos();
        powers.iter().map(|&(i, j)| wave(x, i) * wave(y, j)).collect()
    };
    let mut normal = Normal::new(powers.len());
    for pixel in (0..light.len()).filter(|&pixel| seen[pixel]) {
        normal.add_full(&terms(pixel), light[pixel], 1.0);
    }
    let values = normal.solve()?.values;
    let at = |pixel: usize| terms(pixel).iter().zip(&values).map(|(term, value)| term * value).sum();
    Ok((0..light.len()).map(at).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_and_polynomials_are_those_of_the_place_of_a_pixel() {
        let size = Resolution::new(4, 2);
        assert_eq!([0, 3, 6].map(|pixel| centred(pixel, size)), [[-0.75, -0.5], [0.75, -0.5], [0.25, 0.5]]);
        let expected = [-0.75, -0.5, 0.375, 0.5 * (0.5625 - 0.25), 0.40625, 0.40625 * 0.40625];
        assert_eq!(polynomials(0, size), expected);
        // Half periods are counted from the left and from the top. One half period has the value 1 at the edge and 0.5 in the middle.
        let near =
            |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        near(smooth([0.3, -0.2], [0, 0]), 1.0);
        near(smooth([-1.0, -1.0], [3, 2]), 1.0);
        near(smooth([0.0, 0.7], [1, 0]), 0.5);
        near(smooth([0.0, 0.7], [2, 0]), 0.0);
        near(smooth([-1.0, -1.0 / 3.0], [0, 1]), 0.75);
        near(smooth([1.0, 1.0], [1, 1]), 1.0);
    }

    #[test]
    fn a_slope_is_the_length_of_the_steps_to_the_right_and_down() {
        let found = slope(&[0.0, 3.0, 3.0, 4.0, 7.0, 19.0], Resolution::new(3, 2));
        assert_eq!(found, [5.0, 4.0, 16.0, 3.0, 12.0, 0.0]);
        assert_eq!(unspread(&[1.0, 2.0], None), [1.0, 2.0]);
    }

    /// The prior (all terms are small) is combined with one equation. The solution is then proportional to the equation's row.
    #[test]
    fn an_equation_is_weighed_by_noise_response_and_map() {
        let photos = Photos {
            before: vec![vec![1.0, 0.5], vec![0.25, 2.0]],
            slopes: vec![vec![0.1, 0.2], vec![0.3, 0.4]],
            map_error: 0.05,
            photos: vec![vec![3.0, -1.0], vec![2.0, 4.0]],
            variance: vec![vec![0.01, 0.02], vec![0.03, 0.04]],
        };
        let terms = [[1.0, 0.0, 2.0, 0.0, 0.0, 0.0], [0.0, 3.0, 1.0, 0.0, 0.0, 0.0]];
        let mut normal = Normal::new(TERMS);
        for term in 0..TERMS {
            normal.add(&[(term, 1.0)], 0.0, 4.0);
        }
        photos.add(0, 1, &terms, &mut normal);
        let [first, second] = [1.0 * 2.0 - 0.25 * 3.0, 0.5 * 4.0 + 2.0 * 1.0];
        let row = [first, 3.0 * second, 2.0 * first + second, 0.0, 0.0, 0.0];
        let noise = 1.0 * 0.03 + 0.0625 * 0.01 + 0.25 * 0.04 + 4.0 * 0.02;
        let response = 5e-4 * (1.0 * 2.0 + 0.5 * 4.0);
        let shifted = 0.05 * (0.1 * 2.0 + 0.3 * 3.0 + 0.2 * 4.0 + 0.4 * 1.0);
        let weight = 1.0 / (noise + response * response + shifted * shifted);
        let square: f64 = row.iter().map(|entry| entry * entry).sum();
        let along = -weight * (first + second) / (4.0 + weight * square);
        let found = normal.solve().expect("the expectation determines every term").values;
        for (found, entry) in found.iter().zip(row) {
            // The tolerance allows for the rounding of a Cholesky factorization with six unknowns.
            assert!((found - along * entry).abs() < 1e-12, "{found} {}", along * entry);
        }
    }

    #[test]
    fn vignetting_is_found_also_where_no_pixel_is_seen() -> Result<()> {
        let size = Resolution::new(24, 16);
        let truth: Vec<f64> = (0..size.pixels())
            .map(|pixel| {
                let (x, y) = ((pixel % 24) as f64 / 12.0 - 1.0, (pixel / 24) as f64 / 8.0 - 1.0);
                (1.0 - 0.1 * (x * x + y * y)) * (1.0 - 0.05 * x)
            })
            .collect();
        let seen: Vec<bool> = (0..size.pixels()).map(|pixel| pixel % 7 != 0).collect();
        let dark: Vec<f64> = truth.iter().zip(&seen).map(|(t, seen)| if *seen { *t } else { 0.0 }).collect();
        let found = polynomial(&dark, &seen, size)?;
        // The fit includes polynomials of degree three, so only rounding is left.
        assert!(found.iter().zip(&truth).all(|(found, truth)| (found - truth).abs() < 1e-9));
        Ok(())
    }
}
