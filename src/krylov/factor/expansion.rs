//! What the three factorizations share: an orthonormal basis, and the coefficients of the products on it.

use std::collections::VecDeque;

use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::super::basis::{Basis, norm};
use super::super::orthogonalize::orthogonalize;
use super::super::start::gaussian;
use crate::error::{Error, Result};
use crate::operator::{Operator, block, block_mut};

/// What a step of a factorization found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The subspace grew by one, and goes on growing.
    Extended,
    /// The subspace grew by one, but the product held nothing new: the block is narrower by one from now on.
    Deflated,
    /// The subspace grew by one and is now invariant (no residual is left): all its Ritz pairs are eigenpairs. The
    /// next step goes on from random vectors orthogonal to everything so far, and finds, e.g., further copies of a
    /// repeated eigenvalue.
    Invariant,
    /// The subspace is the whole space (less the known vectors): nothing is left to find. A further step takes no
    /// product.
    Exhausted,
}

/// The state of a factorization of an operator `A` of `n × n`: after `m` steps, with `p` vectors waiting for their
/// product,
///
/// ```text
/// A V = V⁺ H + Q C,    V⁺ = [V v_{m+1} … v_{m+p}] of n × (m+p), orthonormal,    QᵀV⁺ = 0
/// ```
///
/// where `H = V⁺ᵀ A V` is `(m+p) × m` and `C = Qᵀ A V` has a row per known vector. `p` is the block size until
/// products turn out to hold nothing new; 1 for Lanczos and Arnoldi. A step multiplies `v_{m+1}` and appends what of
/// the product is orthogonal to everything (Ruhe's band form of the block process), so that a block, too, is taken one
/// product at a time.
///
/// Storage: `m + p + k` vectors of length `n` for `k` known ones, and one more to work in.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// Columns `Q`, then `v_1 … v_{m+p}`.
    pub(super) basis: Basis,
    pub(super) known: usize,
    /// How many vectors start the process, and start it anew from an invariant subspace.
    pub(super) block: usize,
    /// Per step, the coefficients of `A v_j` on `Q, v_1, …`: as many as there were by then, the new one included.
    pub(super) columns: Vec<Vec<f64>>,
    /// A bound on the Frobenius norm of what of `A V` restarts threw away. Rounding errors for symmetric products.
    /// Restarts rotate it, which leaves it as it is: bounds for each column would grow with every restart.
    pub(super) leak: f64,
    pub(super) products: usize,
    /// The largest `‖A v_j‖` so far: a lower bound of `‖A‖`.
    pub(super) scale: f64,
    /// Random vectors drawn so far.
    pub(super) draws: u64,
    pub(super) work: Vec<f64>,
    /// Products with the first of the waiting vectors, where they were taken as a block.
    pub(super) ready: VecDeque<Vec<f64>>,
}

