//! The low-rank model as an operator that takes no photos.

use std::sync::Arc;

use crate::analysis::captures::Posterior;
use crate::error::{Error, Result};
use crate::krylov::{dot, norm};
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::sparse::Csr;

/// The model `A ≈ D + G_k` (`n × n`) from `k` photos (see the module). `D` is a diagonal (for coaxial pinholes) or a sparse matrix.
#[derive(Clone, Debug)]
pub struct LowRank {
    basis: Vec<Vec<f64>>,
    photos: Vec<Vec<f64>>,
    direct: Vec<f64>,
    spread: Option<Arc<[Csr; 2]>>,
    symmetric: bool,
    /// Light of two or more bounces that is not in the low-rank part, and its transpose.
    near: Option<Arc<[Csr; 2]>>,
    posterior: Option<Posterior>,
}

impl LowRank {
    /// Makes the model from `k` orthonormal patterns and their photos without direct light (`n` and `m` values each). `direct` has `n`
    /// values and needs `m = n`, or is empty. Fails with [`Error::Dimension`] if sizes differ.
    pub fn new(
        basis: Vec<Vec<f64>>,
        photos: Vec<Vec<f64>>,
        direct: Vec<f64>,
        symmetric: bool,
    ) -> Result<Self> {
        let [n, m] = [&basis, &photos].map(|vectors| vectors.first().map_or(0, Vec::len));
        Error::check_size("photos of a low-rank model", basis.len(), photos.len())?;
        for (vectors, pixels) in [(&basis, n), (&photos, m)] {
            for vector in vectors {
                Error::check_size("pixels of a low-rank model", pixels, vector.len())?;
            }
        }
        if !direct.is_empty() || symmetric {
            Error::check_size("pixels of the photos of a low-rank model", n, m)?;
        }
        if !direct.is_empty() && !basis.is_empty() {
            Error::check_size("pixels of the direct image", n, direct.len())?;
        }
        Ok(Self { basis, photos, direct, spread: None, symmetric, near: None, posterior: None })
    }

    /// Replaces the direct part by a matrix that is not a diagonal, for an open lens or for a projector at another position than the
    /// camera. Fails with [`Error::Dimension`] if the matrix is not `m × n`.
    pub fn with_direct_matrix(self, direct: Csr) -> Result<Self> {
        let spread = self.both(direct)?;
        Ok(Self { direct: Vec::new(), spread: Some(spread), ..self })
    }

    /// Adds a sparse matrix to the global part. Fails with [`Error::Dimension`] if the matrix is not `m × n`.
    pub fn with_near_matrix(self, near: Csr) -> Result<Self> {
        let near = self.both(near)?;
        Ok(Self { near: Some(near), ..self })
    }

    /// The sparse matrix of the global part.
    pub fn near_matrix(&self) -> Option<&Csr> {
        self.near.as_ref().map(|both| &both[0])
    }

    /// A matrix of this size, and its transpose.
    fn both(&self, matrix: Csr) -> Result<Arc<[Csr; 2]>> {
        let (m, n) = (self.rows(), self.cols());
        let found = format!("{}x{}", matrix.rows(), matrix.cols());
        Error::check_size("rows and columns of a part of a low-rank model", format!("{m}x{n}"), found)?;
        let transposed = matrix.transposed();
        Ok(Arc::new([matrix, transposed]))
    }

    /// Adds the errors of a model that was fitted to captures. They replace the estimate from the newest photos.
    #[must_use]
    pub fn with_posterior(self, posterior: Posterior) -> Self {
        Self { posterior: Some(posterior), ..self }
    }

    /// The errors of a model that was fitted to captures.
    pub fn posterior(&self) -> Option<&Posterior> {
        self.posterior.as_ref()
    }

    /// The model without direct light, `G_k`.
    pub fn global(&self) -> Self {
        Self { direct: Vec::new(), spread: None, ..self.clone() }
    }

