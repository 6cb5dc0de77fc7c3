//! The fit of the lens map to the edges of stripes, to hundredths of a pixel.
//!
//! Gray codes identify the projector pixel that a camera pixel sees, but not the position within that projector pixel. A map that is fitted
//! to Gray codes follows this rounding, by up to a tenth of a pixel at the border of the field. A camera pixel that sees the edge of a
//! stripe is more informative: the contrast of the stripes in its photos shows how much of its area lies on either side of the edge. The
//! map is therefore fitted to the photos of the finest stripes.
//!
//! For camera pixel `j`, `D_jp = d_j S_jp` is the photo of stripes `p` minus the photo of the inverse stripes. `d_j` is the direct light of
//! the pixel. `S_jp` is the mean of the stripes (1 and −1) over the area that the pixel sees according to the map. The map's parameters
//! minimise the squares of `D_jp / d_j − S_jp`, by Gauss–Newton iteration with Tukey's weights. Each step eliminates `d_j` (variable
//! projection, Kaufman 1975).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::least_squares::{Clusters, Equations, Normal, form};
use super::map_fit::{Fit, weight};
use super::structured_light::{Decoded, SIGMAS, gray_bit};
use crate::error::Result;
use crate::image::{Resolution, percentile};
use crate::measure::footprint::{area, corners, overlapped};
use crate::measure::lens_map::{LensMap, PARAMETERS, centre, evaluate, half_diagonal, normalized};

/// The approximate number of camera pixels that are used. If more camera pixels are usable, pixels are drawn at random.
const MOST: f64 = 40_000.0;

const STEPS: usize = 20;

/// The iteration ends when a step moves the map by less than this many projector pixels.
const SMALLEST_STEP: f64 = 1e-5;

/// The derivative of the stripes is computed as a difference over this distance, in projector pixels.
const SHIFT: f64 = 0.02;

/// The error of the model, as a fraction of the direct light. The model neglects light of the stripes that reaches a pixel by way of other
/// surfaces, and changes of the brightness within a pixel.
const MODEL: f64 = 0.01;

/// A camera pixel is left out when its misfit is at least the median misfit times this factor.
const LIMIT: f64 = 5.0;

/// The largest number of stripe patterns that are used: the two finest patterns of each axis.
const PLANES: usize = 4;

/// A camera pixel with one equation for each stripe pattern.
struct EdgePixel {
    equations: Equations<PLANES>,
    /// The column and the row of the projector pixel that the camera pixel sees.
    near: [u64; 2],
}

impl EdgePixel {
    /// The norm of the residuals, in units of the expected noise.
    fn misfit(&self) -> f64 {
        (self.equations.weight * self.equations.residuals.iter().map(|r| r * r).sum::<f64>()).sqrt()
    }

    /// The equations with a robust weight. The weight is 0 when the misfit is at least `limit`.
    fn robust(&self, limit: f64) -> Equations<PLANES> {
        Equations { weight: self.equations.weight * weight(self.misfit(), limit), ..self.equations }
    }
}

/// Fits the map to the stripes. The iteration starts from a map whose error is about one pixel. Fails with [`crate::Error::Numerical`] when
/// too few camera pixels see the edges of stripes.
pub(crate) fn refined(first: &Fit, decoded: &Decoded) -> Result<Fit> {
    let mut map = first.map.clone();
    let pixels = chosen(decoded);
    for _ in 0..STEPS {
        let equations = equations(&map, decoded, &pixels);
        let step = normal_equations(&equations).damped(1e-9).solve()?.values;
        let before = map.clone();
        map = map.moved(&step);
        if farthest(&before, &map) < SMALLEST_STEP {
            break;
        }
    }
    let error = field_error(&map, &equations(&map, decoded, &pixels), &pixels)?;
    Ok(Fit { map, error, ..first.clone() })
}

/// Chooses camera pixels that are lit and not saturated, so that their direct light is known.
fn chosen(decoded: &Decoded) -> Vec<usize> {
    let usable = |pixel: &usize| decoded.lit[*pixel] && !decoded.saturated[*pixel];
    let all: Vec<usize> = (0..decoded.lit.len()).filter(usable).collect();
    let share = MOST / all.len() as f64;
    let mut random = Pcg64::seed_from_u64(0);
    all.into_iter().filter(|_| share >= 1.0 || random.random::<f64>() < share).collect()
}

