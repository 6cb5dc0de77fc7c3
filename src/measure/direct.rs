//! The direct stage: the light that each pixel reflects straight back to itself, as an operator `S diag(d) K`.
//!
//! The projector shows patterns that change from pixel to pixel or from square to square ([`DirectPatterns`]). Global light is an average
//! over many pixels and hardly changes from pattern to pattern. The direct light of a pixel is proportional to the light that arrives at
//! this pixel. A projector's lens spreads each pixel's light over its neighbours, so the light that arrives is the blurred pattern
//! `u = K x`. The camera's pixels spread the reflected light, by the known matrix `S` ([`PixelSpread`]). With direct light `d` and global
//! light `g`, the model of the photo `y_m` of pattern `m` and the fit of `d` are
//!
//! ```text
//! y_m = S (d ∘ u_m) + g,      minimise over d:  Σ_m ‖y_m − ȳ − S (d ∘ (u_m − ū))‖²
//! ```
//!
//! Here `ȳ` and `ū` are the means over the patterns. The patterns enter *as shown*, after rounding to levels. Without `S`, the fit is
//! `d = Σ_m (u_m − ū) y_m / Σ_m (u_m − ū)²`. The blur `K` is the Gaussian with the least residual of this fit, over all pixels, photos and
//! channels. A residual larger than the noise of the photos shows that the model is wrong at a pixel, for example because the global light
//! changes from square to square. Such a residual counts as an error of `d`.
//!
//! Nayar, Krishnan, Grossberg and Raskar, *Fast separation of direct and global components of a scene using high frequency
//! illumination* (2006), doi:10.1145/1141911.1141977.

use std::sync::Arc;

use super::calibration::Registration;
use super::direct_fit::{BlurDoubt, DirectFit, wider, without_mean};
use super::hdr::{BlackPhotos, RateFrame};
use super::photos::Plane;
use super::registration::combine;
use super::spread::{PixelSpread, merged};
use crate::image::{Blur, Resolution};
use crate::sparse::WeightedColumn;

/// The widest blur that is considered, in pixels as a standard deviation. The blur must be narrower than the squares.
const WIDEST: f64 = 2.0;

/// The narrowest blur that is considered. Below this value, a sampled Gaussian is a single pixel.
const NARROWEST: f64 = 0.25;

/// Entries of the matrix below this fraction of the largest entry in their row are left out.
const SMALLEST: f64 = 1e-6;

/// The number of blur widths that are tried before the best width is refined.
const TRIED: usize = 8;

/// The number of refinement steps. Each step narrows the interval of blur widths to 0.62 of its length. The last interval is 0.0002 pixels
/// long. The blur must be this precise: with a blur of 0.6 pixels, codes keep half of their contrast, and an error of 0.005 in the blur
/// makes the direct light 1 % wrong, which is several per cent of the global light.
const REFINED: usize = 16;

/// The numbers of conjugate gradient steps: first while the blur is chosen, then in the final fit. Few steps suffice because the spread is
/// narrow.
const STEPS: [usize; 2] = [4, 12];

/// Direct light: `y = S (d ∘ K x)` for each of the camera's channels.
#[derive(Clone, Debug)]
pub(crate) struct DirectMatrix {
    /// `d` and its variance for each of the camera's channels.
    planes: Vec<Plane>,
    doubt: BlurDoubt,
    /// The spread `K` of the projector's pixels. It is `None` when no spread was found.
    blur: Option<Blur>,
    /// The spread `S` of the camera's pixels. It is `None` when no spread is known.
    spread: Option<Arc<PixelSpread>>,
}

impl DirectMatrix {
    /// The direct light of one channel under a pattern, with its variance.
    pub(crate) fn under(&self, channel: usize, pattern: &[f64]) -> Plane {
        let Plane { values, variance } = &self.planes[channel];
        let blurred = self.blur.as_ref().map(|blur| blur.apply(pattern));
        let light = blurred.as_deref().unwrap_or(pattern);
        let product = |a: &[f64], power: i32| -> Vec<f64> {
            a.iter().zip(light).map(|(a, light)| a * light.powi(power)).collect()
        };
        let plane = Plane { values: product(values, 1), variance: product(variance, 2) };
        match &self.spread {
            None => plane,
            Some(spread) => {
                Plane { values: spread.apply(&plane.values), variance: spread.variance(&plane.variance) }
            }
        }
    }

