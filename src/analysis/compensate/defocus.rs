//! A preconditioner for a lens out of focus. It divides by the frequency response of a Gaussian, except at frequencies that are lost.
//!
//! ```text
//! M = D^½ K D^½,    K = C diag(k_μ k_ν) Cᵀ,    k_μ = Σ_j κ_j cos(π j μ / N)
//! ```
//!
//! `D` is the white photo. `K` is a Gaussian blur with kernel `κ` of an image mirrored at its borders. Its eigenvectors are the columns of
//! the discrete cosine transform `C` (Strang, *The discrete cosine transform*, 1999, doi:10.1137/S0036144598336745). Frequencies that the
//! blur attenuates below a tenth are amplified by at most ten, because noise dominates these frequencies. The width of the Gaussian is
//! given, or estimated from one photo.

use crate::error::Result;
use crate::image::Resolution;
use crate::krylov::{Diagonal, Preconditioner};

/// The smallest attenuation factor that a frequency is divided by.
const LEAST: f64 = 0.1;

/// The candidate widths of the Gaussian, in pixels.
const WIDTHS: [f64; 14] = [0.0, 0.3, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.5, 8.0];

#[derive(Clone, Debug)]
pub(super) struct Defocus {
    /// The cosines, one row per frequency, along a row and along a column of the image.
    cosines: [Vec<Vec<f64>>; 2],
    kept: Vec<f64>,
    scaling: Vec<f64>,
}

impl Defocus {
    pub(super) fn new(resolution: Resolution, white: Vec<f64>, width: f64) -> Result<Self> {
        let scaling = Diagonal::new(white)?.entries().iter().map(|d| 1.0 / d.sqrt()).collect();
        let cosines = [resolution.width, resolution.height].map(cosines);
        let kept = spectrum(resolution, width);
        Ok(Self { cosines, kept, scaling })
    }

    /// Makes the preconditioner from one photo `y = A x` of a random pattern `x`. Among all candidate widths, it chooses the width that
    /// best explains the photo, frequency by frequency. The lowest sixteenth of the frequencies is left out, because it also contains
    /// indirect light. Also returns the width.
    pub(super) fn measured(
        resolution: Resolution,
        white: Vec<f64>,
        x: &[f64],
        y: &[f64],
    ) -> Result<(Self, f64)> {
        let mut found = Self::new(resolution, white, 0.0)?;
        let shown: Vec<f64> = x.iter().zip(&found.scaling).map(|(x, s)| x / s).collect();
        let seen: Vec<f64> = y.iter().zip(&found.scaling).map(|(y, s)| y * s).collect();
        let (shown, seen) = (found.transform(&shown), found.transform(&seen));
        let low = |index: usize| {
            let (mu, nu) = (index % resolution.width, index / resolution.width);
            16 * mu < resolution.width && 16 * nu < resolution.height
        };
        let explained = |width: &f64| {
            let kept = spectrum(resolution, *width);
            let (mut product, mut square) = (0.0, 0.0);
            for index in (0..kept.len()).filter(|&index| !low(index)) {
                product += kept[index] * shown[index] * seen[index];
                square += (kept[index] * shown[index]).powi(2);
            }
            if product > 0.0 { product * product / square.max(f64::MIN_POSITIVE) } else { 0.0 }
        };
        let width = WIDTHS.into_iter().max_by(|a, b| explained(a).total_cmp(&explained(b))).unwrap_or(0.0);
        found.kept = spectrum(resolution, width);
        Ok((found, width))
    }

    /// The cosine transform `Cᵀ x`.
    fn transform(&self, x: &[f64]) -> Vec<f64> {
        let [across, down] = &self.cosines;
        let rows: Vec<f64> =
            x.chunks(across.len()).flat_map(|row| across.iter().map(|c| dot(c, row))).collect();
        columns(&rows, across.len(), |column| down.iter().map(|c| dot(c, column)).collect())
    }

    fn back(&self, x: &[f64]) -> Vec<f64> {
        let [across, down] = &self.cosines;
        let rows: Vec<f64> = x.chunks(across.len()).flat_map(|row| combined(across, row)).collect();
        columns(&rows, across.len(), |column| combined(down, column))
    }
}