    /// The diagonal `D` (`n`); empty if there is no `D`, or if `D` is not a diagonal.
    pub fn direct(&self) -> &[f64] {
        &self.direct
    }

    /// The matrix `D`, if it is not a diagonal.
    pub fn direct_matrix(&self) -> Option<&Csr> {
        self.spread.as_ref().map(|both| &both[0])
    }

    /// Returns true if `G_k` is symmetric, which makes it more accurate than `W Qᵀ`.
    pub fn is_symmetric(&self) -> bool {
        self.symmetric
    }

    /// The light of one bounce, `D x` (`n`), without a photo.
    pub fn direct_light(&self, pattern: &[f64]) -> Vec<f64> {
        self.direct_product(pattern, 0)
    }

    /// The number of photos in the model, `k`.
    pub fn rank(&self) -> usize {
        self.basis.len()
    }

    /// The patterns `Q`, which are orthonormal and have negative values.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.basis
    }

    /// The photos `W = G Q`.
    pub fn photos(&self) -> &[Vec<f64>] {
        &self.photos
    }

    /// The model from the first `rank` photos only.
    pub fn truncated(&self, rank: usize) -> Self {
        let first = |vectors: &[Vec<f64>]| vectors.iter().take(rank).cloned().collect();
        Self {
            basis: first(&self.basis),
            photos: first(&self.photos),
            direct: self.direct.clone(),
            spread: self.spread.clone(),
            symmetric: self.symmetric,
            near: self.near.clone(),
            posterior: self.posterior.clone(),
        }
    }

    /// Relights a pattern: computes its photo `A x` (`m`) without taking a photo. Patterns may have negative values.
    ///
    /// # Panics
    /// In debug builds, if `x` does not have `n` entries.
    pub fn relight(&self, pattern: &[f64]) -> Vec<f64> {
        self.product(pattern, &self.basis, &self.photos, 0)
    }

    /// The dual photograph `Aᵀ y`: the scene seen from the projector and lit from the camera by `y`.
    ///
    /// # Panics
    /// In debug builds, if `y` does not have `m` entries.
    pub fn dual(&self, pattern: &[f64]) -> Vec<f64> {
        if self.symmetric {
            return self.relight(pattern);
        }
        self.product(pattern, &self.photos, &self.basis, 1)
    }

    /// The diagonal of the model (`n`): the light that each pixel returns to itself.
    pub fn diagonal(&self) -> Vec<f64> {
        let mut diagonal = match (&self.spread, self.direct.is_empty()) {
            (Some(both), _) => both[0].diagonal(),
            (None, true) => vec![0.0; self.cols()],
            (None, false) => self.direct.clone(),
        };
        if let Some(both) = &self.near {
            add(&mut diagonal, 1.0, &both[0].diagonal());
        }
        // The term Q T Qᵀ with T = QᵀW is subtracted. Each vector here is a column of T.
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

    fn projected(&self, y: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; y.len()];
        for vector in &self.basis {
            add(&mut sum, dot(vector, y), vector);
        }
        sum
    }

    fn direct_product(&self, x: &[f64], side: usize) -> Vec<f64> {
        if let Some(both) = &self.spread {
            return sparse_product(&both[side], x);
        }
        match self.direct.is_empty() {
            true => vec![0.0; if side == 0 { self.rows() } else { self.cols() }],
            false => self.direct.iter().zip(x).map(|(direct, value)| direct * value).collect(),
        }
    }

    /// `D x + to (fromᵀ x)` (`Dᵀ x` for `side` 1). A symmetric model adds `from (toᵀ z)`, where `z = x − from (fromᵀ x)`.
    fn product(&self, x: &[f64], from: &[Vec<f64>], to: &[Vec<f64>], side: usize) -> Vec<f64> {
        debug_assert!(from.iter().all(|vector| vector.len() == x.len()));
        let mut y = self.direct_product(x, side);
        if let Some(both) = &self.near {
            add(&mut y, 1.0, &sparse_product(&both[side], x));
        }
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

fn sparse_product(matrix: &Csr, x: &[f64]) -> Vec<f64> {
    let row = |row: usize| -> f64 {
        let (columns, weights) = matrix.row(row);
        columns.iter().zip(weights).map(|(&column, weight)| weight * x[column as usize]).sum()
    };
    (0..matrix.rows()).map(row).collect()
}

pub(super) fn add(sum: &mut [f64], factor: f64, vector: &[f64]) {
    for (sum, value) in sum.iter_mut().zip(vector) {
        *sum += factor * value;
    }
}

impl Operator for LowRank {
    fn rows(&self) -> usize {
        self.photos.first().map_or(self.direct.len(), Vec::len)
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

/// The last `1/LAST` of the photos show how much light an unseen direction sends.
const LAST: usize = 4;

impl LowRank {
    /// The expected norm of the error of a product with `x` (`n` values), in the unit of the photos. It is the norm of the part of `x`
    /// outside the span of the captured patterns, times the light that a new direction sends. A Krylov process finds directions that send
    /// much light first, so the last quarter of its photos shows how much light the next directions send. Random patterns outside the span
    /// send less. The noise of the photos is not included. A model that was fitted to captures states its own errors instead, in which the
    /// noise of the captures is included.
    pub fn error_of_rank(&self, x: &[f64]) -> f64 {
        if let Some(posterior) = &self.posterior {
            return norm(&posterior.errors(x));
        }
        let mut rest = x.to_vec();
        for vector in self.basis() {
            let share = dot(vector, &rest);
            add(&mut rest, -share, vector);
        }
        norm(&rest) * self.newest()
    }

    /// The light that a new direction sends: the root mean square of the norms of the newest photos.
    fn newest(&self) -> f64 {
        let photos = self.photos();
        let newest = &photos[photos.len() - photos.len().div_ceil(LAST)..];
        let sent: f64 = newest.iter().map(|photo| dot(photo, photo)).sum();
        (sent / newest.len().max(1) as f64).sqrt()
    }

    /// The expected norm of the error of a product of the transpose with `y` (`m` values). Where photos and patterns have different sizes, all
    /// of `y` counts as outside the span of the captured patterns.
    pub fn dual_error(&self, y: &[f64]) -> f64 {
        match &self.posterior {
            Some(posterior) => posterior.dual_error(y),
            None if self.rows() == self.cols() => self.error_of_rank(y),
            None => norm(y) * self.newest(),
        }
    }

    /// The standard error of each value of a product with `x` (`m`): from the captures, or else [`Self::error_of_rank`], spread evenly.
    pub fn errors(&self, x: &[f64]) -> Vec<f64> {
        match &self.posterior {
            Some(posterior) => posterior.errors(x),
            None => vec![self.error_of_rank(x) / (self.rows().max(1) as f64).sqrt(); self.rows()],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;

    #[test]
    fn captured_patterns_are_known_and_others_by_what_the_last_photos_sent() -> Result<()> {
        let unit = |at: usize| (0..8).map(|i| f64::from(u8::from(i == at))).collect::<Vec<f64>>();
        let scaled = |at: usize, by: f64| unit(at).iter().map(|value| by * value).collect::<Vec<f64>>();
        // The norms of the photos fall from 1 to 0.2.
        let photos = vec![scaled(0, 1.0), scaled(1, 0.6), scaled(2, 0.4), scaled(3, 0.2)];
        let model = LowRank::new((0..4).map(unit).collect(), photos, Vec::new(), true)?;
        assert_eq!(model.error_of_rank(&scaled(2, 3.0)), 0.0);
        assert!((model.error_of_rank(&scaled(6, 2.0)) - 0.4).abs() < 1e-15);
        Ok(())
    }
}