    /// The standard error of `zᵀ S (d ∘ K x)` for one channel.
    pub(crate) fn error_of_form(&self, channel: usize, z: &[f64], x: &[f64]) -> f64 {
        let blurred = |x: &[f64]| self.blur.as_ref().map_or_else(|| x.to_vec(), |blur| blur.apply(x));
        let back = self.spread.as_ref().map_or_else(|| z.to_vec(), |spread| spread.apply_transposed(z));
        let light = blurred(x);
        let wider = blurred(&self.doubt.widened(x));
        let Plane { values, variance } = &self.planes[channel];
        let slopes = &self.doubt.slopes[channel];
        let (mut of_pixels, mut of_blur) = (0.0, 0.0);
        for pixel in 0..back.len() {
            let weight = back[pixel] * light[pixel];
            of_pixels += weight * weight * variance[pixel];
            of_blur += weight * slopes[pixel] + back[pixel] * wider[pixel] * values[pixel];
        }
        of_pixels.sqrt().hypot(self.doubt.error * of_blur)
    }

    /// Row `pixel` of one channel's matrix: ascending columns with their weights. Weights below [`SMALLEST`] of the largest weight are left
    /// out.
    pub(crate) fn row(&self, channel: usize, pixel: usize) -> Vec<WeightedColumn> {
        let direct = &self.planes[channel].values;
        let own = [(pixel as u32, 1.0)];
        let seen = self.spread.as_ref().map_or(&own[..], |spread| spread.row(pixel));
        let mut row: Vec<WeightedColumn> = Vec::new();
        for &(at, share) in seen {
            let light = share * direct[at as usize];
            match &self.blur {
                None => row.push((at, light)),
                Some(blur) => {
                    row.extend(blur.row(at as usize).into_iter().map(|(x, w)| (x as u32, light * w)));
                }
            }
        }
        let mut row = merged(row);
        let most = row.iter().fold(0.0, |most: f64, entry| most.max(entry.1.abs()));
        row.retain(|entry| entry.1.abs() > SMALLEST * most);
        row
    }
}

impl DirectMatrix {
    /// Fits the direct light to `rate_frames`, the photos of patterns. `shown` holds the patterns that were shown, for each of the camera's
    /// channels.
    pub(crate) fn fit(
        registration: &Registration,
        rate_frames: &[&RateFrame],
        shown: &[Vec<Vec<f64>>],
        blacks: &BlackPhotos,
    ) -> Self {
        let size = registration.projector;
        let spread = registration.lens.as_ref().map(|lens| Arc::new(PixelSpread::new(registration, lens)));
        let channels = shown.len();
        let combined = |channel: usize, coefficient: &dyn Fn(usize, usize) -> f64| {
            combine(registration, rate_frames, coefficient, blacks, (channel, channels))
        };
        // The photos of one channel, minus their mean.
        let photos = |channel: usize| {
            let only =
                |photo: usize| combined(channel, &|_, other| f64::from(u8::from(other == photo))).values;
            without_mean((0..rate_frames.len()).map(only).collect())
        };
        let photos: Vec<Vec<Vec<f64>>> = (0..channels).map(photos).collect();
        let lit = registration.seen();
        let fitted = |channel: usize, shown: &[Vec<f64>], blur: Option<&Blur>, steps: usize| {
            let mut fit = DirectFit::new(shown, &lit, blur, spread.as_deref(), &photos[channel]);
            fit.improve(steps);
            fit
        };
        let residual = |deviation: f64| -> f64 {
            let blur = Blur::new(size, deviation);
            let of = |channel: usize| fitted(channel, &shown[channel], blur.as_ref(), STEPS[0]).residual();
            (0..channels).map(of).sum()
        };
        let blur = Blur::new(size, least(&residual));
        let doubt = BlurDoubt::of(size, channels, &|channel, by| {
            let widened: Vec<Vec<f64>> =
                shown[channel].iter().map(|pattern| wider(size, pattern, by)).collect();
            fitted(channel, &widened, blur.as_ref(), STEPS[1])
        });
        let plane = |channel: usize| {
            let fit = fitted(channel, &shown[channel], blur.as_ref(), STEPS[1]);
            let noise = combined(channel, &|pixel, photo| fit.slope(pixel, photo)).variance;
            fit.plane(noise, size)
        };
        Self { planes: (0..channels).map(plane).collect(), doubt, blur, spread }
    }
}

/// The blur with the least residual, as a standard deviation in pixels. It is 0 when no blur improves the fit.
fn least(residual: &dyn Fn(f64) -> f64) -> f64 {
    let step = (WIDEST - NARROWEST) / (TRIED - 1) as f64;
    let tried = (0..TRIED).map(|index| NARROWEST + step * index as f64);
    let best = tried.map(|deviation| (residual(deviation), deviation)).min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, best)) = best else { return 0.0 };
    let (mut low, mut high) = ((best - step).max(NARROWEST), (best + step).min(WIDEST));
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let inner = |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
    let mut at = inner(low, high);
    let mut values = at.map(residual);
    for _ in 0..REFINED {
        if values[0] < values[1] {
            high = at[1];
            at = inner(low, high);
            values = [residual(at[0]), values[0]];
        } else {
            low = at[0];
            at = inner(low, high);
            values = [values[1], residual(at[1])];
        }
    }
    let refined = 0.5 * (low + high);
    if residual(refined) < residual(0.0) { refined } else { 0.0 }
}

