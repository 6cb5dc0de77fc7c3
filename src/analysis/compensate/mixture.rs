//! A model of a lens out of focus as a sum of blurs. It is fitted to photos that the method takes anyway.
//!
//! ```text
//! P = D Σ_m diag(c_m) K_m,   c_m ≥ 0
//! ```
//!
//! `D` is the white photo. The `K_m` are Gaussian blurs of fixed widths of an image mirrored at its borders. Their widths range from no
//! blur to the width of indirect light. The shares `c_m` vary slowly over the image, as depth does. They are fitted by non-negative least
//! squares in windows of a few pixels. The model also gives the transpose, `Σ_m K_m diag(c_m) D`. If only the projector's lens is out of
//! focus, no photo can measure the transpose.

use std::sync::Arc;

use super::gaussian::Gaussian;
use crate::image::Resolution;
use crate::krylov::{Surrogate, dot};

/// Standard deviations of the blurs in pixels. Blurs wider than a quarter of the image are left out.
const WIDTHS: [f64; 9] = [0.0, 0.5, 0.75, 1.25, 2.0, 3.0, 5.0, 10.0, 25.0];

/// The side, in pixels, of a cell. Each cell has its own shares.
const CELL: usize = 8;

/// The standard deviation, in cells, of the window from which the shares of a cell are fitted.
const WINDOW: f64 = 1.25;

/// The relative weight of the ridge term. This term makes the shares of nearly equal blurs unique.
const RIDGE: f64 = 1e-6;

/// The number of sweeps of coordinate descent per cell.
const SWEEPS: usize = 500;

#[derive(Clone)]
pub(crate) struct Mixture {
    resolution: Resolution,
    white: Arc<Vec<f64>>,
    blurs: Arc<Vec<Gaussian>>,
    /// The share `c_m` of a blur in each pixel; `None` if the blur has no share in any pixel.
    shares: Vec<Option<Vec<f64>>>,
}

impl Mixture {
    /// Makes the model of a white photo (`n`). The model has no blur until it is fitted.
    pub(crate) fn new(resolution: Resolution, white: &[f64]) -> Self {
        let widest = resolution.width.min(resolution.height) as f64 / 4.0;
        let widths = WIDTHS.iter().filter(|width| **width <= widest);
        let blurs: Vec<Gaussian> = widths.map(|&width| Gaussian::new(resolution, width)).collect();
        let mut shares = vec![None; blurs.len()];
        shares[0] = Some(vec![1.0; white.len()]);
        // Dark pixels contain only noise.
        let floor = 1e-3 * white.iter().copied().fold(0.0, f64::max);
        let white = white.iter().map(|value| value.max(floor)).collect();
        Self { resolution, white: Arc::new(white), blurs: Arc::new(blurs), shares }
    }

    /// The normal equations `[G, h]` of each cell, row by row, summed over the cell's window.
    fn equations(&self, patterns: &[Vec<f64>], products: &[Vec<f64>], cells: Resolution) -> Vec<Vec<f64>> {
        let count = self.blurs.len();
        // Each entry of G and of h has one plane over the cells.
        let mut planes = vec![vec![0.0; cells.pixels()]; count * (count + 1)];
        let cell_of: Vec<usize> = (0..self.white.len())
            .map(|pixel| {
                let (x, y) = (pixel % self.resolution.width, pixel / self.resolution.width);
                (y / CELL) * cells.width + x / CELL
            })
            .collect();
        for (x, y) in patterns.iter().zip(products) {
            let blurred: Vec<Vec<f64>> = self.blurs.iter().map(|blur| blur.apply(x)).collect();
            let seen: Vec<f64> = y.iter().zip(&*self.white).map(|(y, white)| y / white).collect();
            let mut add = |entry: usize, a: &[f64], b: &[f64]| {
                let plane = &mut planes[entry];
                cell_of.iter().zip(a).zip(b).for_each(|((&cell, a), b)| plane[cell] += a * b);
            };
            for (row, a) in blurred.iter().enumerate() {
                for (column, b) in blurred.iter().enumerate() {
                    add(row * (count + 1) + column, a, b);
                }
                add(row * (count + 1) + count, a, &seen);
            }
        }
        let window = Gaussian::new(cells, WINDOW);
        planes.iter_mut().for_each(|plane| *plane = window.apply(plane));
        (0..cells.pixels()).map(|cell| planes.iter().map(|plane| plane[cell]).collect()).collect()
    }

    fn between(&self, cells: Resolution, of_cells: &[f64]) -> Vec<f64> {
        let place = |pixel: usize, count: usize| {
            let at = ((pixel as f64 + 0.5) / CELL as f64 - 0.5).clamp(0.0, (count - 1) as f64);
            let first = (at.floor() as usize).min(count.saturating_sub(2));
            (first, (first + 1).min(count - 1), at - first as f64)
        };
        let Resolution { width, height } = self.resolution;
        let mut values = Vec::with_capacity(width * height);
        for y in 0..height {
            let (top, bottom, down) = place(y, cells.height);
            for x in 0..width {
                let (left, right, across) = place(x, cells.width);
                let row = |row: usize| {
                    (1.0 - across) * of_cells[row * cells.width + left]
                        + across * of_cells[row * cells.width + right]
                };
                values.push((1.0 - down) * row(top) + down * row(bottom));
            }
        }
        values
    }

