//! The state of all three factorizations: an orthonormal basis, and the coefficients of the products on it.

use std::collections::VecDeque;

use super::Filter;
use crate::error::{Error, Result};
use crate::krylov::basis::{Basis, norm, orthogonalize};
use crate::krylov::start::seeded;
use crate::operator::Operator;

/// The state of a factorization of an operator `A` of `n × n`. After `m` steps, with `p` vectors waiting for their product,
///
/// ```text
/// A V = V⁺ H + Q C,    V⁺ = [V v_{m+1} … v_{m+p}] of n × (m+p), orthonormal,    QᵀV⁺ = 0
/// ```
///
/// where `H = V⁺ᵀ A V` is `(m+p) × m` and `C = Qᵀ A V` has a row per known vector. `p` is 1 for Lanczos and Arnoldi. Otherwise it is the
/// block size minus the number of products that were in the span. A step multiplies `v_{m+1}` and appends the part of the product that is
/// orthogonal to the basis (Ruhe's band form of the block process). A block process therefore also takes one product per step. The process
/// stores `m + p + k` vectors of length `n` for `k` known vectors, and one work vector.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// Columns `Q`, then `v_1 … v_{m+p}`.
    pub(super) basis: Basis,
    pub(super) known: usize,
    /// The number of vectors that start the process, and that continue it from an invariant subspace.
    pub(super) block: usize,
    /// For each step, the coefficients of `A v_j` on `Q, v_1, …`, up to the vector that the step appended.
    pub(super) columns: Vec<Vec<f64>>,
    /// For each step, the standard error of `A v_j` ([`Operator::standard_errors`]); 0 if it is unknown.
    pub(super) errors: Vec<f64>,
    /// A bound on the Frobenius norm of the part of `A V` that restarts discarded; for symmetric products it is rounding error. There is
    /// one bound for all columns, because rotations do not change it. Bounds per column would grow with every restart.
    pub(super) leak: f64,
    pub(super) products: usize,
    /// The largest `‖A v_j‖` so far, a lower bound of `‖A‖`.
    pub(super) scale: f64,
    pub(super) draws: u64,
    pub(super) work: Vec<f64>,
    /// The parts that the last column still has along the columns before it, at most 1e-12 in all; empty if there are none. The next step
    /// removes them.
    pub(super) late: Vec<f64>,
    /// Products with the first waiting vectors, taken as a block before their steps.
    pub(super) ready: VecDeque<(Vec<f64>, f64)>,
    /// Removes noise from the next direction. It is not saved.
    pub(super) filter: Option<Filter>,
}

impl Expansion {
    /// Starts from the independent vectors among `starts`, with `deflate` projected out. If none remains, it starts from a random vector.
    /// `n` is the length of the first start.
    pub(super) fn new(starts: &[Vec<f64>], deflate: &[Vec<f64>]) -> Result<Self> {
        let n = starts.first().map_or(0, Vec::len);
        if n == 0 {
            return Err(Error::Numerical("a Krylov process needs a space of at least one dimension".into()));
        }
        let mut basis = Basis::new(n);
        for (index, vector) in deflate.iter().enumerate() {
            Error::check_size("a known vector's length", n, vector.len())?;
            if !append(&mut basis, vector)? {
                return Err(Error::Numerical(format!(
                    "known vector {} is zero or depends on those before it",
                    index + 1
                )));
            }
        }
        let known = basis.len();
        for start in starts {
            Error::check_size("a start vector's length", n, start.len())?;
            append(&mut basis, start)?;
        }
        let mut process = Self {
            basis,
            known,
            block: starts.len().min(n),
            columns: Vec::new(),
            errors: Vec::new(),
            leak: 0.0,
            products: 0,
            scale: 0.0,
            draws: 0,
            work: vec![0.0; n],
            late: Vec::new(),
            ready: VecDeque::new(),
            filter: None,
        };
        if process.basis.len() == known {
            process.append_random();
        }
        Ok(process)
    }

    /// Adds start vectors to the vectors that wait for their product.
    pub(super) fn widen(&mut self, starts: &[Vec<f64>]) -> Result<()> {
        self.settle();
        for start in starts {
            Error::check_size("a start vector's length", self.n(), start.len())?;
            if self.basis.len() < self.n() {
                append(&mut self.basis, start)?;
            }
        }
        self.block = (self.block + starts.len()).min(self.n());
        Ok(())
    }

    /// Refuses an operator of another size.
    pub(super) fn fits(&self, operator: &dyn Operator) -> Result<()> {
        let n = self.n();
        let found = format!("{}x{}", operator.rows(), operator.cols());
        Error::check_size("the operator of a Krylov process", format!("{n}x{n}"), found)
    }