// The patterns for the fit.
//
// Away from the raster's border, a checkerboard with squares of two pixels is an eigenvector of every blur. A blur thus keeps the shape of
// this checkerboard, and the lower contrast looks like less direct light. [Codes](code_patterns) hold all spatial frequencies. Their photos
// therefore determine the blur, and separate light of near pixels from the pixel's own light. Codes change from pixel to pixel, so the
// camera must resolve single pixels. If the camera does not, or if the spread of its pixels is unknown, squares of four pixels are used.
// The edges of these squares show the blur.

/// The camera resolves single pixels when it has this many camera pixels per projector pixel.
const RESOLVES: usize = 4;

/// The number of photos of codes. It equals the number of photos of shifted squares.
const CODES: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DirectPatterns {
    /// Near pixels are lit in different sets of photos.
    Codes,
    /// A checkerboard of squares with this side, shifted step by step.
    Squares(usize),
}

impl DirectPatterns {
    /// The patterns that suit a pixel map. Without a lens map, they are squares of four pixels, as in earlier versions, so that runs of
    /// these versions can still be queried.
    pub(crate) fn of(registration: &Registration) -> Self {
        let finer = registration.camera.pixels() >= RESOLVES * registration.projector.pixels();
        if finer && registration.lens.is_some() { Self::Codes } else { Self::Squares(4) }
    }

    /// Makes the patterns. About half of the patterns light each pixel for which `lit` is true. All other pixels stay dark.
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

/// A checkerboard with squares of `side` pixels, moved to the left by `right` pixels and up by `down` pixels. The value is 1 where a pixel
/// is lit, 0 elsewhere.
pub fn checkerboard(resolution: Resolution, side: usize, [right, down]: [usize; 2]) -> Vec<f64> {
    let lit = |pixel: usize| {
        let (x, y) = (pixel % resolution.width + right, pixel / resolution.width + down);
        f64::from(u8::from((x / side + y / side).is_multiple_of(2)))
    };
    (0..resolution.pixels()).map(lit).collect()
}

/// The checkerboards of Nayar's separation, at `shifts²` places, row by row. The step between places is `2·side/shifts` pixels, rounded
/// down.
pub fn shifted_checkerboards(
    resolution: Resolution,
    side: usize,
    shifts: usize,
) -> impl Iterator<Item = Vec<f64>> {
    let offset = move |shift: usize| shift * 2 * side / shifts;
    (0..shifts * shifts)
        .map(move |at| checkerboard(resolution, side, [offset(at % shifts), offset(at / shifts)]))
}

/// The checkerboards, shifted by half a square: each pixel is well inside a bright square and well inside a dark square at least once.
fn squares(resolution: Resolution, side: usize) -> Vec<Vec<f64>> {
    let shifts = |to: usize| (0..to).step_by(side.div_ceil(2));
    shifts(side)
        .flat_map(|down| shifts(2 * side).map(move |right| checkerboard(resolution, side, [right, down])))
        .collect()
}

// Codes are patterns in which each pixel is lit in half of the photos, and near pixels have different codes.
//
// The code of a pixel is the set of photos in which the pixel is lit. It is a row of a Hadamard matrix. Two different codes are orthogonal.
// Light from a pixel with another code therefore cancels exactly in the correlation of the photos with the pixel's code. Pixels with the
// same code are about `√photos` pixels apart. Every second row has inverted codes, so that even global light from pixels with the same code
// cancels.

/// The code patterns. `photos` is a power of two of at least 4. Each pattern has `n` values: 1 where a pixel is lit, 0 elsewhere.
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

/// The difference between the codes of a pixel and of the pixel below it. The returned difference puts pixels with the same code as far
/// apart as possible. `codes` is the number of codes, which are numbered along each row of the picture.
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
    use crate::measure::lens_map::LensMap;

    fn none(resolution: Resolution) -> BlurDoubt {
        BlurDoubt { resolution, error: 0.0, slopes: vec![vec![0.0; resolution.pixels()]] }
    }

    #[test]
    fn the_least_residual_is_found_wherever_it_is() {
        for truth in [NARROWEST, NARROWEST + 0.013, 0.37, 0.61, 0.5 * (NARROWEST + WIDEST), WIDEST] {
            let found =
                least(&|deviation| 0.5 + (deviation - truth).powi(2) + 0.1 * (deviation - truth).abs());
            // Each refinement leaves 0.618 of the bracket. The first bracket is twice as long as the distance between tried deviations.
            let bracket = 2.0 * (WIDEST - NARROWEST) / (TRIED - 1) as f64 * 0.619_f64.powi(REFINED as i32);
            assert!((found - truth).abs() < 0.51 * bracket, "{found} {truth}");
        }
    }

