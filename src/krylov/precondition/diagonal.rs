//! The diagonal (Jacobi) preconditioner.

use super::super::vectors::update2;
use super::Preconditioner;
use crate::error::{Error, Result};

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