    /// Entry `(i, j)` of `H`, counted from 0: `v_iᵀ A v_j`, `j < m`, `i < m + p`.
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        self.columns.get(j).and_then(|column| column.get(self.known + i)).copied().unwrap_or(0.0)
    }

    /// Entry `(i, j)` of `T`, the symmetric part of the upper `m × m` of `H`. It is the mean of `H_ij` and `H_ji`, which are two
    /// measurements of one number. If the operator states the errors `e` of its products, the mean is weighted by `1/e²`, so that a noisy
    /// late product does not spoil the result of a good early one.
    pub(super) fn symmetric(&self, i: usize, j: usize) -> f64 {
        let square = |k: usize| self.errors.get(k).map_or(0.0, |error| error * error);
        let (of_i, of_j) = (square(i), square(j));
        let (upper, lower) = (self.entry(i, j), self.entry(j, i));
        // Column j of H comes from the product with v_j.
        if of_i + of_j > 0.0 { (upper * of_i + lower * of_j) / (of_i + of_j) } else { 0.5 * (upper + lower) }
    }

    /// The dimension of the space.
    pub fn n(&self) -> usize {
        self.basis.rows()
    }

    /// The dimension `m` of the subspace: the number of steps minus the number of vectors that restarts discarded.
    pub fn steps(&self) -> usize {
        self.columns.len()
    }

    /// The number of products, one per step.
    pub fn products(&self) -> usize {
        self.products
    }

    /// The number `p` of vectors that wait for their product.
    pub fn pending(&self) -> usize {
        self.basis.len() - self.known - self.steps()
    }

    /// `V`: `m` orthonormal vectors of length `n`.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.basis.columns()[self.known..self.known + self.steps()]
    }

    /// `v_{m+1} … v_{m+p}`: orthonormal vectors of length `n`, multiplied in the next steps. The last may have parts along the others of up
    /// to 1e-12, usually far smaller; the next step removes them.
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

    /// The standard error of `A V s` due to the noise of the products, `√Σ (s_j ‖e_j‖)²` for independent errors `e_j` of the products
    /// `A v_j`. `imaginary` is the imaginary part of `s`, or empty. The result is 0 if the operator does not state its errors.
    pub(super) fn noise(&self, s: &[f64], imaginary: &[f64]) -> f64 {
        let imaginary = imaginary.iter().chain(std::iter::repeat(&0.0));
        let squares = self.errors.iter().zip(s.iter().zip(imaginary));
        squares.map(|(error, (re, im))| error * error * (re * re + im * im)).sum::<f64>().sqrt()
    }

    /// The largest standard error that the operator stated for a product; 0 if it states none.
    pub(in crate::krylov) fn largest_error(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, f64::max)
    }

    /// Returns true if random vectors have continued the process after its subspace became invariant.
    pub(in crate::krylov) fn broke_down(&self) -> bool {
        self.draws > 0
    }

    /// The asymmetry of the products: `‖H − Hᵀ‖_F / ‖H‖_F` for `H = VᵀAV`. It is about 1e-16 for a symmetric operator, and with noise the
    /// relative noise of the products. Takes no product.
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

    /// Allocates memory for a subspace of `steps` dimensions, so that no step up to this size allocates a long vector.
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

    /// Appends a random vector orthogonal to all others; returns false if there is none.
    pub(super) fn append_random(&mut self) -> bool {
        let n = self.n();
        // In a space of few dimensions a random vector may lie almost in the span, so several are tried.
        for _ in 0..8 {
            if self.basis.len() >= n {
                return false;
            }
            self.draws += 1;
            let vector = seeded(n, self.draws);
            if matches!(append(&mut self.basis, &vector), Ok(true)) {
                return true;
            }
        }
        false
    }
}

/// Appends the part of `vector` that is orthogonal to `basis`, normalized. Returns false if that part is only rounding error.
fn append(basis: &mut Basis, vector: &[f64]) -> Result<bool> {
    let length = norm(vector);
    if !length.is_finite() {
        return Err(Error::Numerical("a start or known vector holds a NaN or an infinity".into()));
    }
    if length == 0.0 {
        return Ok(false);
    }
    let mut w: Vec<f64> = vector.iter().map(|value| value / length).collect();
    let left = orthogonalize(basis, &mut w).norm;
    if left <= f64::EPSILON * (10.0 + (w.len() as f64).sqrt()) {
        return Ok(false);
    }
    basis.push_scaled(&w, left);
    Ok(true)
}