    /// The photo of direct light equals the product of the matrix rows with the pattern: with a blur, with the spread of a coarse camera,
    /// and with both.
    #[test]
    fn the_photo_of_direct_light_is_the_product_with_its_rows() {
        let size = Resolution::new(12, 10);
        let lens = LensMap {
            camera: size,
            projector: size,
            homography: [1.0, 0.0, 0.02, 0.0, 1.0, -0.03, 0.0, 0.0],
            distortion: [0.0; 2],
        };
        let registration = Registration::by_area(size, size);
        let spread = Arc::new(PixelSpread::new(&registration, &lens));
        let values: Vec<f64> = (0..120).map(|pixel| 0.2 + f64::from(pixel % 7) * 0.1).collect();
        let pattern: Vec<f64> = (0..120).map(|pixel| f64::from(u8::from(pixel % 5 < 2))).collect();
        for blur in [None, Blur::new(size, 0.7)] {
            for spread in [None, Some(&spread)] {
                let planes = vec![Plane { values: values.clone(), variance: vec![0.0; 120] }];
                let doubt = none(size);
                let direct = DirectMatrix { planes, doubt, blur: blur.clone(), spread: spread.cloned() };
                let photo = direct.under(0, &pattern).values;
                for (pixel, seen) in photo.iter().enumerate() {
                    let row = direct.row(0, pixel);
                    assert!(row.is_sorted_by(|a, b| a.0 < b.0));
                    let product: f64 = row.iter().map(|&(at, weight)| weight * pattern[at as usize]).sum();
                    // A row omits at most 120 weights, each below `SMALLEST` times its largest weight.
                    let most = row.iter().fold(0.0, |most: f64, entry| most.max(entry.1.abs()));
                    assert!((product - seen).abs() <= 120.0 * SMALLEST * most, "{pixel}: {product} {seen}");
                }
            }
        }
    }

    /// The quadratic form depends on `d` and on the blur, and `d` also depends on the blur.
    #[test]
    fn the_error_of_a_form_is_that_of_pixels_and_of_the_blur() {
        let size = Resolution::new(6, 5);
        let of = |step: usize| -> Vec<f64> { (0..30).map(|at| 0.3 + (at * step % 7) as f64 * 0.1).collect() };
        let (values, variance, slope, z, x) = (of(1), of(2), of(3), of(4), of(5));
        let planes = vec![Plane { values: values.clone(), variance: variance.clone() }];
        let known = none(size);
        let mut direct = DirectMatrix { planes, doubt: known, blur: Blur::new(size, 0.5), spread: None };
        let light = Blur::new(size, 0.5).map(|blur| blur.apply(&x)).unwrap_or_default();
        let of_pixels: f64 = (0..30).map(|at| (z[at] * light[at]).powi(2) * variance[at]).sum();
        assert!((direct.error_of_form(0, &z, &x) - of_pixels.sqrt()).abs() < 1e-12);
        let error = 1e-3;
        direct.doubt.error = error;
        direct.doubt.slopes = vec![slope.clone()];
        let form = |share: f64| -> f64 {
            let values = values.iter().zip(&slope).map(|(d, slope)| d + share * slope).collect();
            let planes = vec![Plane { values, variance: variance.clone() }];
            let moved = DirectMatrix { planes, ..direct.clone() };
            moved.under(0, &wider(size, &x, share)).values.iter().zip(&z).map(|(y, z)| y * z).sum()
        };
        // The central difference has no error of second order.
        let of_blur = 0.5 * (form(error) - form(-error));
        let expected = of_pixels.sqrt().hypot(of_blur);
        assert!((direct.error_of_form(0, &z, &x) - expected).abs() < 1e-9 * expected);
    }

    #[test]
    fn each_pixel_is_lit_in_half_of_the_patterns() {
        let resolution = Resolution::new(9, 7);
        for side in 1..6 {
            let patterns = DirectPatterns::Squares(side).shown(resolution, &[true; 63]);
            for pixel in 0..63 {
                let light: f64 = patterns.iter().map(|pattern| pattern[pixel]).sum();
                // When the step of the shifts does not divide the side of a square, more or fewer than half of the patterns may light a
                // pixel.
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
        // The largest fraction of a blurred pattern's variance that a multiple of the sharp pattern does not explain.
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
        // In squares of two pixels, the two neighbours of a pixel along each axis differ, so their contributions cancel.
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
            // In a square lattice with one point per `codes` pixels, the nearest points are `√codes` apart.
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
