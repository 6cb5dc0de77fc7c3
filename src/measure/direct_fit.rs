//! The least-squares fit of one channel's direct light to the photos of patterns.

use super::photos::Plane;
use super::spread::PixelSpread;
use crate::image::{Blur, Resolution};

/// A residual shows an error of the model when its square is this many times the square of the noise. For pure noise, the mean of this
/// ratio over neighbours has a standard deviation of 0.16, because it averages about twelve pixels with six degrees of freedom each.
const CLEARLY: f64 = 1.6;

/// The fit of `d` that minimises `Σ_m ‖y_m − S (d ∘ u_m)‖²` for patterns `u_m` and photos `y_m`. The means over the patterns are subtracted
/// from both.
pub(crate) struct DirectFit<'a> {
    light: Vec<Vec<f64>>,
    /// `Σ_m u_m²` at each pixel.
    square: Vec<f64>,
    spread: Option<&'a PixelSpread>,
    direct: Vec<f64>,
    /// The residuals of the photos.
    left: Vec<Vec<f64>>,
}

impl<'a> DirectFit<'a> {
    /// Fits `d` without the spread `S`. The fit is exact when there is no spread. The caller has subtracted the mean from `photos`, but not
    /// from `shown`.
    ///
    /// Pixels that are not `lit` by any pattern have no direct light. A blur gives such a pixel a trace of its neighbours' light, and the
    /// camera pixels at a silhouette may see a trace of such a pixel. A fit to these traces would explain every error of the photos there
    /// by an enormous `d`.
    pub(crate) fn new(
        shown: &[Vec<f64>],
        lit: &[bool],
        blur: Option<&Blur>,
        spread: Option<&'a PixelSpread>,
        photos: &[Vec<f64>],
    ) -> Self {
        let mut light: Vec<Vec<f64>> = match blur {
            Some(blur) => shown.iter().map(|pattern| blur.apply(pattern)).collect(),
            None => shown.to_vec(),
        };
        for pattern in &mut light {
            pattern.iter_mut().zip(lit).filter(|(_, lit)| !**lit).for_each(|(light, _)| *light = 0.0);
        }
        let light = without_mean(light);
        let sum = |of: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            let pixels = 0..light.first().map_or(0, Vec::len);
            pixels.map(|pixel| (0..light.len()).map(|m| of(m, pixel)).sum()).collect()
        };
        let square = sum(&|m, pixel| light[m][pixel].powi(2));
        let along = sum(&|m, pixel| light[m][pixel] * photos[m][pixel]);
        let direct = along.iter().zip(&square).map(|(along, square)| ratio(*along, *square)).collect();
        let mut fit = Self { light, square, spread, direct, left: Vec::new() };
        fit.left = photos
            .iter()
            .enumerate()
            .map(|(m, photo)| {
                photo.iter().zip(fit.photo(m, &fit.direct)).map(|(y, fitted)| y - fitted).collect()
            })
            .collect();
        fit
    }

    /// The product `S (d ∘ u_m)`.
    fn photo(&self, m: usize, direct: &[f64]) -> Vec<f64> {
        let light: Vec<f64> = direct.iter().zip(&self.light[m]).map(|(d, u)| d * u).collect();
        match self.spread {
            Some(spread) => spread.apply(&light),
            None => light,
        }
    }

    /// The sum `Σ_m u_m ∘ Sᵀ z_m` for the residuals `z_m`: half the negative gradient of the sum of squares.
    fn gradient(&self, spread: &PixelSpread) -> Vec<f64> {
        let mut sum = vec![0.0; self.square.len()];
        for (left, light) in self.left.iter().zip(&self.light) {
            let back = spread.apply_transposed(left);
            sum.iter_mut().zip(back.iter().zip(light)).for_each(|(sum, (z, u))| *sum += z * u);
        }
        sum
    }

    /// Takes `steps` steps of conjugate gradients for least squares, scaled by the diagonal. It does nothing without a spread.
    pub(crate) fn improve(&mut self, steps: usize) {
        let Some(spread) = self.spread else { return };
        let diagonal: Vec<f64> =
            spread.squares().iter().zip(&self.square).map(|(spread, square)| spread * square).collect();
        let scaled = |gradient: &[f64]| -> Vec<f64> {
            gradient.iter().zip(&diagonal).map(|(gradient, diagonal)| ratio(*gradient, *diagonal)).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut gradient = self.gradient(spread);
        let mut direction = scaled(&gradient);
        let mut norm = dot(&gradient, &direction);
        for _ in 0..steps {
            let images: Vec<Vec<f64>> = (0..self.light.len()).map(|m| self.photo(m, &direction)).collect();
            let curvature: f64 = images.iter().map(|image| dot(image, image)).sum();
            if !(curvature > 0.0 && norm > 0.0) {
                break;
            }
            let step = norm / curvature;
            self.direct.iter_mut().zip(&direction).for_each(|(d, direction)| *d += step * direction);
            for (left, image) in self.left.iter_mut().zip(&images) {
                left.iter_mut().zip(image).for_each(|(left, image)| *left -= step * image);
            }
            gradient = self.gradient(spread);
            let next = scaled(&gradient);
            let next_norm = dot(&gradient, &next);
            direction.iter_mut().zip(&next).for_each(|(d, next)| *d = next + next_norm / norm * *d);
            norm = next_norm;
        }
    }

    /// The derivative of a pixel's direct light with respect to a photo's value, without the spread.
    pub(crate) fn slope(&self, pixel: usize, photo: usize) -> f64 {
        ratio(self.light[photo][pixel], self.square[pixel])
    }

    /// The sum of squared residuals.
    pub(crate) fn residual(&self) -> f64 {
        self.left.iter().flatten().map(|value| value * value).sum()
    }

    /// The sum of squared residuals in each pixel.
    pub(crate) fn residuals(&self) -> Vec<f64> {
        let of = |pixel: usize| self.left.iter().map(|left| left[pixel] * left[pixel]).sum();
        (0..self.square.len()).map(of).collect()
    }

    /// The direct light with its variance. The variance comes from the photos' `noise`, or from the residual when the residual is clearly
    /// larger than the noise. A few photos say little about one pixel, so the residuals of neighbours are averaged.
    pub(crate) fn plane(self, noise: Vec<f64>, resolution: Resolution) -> Plane {
        // Each pixel has two unknowns: direct and global light.
        let freedom = self.left.len().saturating_sub(2).max(1) as f64;
        let left: Vec<f64> = self.residuals().iter().map(|squares| squares / freedom).collect();
        let left = Blur::new(resolution, 1.0).map_or_else(|| left.clone(), |blur| blur.apply(&left));
        let shown = left.iter().zip(&self.square).map(|(left, square)| ratio(*left, *square));
        let either = |(noise, shown): (f64, f64)| if shown > CLEARLY * noise { shown } else { noise };
        let variance = noise.into_iter().zip(shown).map(either).collect();
        Plane { values: self.direct, variance }
    }
}