impl Expansion {
    /// Starts from the independent ones of `starts` with `deflate` projected out, or from a random vector if that
    /// leaves none. `n` is the length of the first start.
    pub(super) fn new(starts: &[Vec<f64>], deflate: &[Vec<f64>]) -> Result<Self> {
        let n = starts.first().map_or(0, Vec::len);
        if n == 0 {
            return Err(Error::Numerical("a Krylov process needs a space of at least one dimension".into()));
        }
        let fits = |vector: &[f64], what: &'static str| {
            if vector.len() == n {
                return Ok(());
            }
            Err(Error::Dimension { what, expected: n.to_string(), found: vector.len().to_string() })
        };
        let mut basis = Basis::new(n);
        for (index, vector) in deflate.iter().enumerate() {
            fits(vector, "a known vector's length")?;
            if !append(&mut basis, vector)? {
                return Err(Error::Numerical(format!(
                    "known vector {} is zero or depends on those before it",
                    index + 1
                )));
            }
        }
        let known = basis.len();
        for start in starts {
            fits(start, "a start vector's length")?;
            append(&mut basis, start)?;
        }
        let mut process = Self {
            basis,
            known,
            block: starts.len().min(n),
            columns: Vec::new(),
            leak: 0.0,
            products: 0,
            scale: 0.0,
            draws: 0,
            work: vec![0.0; n],
            ready: VecDeque::new(),
        };
        if process.basis.len() == known {
            process.append_random();
        }
        Ok(process)
    }

    /// Refuses an operator of another size.
    fn fits(&self, operator: &dyn Operator) -> Result<()> {
        let n = self.n();
        if operator.rows() == n && operator.cols() == n {
            return Ok(());
        }
        Err(Error::Dimension {
            what: "the operator of a Krylov process",
            expected: format!("{n}x{n}"),
            found: format!("{}x{}", operator.rows(), operator.cols()),
        })
    }

    /// Takes the products with up to `most` of the waiting vectors as one block of the operator's size; the next steps use them.
    pub(super) fn multiply_block(&mut self, operator: &mut dyn Operator, most: usize) -> Result<()> {
        let count = operator.block_size().min(most).min(self.pending());
        if count < 2 || !self.ready.is_empty() {
            return Ok(());
        }
        self.fits(operator)?;
        let mut products = vec![vec![0.0; self.n()]; count];
        operator.apply_block(&block(&self.waiting()[..count]), &mut block_mut(&mut products))?;
        self.ready = products.into();
        Ok(())
    }

    /// One step: one product. `recent` is how many of the last columns hold, up to rounding, all of `A v` that is in
    /// the span (0 when all columns do).
    pub(super) fn step(&mut self, operator: &mut dyn Operator, recent: usize) -> Result<Step> {
        let n = self.n();
        self.fits(operator)?;
        let waiting = &self.basis.columns()[self.known + self.steps()..];
        let Some(next) = waiting.first() else { return Ok(Step::Exhausted) };
        match self.ready.pop_front() {
            Some(product) => self.work = product,
            None => operator.apply(next, &mut self.work)?,
        }
        let length = norm(&self.work);
        if !length.is_finite() {
            // The step can be taken again, with a new product.
            self.ready.clear();
            return Err(Error::Numerical(format!(
                "product {} with the operator holds a NaN or an infinity",
                self.products + 1
            )));
        }

        // From here on nothing can fail.
        self.products += 1;
        self.scale = self.scale.max(length);
        let mut removed = orthogonalize(&self.basis, &mut self.work, recent);
        // What is left of A v is nothing but rounding errors of a product of n terms.
        let nothing_new = removed.norm <= self.scale * f64::EPSILON * (10.0 + (n as f64).sqrt());
        if !nothing_new && self.basis.len() < n {
            removed.coefficients.push(removed.norm);
            self.columns.push(removed.coefficients);
            self.basis.push_scaled(&self.work, removed.norm);
            return Ok(Step::Extended);
        }
        self.columns.push(removed.coefficients);
        if self.pending() > 0 {
            return Ok(Step::Deflated);
        }
        for _ in 0..self.block {
            self.append_random();
        }
        Ok(if self.pending() > 0 { Step::Invariant } else { Step::Exhausted })
    }

    /// Entry `(i, j)` of `H`, counted from 0: `v_iᵀ A v_j`, `j < m`, `i < m + p`.
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        self.columns.get(j).and_then(|column| column.get(self.known + i)).copied().unwrap_or(0.0)
    }

    /// The dimension of the space.
    pub fn n(&self) -> usize {
        self.basis.rows()
    }

    /// The dimension `m` of the subspace: steps done, less what restarts threw away.
    pub fn steps(&self) -> usize {
        self.columns.len()
    }

    /// Products taken in all.
    pub fn products(&self) -> usize {
        self.products
    }

    /// Vectors `p` that wait for their product.
    pub fn pending(&self) -> usize {
        self.basis.len() - self.known - self.steps()
    }

    /// `V`: `m` orthonormal vectors of length `n`.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.basis.columns()[self.known..self.known + self.steps()]
    }

    /// `v_{m+1} … v_{m+p}`: orthonormal vectors of length `n`, whose products come next.
    pub fn waiting(&self) -> &[Vec<f64>] {
        &self.basis.columns()[self.known + self.steps()..]
    }

    /// `Q`: the known vectors, made orthonormal.
    pub fn known(&self) -> &[Vec<f64>] {
        &self.basis.columns()[..self.known]
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
        for j in 0..self.steps() {
            total += self.entry(j, j).powi(2);
            for i in 0..j {
                let (upper, lower) = (self.entry(i, j), self.entry(j, i));
                total += upper * upper + lower * lower;
                difference += 2.0 * (upper - lower).powi(2);
            }
        }
        if total > 0.0 { (difference / total).sqrt() } else { 0.0 }
    }

    /// Sets memory aside for a subspace of `steps` dimensions: no step up to there asks for a long vector.
    pub fn reserve(&mut self, steps: usize) {
        self.basis.reserve(self.known + steps.min(self.n()) + self.block);
    }

    /// `V s`, for `s` of length `m`.
    pub(super) fn combine(&self, s: &[f64]) -> Vec<f64> {
        let mut vector = vec![0.0; self.n()];
        // The coefficients of the waiting vectors are zero.
        let mut padded = s.to_vec();
        padded.resize(self.basis.len() - self.known, 0.0);
        self.basis.accumulate(self.known, &padded, 1.0, &mut vector);
        vector
    }

    /// Appends a random vector orthogonal to all; false when there is none.
    fn append_random(&mut self) -> bool {
        let n = self.n();
        // In a space of a few dimensions a random vector may have next to nothing outside the span: try some more.
        for _ in 0..8 {
            if self.basis.len() >= n {
                return false;
            }
            self.draws += 1;
            let vector = gaussian(n, &mut Pcg64::seed_from_u64(self.draws));
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
