//! A Gaussian for rasters. On pattern and photo alike it leaves a symmetric operator symmetric: `K A K`.
//!
//! At the edges the picture is mirrored at the border between pixels (`… c b a | a b c …`): so `K = Kᵀ`, and `K 1 = 1`, which keeps
//! a constant vector a constant pattern.

use super::Resolution;

/// Kernels reach so many standard deviations.
const REACH: f64 = 4.0;

/// A separable Gaussian of some standard deviation in pixels.
#[derive(Clone, Debug)]
pub struct Blur {
    resolution: Resolution,
    /// From the centre outwards; with their mirror images they add up to 1.
    kernel: Vec<f64>,
}

impl Blur {
    /// `None` for a deviation of 0, which leaves everything as it is.
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

    /// The pixels that it is for.
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// `K x`, both of length `n`.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        self.with(&self.kernel, x)
    }

    /// The variances (`n`) of `K x` for independent entries of `x` with these.
    pub fn variance(&self, variance: &[f64]) -> Vec<f64> {
        let (width, height) = (self.resolution.width, self.resolution.height);
        // Near an edge one pixel comes in twice, so weights are collected before they are squared.
        let [across, down] = [width, height]
            .map(|length| (0..length).map(|at| self.squares(at, length)).collect::<Vec<Vec<(usize, f64)>>>());
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

    fn squares(&self, at: usize, length: usize) -> Vec<(usize, f64)> {
        let mut weights = std::collections::BTreeMap::new();
        for (offset, &weight) in self.kernel.iter().enumerate() {
            let offset = offset as isize;
            for signed in if offset == 0 { vec![0] } else { vec![-offset, offset] } {
                *weights.entry(mirrored(at as isize + signed, length)).or_insert(0.0) += weight;
            }
        }
        weights.into_iter().map(|(at, weight)| (at, weight * weight)).collect()
    }

    /// Each tap adds a shifted copy of a whole row.
    fn with(&self, kernel: &[f64], x: &[f64]) -> Vec<f64> {
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

fn add(sum: &mut [f64], weight: f64, of: &[f64]) {
    sum.iter_mut().zip(of).for_each(|(sum, value)| *sum += weight * value);
}

/// The pixel that stands at `at` when the row is mirrored at its ends, again and again.
fn mirrored(at: isize, length: usize) -> usize {
    let within = at.rem_euclid(2 * length as isize) as usize;
    if within < length { within } else { 2 * length - 1 - within }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kernel_is_symmetric_keeps_constants_and_knows_its_variance() {
        // Wider than the raster is high, so that mirroring wraps more than once.
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