/// Returns `a / b`, or 0 when `b` is 0: then a pixel's light never changes, and the photos do not determine its direct light.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// Subtracts the planes' mean from each plane.
pub(crate) fn without_mean(mut planes: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let count = planes.len() as f64;
    for pixel in 0..planes.first().map_or(0, Vec::len) {
        let mean = planes.iter().map(|plane| plane[pixel]).sum::<f64>() / count;
        planes.iter_mut().for_each(|plane| plane[pixel] -= mean);
    }
    planes
}

// The uncertainty of the projector's blur, and its effect on the direct light.
//
// Light that a pixel sends to its neighbours by way of other surfaces looks like a blur, but only near edges and creases. A blur that is a
// little too wide makes the direct light of all pixels a little too bright, and an average over pixels does not remove this error. The
// error of the blur is estimated from the disagreement between parts of the picture. Let `R_b(t)` be the sum of the squared residuals in
// part `b` if an additional share `t` of each pixel's light goes to its neighbours. With derivatives in `t`, the error is `√Σ_b R_b'²`
// divided by `Σ_b R_b''` (a cluster-robust standard error).

/// The step in the share `t` for the finite differences of the squared residuals.
const SHARE_STEP: f64 = 0.002;

/// The side of a part of the picture, in pixels. Light that arrives by way of other surfaces changes little over several pixels.
const PART: usize = 8;

/// The standard error of the blur, and the dependence of direct light on the blur.
#[derive(Clone, Debug)]
pub(crate) struct BlurDoubt {
    pub(crate) resolution: Resolution,
    /// The standard error of the share of a pixel's light that goes to its neighbours.
    pub(crate) error: f64,
    /// The derivative of `d` with respect to this share, for each of the camera's channels.
    pub(crate) slopes: Vec<Vec<f64>>,
}