fn equations(map: &LensMap, decoded: &Decoded, pixels: &[usize]) -> Vec<EdgePixel> {
    pixels.par_iter().filter_map(|&pixel| of_pixel(map, decoded, pixel)).collect()
}

/// Sets up the equations of one camera pixel. Returns `None` when the pixel sees no edge, or when its direct light is unknown.
fn of_pixel(map: &LensMap, decoded: &Decoded, pixel: usize) -> Option<EdgePixel> {
    let seen = corners(map, pixel);
    let stripes = |right: f64, down: f64| {
        mean_stripes(seen.map(|[x, y]| [x + right, y + down]), map.projector, decoded)
    };
    let light: [f64; PLANES] = std::array::from_fn(|plane| {
        decoded.stripes.get(plane).map_or(0.0, |stripes| stripes.difference[pixel])
    });
    let expected = stripes(0.0, 0.0);
    let square = product(&expected, &expected);
    let direct = product(&light, &expected) / square;
    if !(square > 0.25 && direct > SIGMAS * decoded.noise[pixel]) {
        return None;
    }
    // A change of the direct light can explain a part of a change of the stripes. This part is removed.
    let change = |more: [f64; PLANES], less: [f64; PLANES]| {
        let change: [f64; PLANES] = std::array::from_fn(|plane| (more[plane] - less[plane]) / (2.0 * SHIFT));
        let along = product(&change, &expected) / square;
        std::array::from_fn::<f64, PLANES, _>(|plane| change[plane] - along * expected[plane])
    };
    let right = change(stripes(SHIFT, 0.0), stripes(-SHIFT, 0.0));
    let down = change(stripes(0.0, SHIFT), stripes(0.0, -SHIFT));
    if product(&right, &right) + product(&down, &down) < 1e-6 {
        return None;
    }
    let unit = half_diagonal(map.projector);
    let (_, of_map) = evaluate(&map.parameters(), normalized(centre(pixel, map.camera), map.camera));
    let slope = |plane: usize, i: usize| unit * (right[plane] * of_map[0][i] + down[plane] * of_map[1][i]);
    let noise = (decoded.noise[pixel] / direct).hypot(MODEL);
    let equations = Equations {
        residuals: std::array::from_fn(|plane| light[plane] / direct - expected[plane]),
        slopes: std::array::from_fn(|plane| std::array::from_fn(|i| slope(plane, i))),
        weight: 1.0 / (noise * noise),
    };
    Some(EdgePixel {
        equations,
        near: map.to_projector(centre(pixel, map.camera)).map(|at| at.max(0.0) as u64),
    })
}

/// The mean of each stripe pattern over the area that a camera pixel sees. The stripes are 0 outside the raster.
fn mean_stripes(seen: [[f64; 2]; 4], projector: Resolution, decoded: &Decoded) -> [f64; PLANES] {
    let mut mean = [0.0; PLANES];
    for (at, common) in overlapped(seen, projector) {
        for (mean, stripes) in mean.iter_mut().zip(&decoded.stripes) {
            *mean += if gray_bit(at[stripes.axis], stripes.bit) { common } else { -common };
        }
    }
    let whole = area(&seen);
    mean.map(|sum| sum / whole)
}

fn normal_equations(equations: &[EdgePixel]) -> Normal {
    let limit = limit(equations);
    let mut normal = Normal::new(PARAMETERS);
    equations.iter().for_each(|pixel| pixel.robust(limit).add_to(&mut normal));
    normal
}

/// The misfit from which a camera pixel is left out.
fn limit(equations: &[EdgePixel]) -> f64 {
    LIMIT * percentile(equations.iter().map(EdgePixel::misfit), 0.5).max(f64::MIN_POSITIVE)
}

