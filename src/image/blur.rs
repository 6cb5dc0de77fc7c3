//! Gaussian blur `K` of patterns and photos. If it is applied to both, a symmetric operator stays symmetric:
//! `K A K`.
//!
//! Beyond its edges the image is continued by reflection at the border between pixels (`… c b a | a b c …`).
//! Then `K = Kᵀ`, and `K 1 = 1`, so that a constant pattern stays constant.

use super::Resolution;

/// The radius of the kernel in standard deviations.
const REACH: f64 = 4.0;

/// A separable Gaussian blur of images of one resolution.
#[derive(Clone, Debug)]
pub struct Blur {
    resolution: Resolution,
    /// The weights from the centre outwards. Together with their mirror images they sum to 1.
    kernel: Vec<f64>,
}

impl Blur {
    /// A blur whose standard deviation is `deviation` pixels; `None` if that is 0, which means no blur.
    pub fn new(resolution: Resolution, deviation: f64) -> Option<Self> {
        if deviation <= 0.0 {
            return None;
        }
        let reach = (REACH * deviation).ceil() as usize;
        let half: Vec<f64> = (0..=reach).map(|at| (-0.5 * (at as f64 / deviation).powi(2)).exp()).collect();
        let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
        let kernel = half.iter().map(|weight| weight / sum).collect();
        Some(Self { resolution, kernel })
    }

    /// The resolution of the images that it blurs.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// The blurred image `K x`; both have `n` values.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        self.convolve(&self.kernel, x)
    }

    /// The variances of the entries of `K x`, if the entries of `x` are independent and have these variances;
    /// both have `n` values.
    pub fn variance(&self, variance: &[f64]) -> Vec<f64> {
        let (width, height) = (self.resolution.width, self.resolution.height);
        // Near an edge a pixel enters more than once, so its weights are summed before they are squared.
        let [across, down] = [width, height].map(|length| {
            (0..length).map(|at| self.squared_weights(at, length)).collect::<Vec<Vec<(usize, f64)>>>()
        });
        let sum = |row: &[(usize, f64)], of: &dyn Fn(usize) -> f64| {
            row.iter().map(|&(at, w)| w * of(at)).sum::<f64>()
        };
        let rows: Vec<f64> = (0..width * height)
            .map(|pixel| sum(&across[pixel % width], &|x| variance[pixel / width * width + x]))
            .collect();
        (0..width * height)
            .map(|pixel| sum(&down[pixel / width], &|y| rows[y * width + pixel % width]))
            .collect()
    }

    /// The row of `K` for one pixel: the pixels that contribute to it, and their weights.
    pub(crate) fn row(&self, pixel: usize) -> Vec<(usize, f64)> {
        let Resolution { width, height } = self.resolution;
        let across = self.weights(pixel % width, width);
        let down = self.weights(pixel / width, height).into_iter();
        down.flat_map(|(y, b)| across.iter().map(move |&(x, a)| (y * width + x, a * b))).collect()
    }

    /// The squared weights of the pixels that contribute to pixel `at` of a row of `length` pixels.
    fn squared_weights(&self, at: usize, length: usize) -> Vec<(usize, f64)> {
        self.weights(at, length).into_iter().map(|(at, weight)| (at, weight * weight)).collect()
    }

    /// The weights of the pixels that contribute to pixel `at` of a row of `length` pixels.
    fn weights(&self, at: usize, length: usize) -> Vec<(usize, f64)> {
        let mut weights = std::collections::BTreeMap::new();
        for (offset, &weight) in self.kernel.iter().enumerate() {
            let offset = offset as isize;
            for signed in if offset == 0 { vec![0] } else { vec![-offset, offset] } {
                *weights.entry(mirrored(at as isize + signed, length)).or_insert(0.0) += weight;
            }
        }
        weights.into_iter().collect()
    }

    /// Convolves the rows and then the columns. Each weight of the kernel adds a shifted copy of a whole row,
    /// which is fast.
    fn convolve(&self, kernel: &[f64], x: &[f64]) -> Vec<f64> {
        let (width, height) = (self.resolution.width, self.resolution.height);
        let reach = kernel.len() - 1;
        let mut rows = vec![0.0; x.len()];
        let mut padded = vec![0.0; width + 2 * reach];
        for (from, to) in x.chunks(width).zip(rows.chunks_mut(width)) {
            for (at, value) in padded.iter_mut().enumerate() {
                *value = from[mirrored(at as isize - reach as isize, width)];
            }
            for (offset, &weight) in kernel.iter().enumerate() {
                add(to, weight, &padded[reach + offset..]);
                if offset > 0 {
                    add(to, weight, &padded[reach - offset..]);
                }
            }
        }
        let row = |y: isize| &rows[mirrored(y, height) * width..];
        let mut picture = vec![0.0; x.len()];
        for (y, to) in picture.chunks_mut(width).enumerate() {
            for (offset, &weight) in kernel.iter().enumerate() {
                let (y, offset) = (y as isize, offset as isize);
                add(to, weight, row(y + offset));
                if offset > 0 {
                    add(to, weight, row(y - offset));
                }
            }
        }
        picture
    }
}

/// Adds `weight · of` to `sum`.
fn add(sum: &mut [f64], weight: f64, of: &[f64]) {
    sum.iter_mut().zip(of).for_each(|(sum, value)| *sum += weight * value);
}

/// The index of the pixel at position `at` when a row of `length` pixels is continued by repeated reflection
/// at its ends.
fn mirrored(at: isize, length: usize) -> usize {
    let within = at.rem_euclid(2 * length as isize) as usize;
    if within < length { within } else { 2 * length - 1 - within }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_blur_is_symmetric_keeps_constants_and_predicts_variances() {
        // The kernel is wider than the image is high, so that positions are reflected more than once.
        let resolution = Resolution::new(7, 3);
        let blur = Blur::new(resolution, 1.3).expect("wider than 0");
        let n = resolution.pixels();
        let columns: Vec<Vec<f64>> = (0..n)
            .map(|k| blur.apply(&(0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<_>>()))
            .collect();
        let variance = blur.variance(&(0..n).map(|k| 1.0 + k as f64).collect::<Vec<_>>());
        for i in 0..n {
            assert!((columns.iter().map(|column| column[i]).sum::<f64>() - 1.0).abs() < 1e-14);
            let expected: f64 = (0..n).map(|k| columns[k][i].powi(2) * (1.0 + k as f64)).sum();
            assert!((variance[i] - expected).abs() < 1e-12);
            let row = columns.iter().map(|column| column[i]);
            assert!(row.zip(&columns[i]).all(|(across, down)| (across - down).abs() < 1e-16));
        }
        assert!(Blur::new(resolution, 0.0).is_none());
    }
}
