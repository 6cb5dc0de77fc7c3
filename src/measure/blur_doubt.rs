//! What the fit of direct light does not know of the projector's blur.
//!
//! Light that a pixel sends to its neighbours by way of other surfaces looks like a blur, and near edges and creases only. A blur that is a little too wide makes
//! the direct light of all pixels a little too bright, which no average over pixels takes out. The error of the blur is found from how much
//! parts of the picture disagree on it: with `R_b(t)` the squares that are left in part `b` if a share `t` more of each pixel's light goes to its
//! neighbours, it is `√Σ_b R_b'²` over the curvature of `Σ_b R_b` (a cluster-robust standard error).

use super::direct_fit::DirectFit;
use crate::image::Resolution;

/// The share `t` over which squares are differentiated.
const STEP: f64 = 0.002;

/// The side of a part of the picture in pixels: light by way of other surfaces is alike over several pixels.
const PART: usize = 8;

/// The standard error of the blur, and how direct light depends on it.
#[derive(Clone, Debug)]
pub(crate) struct BlurDoubt {
    resolution: Resolution,
    /// The standard error of the share of a pixel's light that goes to its neighbours.
    pub(crate) error: f64,
    /// The change of `d` with this share, for each of the camera's channels.
    pub(crate) slopes: Vec<Vec<f64>>,
}

impl BlurDoubt {
    /// That of fits of each of the `channels`, where `fit` has so much more light go to the neighbours.
    pub(crate) fn of<'a>(
        resolution: Resolution,
        channels: usize,
        fit: &dyn Fn(usize, f64) -> DirectFit<'a>,
    ) -> Self {
        let n = resolution.pixels();
        let (mut squares, mut slopes) = ([vec![0.0; n], vec![0.0; n], vec![0.0; n]], Vec::new());
        for channel in 0..channels {
            let fits = [-STEP, 0.0, STEP].map(|by| fit(channel, by));
            for (sum, fit) in squares.iter_mut().zip(&fits) {
                sum.iter_mut().zip(fit.residuals()).for_each(|(sum, square)| *sum += square);
            }
            let [less, _, more] = &fits;
            let change = less.direct().iter().zip(more.direct());
            slopes.push(change.map(|(less, more)| (more - less) / (2.0 * STEP)).collect());
        }
        Self { resolution, error: error(resolution, &squares), slopes }
    }

    /// A blur that is known.
    #[cfg(test)]
    pub(crate) fn none(resolution: Resolution) -> Self {
        Self { resolution, error: 0.0, slopes: vec![vec![0.0; resolution.pixels()]] }
    }

    /// The change of a pattern with the share of light that goes to the neighbours.
    pub(crate) fn widened(&self, pattern: &[f64]) -> Vec<f64> {
        neighbours(self.resolution, pattern).iter().zip(pattern).map(|(near, own)| near - own).collect()
    }
}

/// The pattern with a share `by` of each pixel's light given to its neighbours.
pub(crate) fn wider(resolution: Resolution, pattern: &[f64], by: f64) -> Vec<f64> {
    let near = neighbours(resolution, pattern);
    pattern.iter().zip(near).map(|(own, near)| own + by * (near - own)).collect()
}

/// The mean of the four neighbours of each pixel. At the border a pixel stands for the neighbour that it lacks.
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

/// The standard error of the share from the squares that are left in each pixel with less, as much and more of it.
fn error(resolution: Resolution, [less, same, more]: &[Vec<f64>; 3]) -> f64 {
    let columns = resolution.width.div_ceil(PART);
    let mut slopes = vec![0.0; columns * resolution.height.div_ceil(PART)];
    let mut curvature = 0.0;
    for pixel in 0..same.len() {
        let part = pixel / resolution.width / PART * columns + pixel % resolution.width / PART;
        slopes[part] += (more[pixel] - less[pixel]) / (2.0 * STEP);
        curvature += (more[pixel] + less[pixel] - 2.0 * same[pixel]) / (STEP * STEP);
    }
    if curvature <= 0.0 {
        return 0.0;
    }
    slopes.iter().map(|slope| slope * slope).sum::<f64>().sqrt() / curvature
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_goes_to_neighbours_and_none_is_lost() {
        let size = Resolution::new(5, 4);
        let pattern: Vec<f64> = (0..20).map(|pixel| f64::from(pixel * 7 % 5)).collect();
        let wide = wider(size, &pattern, 0.3);
        let light = |pattern: &[f64]| pattern.iter().sum::<f64>();
        assert!((light(&wide) - light(&pattern)).abs() < 1e-12, "rounding");
        // A pixel inside has a quarter of what each of its neighbours gives.
        let near = pattern[6] + pattern[8] + pattern[2] + pattern[12];
        assert!((wide[7] - (0.7 * pattern[7] + 0.3 * 0.25 * near)).abs() < 1e-14);
    }

    /// The squares of each part are least at a share of its own; those of the whole are least at their mean, 0.
    #[test]
    fn parts_that_disagree_make_the_error_of_their_mean() {
        let size = Resolution::new(2 * PART, PART);
        let apart = 0.001;
        let least = |pixel: usize| if pixel % (2 * PART) < PART { apart } else { -apart };
        let squares = [-STEP, 0.0, STEP].map(|share| {
            (0..size.pixels()).map(|pixel| 1.0 + (share - least(pixel)).powi(2)).collect::<Vec<f64>>()
        });
        // Two shares, each off by 0.001, have a mean with a standard error of 0.001 / √2.
        assert!((error(size, &squares) - apart / 2.0_f64.sqrt()).abs() < 1e-9);
    }
}