/// The standard error of the map, in projector pixels: the root mean square over the camera pixels. Interreflections cause the same error
/// in all camera pixels along an edge. Residuals are therefore summed per projector row and column before they are squared (cluster-robust
/// covariance).
fn field_error(map: &LensMap, equations: &[EdgePixel], pixels: &[usize]) -> Result<f64> {
    let limit = limit(equations);
    let inverse = normal_equations(equations).solve()?.covariance;
    let mut clusters = Clusters::default();
    for pixel in equations {
        let Equations { residuals, slopes, weight } = pixel.robust(limit);
        for axis in [0, 1] {
            for (slopes, residual) in slopes.iter().zip(&residuals) {
                clusters.add((axis, pixel.near[axis]), slopes, weight * residual);
            }
        }
    }
    let covariance = clusters.covariance(&inverse);
    let unit = half_diagonal(map.projector);
    let squares = pixels.iter().map(|&pixel| {
        let (_, slopes) = evaluate(&map.parameters(), normalized(centre(pixel, map.camera), map.camera));
        slopes.iter().map(|row| form(&covariance, row)).sum::<f64>()
    });
    Ok(unit * (squares.sum::<f64>() / pixels.len() as f64).sqrt())
}

/// The largest distance between the projector points of two maps, over the corners and the centre of the camera.
fn farthest(one: &LensMap, other: &LensMap) -> f64 {
    let [width, height] = [one.camera.width as f64, one.camera.height as f64];
    let points = [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height], [0.5 * width, 0.5 * height]];
    let distance = |at: [f64; 2]| {
        let ([x, y], [u, v]) = (one.to_projector(at), other.to_projector(at));
        (x - u).hypot(y - v)
    };
    points.into_iter().map(distance).fold(0.0, f64::max)
}

