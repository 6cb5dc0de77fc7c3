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
    /// The dimension `n`, or `None` if the preconditioner fits any dimension.
    fn size(&self) -> Option<usize>;
    /// `z ← M⁻¹ r`, both of length `n`; every entry of `z` is overwritten. If the preconditioner is itself an operator, it may fail with
    /// the errors of that operator.
    fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()>;
    /// Returns true if `M` is symmetric and positive definite, as CG, MINRES, LSQR and LSMR require.
    fn is_positive_definite(&self) -> bool;
    /// `d` (`n` numbers other than 0) if `M = diag(d)`, so that the memory of an operator can apply `M⁻¹`.
    fn diagonal(&self) -> Option<&[f64]> {
        None
    }
}

impl fmt::Debug for dyn Preconditioner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Preconditioner({:?})", self.size())
    }
}

/// `M = diag(d)`: `M⁻¹ r = r / d`, entry by entry.
///
/// With CG and MINRES, this preconditioner scales the system symmetrically, `D^-½ A D^-½`. With `d = A 1` (the white photo), the spectrum
/// of the scaled `A` lies in [−1, 1] if `A` is symmetric and non-negative. With `d` equal to the direct image, `M⁻¹ A` is `I` plus scaled
/// indirect light.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagonal {
    entries: Vec<f64>,
}

impl Diagonal {
    /// Makes `M = diag(entries)` from `n` non-negative numbers. Entries below `1e-6` of the largest entry (pixels that see no light) are
    /// raised to this value, so that they do not dominate the quotient.
    ///
    /// # Errors
    /// [`Error::Numerical`] if an entry is negative, infinite or NaN, or if no entry is positive.
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
    fn diagonal(&self) -> Option<&[f64]> {
        Some(&self.entries)
    }
}

/// The smallest share of the light that is assumed for a measured band.
const LEAST_SHARE: f64 = 0.1;

/// `M⁻¹ = S (Σ_l g_l (P_l − P_{l+1})) S` on images of `height × width`.
///
/// `P_l` replaces each block of `2^l × 2^l` pixels (cut off at the borders) by its mean, and `P_0 = I`. The blocks are nested, so the bands
/// `P_l − P_{l+1}` are orthogonal projectors. Band 0 contains differences between neighbours, and the last band contains the means of the
/// coarsest blocks. `M⁻¹` is symmetric, and positive definite because the gains are positive. `S` is `D^-½` if there is a diagonal
/// ([`Multiscale::scaled_by`]), and `I` otherwise.
///
/// Indirect light adds to the coarse scales of `A`, so gains that *fall* with `l` approximate its inverse. Defocus removes the fine scales
/// of `A`. Inverting defocus would amplify noise; a small `g_0` smooths instead.
///
/// References: The bands form the two-dimensional Haar pyramid: Mallat (1989), doi:10.1109/34.192463.
#[derive(Clone, Debug, PartialEq)]
pub struct Multiscale {
    width: usize,
    height: usize,
    gains: Vec<f64>,
    /// `D^-½`, or empty.
    scaling: Vec<f64>,
}

impl Multiscale {
    /// Makes the preconditioner with gains `g_0 … g_L` for images of `width × height`, stored row by row.
    ///
    /// # Errors
    /// [`Error::Numerical`] if there is no gain, if a gain is not positive and finite, or if the image has no pixel.
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

    /// Applies this preconditioner between two divisions by `√d`, for a diagonal `d` of `n` positive entries.
    ///
    /// # Errors
    /// [`Error::Dimension`] if `d` does not have one entry per pixel; the errors of [`Diagonal::new`] if the values of `d` are not valid.
    pub fn scaled_by(mut self, diagonal: Vec<f64>) -> Result<Self> {
        let pixels = self.width * self.height;
        Error::check_size("the diagonal of a multiscale preconditioner", pixels, diagonal.len())?;
        self.scaling = Diagonal::new(diagonal)?.entries().iter().map(|d| 1.0 / d.sqrt()).collect();
        Ok(self)
    }

    /// Measures the gains by one product `y = A x` with a random `x` of `n` signs. The preconditioner is scaled by `√d` on both sides, with
    /// `d = A 1`. The gain of a band is the inverse of its share `uᵀ(P_l − P_{l+1})w / uᵀ(P_l − P_{l+1})u` with `u = D^½ x`, `w = D^-½ y`.
    /// The share estimates the mean of `D^-½ A D^-½` over the band (Hutchinson's estimator).
    ///
    /// Shares are clamped to [0.1, 1]. This avoids amplifying the noise of a band that defocus has nearly removed. Bands with fewer than 64
    /// blocks have rough estimates and get the gain 1.
    ///
    /// # Errors
    /// The errors of [`Multiscale::new`] and [`Multiscale::scaled_by`]; [`Error::Dimension`] if the length of `x` or `y` is wrong.
    pub fn measured(width: usize, height: usize, diagonal: Vec<f64>, x: &[f64], y: &[f64]) -> Result<Self> {
        let mut measured = Self::new(width, height, vec![1.0])?.scaled_by(diagonal)?;
        for vector in [x, y] {
            let what = "the pattern and the photo that measure a multiscale preconditioner";
            Error::check_size(what, width * height, vector.len())?;
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
            // If the pattern has no component in a band, the share is NaN and the gain is 1.
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

    /// The pixels of each block at `level`. Each range covers one row of a block.
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

    /// Adds the block means of `S r` at `level`, times `factor`, to `z`.
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
        // The sum over bands is Σ g_l (P_l − P_{l+1}) = g_0 + Σ (g_l − g_{l−1}) P_l.
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

/// A preconditioner `M⁻¹` that the caller supplies as a closure or an operator. Products with this operator are not counted, so it should
/// be cheap, for example a model of the scene.
pub struct UserPreconditioner {
    size: Option<usize>,
    positive_definite: bool,
    apply: Box<Apply>,
}

impl UserPreconditioner {
    /// Wraps a closure `(r, z)` that overwrites `z` with `M⁻¹ r`. `positive_definite` is not verified.
    pub fn closure(
        positive_definite: bool,
        apply: impl Fn(&[f64], &mut [f64]) -> Result<()> + Send + Sync + 'static,
    ) -> Self {
        Self { size: None, positive_definite, apply: Box::new(apply) }
    }

    /// Wraps an operator `M⁻¹`.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the operator is not square.
    pub fn operator(positive_definite: bool, operator: impl Operator + Send + 'static) -> Result<Self> {
        let (rows, cols) = (operator.rows(), operator.cols());
        if rows != cols {
            return Err(Error::dimension(
                "an operator used as preconditioner",
                "as many rows as columns",
                format!("{rows}x{cols}"),
            ));
        }
        let operator = Mutex::new(operator);
        let apply = move |r: &[f64], z: &mut [f64]| {
            // A poisoned lock means that an earlier product panicked. The operator must keep its state valid.
            let mut operator = operator.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            operator.apply(r, z)
        };
        Ok(Self { size: Some(rows), positive_definite, apply: Box::new(apply) })
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
