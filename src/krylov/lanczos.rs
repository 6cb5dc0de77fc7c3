//! The Lanczos process: `A V = V T + β v eᵀ`, one product a step.

use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::basis::{Basis, norm};
use super::orthogonalize::orthogonalize;
use super::start::gaussian;
use crate::error::{Error, Result};
use crate::operator::{Operator, Symmetry};

/// What a step of [`Lanczos::expand`] found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The subspace grew by one, and goes on growing.
    Extended,
    /// The subspace grew by one and is now invariant (`β = 0`): all its Ritz pairs are eigenpairs. The next step goes
    /// on from a random vector orthogonal to everything so far, and finds, e.g., further copies of a repeated
    /// eigenvalue.
    Invariant,
    /// The subspace is the whole space (less the known vectors): nothing is left to find. A further step takes no
    /// product.
    Exhausted,
}

/// A Lanczos factorization of a symmetric operator `A` of `n × n`, with full reorthogonalization.
///
/// After `m` steps, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric tridiagonal (diagonal `α`, off-diagonal
/// `β`) and `v` the next basis vector,
///
/// ```text
/// A V = V T + β_m v e_mᵀ,    VᵀV = I,    Vᵀv = 0,    QᵀV = 0
/// ```
///
/// where `Q` are known vectors (deflation): they are projected out of the start and of every new vector. For
/// eigenvectors `Q` of `A` the process then sees `A` on the rest of the space only, and a further copy of their
/// eigenvalue as a simple one.
///
/// A step takes exactly one product. When that fails, the factorization is as it was before, to the bit, and the step
/// can be taken again. Storage: `m + 1 + k` vectors of `n` for `k` known ones, and one more to work in.
///
/// The coefficients of `A v_j` on all basis vectors, which reorthogonalization computes anyway, are kept. They are
/// zero to rounding where `A` is symmetric, tell by how much it is not ([`Lanczos::asymmetry`]), and keep residual
/// norms honest in that case.
///
/// # References
/// Lanczos (1950), doi:10.6028/jres.045.026; Paige, *The computation of eigenvalues and eigenvectors of very large
/// sparse matrices* (1971); Parlett, *The Symmetric Eigenvalue Problem*, chapter 13, doi:10.1137/1.9781611971163. With
/// photos for products: O'Toole and Kutulakos, *Optical computing for fast light transport analysis* (2010),
/// doi:10.1145/1882261.1866165.
#[derive(Clone, Debug)]
pub struct Lanczos {
    /// Columns `Q`, then `v_1 … v_m`, then `v_{m+1}` unless exhausted.
    basis: Basis,
    known: usize,
    alphas: Vec<f64>,
    betas: Vec<f64>,
    /// Per step, the coefficients of `A v_j` on `Q, v_1 … v_j`.
    projections: Vec<Vec<f64>>,
    /// The largest `‖A v_j‖` so far: a lower bound of `‖A‖`.
    scale: f64,
    restarts: u64,
    work: Vec<f64>,
}

impl Lanczos {
    /// A process that starts from `start` (length `n`) with the vectors of `deflate` (length `n` each, independent;
    /// they need be neither normalized nor orthogonal) projected out. A start within their span is replaced by a
    /// random one.
    ///
    /// # Errors
    /// [`Error::Dimension`] when a length differs from the start's. [`Error::Numerical`] when a vector holds NaN or
    /// an infinity, when `n = 0`, or when a known vector is zero or depends on those before it.
    pub fn new(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        let n = start.len();
        if n == 0 {
            return Err(Error::Numerical("a Lanczos process needs a space of at least one dimension".into()));
        }
        let mut basis = Basis::new(n);
        for (index, vector) in deflate.iter().enumerate() {
            if vector.len() != n {
                return Err(Error::Dimension {
                    what: "a known vector's length",
                    expected: n.to_string(),
                    found: vector.len().to_string(),
                });
            }
            if !append(&mut basis, vector)? {
                return Err(Error::Numerical(format!(
                    "known vector {} is zero or depends on those before it",
                    index + 1
                )));
            }
        }
        let known = basis.len();
        let mut process = Self {
            basis,
            known,
            alphas: Vec::new(),
            betas: Vec::new(),
            projections: Vec::new(),
            scale: 0.0,
            restarts: 0,
            work: vec![0.0; n],
        };
        if !append(&mut process.basis, start)? {
            process.append_random();
        }
        Ok(process)
    }

    /// One step: one product with `operator`, which must be the same from step to step.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the operator is not `n × n`. [`Error::Numerical`] when it is not declared symmetric
    /// (no product is taken then), or when the product holds NaN or an infinity. Whatever the product fails with.
    /// After any error the factorization is as it was before.
    pub fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step> {
        let n = self.n();
        if operator.rows() != n || operator.cols() != n {
            return Err(Error::Dimension {
                what: "the operator of a Lanczos process",
                expected: format!("{n}x{n}"),
                found: format!("{}x{}", operator.rows(), operator.cols()),
            });
        }
        if operator.symmetry() != Symmetry::Symmetric {
            return Err(Error::Numerical(
                "Lanczos needs a symmetric operator (a coaxial rig's), and this one is not declared symmetric".into(),
            ));
        }
        if self.is_exhausted() {
            return Ok(Step::Exhausted);
        }
        let Some(next) = self.basis.columns().last() else { return Ok(Step::Exhausted) };
        operator.apply(next, &mut self.work)?;
        let length = norm(&self.work);
        if !length.is_finite() {
            return Err(Error::Numerical(format!(
                "product {} with the operator holds a NaN or an infinity",
                self.products() + 1
            )));
        }

        // From here on nothing can fail.
        self.scale = self.scale.max(length);
        // A v_j lies in the span of v_{j−1}, v_j, v_{j+1}.
        let removed = orthogonalize(&self.basis, &mut self.work, 2);
        self.alphas.push(removed.coefficients.last().copied().unwrap_or_default());
        self.projections.push(removed.coefficients);
        // What is left of A v is nothing but rounding errors of a product of n terms.
        let invariant = removed.norm <= self.scale * f64::EPSILON * (10.0 + (n as f64).sqrt());
        if invariant || self.basis.len() == n {
            self.betas.push(0.0);
            return Ok(if self.append_random() { Step::Invariant } else { Step::Exhausted });
        }
        self.betas.push(removed.norm);
        self.basis.push_scaled(&self.work, removed.norm);
        Ok(Step::Extended)
    }

