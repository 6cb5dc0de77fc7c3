//! Preconditioners: approximate inverses that cost no product.
//!
//! | preconditioner | `M⁻¹` | symmetric positive definite |
//! |---|---|---|
//! | [`Diagonal`] | division by a vector: `D = A 1`, or the direct image | yes, for positive entries |
//! | [`Multiscale`] | a gain for each scale of an image pyramid | yes, for positive gains |
//! | [`UserPreconditioner`] | a closure, or another operator | as the caller says |

use std::fmt;
use std::ops::Range;
use std::sync::Mutex;

use super::basis::update2;
use crate::error::{Error, Result};
use crate::operator::Operator;

/// An approximate inverse `M⁻¹` of `n × n`. Applying it takes no product with `A`.
pub trait Preconditioner: Send + Sync {
    /// The dimension `n`, or `None` where it fits any.
    fn size(&self) -> Option<usize>;
    /// `z ← M⁻¹ r`, both of length `n`; every entry of `z` is overwritten.
    ///
    /// # Errors
    /// The error of a preconditioner that is itself an operator.
    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()>;
    /// Whether `M` is symmetric and positive definite, as CG, MINRES, LSQR and LSMR require.
    fn is_positive_definite(&self) -> bool;
}

/// `M = diag(d)`: `M⁻¹ r = r / d`, entry by entry.
///
/// With CG and MINRES this is symmetric scaling, `D^-½ A D^-½`. `d = A 1` (the white photo) brings the
/// spectrum of a non-negative symmetric `A` into [−1, 1]; with `d` = the direct image, `M⁻¹ A` is `I` plus
/// scaled indirect light.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagonal {
    entries: Vec<f64>,
}

impl Diagonal {
    /// `M = diag(entries)`, `n` positive numbers. Entries below `1e-6` of the largest (pixels that see no
    /// light) are raised to that, so that they do not dominate the quotient.
    ///
    /// # Errors
    /// [`Error::Numerical`] when an entry is negative, infinite or NaN, or when none is positive.
    pub fn new(mut entries: Vec<f64>) -> Result<Self> {
        if let Some(index) = entries.iter().position(|entry| !entry.is_finite() || *entry < 0.0) {
            return Err(Error::Numerical(format!(
                "a preconditioner's diagonal must be finite and not negative, and entry {index} is {}",
                entries[index]
            )));
        }
        let largest = entries.iter().copied().fold(0.0, f64::max);
        if largest == 0.0 {
            return Err(Error::Numerical("all entries of a preconditioner's diagonal are zero".into()));
        }
        for entry in &mut entries {
            *entry = entry.max(1e-6 * largest);
        }
        Ok(Self { entries })
    }

    /// `d`, of length `n`.
    pub fn entries(&self) -> &[f64] {
        &self.entries
    }
}

impl Preconditioner for Diagonal {
    fn size(&self) -> Option<usize> {
        Some(self.entries.len())
    }
    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()> {
        update2(z, r, &self.entries, |_, r, d| r / d);
        Ok(())
    }
    fn is_positive_definite(&self) -> bool {
        true
    }
}

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
    /// [`Error::Dimension`] when `d` has not one entry per pixel; as [`Diagonal::new`] for its values.
    pub fn scaled_by(mut self, diagonal: Vec<f64>) -> Result<Self> {
        let pixels = self.width * self.height;
        if diagonal.len() != pixels {
            return Err(Error::Dimension {
                what: "the diagonal of a multiscale preconditioner",
                expected: pixels.to_string(),
                found: diagonal.len().to_string(),
            });
        }
        self.scaling = Diagonal::new(diagonal)?.entries().iter().map(|d| 1.0 / d.sqrt()).collect();
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

type Apply = dyn Fn(&[f64], &mut [f64]) -> Result<()> + Send + Sync;

/// A preconditioner `M⁻¹` of the caller: a closure or an operator. Products with this operator are not
/// counted, so it should be a cheap one, such as a model of the scene.
pub struct UserPreconditioner {
    size: Option<usize>,
    positive_definite: bool,
    apply: Box<Apply>,
}

impl UserPreconditioner {
    /// `M⁻¹ r` by a closure `(r, z)` that overwrites `z`. `positive_definite` is taken on trust.
    pub fn closure(
        positive_definite: bool,
        apply: impl Fn(&[f64], &mut [f64]) -> Result<()> + Send + Sync + 'static,
    ) -> Self {
        Self { size: None, positive_definite, apply: Box::new(apply) }
    }

    /// `M⁻¹` as an operator, which must be square.
    ///
    /// # Errors
    /// [`Error::Dimension`] when it is not square.
    pub fn operator(positive_definite: bool, operator: impl Operator + Send + 'static) -> Result<Self> {
        let (rows, cols) = (operator.rows(), operator.cols());
        if rows != cols {
            return Err(Error::Dimension {
                what: "an operator used as preconditioner",
                expected: "as many rows as columns".into(),
                found: format!("{rows}x{cols}"),
            });
        }
        let operator = Mutex::new(operator);
        let apply = move |r: &[f64], z: &mut [f64]| {
            // A poisoned lock means that an earlier product panicked. The operator is responsible for its own
            // state.
            let mut operator = operator.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            operator.apply(r, z)
        };
        Ok(Self { size: Some(rows), positive_definite, apply: Box::new(apply) })
    }
}

impl fmt::Debug for UserPreconditioner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("UserPreconditioner")
            .field("size", &self.size)
            .field("positive_definite", &self.positive_definite)
            .finish_non_exhaustive()
    }
}

impl Preconditioner for UserPreconditioner {
    fn size(&self) -> Option<usize> {
        self.size
    }
    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()> {
        (self.apply)(r, z)
    }
    fn is_positive_definite(&self) -> bool {
        self.positive_definite
    }
}
