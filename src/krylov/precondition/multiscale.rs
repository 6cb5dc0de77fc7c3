//! A gain for each scale of an image pyramid.

use super::Preconditioner;
use crate::error::{Error, Result};

/// `M⁻¹ = S (Σ_l g_l (P_l − P_{l+1})) S` on images of `height × width`.
///
/// `P_l` replaces each block of `2^l × 2^l` pixels (cut off at the borders) by its mean; `P_0 = I`. The blocks are
/// nested, so the bands `P_l − P_{l+1}` are orthogonal projectors: band 0 holds differences between neighbours, the
/// last band what is left above the coarsest blocks. `M⁻¹` is symmetric, and positive definite as the gains are
/// positive. `S = D^-½` if a diagonal is given, else `I`.
///
/// Indirect light adds to the coarse scales of `A`, so gains that *fall* with `l` approximate its inverse. Defocus
/// takes away the fine scales, whose inverse would need gains that raise noise: falling ones, or a small `g_0`,
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
    /// Gains `g_0 … g_L` for images of `width × height`, row by row.
    ///
    /// # Errors
    /// [`Error::Numerical`] when there is no gain or one is not positive and finite, or the image has no pixel.
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

    /// The same between two divisions by `√d`, for `n` positive entries.
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

    /// The block means at `level`, times `factor`, added to `z`.
    fn add_means(&self, level: usize, factor: f64, r: &[f64], z: &mut [f64]) {
        let side = 1_usize.checked_shl(u32::try_from(level).unwrap_or(u32::MAX)).unwrap_or(usize::MAX);
        for top in (0..self.height).step_by(side) {
            let bottom = top.saturating_add(side).min(self.height);
            for left in (0..self.width).step_by(side) {
                let right = left.saturating_add(side).min(self.width);
                let rows = (top..bottom).map(|y| y * self.width + left..y * self.width + right);
                let sum: f64 = rows.clone().map(|row| r[row].iter().sum::<f64>()).sum();
                let share = factor * sum / ((bottom - top) * (right - left)) as f64;
                for row in rows {
                    for value in &mut z[row] {
                        *value += share;
                    }
                }
            }
        }
    }
}

impl Preconditioner for Multiscale {
    fn size(&self) -> Option<usize> {
        Some(self.width * self.height)
    }

    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()> {
        let scaled: Vec<f64>;
        let r = if self.scaling.is_empty() {
            r
        } else {
            scaled = r.iter().zip(&self.scaling).map(|(r, s)| r * s).collect();
            &scaled
        };
        // Σ g_l (P_l − P_{l+1}) = g_0 + Σ (g_l − g_{l−1}) P_l.
        for (z, r) in z.iter_mut().zip(r) {
            *z = self.gains[0] * r;
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