impl BlurDoubt {
    /// The uncertainty of the blur for `channels` channels. `fit(channel, share)` fits a channel when the share of a pixel's light that goes
    /// to its neighbours is larger by `share`.
    pub(crate) fn of<'a>(
        resolution: Resolution,
        channels: usize,
        fit: &dyn Fn(usize, f64) -> DirectFit<'a>,
    ) -> Self {
        let n = resolution.pixels();
        let (mut squares, mut slopes) = ([vec![0.0; n], vec![0.0; n], vec![0.0; n]], Vec::new());
        for channel in 0..channels {
            let fits = [-SHARE_STEP, 0.0, SHARE_STEP].map(|by| fit(channel, by));
            for (sum, fit) in squares.iter_mut().zip(&fits) {
                sum.iter_mut().zip(fit.residuals()).for_each(|(sum, square)| *sum += square);
            }
            let [less, _, more] = &fits;
            let change = less.direct.iter().zip(&more.direct);
            slopes.push(change.map(|(less, more)| (more - less) / (2.0 * SHARE_STEP)).collect());
        }
        Self { resolution, error: share_error(resolution, &squares), slopes }
    }

    /// The derivative of a pattern with respect to the share of light that goes to the neighbours.
    pub(crate) fn widened(&self, pattern: &[f64]) -> Vec<f64> {
        neighbours(self.resolution, pattern).iter().zip(pattern).map(|(near, own)| near - own).collect()
    }
}

/// Gives a share `by` of each pixel's light to its neighbours.
pub(crate) fn wider(resolution: Resolution, pattern: &[f64], by: f64) -> Vec<f64> {
    let near = neighbours(resolution, pattern);
    pattern.iter().zip(near).map(|(own, near)| own + by * (near - own)).collect()
}

/// The mean of the four neighbours of each pixel. A pixel at the border replaces a missing neighbour by itself.
fn neighbours(Resolution { width, height }: Resolution, pattern: &[f64]) -> Vec<f64> {
    let mean = |pixel: usize| {
        let (x, y) = (pixel % width, pixel / width);
        let or_own = |is_there: bool, other: usize| pattern[if is_there { other } else { pixel }];
        0.25 * (or_own(x > 0, pixel.wrapping_sub(1))
            + or_own(x + 1 < width, pixel + 1)
            + or_own(y > 0, pixel.wrapping_sub(width))
            + or_own(y + 1 < height, pixel + width))
    };
    (0..pattern.len()).map(mean).collect()
}