impl Expansion {
    /// Thick restart: `V ← V S` for orthonormal eigenvectors `S` of the symmetric part of `H`, with their values. The waiting vectors are
    /// kept. `H` becomes `diag(values)` with the couplings to the waiting vectors below.
    pub(super) fn restart(&mut self, kept: &[(f64, &[f64])]) {
        self.settle();
        let (m, pending) = (self.steps(), self.pending());
        let asymmetric = self.asymmetric_part();
        let parts: Vec<Outside> = kept.iter().map(|(_, s)| self.outside(s, &asymmetric)).collect();
        // Each part includes the loss of earlier restarts, which is counted only once.
        let lost: Vec<f64> = parts.iter().map(|part| part.asymmetric - self.leak).collect();
        self.leak += norm(&lost);
        self.errors = kept.iter().map(|(_, s)| self.noise(s, &[])).collect();
        let vectors: Vec<&[f64]> = kept.iter().map(|(_, s)| *s).collect();
        self.basis.rotate(self.known, self.known + m, &vectors);
        self.columns.clear();
        for (index, ((value, _), part)) in kept.iter().zip(parts).enumerate() {
            let mut column = part.known;
            column.resize(self.known + kept.len(), 0.0);
            column[self.known + index] = *value;
            column.extend_from_slice(&part.waiting[..pending]);
            self.columns.push(column);
        }
    }

    /// `H − T`, column by column, for [`Expansion::outside`]. `T` is the symmetric part of the upper `m × m` of `H`.
    pub(super) fn asymmetric_part(&self) -> Vec<f64> {
        let m = self.steps();
        (0..m * m).map(|at| (at % m, at / m)).map(|(i, j)| self.entry(i, j) - self.symmetric(i, j)).collect()
    }

    /// The components of `A V s − V T s` for `s` of norm 1. `T` is the symmetric part of `H`, and `asymmetric` the other part
    /// ([`Expansion::asymmetric_part`]).
    pub(super) fn outside(&self, s: &[f64], asymmetric: &[f64]) -> Outside {
        let mut inside = vec![0.0; self.steps()];
        for (apart, s) in asymmetric.chunks_exact(self.steps().max(1)).zip(s) {
            inside.iter_mut().zip(apart).for_each(|(sum, apart)| *sum += apart * s);
        }
        let [known, waiting] = self.beyond(s);
        Outside { known, waiting, asymmetric: norm(&inside) + self.leak }
    }

    /// The components of `A V s` along the known vectors, and along the waiting vectors.
    pub(super) fn beyond(&self, s: &[f64]) -> [Vec<f64>; 2] {
        let mut known = vec![0.0; self.known];
        let mut waiting = vec![0.0; self.pending()];
        for (column, s) in self.columns.iter().zip(s) {
            known.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * s);
            let below = column.iter().skip(self.known + self.steps());
            waiting.iter_mut().zip(below).for_each(|(sum, entry)| *sum += entry * s);
        }
        [known, waiting]
    }

    /// The norm of the part outside the subspace, minus the noise of the products that it comes from. The waiting vectors come from the
    /// last few products, so only the noise of these products counts.
    pub(super) fn unresolved(&self, outside: &Outside, s: &[f64]) -> f64 {
        let inside = self.known + self.steps();
        let tells = |column: &Vec<f64>| column.iter().skip(inside).any(|&entry| entry != 0.0);
        let last = self.columns.iter().zip(&self.errors).zip(s).filter(|((column, _), _)| tells(column));
        let noise: f64 = last.map(|((_, error), s)| (error * s).powi(2)).sum();
        let square = norm(&outside.known).powi(2) + norm(&outside.waiting).powi(2);
        (square - noise).max(0.0).sqrt()
    }

    /// The part of `‖(H − T) s‖` that independent errors of the products do not explain; 0 if no errors are stated.
    ///
    /// Errors of norm `e_i` and `e_j`, spread evenly over `n` entries, give the difference of `H_ij` and `H_ji` the variance
    /// `(e_i² + e_j²)/n`. Each of the two differs from their mean by half of the difference.
    pub(super) fn beyond_errors(&self, asymmetric: f64, s: &[f64]) -> f64 {
        let squares: Vec<f64> = self.errors.iter().map(|error| error * error).collect();
        let all: f64 = squares.iter().sum();
        if all == 0.0 {
            return 0.0;
        }
        let (m, n) = (squares.len() as f64, self.n() as f64);
        let of_column = |(square, s): (&f64, &f64)| s * s * (all + (m - 2.0) * square) / (4.0 * n);
        let explained: f64 = squares.iter().zip(s).map(of_column).sum();
        (asymmetric * asymmetric - explained).max(0.0).sqrt()
    }
}

/// The components of `A V s − V T s`.
pub(super) struct Outside {
    /// The components along `Q`: zero to rounding if the known vectors are eigenvectors of a symmetric `A`.
    pub(super) known: Vec<f64>,
    /// The components along the waiting vectors.
    pub(super) waiting: Vec<f64>,
    /// The norm of `V (H − T) s` plus a bound on the part that restarts discarded; zero to rounding if `A` is symmetric.
    pub(super) asymmetric: f64,
}