fn product(a: &[f64; PLANES], b: &[f64; PLANES]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::super::map_fit::fit;
    use super::*;
    use crate::calibrate::structured_light::Stripes;
    use crate::measure::lens_map::Match;

    fn truth() -> LensMap {
        LensMap {
            camera: Resolution::new(120, 90),
            projector: Resolution::new(48, 36),
            homography: [1.002, 0.002, 0.012, -0.002, 1.002, -0.015, 0.002, -0.001],
            distortion: [0.004, 0.001],
        }
    }

    /// Photos of stripes by a camera with the map `truth`. `noise` is the standard deviation of the noise. The direct light differs from
    /// pixel to pixel, and every seventh pixel also sees stray light.
    fn decoded(truth: &LensMap, noise: f64) -> Decoded {
        let pixels = truth.camera.pixels();
        let empty = |axis, bit| Stripes { axis, bit, difference: vec![0.0; pixels] };
        let mut decoded = Decoded {
            seen: Vec::new(),
            between: Vec::new(),
            lit: vec![true; pixels],
            unreliable: 0.0,
            step: 1,
            white: vec![1.0; pixels],
            black: vec![0.0; pixels],
            direct: vec![1.0; pixels],
            noise: vec![noise.max(1e-4); pixels],
            saturated: vec![false; pixels],
            stripes: vec![empty(0, 0), empty(0, 1), empty(1, 0), empty(1, 1)],
        };
        let mut random = Pcg64::seed_from_u64(3);
        for pixel in 0..pixels {
            let direct = 0.5 + random.random::<f64>();
            let seen = mean_stripes(corners(truth, pixel), truth.projector, &decoded);
            for (stripes, mean) in decoded.stripes.iter_mut().zip(seen) {
                // The sum of three uniform numbers has a variance of a quarter.
                let sum: f64 = (0..3).map(|_| random.random::<f64>() - 0.5).sum();
                let stray = if pixel % 7 == 0 { random.random::<f64>() - 0.5 } else { 0.0 };
                stripes.difference[pixel] = direct * mean + 2.0 * noise * sum + stray;
            }
        }
        decoded
    }

    /// The map that is fitted to whole-pixel codes.
    fn by_codes(truth: &LensMap) -> Fit {
        let matches: Vec<Match> = (0..truth.camera.pixels())
            .map(|pixel| centre(pixel, truth.camera))
            .map(|camera| Match { camera, projector: truth.to_projector(camera).map(|at| at.floor() + 0.5) })
            .collect();
        fit(&matches, truth.camera, truth.projector, 0.41).expect("enough matches")
    }

    #[test]
    fn the_edges_of_stripes_give_the_map_to_a_hundredth_of_a_pixel() {
        let truth = truth();
        let first = by_codes(&truth);
        let found = refined(&first, &decoded(&truth, 0.01)).expect("edges everywhere");
        let off = [&first.map, &found.map].map(|map| farthest(map, &truth));
        assert!(off[0] > 0.05, "rounding misleads the first map, most of all in the corners: {off:?}");
        assert!(off[1] < 0.01, "{off:?}");
        // The largest error among five points is a few times the standard error.
        assert!((0.3..5.0).contains(&(off[1] / found.error)), "{off:?}, stated {}", found.error);
    }

    /// A slope is the change of a residual with a map parameter, while the direct light is adjusted to each map.
    #[test]
    fn slopes_are_the_derivatives_of_the_residuals() {
        let truth = truth();
        let exact = decoded(&truth, 0.0);
        let step = 1e-5;
        let [mut compared, mut agree] = [0; 2];
        for pixel in (0..truth.camera.pixels()).filter(|pixel| pixel % 7 != 0).step_by(97) {
            let Some(here) = of_pixel(&truth, &exact, pixel) else { continue };
            for parameter in 0..PARAMETERS {
                let moved = |by: f64| {
                    let mut change = [0.0; PARAMETERS];
                    change[parameter] = by;
                    of_pixel(&truth.moved(&change), &exact, pixel)
                };
                let (Some(more), Some(less)) = (moved(step), moved(-step)) else { continue };
                for plane in 0..PLANES {
                    let derivative =
                        (more.equations.residuals[plane] - less.equations.residuals[plane]) / (2.0 * step);
                    let slope = here.equations.slopes[plane][parameter];
                    let size = here
                        .equations
                        .slopes
                        .iter()
                        .map(|slopes| slopes[parameter].abs())
                        .fold(1.0, f64::max);
                    compared += 1;
                    agree += usize::from((derivative + slope).abs() < 0.05 * size);
                }
            }
        }
        // The derivative is a difference over 0.02 pixels. Within this distance, an edge may enter or leave the footprint, so a fifth of
        // the slopes may disagree.
        assert!(compared > 1000 && agree * 5 > compared * 4, "{agree} of {compared}");
    }

    #[test]
    fn photos_without_noise_give_the_exact_map() {
        let truth = truth();
        let mut exact = decoded(&truth, 0.0);
        (0..truth.camera.pixels()).filter(|pixel| pixel % 7 == 0).for_each(|pixel| exact.lit[pixel] = false);
        let found = refined(&by_codes(&truth), &exact).expect("edges everywhere");
        assert!(farthest(&found.map, &truth) < 1e-4, "{}", farthest(&found.map, &truth));
    }

    #[test]
    fn a_part_of_many_pixels_is_chosen() {
        let small = truth();
        let of = |camera| decoded(&LensMap { camera, ..small.clone() }, 0.0);
        assert_eq!(chosen(&of(small.camera)).len(), small.camera.pixels());
        let large = chosen(&of(Resolution::new(400, 200)));
        let left = large.iter().filter(|pixel| *pixel % 400 < 200).count();
        // Each of 80,000 pixels is chosen with a probability of one half. The standard deviation is 141 for the number of chosen pixels,
        // and 100 for the number in each half of the image.
        assert!((large.len() as f64 - MOST).abs() < 4.0 * 141.0, "{}", large.len());
        assert!((left as f64 - 0.5 * MOST).abs() < 4.0 * 100.0, "{left}");
    }

    #[test]
    fn a_camera_that_sees_no_edge_determines_nothing() {
        let projector = Resolution::new(16, 16);
        let map = LensMap {
            camera: projector,
            projector,
            homography: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            distortion: [0.0; 2],
        };
        let first = Fit { map: map.clone(), rms: 0.0, error: 0.0, outliers: 0.0 };
        let dark = Decoded { lit: vec![false; 256], ..decoded(&map, 0.0) };
        assert!(refined(&first, &dark).is_err());
    }
}
