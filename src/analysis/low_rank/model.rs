//! The model itself: an operator that costs no photo.

use crate::error::{Error, Result};
use crate::krylov::dot;
use crate::operator::{Adjoint, Operator, Symmetry};

/// `A ≈ diag(direct) + G_k` of `n × n` from `k` photos (see the module).
#[derive(Clone, Debug)]
pub struct LowRank {
    basis: Vec<Vec<f64>>,
    photos: Vec<Vec<f64>>,
    direct: Vec<f64>,
    symmetric: bool,
}

impl LowRank {
    /// The model of `k` orthonormal patterns (`n` each) and their photos (`n` each, without direct light); `direct` has `n`
    /// entries, or none.
    ///
    /// # Errors
    /// [`Error::Dimension`].
    pub fn new(
        basis: Vec<Vec<f64>>,
        photos: Vec<Vec<f64>>,
        direct: Vec<f64>,
        symmetric: bool,
    ) -> Result<Self> {
        let n = basis.first().map_or(0, Vec::len);
        let agree = |what, expected: usize, found: usize| match expected == found {
            true => Ok(()),
            false => Err(Error::Dimension { what, expected: expected.to_string(), found: found.to_string() }),
        };
        agree("photos of a low-rank model", basis.len(), photos.len())?;
        for vector in basis.iter().chain(&photos) {
            agree("pixels of a low-rank model", n, vector.len())?;
        }
        if !direct.is_empty() {
            agree("pixels of the direct image", n, direct.len())?;
        }
        Ok(Self { basis, photos, direct, symmetric })
    }

    /// `k`: photos that it was made from.
    pub fn rank(&self) -> usize {
        self.basis.len()
    }

    /// `Q`: the patterns, orthonormal and signed.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.basis
    }

    /// `W = G Q`.
    pub fn photos(&self) -> &[Vec<f64>] {
        &self.photos
    }

    /// The same model with only the first `rank` photos.
    pub fn truncated(&self, rank: usize) -> Self {
        let first = |vectors: &[Vec<f64>]| vectors.iter().take(rank).cloned().collect();
        Self {
            basis: first(&self.basis),
            photos: first(&self.photos),
            direct: self.direct.clone(),
            symmetric: self.symmetric,
        }
    }

    /// The photo of a pattern, `A x` (`n`, signed or not): relighting. Costs no photo.
    ///
    /// # Panics
    /// In debug builds, when `x` does not have `n` entries.
    pub fn relight(&self, pattern: &[f64]) -> Vec<f64> {
        self.product(pattern, &self.basis, &self.photos)
    }

    /// The dual photograph, `Aᵀ y`: the scene as the projector would see it, lit from the camera by `y`.
    ///
    /// # Panics
    /// As [`LowRank::relight`].
    pub fn dual(&self, pattern: &[f64]) -> Vec<f64> {
        if self.symmetric {
            return self.relight(pattern);
        }
        self.product(pattern, &self.photos, &self.basis)
    }

    /// The diagonal (`n`): what each pixel sends back to itself.
    pub fn diagonal(&self) -> Vec<f64> {
        let mut diagonal = match self.direct.is_empty() {
            true => vec![0.0; self.cols()],
            false => self.direct.clone(),
        };
        // What Q (Qᵀ W) Qᵀ takes away again, column by column of T.
        let correction: Vec<Vec<f64>> = match self.symmetric {
            true => self.photos.iter().map(|photo| self.projected(photo)).collect(),
            false => Vec::new(),
        };
        for (index, (pattern, photo)) in self.basis.iter().zip(&self.photos).enumerate() {
            for (i, sum) in diagonal.iter_mut().enumerate() {
                let twice = if self.symmetric { 2.0 * photo[i] - correction[index][i] } else { photo[i] };
                *sum += twice * pattern[i];
            }
        }
        diagonal
    }

    /// `Q Qᵀ y`.
    fn projected(&self, y: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; y.len()];
        for vector in &self.basis {
            add(&mut sum, dot(vector, y), vector);
        }
        sum
    }

    /// `diag(direct) x + to (fromᵀ x)`, and for a symmetric model `from (toᵀ z)` of the rest `z = x − from (fromᵀ x)`.
    fn product(&self, x: &[f64], from: &[Vec<f64>], to: &[Vec<f64>]) -> Vec<f64> {
        debug_assert!(from.iter().all(|vector| vector.len() == x.len()));
        let mut y: Vec<f64> = match self.direct.is_empty() {
            true => vec![0.0; x.len()],
            false => self.direct.iter().zip(x).map(|(direct, value)| direct * value).collect(),
        };
        let mut rest = x.to_vec();
        let shares: Vec<f64> = from.iter().map(|vector| dot(vector, x)).collect();
        for ((from, to), share) in from.iter().zip(to).zip(&shares) {
            add(&mut y, *share, to);
            if self.symmetric {
                add(&mut rest, -share, from);
            }
        }
        if self.symmetric {
            for (from, to) in from.iter().zip(to) {
                add(&mut y, dot(to, &rest), from);
            }
        }
        y
    }
}

fn add(sum: &mut [f64], factor: f64, vector: &[f64]) {
    for (sum, value) in sum.iter_mut().zip(vector) {
        *sum += factor * value;
    }
}

impl Operator for LowRank {
    fn rows(&self) -> usize {
        self.cols()
    }

    fn cols(&self) -> usize {
        self.basis.first().map_or(self.direct.len(), Vec::len)
    }

    fn symmetry(&self) -> Symmetry {
        if self.symmetric { Symmetry::Symmetric } else { Symmetry::General }
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        y.copy_from_slice(&self.relight(x));
        Ok(())
    }
}

impl Adjoint for LowRank {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        x.copy_from_slice(&self.dual(y));
        Ok(())
    }
}