    fn present(&self) -> impl Iterator<Item = (&Gaussian, &Vec<f64>)> {
        self.blurs
            .iter()
            .zip(&self.shares)
            .filter_map(|(blur, share)| share.as_ref().map(|share| (blur, share)))
    }
}

/// Computes `argmin ½ cᵀG c − hᵀc` over `c ≥ 0` by coordinate descent; `equations` holds `[G, h]`, row by row.
fn non_negative(equations: &[f64], count: usize) -> Vec<f64> {
    let row = |at: usize| &equations[at * (count + 1)..at * (count + 1) + count];
    let trace: f64 = (0..count).map(|at| row(at)[at]).sum();
    let ridge = RIDGE * trace;
    let mut shares = vec![0.0; count];
    if trace <= 0.0 {
        shares[0] = 1.0;
        return shares;
    }
    for _ in 0..SWEEPS {
        let mut moved = 0.0_f64;
        for at in 0..count {
            let rest = equations[at * (count + 1) + count] - dot(row(at), &shares) + row(at)[at] * shares[at];
            let next = (rest / (row(at)[at] + ridge)).max(0.0);
            moved = moved.max((next - shares[at]).abs());
            shares[at] = next;
        }
        if moved < 1e-6 {
            break;
        }
    }
    shares
}

impl Surrogate for Mixture {
    fn size(&self) -> usize {
        self.white.len()
    }

    fn fitted(&self, patterns: &[Vec<f64>], products: &[Vec<f64>]) -> Arc<dyn Surrogate> {
        let Resolution { width, height } = self.resolution;
        let cells = Resolution::new(width.div_ceil(CELL), height.div_ceil(CELL));
        let equations = self.equations(patterns, products, cells);
        let of_cells: Vec<Vec<f64>> =
            equations.iter().map(|equations| non_negative(equations, self.blurs.len())).collect();
        let share = |blur: usize| {
            let plane: Vec<f64> = of_cells.iter().map(|shares| shares[blur]).collect();
            plane.iter().any(|share| *share > 0.0).then(|| self.between(cells, &plane))
        };
        let shares = (0..self.blurs.len()).map(share).collect();
        Arc::new(Self { shares, ..self.clone() })
    }

    fn apply(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (blur, share) in self.present() {
            y.iter_mut().zip(blur.apply(x)).zip(share).for_each(|((y, value), share)| *y += share * value);
        }
        y.iter_mut().zip(&*self.white).for_each(|(y, white)| *y *= white);
    }

    fn apply_adjoint(&self, y: &[f64], x: &mut [f64]) {
        x.fill(0.0);
        for (blur, share) in self.present() {
            let weighted: Vec<f64> =
                y.iter().zip(&*self.white).zip(share).map(|((y, white), share)| y * white * share).collect();
            x.iter_mut().zip(blur.apply(&weighted)).for_each(|(x, value)| *x += value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(n: usize, seed: usize) -> Vec<f64> {
        (0..n).map(|i| ((i * 7919 + 13 * seed) % 101) as f64 / 101.0).collect()
    }

    #[test]
    fn a_blur_that_widens_across_the_picture_is_told_from_two_photos() {
        let resolution = Resolution::new(48, 40);
        let n = resolution.pixels();
        let white: Vec<f64> = (0..n).map(|i| 0.5 + 0.01 * (i % 7) as f64).collect();
        // The truth belongs to the model's family: the sharper blur at the left, the wider blur at the right, and half of each in the
        // middle.
        let truth = |x: &[f64]| -> Vec<f64> {
            let [sharp, wide] = [0.75, 2.0].map(|width| Gaussian::new(resolution, width).apply(x));
            (0..n)
                .map(|i| {
                    let at = (i % 48) as f64 / 47.0;
                    white[i] * ((1.0 - at) * sharp[i] + at * wide[i])
                })
                .collect()
        };
        let patterns = [noise(n, 1), noise(n, 2)];
        let products = [0, 1].map(|at| truth(&patterns[at]));
        let plain = Mixture::new(resolution, &white);
        let fitted = plain.fitted(&patterns, &products);
        let missed = |of: &dyn Surrogate, x: &[f64]| {
            let mut y = vec![0.0; n];
            of.apply(x, &mut y);
            let expected = truth(x);
            let square = |of: &mut dyn Iterator<Item = f64>| of.map(|value| value * value).sum::<f64>();
            (square(&mut y.iter().zip(&expected).map(|(a, b)| a - b)) / square(&mut expected.iter().copied()))
                .sqrt()
        };
        let other = noise(n, 5);
        // Windows of ten pixels cannot exactly follow shares that change by a fifth within a window.
        let (before, after) = (missed(&plain, &other), missed(&*fitted, &other));
        assert!(after < 0.1 * before, "{before} {after}");
        // The comparison of the two inner products has the rounding errors of a few thousand terms.
        let y = noise(n, 9);
        let (mut image, mut back) = (vec![0.0; n], vec![0.0; n]);
        fitted.apply(&other, &mut image);
        fitted.apply_adjoint(&y, &mut back);
        assert!((dot(&image, &y) - dot(&other, &back)).abs() < 1e-12 * n as f64);
    }
}
