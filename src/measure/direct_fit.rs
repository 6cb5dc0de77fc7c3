//! The least-squares fit of one channel's direct light to the photos of shifted patterns.

use super::photo::Plane;
use super::spread::Spread;
use crate::image::{Blur, Resolution};

/// A residual shows an error of the model where its square is so many times that of the noise. The mean over neighbours of noise alone
/// scatters by 0.16, with six degrees of freedom in each of some twelve pixels.
const CLEARLY: f64 = 1.6;

/// `Σ_m ‖y_m − S (d ∘ u_m)‖²` with patterns `u_m` and photos `y_m`, each less its mean over the patterns.
pub(super) struct DirectFit<'a> {
    light: Vec<Vec<f64>>,
    /// `Σ_m u_m²` at each pixel.
    square: Vec<f64>,
    spread: Option<&'a Spread>,
    direct: Vec<f64>,
    /// What is left of the photos.
    left: Vec<Vec<f64>>,
}

impl<'a> DirectFit<'a> {
    /// The fit without the spread, which is exact where there is none. The `photos` are less their mean, the patterns as they were `shown`.
    pub(super) fn new(
        shown: &[Vec<f64>],
        blur: Option<&Blur>,
        spread: Option<&'a Spread>,
        photos: &[Vec<f64>],
    ) -> Self {
        let light: Vec<Vec<f64>> = match blur {
            Some(blur) => shown.iter().map(|pattern| blur.apply(pattern)).collect(),
            None => shown.to_vec(),
        };
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

    /// `S (d ∘ u_m)`.
    fn photo(&self, m: usize, direct: &[f64]) -> Vec<f64> {
        let light: Vec<f64> = direct.iter().zip(&self.light[m]).map(|(d, u)| d * u).collect();
        match self.spread {
            Some(spread) => spread.apply(&light),
            None => light,
        }
    }

    /// `Σ_m u_m ∘ Sᵀ z_m` for what is left of the photos: half the negative gradient of the sum of squares.
    fn gradient(&self, spread: &Spread) -> Vec<f64> {
        let mut sum = vec![0.0; self.square.len()];
        for (left, light) in self.left.iter().zip(&self.light) {
            let back = spread.apply_transposed(left);
            sum.iter_mut().zip(back.iter().zip(light)).for_each(|(sum, (z, u))| *sum += z * u);
        }
        sum
    }

    /// Takes so many steps of conjugate gradients for least squares, scaled by the diagonal. Without a spread there is nothing to improve.
    pub(super) fn improve(&mut self, steps: usize) {
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

    /// The factor of a photo in the direct light of a pixel, without the spread.
    pub(super) fn slope(&self, pixel: usize, photo: usize) -> f64 {
        ratio(self.light[photo][pixel], self.square[pixel])
    }

    /// The sum of squares that is left.
    pub(super) fn residual(&self) -> f64 {
        self.left.iter().flatten().map(|value| value * value).sum()
    }

    /// The direct light. Its variance is that of the photos' `noise`, or that which the residual shows where it is clearly more. A few photos
    /// tell little of one pixel, so that the residuals of neighbours are averaged.
    pub(super) fn plane(self, noise: Vec<f64>, resolution: Resolution) -> Plane {
        // Each pixel has two unknowns: direct and global light.
        let freedom = self.left.len().saturating_sub(2).max(1) as f64;
        let of = |pixel: usize| self.left.iter().map(|left| left[pixel].powi(2)).sum::<f64>() / freedom;
        let left: Vec<f64> = (0..self.square.len()).map(of).collect();
        let left = Blur::new(resolution, 1.0).map_or_else(|| left.clone(), |blur| blur.apply(&left));
        let shown = left.iter().zip(&self.square).map(|(left, square)| ratio(*left, *square));
        let either = |(noise, shown): (f64, f64)| if shown > CLEARLY * noise { shown } else { noise };
        let variance = noise.into_iter().zip(shown).map(either).collect();
        Plane { values: self.direct, variance }
    }
}

/// `a / b`, or 0 where `b` is 0: a pixel whose light never changes tells nothing.
fn ratio(a: f64, b: f64) -> f64 {
    if b > 0.0 { a / b } else { 0.0 }
}

/// The planes less their mean.
pub(super) fn without_mean(mut planes: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let count = planes.len() as f64;
    for pixel in 0..planes.first().map_or(0, Vec::len) {
        let mean = planes.iter().map(|plane| plane[pixel]).sum::<f64>() / count;
        planes.iter_mut().for_each(|plane| plane[pixel] -= mean);
    }
    planes
}
