//! A preconditioner with a gain for each scale of an image pyramid.

use std::ops::Range;

use super::Preconditioner;
use crate::error::{Error, Result};

/// The smallest share of the light that a measured band is assumed to keep.
const LEAST_SHARE: f64 = 0.1;

/// `M⁻¹ = S (Σ_l g_l (P_l − P_{l+1})) S` on images of `height × width`.
///
/// `P_l` replaces each block of `2^l × 2^l` pixels (cut off at the borders) by its mean; `P_0 = I`. The
/// blocks are nested, so the bands `P_l − P_{l+1}` are orthogonal projectors: band 0 contains differences
/// between neighbours, the last band the means of the coarsest blocks. `M⁻¹` is symmetric, and positive
/// definite because the gains are positive. `S = D^-½` with a diagonal ([`Multiscale::scaled_by`]), else `I`.
///
/// Indirect light adds to the coarse scales of `A`, so gains that *fall* with `l` approximate its inverse.
/// Defocus removes the fine scales; inverting it would amplify noise, so gains that fall, or a small `g_0`,
/// smooth instead.
///
/// # References
/// The bands are those of the two-dimensional Haar pyramid: Mallat (1989), doi:10.1109/34.192463.
#[derive(Clone, Debug, PartialEq)]
pub struct Multiscale {
    width: usize,
    height: usize,
    gains: Vec<f64>,
    /// `D^-½`, or empty.
    scaling: Vec<f64>,
}

impl Multiscale {
    /// The preconditioner with gains `g_0 … g_L` for images of `width × height`, stored row by row.
    ///
    /// # Errors
    /// [`Error::Numerical`] when there is no gain or one is not positive and finite, or the image has no
    /// pixel.
    pub fn new(width: usize, height: usize, gains: Vec<f64>) -> Result<Self> {
        if width == 0 || height == 0 {
            return Err(Error::Numerical("a multiscale preconditioner needs an image with pixels".into()));
        }
        if gains.is_empty() || gains.iter().any(|gain| !gain.is_finite() || *gain <= 0.0) {
            return Err(Error::Numerical(
                "a multiscale preconditioner needs at least one gain, all positive and finite".into(),
            ));
        }
        Ok(Self { width, height, gains, scaling: Vec::new() })
    }

    /// This preconditioner between two divisions by `√d`, for a diagonal `d` of `n` positive entries.
    ///
    /// # Errors
    /// [`Error::Dimension`] when `d` has not one entry per pixel; as [`super::Diagonal::new`] for its values.
    pub fn scaled_by(mut self, diagonal: Vec<f64>) -> Result<Self> {
        let pixels = self.width * self.height;
        if diagonal.len() != pixels {
            return Err(Error::Dimension {
                what: "the diagonal of a multiscale preconditioner",
                expected: pixels.to_string(),
                found: diagonal.len().to_string(),
            });
        }
        self.scaling = super::Diagonal::new(diagonal)?.entries().iter().map(|d| 1.0 / d.sqrt()).collect();
        Ok(self)
    }

    /// Gains measured by one product `y = A x` of a random `x` of `n` signs: for each band the inverse of its
    /// share `uᵀ(P_l − P_{l+1})w / uᵀ(P_l − P_{l+1})u` with `u = D^½ x`, `w = D^-½ y`, which estimates the
    /// mean of `D^-½ A D^-½` over the band (Hutchinson's estimator). Between the two divisions by `√d`,
    /// `d = A 1`.
    ///
    /// Shares are clamped to [0.1, 1], so that the noise of a band that defocus has nearly removed is not
    /// amplified. Bands with fewer than 64 blocks, whose estimates are rough, have the gain 1.
    ///
    /// # Errors
    /// As [`Multiscale::new`] and [`Multiscale::scaled_by`]; [`Error::Dimension`] when `x` or `y` is of
    /// another length.
    pub fn measured(width: usize, height: usize, diagonal: Vec<f64>, x: &[f64], y: &[f64]) -> Result<Self> {
        let mut measured = Self::new(width, height, vec![1.0])?.scaled_by(diagonal)?;
        for vector in [x, y] {
            if vector.len() != width * height {
                return Err(Error::Dimension {
                    what: "the pattern and the photo that measure a multiscale preconditioner",
                    expected: (width * height).to_string(),
                    found: vector.len().to_string(),
                });
            }
        }
        let u: Vec<f64> = x.iter().zip(&measured.scaling).map(|(x, s)| x / s).collect();
        let w: Vec<f64> = y.iter().zip(&measured.scaling).map(|(y, s)| y * s).collect();
        let blocks = |level: usize| width.div_ceil(1 << level) * height.div_ceil(1 << level);
        let levels = (0..).take_while(|&level| blocks(level + 1) >= 64).count();
        let mut gains = Vec::new();
        for level in 0..levels {
            let band = |a: &[f64], b: &[f64]| {
                measured.coarse_dot(level, a, b) - measured.coarse_dot(level + 1, a, b)
            };
            let share = band(&u, &w) / band(&u, &u);
            // A band without any pattern gives NaN, which becomes 1.
            gains.push(1.0 / if share < 1.0 { share.max(LEAST_SHARE) } else { 1.0 });
        }
        gains.push(1.0);
        measured.gains = gains;
        Ok(measured)
    }