/// The standard error of the share. The arguments are the squared residuals of each pixel with a smaller, the same and a larger share.
fn share_error(resolution: Resolution, [less, same, more]: &[Vec<f64>; 3]) -> f64 {
    let columns = resolution.width.div_ceil(PART);
    let mut slopes = vec![0.0; columns * resolution.height.div_ceil(PART)];
    let mut curvature = 0.0;
    for pixel in 0..same.len() {
        let part = pixel / resolution.width / PART * columns + pixel % resolution.width / PART;
        slopes[part] += (more[pixel] - less[pixel]) / (2.0 * SHARE_STEP);
        curvature += (more[pixel] + less[pixel] - 2.0 * same[pixel]) / (SHARE_STEP * SHARE_STEP);
    }
    if curvature <= 0.0 {
        return 0.0;
    }
    slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt() / curvature
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::direct::DirectPatterns;
    use crate::measure::footprint::by_overlap;
    use crate::measure::lens_map::LensMap;

    /// The photos of direct light, minus their mean over the patterns.
    fn photos(direct: &[f64], shown: &[Vec<f64>], spread: Option<&PixelSpread>) -> Vec<Vec<f64>> {
        let photo = |pattern: &Vec<f64>| -> Vec<f64> {
            let light: Vec<f64> = direct.iter().zip(pattern).map(|(d, u)| d * u).collect();
            spread.map_or(light.clone(), |spread| spread.apply(&light))
        };
        without_mean(shown.iter().map(photo).collect())
    }

    fn uneven(count: usize) -> Vec<f64> {
        (0..count).map(|pixel| 1.0 + (pixel * 7 % 11) as f64 / 10.0).collect()
    }

    #[test]
    fn without_a_spread_the_fit_is_exact_at_once() {
        let resolution = Resolution::new(6, 5);
        let mut shown = DirectPatterns::Squares(2).shown(resolution, &[true; 30]);
        // The photos do not determine the direct light of a pixel that is never lit.
        shown.iter_mut().for_each(|pattern| pattern[4] = 0.0);
        let direct = uneven(30);
        let photos = photos(&direct, &shown, None);
        let mut fit = DirectFit::new(&shown, &[true; 30], None, None, &photos);
        fit.improve(5);
        assert!(fit.residual() < 1e-25);
        // The fit is linear in the photos. `slope` gives the factors.
        for pixel in 0..30 {
            let sum: f64 =
                photos.iter().enumerate().map(|(m, photo)| fit.slope(pixel, m) * photo[pixel]).sum();
            let expected = if pixel == 4 { 0.0 } else { direct[pixel] };
            assert!(
                (sum - expected).abs() < 1e-12 && (fit.direct[pixel] - expected).abs() < 1e-12,
                "{pixel}"
            );
        }
    }

    /// The patterns have values of ±1 and ±2. The residuals of ±e are orthogonal to the patterns.
    #[test]
    fn the_variance_is_that_of_noise_or_of_the_residuals_where_they_are_clearly_larger() {
        let resolution = Resolution::new(8, 6);
        let signs = [1.0, -1.0, 1.0, -1.0];
        let shown: Vec<Vec<f64>> = signs
            .map(|sign| (0..48).map(|pixel| if pixel < 24 { 3.0 + sign } else { 3.0 + 2.0 * sign }).collect())
            .to_vec();
        let e = 0.1;
        let mut photos = photos(&uneven(48), &shown, None);
        for (photo, sign) in photos.iter_mut().zip([1.0, 1.0, -1.0, -1.0]) {
            photo.iter_mut().for_each(|value| *value += sign * e);
        }
        let fit = || DirectFit::new(&shown, &[true; 48], None, None, &photos);
        assert!((fit().residual() - 4.0 * 48.0 * e * e).abs() < 1e-12);
        // The squared residuals are 4 e² with two degrees of freedom. The patterns' sums of squares are 4 and 16.
        let from_residuals = |pixel: usize| 2.0 * e * e / if pixel < 24 { 4.0 } else { 16.0 };
        for (share, counts) in [(1.0 / 1.7, true), (1.0 / 1.5, false), (2.0, false), (0.0, true)] {
            let noise: Vec<f64> = (0..48).map(|pixel| share * from_residuals(pixel)).collect();
            let plane = fit().plane(noise.clone(), resolution);
            for (pixel, (found, noise)) in plane.variance.iter().zip(&noise).enumerate() {
                let expected = if counts { from_residuals(pixel) } else { *noise };
                assert!((found / expected - 1.0).abs() < 1e-9, "{share} {pixel}");
            }
            let (found, expected) = (plane.values, uneven(48));
            assert!(found.iter().zip(&expected).all(|(f, e)| (f - e).abs() < 1e-12));
        }
    }

    #[test]
    fn residuals_of_neighbours_are_averaged() {
        let resolution = Resolution::new(9, 9);
        let shown = [vec![1.0; 81], vec![0.0; 81], vec![1.0; 81], vec![0.0; 81], vec![0.5; 81]];
        let mut photos = photos(&[1.0; 81], &shown, None);
        photos[4][40] = 0.3;
        let plane =
            DirectFit::new(&shown, &[true; 81], None, None, &photos).plane(vec![1e-9; 81], resolution);
        let blur = Blur::new(resolution, 1.0).expect("a blur of one pixel");
        // There are three degrees of freedom. The patterns' squares add up to one.
        let one: Vec<f64> = (0..81).map(|pixel| if pixel == 40 { 0.09 / 3.0 } else { 0.0 }).collect();
        for (found, expected) in plane.variance.iter().zip(blur.apply(&one)) {
            let expected = if expected > 1.6e-9 { expected } else { 1e-9 };
            assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
        }
    }

    /// At a silhouette, the camera sees a trace of a pixel that is never lit, and the projector's blur sends a trace of light to this
    /// pixel. Errors of the photos, for example due to a map that is off by 0.01 pixels, must not become direct light of this pixel or
    /// spoil its neighbours.
    #[test]
    fn pixels_that_are_never_lit_explain_nothing() {
        let resolution = Resolution::new(12, 10);
        let camera = Resolution::new(24, 20);
        let lit: Vec<bool> = (0..120).map(|pixel| pixel % 12 < 9).collect();
        let unit = 0.5 * 12.0_f64.hypot(10.0);
        let blur = Blur::new(resolution, 0.3);
        for past in [0.0, 0.002, 0.005, 0.01, -0.01, 0.1, 0.5] {
            let lens = LensMap {
                camera,
                projector: resolution,
                homography: [1.0, 0.0, past / unit, 0.0, 1.0, 0.3 * past / unit, 0.0, 0.0],
                distortion: [0.0; 2],
            };
            let spread = PixelSpread::new(&by_overlap(&lens, &[true; 480]), &lens);
            let shown = DirectPatterns::Codes.shown(resolution, &lit);
            let direct: Vec<f64> =
                uneven(120).into_iter().zip(&lit).map(|(d, &lit)| if lit { d } else { 0.0 }).collect();
            let seen: Vec<Vec<f64>> = shown
                .iter()
                .map(|pattern| blur.as_ref().map_or(pattern.clone(), |blur| blur.apply(pattern)))
                .collect();
            let mut photos = photos(&direct, &seen, Some(&spread));
            // The photos have an error of a thousandth of white.
            for (m, photo) in photos.iter_mut().enumerate() {
                photo.iter_mut().enumerate().for_each(|(at, y)| *y += 1e-3 * ((at * 7 + m * 5) % 3) as f64);
            }
            let photos = without_mean(photos);
            let mut fit = DirectFit::new(&shown, &lit, blur.as_ref(), Some(&spread), &photos);
            fit.improve(40);
            for (pixel, (found, truth)) in fit.direct.iter().zip(&direct).enumerate() {
                // At a shift of half a pixel, the fit undoes the spread of the camera's pixels, and errors grow.
                let most = if past < 0.2 { 0.01 } else { 0.1 };
                assert!((found - truth).abs() < most, "{past}: {found} for {truth} at {pixel}");
            }
        }
    }

    /// The camera has the projector's number of pixels and is shifted by half a pixel.
    #[test]
    fn with_a_spread_conjugate_gradients_end_after_as_many_steps_as_there_are_pixels() {
        let resolution = Resolution::new(4, 3);
        let lens = LensMap {
            camera: resolution,
            projector: resolution,
            homography: [1.0, 0.0, 0.5 / 2.5, 0.0, 1.0, 0.2 / 2.5, 0.0, 0.0],
            distortion: [0.0; 2],
        };
        let spread = PixelSpread::new(&by_overlap(&lens, &[true; 12]), &lens);
        let shown = DirectPatterns::Squares(2).shown(resolution, &[true; 12]);
        let direct = uneven(12);
        let photos = photos(&direct, &shown, Some(&spread));
        let after = |steps: usize| {
            let mut fit = DirectFit::new(&shown, &[true; 12], None, Some(&spread), &photos);
            fit.improve(steps);
            fit
        };
        let residuals: Vec<f64> = (0..12).map(|steps| after(steps).residual()).collect();
        assert!(residuals.windows(2).all(|pair| pair[1] < pair[0]), "{residuals:?}");
        assert!(residuals[0] > 1e-3, "there is something to improve");
        for steps in [12, 60] {
            let fit = after(steps);
            assert!(fit.residual() < 1e-18 * residuals[0], "{} after {steps}", fit.residual());
            assert!(fit.direct.iter().zip(&direct).all(|(f, d)| (f - d).abs() < 1e-8), "{:?}", fit.direct);
        }
    }

    #[test]
    fn light_goes_to_neighbours_and_none_is_lost() {
        let size = Resolution::new(5, 4);
        let pattern: Vec<f64> = (0..20).map(|pixel| f64::from(pixel * 7 % 5)).collect();
        let wide = wider(size, &pattern, 0.3);
        let light = |pattern: &[f64]| pattern.iter().sum::<f64>();
        assert!((light(&wide) - light(&pattern)).abs() < 1e-12, "rounding");
        // An inner pixel gets a quarter of the light that each of its neighbours gives away.
        let near = pattern[6] + pattern[8] + pattern[2] + pattern[12];
        assert!((wide[7] - (0.7 * pattern[7] + 0.3 * 0.25 * near)).abs() < 1e-14);
    }

    /// The squared residuals of the two parts are least at opposite shares. The sum over both parts is least at the mean of these shares,
    /// 0.
    #[test]
    fn parts_that_disagree_make_the_error_of_their_mean() {
        let size = Resolution::new(2 * PART, PART);
        let apart = 0.001;
        let least = |pixel: usize| if pixel % (2 * PART) < PART { apart } else { -apart };
        let squares = [-SHARE_STEP, 0.0, SHARE_STEP].map(|share| {
            (0..size.pixels()).map(|pixel| 1.0 + (share - least(pixel)).powi(2)).collect::<Vec<f64>>()
        });
        // Two shares, each off by 0.001, have a mean with a standard error of 0.001 / √2.
        assert!((share_error(size, &squares) - apart / 2.0_f64.sqrt()).abs() < 1e-9);
    }
}