fn spectrum(resolution: Resolution, width: f64) -> Vec<f64> {
    let line = |length: usize| -> Vec<f64> {
        let reach = (4.0 * width).ceil() as usize;
        let weight = |at: usize| if at == 0 { 1.0 } else { 2.0 * (-0.5 * (at as f64 / width).powi(2)).exp() };
        let sum: f64 = (0..=reach).map(weight).sum();
        let at = |frequency: usize, offset: usize| {
            (std::f64::consts::PI * (frequency * offset) as f64 / length as f64).cos()
        };
        let share =
            |frequency| (0..=reach).map(|offset| weight(offset) * at(frequency, offset)).sum::<f64>() / sum;
        (0..length).map(share).collect()
    };
    let (across, down) = (line(resolution.width), line(resolution.height));
    down.iter().flat_map(|nu| across.iter().map(move |mu| mu * nu)).collect()
}

/// The orthonormal cosines of a line, `√(2/N) cos(π μ (j + ½)/N)`. The constant cosine (`μ = 0`) is divided by `√2`.
fn cosines(length: usize) -> Vec<Vec<f64>> {
    let n = length as f64;
    let row = |mu: usize| {
        let scale = if mu == 0 { (1.0 / n).sqrt() } else { (2.0 / n).sqrt() };
        (0..length).map(|j| scale * (std::f64::consts::PI * mu as f64 * (j as f64 + 0.5) / n).cos()).collect()
    };
    (0..length).map(row).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn combined(cosines: &[Vec<f64>], x: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; x.len()];
    for (x, cosine) in x.iter().zip(cosines) {
        sum.iter_mut().zip(cosine).for_each(|(sum, c)| *sum += x * c);
    }
    sum
}

fn columns(picture: &[f64], width: usize, work: impl Fn(&[f64]) -> Vec<f64>) -> Vec<f64> {
    let mut result = vec![0.0; picture.len()];
    for x in 0..width {
        let column: Vec<f64> = picture.iter().skip(x).step_by(width).copied().collect();
        for (y, value) in work(&column).into_iter().enumerate() {
            result[y * width + x] = value;
        }
    }
    result
}

impl Preconditioner for Defocus {
    fn size(&self) -> Option<usize> {
        Some(self.scaling.len())
    }

    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()> {
        let scaled: Vec<f64> = r.iter().zip(&self.scaling).map(|(r, s)| r * s).collect();
        let mut frequencies = self.transform(&scaled);
        frequencies.iter_mut().zip(&self.kept).for_each(|(value, kept)| *value /= kept.max(LEAST));
        for ((z, value), s) in z.iter_mut().zip(self.back(&frequencies)).zip(&self.scaling) {
            *z = value * s;
        }
        Ok(())
    }

    fn is_positive_definite(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Blur;

    fn noise(n: usize) -> Vec<f64> {
        (0..n).map(|i| ((i * 7919 + 13) % 101) as f64 / 50.0 - 1.0).collect()
    }

    #[test]
    fn undoes_a_gaussian_where_nothing_is_lost_and_tells_its_width() -> Result<()> {
        let resolution = Resolution::new(24, 15);
        let white: Vec<f64> = (0..resolution.pixels()).map(|i| 0.5 + 0.01 * (i % 7) as f64).collect();
        // A Gaussian of half a pixel attenuates the highest frequency to a third.
        let (x, width) = (noise(resolution.pixels()), 0.5);
        let root: Vec<f64> = white.iter().map(|d| d.sqrt()).collect();
        let times = |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a * b).collect() };
        let Some(blur) = Blur::new(resolution, width) else { return Ok(()) };
        let y = times(&root, &blur.apply(&times(&root, &x)));
        let model = Defocus::new(resolution, white.clone(), width)?;
        let mut back = vec![0.0; x.len()];
        model.apply(&y, &mut back)?;
        for (a, b) in back.iter().zip(&x) {
            // Both blurs have the same kernel. The error is a thousand roundings, amplified by at most ten.
            assert!((a - b).abs() < 1e-11, "{a} {b}");
        }
        for width in [0.0, 0.5, 2.0] {
            let y = match Blur::new(resolution, width) {
                Some(blur) => times(&root, &blur.apply(&times(&root, &x))),
                None => times(&white, &x),
            };
            assert_eq!(Defocus::measured(resolution, white.clone(), &x, &y)?.1, width);
        }
        Ok(())
    }
}