    /// `g_0 … g_L`.
    pub fn gains(&self) -> &[f64] {
        &self.gains
    }

    /// The pixels of each block at `level`, as ranges of one row each.
    fn blocks(&self, level: usize) -> impl Iterator<Item = impl Iterator<Item = Range<usize>> + Clone> {
        let (width, height) = (self.width, self.height);
        let side = 1_usize.checked_shl(u32::try_from(level).unwrap_or(u32::MAX)).unwrap_or(usize::MAX);
        (0..height).step_by(side).flat_map(move |top| {
            let bottom = top.saturating_add(side).min(height);
            (0..width).step_by(side).map(move |left| {
                let right = left.saturating_add(side).min(width);
                (top..bottom).map(move |y| y * width + left..y * width + right)
            })
        })
    }

    /// `aᵀ P_l b`.
    fn coarse_dot(&self, level: usize, a: &[f64], b: &[f64]) -> f64 {
        let sum = |of: &[f64], rows: &mut dyn Iterator<Item = Range<usize>>| -> f64 {
            rows.map(|row| of[row].iter().sum::<f64>()).sum()
        };
        self.blocks(level)
            .map(|rows| {
                let pixels: usize = rows.clone().map(|row| row.len()).sum();
                sum(a, &mut rows.clone()) * sum(b, &mut rows.clone()) / pixels as f64
            })
            .sum()
    }

    /// The block means of `S r` at `level`, times `factor`, added to `z`.
    fn add_means(&self, level: usize, factor: f64, r: &[f64], z: &mut [f64]) {
        for rows in self.blocks(level) {
            let pixels: usize = rows.clone().map(|row| row.len()).sum();
            let sum: f64 = rows.clone().map(|row| self.scaled_sum(row, r)).sum();
            let share = factor * sum / pixels as f64;
            for row in rows {
                for value in &mut z[row] {
                    *value += share;
                }
            }
        }
    }

    /// The sum of `S r` over these pixels.
    fn scaled_sum(&self, pixels: Range<usize>, r: &[f64]) -> f64 {
        match self.scaling.get(pixels.clone()) {
            Some(scaling) => r[pixels].iter().zip(scaling).map(|(r, s)| r * s).sum(),
            None => r[pixels].iter().sum(),
        }
    }
}

impl Preconditioner for Multiscale {
    fn size(&self) -> Option<usize> {
        Some(self.width * self.height)
    }

    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()> {
        // Σ g_l (P_l − P_{l+1}) = g_0 + Σ (g_l − g_{l−1}) P_l.
        let scaling = self.scaling.iter().copied().chain(std::iter::repeat(1.0));
        for ((z, r), s) in z.iter_mut().zip(r).zip(scaling) {
            *z = self.gains[0] * r * s;
        }
        for (level, pair) in self.gains.windows(2).enumerate() {
            self.add_means(level + 1, pair[1] - pair[0], r, z);
        }
        for (z, s) in z.iter_mut().zip(&self.scaling) {
            *z *= s;
        }
        Ok(())
    }

    fn is_positive_definite(&self) -> bool {
        true
    }
}