    /// The dimension of the space.
    pub fn n(&self) -> usize {
        self.basis.rows()
    }

    /// Steps done, `m`; also the dimension of the subspace.
    pub fn steps(&self) -> usize {
        self.alphas.len()
    }

    /// Products taken: one a step.
    pub fn products(&self) -> usize {
        self.steps()
    }

    /// The subspace is the whole space less the known vectors; no further step takes a product.
    pub fn is_exhausted(&self) -> bool {
        self.basis.len() == self.known + self.steps()
    }

    /// `V`: `m` orthonormal vectors of length `n`.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.basis.columns()[self.known..self.known + self.steps()]
    }

    /// `Q`: the known vectors, made orthonormal.
    pub fn known(&self) -> &[Vec<f64>] {
        &self.basis.columns()[..self.known]
    }

    /// `α_1 … α_m`, the diagonal of `T`.
    pub fn alphas(&self) -> &[f64] {
        &self.alphas
    }

    /// `β_1 … β_m`: the off-diagonal of `T`, and last the norm of the residual `β_m v e_mᵀ`. Zero where the subspace
    /// was invariant.
    pub fn betas(&self) -> &[f64] {
        &self.betas
    }

    /// `β_m`, or 0 before the first step.
    pub fn residual_norm(&self) -> f64 {
        self.betas.last().copied().unwrap_or(0.0)
    }

    /// The largest `‖A v_j‖` so far, a lower bound of `‖A‖₂`.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// How far the products taken are from those of a symmetric operator: `‖H − Hᵀ‖_F / ‖H‖_F` for `H = VᵀAV`. About
    /// 1e-16 for a symmetric one; the relative noise of the products otherwise. Costs no product.
    pub fn asymmetry(&self) -> f64 {
        let mut difference = 0.0;
        let mut total = 0.0;
        for (j, column) in self.projections.iter().enumerate() {
            for (i, &upper) in column[self.known..].iter().enumerate() {
                let lower = self.lower(i, j);
                total += upper * upper;
                if i < j {
                    total += lower * lower;
                    difference += 2.0 * (upper - lower).powi(2);
                }
            }
        }
        if total > 0.0 { (difference / total).sqrt() } else { 0.0 }
    }

    /// The norm of `A V s − V T s − β_m v s_m` for `s` of length `m`: what of `A V s` lies along the known vectors,
    /// and what breaks the symmetry. Zero to rounding where the known vectors are eigenvectors and `A` is symmetric.
    pub(super) fn unmodelled(&self, s: &[f64]) -> f64 {
        let mut rest = vec![0.0; self.known + self.steps()];
        for (j, column) in self.projections.iter().enumerate() {
            for (i, &coefficient) in column.iter().enumerate() {
                let modelled = if i < self.known {
                    0.0
                } else if i - self.known == j {
                    coefficient
                } else {
                    self.lower(i - self.known, j)
                };
                rest[i] += (coefficient - modelled) * s[j];
            }
        }
        norm(&rest)
    }

    /// Entry `(j, i)` of `VᵀAV` for `i < j`, as the process measured it: `β` beside the diagonal, zero below.
    fn lower(&self, i: usize, j: usize) -> f64 {
        if i + 1 == j { self.betas[i] } else { 0.0 }
    }

    pub(super) fn accumulate_basis(&self, s: &[f64], out: &mut [f64]) {
        // The coefficients of Q and of the next vector are zero; skipping Q is all that is worth it.
        let mut padded = s.to_vec();
        padded.resize(self.basis.len() - self.known, 0.0);
        self.basis.accumulate(self.known, &padded, 1.0, out);
    }

    /// Appends a random vector orthogonal to all; false when there is none.
    fn append_random(&mut self) -> bool {
        let n = self.n();
        // In a space of a few dimensions a random vector may have next to nothing outside the span: try some more.
        for _ in 0..8 {
            if self.basis.len() >= n {
                return false;
            }
            self.restarts += 1;
            let vector = gaussian(n, &mut Pcg64::seed_from_u64(self.restarts));
            if matches!(append(&mut self.basis, &vector), Ok(true)) {
                return true;
            }
        }
        false
    }
}

/// Appends what of `vector` is orthogonal to `basis`, normalized; false when that is nothing but rounding errors.
fn append(basis: &mut Basis, vector: &[f64]) -> Result<bool> {
    let length = norm(vector);
    if !length.is_finite() {
        return Err(Error::Numerical("a start or known vector holds a NaN or an infinity".into()));
    }
    if length == 0.0 {
        return Ok(false);
    }
    let mut w: Vec<f64> = vector.iter().map(|value| value / length).collect();
    let left = orthogonalize(basis, &mut w, 0).norm;
    if left <= f64::EPSILON * (10.0 + (w.len() as f64).sqrt()) {
        return Ok(false);
    }
    basis.push_scaled(&w, left);
    Ok(true)
}
