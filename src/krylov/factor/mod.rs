//! Krylov factorizations `A V = V⁺ H`, from which eigenpairs are computed.

mod place;
mod ritz;
mod save;
mod step;

use std::collections::VecDeque;
use std::sync::Arc;

use self::place::{Host, orthogonalize};
use super::basis::{Basis, exceeds_rounding, norm};
use super::start::seeded;
use crate::error::{Error, Result};
use crate::operator::{Operator, Symmetry, Vectors, check_square};

pub(in crate::krylov) use place::{MOST, Placed};
pub use ritz::{PairStatus, RitzPair, Which, temple_kato};
pub use step::Step;

/// The process that makes a [`Factorization`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessKind {
    /// A Lanczos factorization of a symmetric operator `A` of `n × n`, with full reorthogonalization.
    ///
    /// After `m` steps, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric tridiagonal (diagonal `α`, off-diagonal `β`) and `v` the
    /// next basis vector,
    ///
    /// ```text
    /// A V = V T + β_m v e_mᵀ,    VᵀV = I,    Vᵀv = 0,    QᵀV = 0
    /// ```
    ///
    /// where `Q` are known vectors (deflation). The process projects them out of the start and of every new vector. If `Q` are eigenvectors
    /// of `A`, the process sees `A` only on the orthogonal complement of `Q`. A further copy of one of their eigenvalues then appears as a
    /// simple eigenvalue.
    ///
    /// A step takes exactly one product. If the product fails, the factorization is bitwise unchanged and the step can be taken again.
    /// Storage: `m + 1 + k` vectors of `n` for `k` known vectors, and one work vector.
    ///
    /// Reorthogonalization computes the coefficients of `A v_j` on all basis vectors, and the process keeps these coefficients. If `A` is
    /// symmetric, the coefficients outside the tridiagonal are zero to rounding. Otherwise they measure the asymmetry
    /// ([`Factorization::asymmetry`]) and keep the residual norms correct.
    ///
    /// References: Lanczos (1950), doi:10.6028/jres.045.026; Paige, *The computation of eigenvalues and eigenvectors of very large sparse
    /// matrices* (1971); Parlett, *The Symmetric Eigenvalue Problem*, chapter 13, doi:10.1137/1.9781611971163. With photos for products:
    /// O'Toole and Kutulakos, section 4 (the Krylov subspace), section 7.1 (orthogonal patterns) and section 8.1 (as many Lanczos vectors
    /// as photos, and no restart). See also *Optical computing for fast light transport analysis* (2010), doi:10.1145/1882261.1866165.
    Lanczos = 1,
    /// A block Lanczos factorization of a symmetric operator `A` of `n × n`, with full reorthogonalization.
    ///
    /// After `m` steps from a block of `b` vectors, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric with `b` diagonals on each
    /// side of the main diagonal, and `W` the `p ≤ b` vectors that wait for their product,
    ///
    /// ```text
    /// A V = V T + W B,    [V W]ᵀ[V W] = I,    Qᵀ[V W] = 0
    /// ```
    ///
    /// where `B = WᵀAV`, and `Q` are known vectors that are projected out (see [`ProcessKind::Lanczos`]). A process from a single start
    /// vector finds one vector of each eigenspace. A process from `b` start vectors finds `b` vectors of each eigenspace, and so all copies
    /// of an eigenvalue that is repeated up to `b` times. One round over the block costs `b` products and raises the polynomial degree by
    /// one, like one Lanczos step.
    ///
    /// A step takes one product (Ruhe's band form), so the process can stop and resume within a block. The products with the waiting
    /// vectors may be taken together before their steps ([`Factorization::multiply_block`]). The block becomes narrower if a product lies
    /// in the span of the basis, or if start vectors are dependent. When no vector waits any more, the subspace is invariant, and the
    /// process continues from `b` random vectors. The process stores `m + p + k` vectors of `n` for `k` known vectors, and one work vector.
    ///
    /// References: Golub and Underwood, *The block Lanczos method for computing eigenvalues*, Mathematical Software III (1977); Ruhe,
    /// *Implementation aspects of band Lanczos algorithms*, Math. Comp. 33 (1979), doi:10.1090/S0025-5718-1979-0521282-9.
    BlockLanczos = 2,
    /// An Arnoldi factorization of any operator `A` of `n × n`, with full reorthogonalization.
    ///
    /// After `m` steps, with `V` of `n × m` orthonormal, `H` of `m × m` upper Hessenberg and `v` the next basis vector,
    ///
    /// ```text
    /// A V = V H + h_{m+1,m} v e_mᵀ,    VᵀV = I,    Vᵀv = 0,    QᵀV = 0
    /// ```
    ///
    /// where `Q` are known vectors, projected out of the start and of every new vector. The process then sees `(I − QQᵀ) A` on the
    /// orthogonal complement of `Q`. If `Q` spans an invariant subspace, the eigenvalues of this operator are the other eigenvalues of `A`.
    /// The Ritz vectors then approximate Schur vectors and not eigenvectors, unless `Q` is also invariant under `Aᵀ`. The residual norms
    /// are computed for `A`, so they show this difference.
    ///
    /// A breakdown, `h_{m+1,m} = 0`, is harmless: `V` is invariant, its Ritz pairs are eigenpairs, and the process continues from a random
    /// vector. The process stores `m + 1 + k` vectors of `n` for `k` known vectors, and one work vector.
    ///
    /// References: Arnoldi, *The principle of minimized iterations in the solution of the matrix eigenvalue problem* (1951),
    /// doi:10.1090/qam/42792; Saad, *Numerical Methods for Large Eigenvalue Problems*, chapter 6, doi:10.1137/1.9781611970739. With photos
    /// for products: O'Toole and Kutulakos, section 4 (the Arnoldi approximation problem) and section 7.1 (orthogonal patterns).
    Arnoldi = 3,
}

/// A factorization that takes one product per step. Its eigenpairs need no further product.
///
/// The process can be stopped, inspected, saved and resumed after any step. If a product fails, the factorization is bitwise unchanged, and
/// the step can be taken again.
///
/// Let `A` be an operator of `n × n`. After `m` steps, with `p` vectors waiting for their product,
///
/// ```text
/// A V = V⁺ H + Q C,    V⁺ = [V v_{m+1} … v_{m+p}] of n × (m+p), orthonormal,    QᵀV⁺ = 0
/// ```
///
/// where `H = V⁺ᵀ A V` is `(m+p) × m` and `C = Qᵀ A V` has a row per known vector. `p` is 1 for Lanczos and Arnoldi. For a block process,
/// `p` is the block size minus the number of products that were in the span of the basis. A step multiplies `v_{m+1}` and appends the part
/// of the product that is orthogonal to the basis (Ruhe's band form of the block process). A block process therefore also takes one product
/// per step. The process stores `m + p + k` vectors of length `n` for `k` known vectors, and one work vector.
#[derive(Clone, Debug)]
pub struct Factorization {
    kind: ProcessKind,
    /// Columns `Q`, then `v_1 … v_{m+p}`, and the product of the present step.
    host: Host,
    known: usize,
    /// `p`.
    pending: usize,
    /// The number of vectors that start the process. If the subspace is invariant, the same number of random vectors continues the process.
    block: usize,
    /// For each step, the coefficients of `A v_j` on `Q, v_1, …`, up to the vector that the step appended.
    columns: Vec<Vec<f64>>,
    /// For each step, the standard error of `A v_j` ([`Operator::standard_errors`]); 0 if it is unknown.
    errors: Vec<f64>,
    /// A bound on the Frobenius norm of the part of `A V` that restarts discarded. For symmetric products, this part is only rounding
    /// error. There is one bound for all columns, because rotations do not change it. Bounds per column would grow with every restart.
    leak: f64,
    products: usize,
    /// The largest `‖A v_j‖` so far, a lower bound of `‖A‖`.
    scale: f64,
    draws: u64,
    /// The parts that the last column still has along the columns before it, of norm at most 1e-12 together; empty if there are none. The
    /// next step removes these parts.
    late: Vec<f64>,
    /// Products with the first waiting vectors, taken as a block before their steps.
    ready: VecDeque<(Vec<f64>, f64)>,
    /// Removes noise from the next direction. It is not saved.
    filter: Option<Filter>,
}

impl Factorization {
    /// Starts a Lanczos process from `start` (length `n`) and projects out the vectors of `deflate`. The vectors of `deflate` have length
    /// `n` and are independent; they need not be normalized or orthogonal. If `start` lies in their span, a random vector replaces it.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a length differs from the length of the start. [`Error::Numerical`] if a vector holds NaN or an infinity, if
    /// `n = 0`, or if a known vector is zero or depends on the vectors before it.
    pub fn lanczos(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        Self::start(ProcessKind::Lanczos, &[start.to_vec()], deflate)
    }

    /// Starts a block Lanczos process from the independent vectors among `starts` (`b ≥ 1`, length `n` each), and projects out the vectors
    /// of `deflate`. Fails with the errors of [`Factorization::lanczos`].
    pub fn block_lanczos(starts: &[Vec<f64>], deflate: &[Vec<f64>]) -> Result<Self> {
        Self::start(ProcessKind::BlockLanczos, starts, deflate)
    }

    /// Starts an Arnoldi process from `start` (length `n`) and projects out the vectors of `deflate`. Fails with the errors of
    /// [`Factorization::lanczos`].
    pub fn arnoldi(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        Self::start(ProcessKind::Arnoldi, &[start.to_vec()], deflate)
    }

    /// Starts from the independent vectors among `starts`, with `deflate` projected out. If no vector remains, starts from a random vector.
    /// `n` is the length of the first start vector.
    fn start(kind: ProcessKind, starts: &[Vec<f64>], deflate: &[Vec<f64>]) -> Result<Self> {
        let n = starts.first().map_or(0, Vec::len);
        if n == 0 {
            return Err(Error::Numerical("a Krylov process needs a space of at least one dimension".into()));
        }
        let mut host = Host { basis: Basis::new(n), work: vec![0.0; n] };
        for (index, vector) in deflate.iter().enumerate() {
            Error::check_size("a known vector's length", n, vector.len())?;
            if !append(&mut host, vector)? {
                return Err(Error::Numerical(format!(
                    "known vector {} is zero or depends on those before it",
                    index + 1
                )));
            }
        }
        let known = host.basis.len();
        for start in starts {
            Error::check_size("a start vector's length", n, start.len())?;
            append(&mut host, start)?;
        }
        let mut process = Self {
            kind,
            pending: host.basis.len() - known,
            host,
            known,
            block: starts.len().min(n),
            columns: Vec::new(),
            errors: Vec::new(),
            leak: 0.0,
            products: 0,
            scale: 0.0,
            draws: 0,
            late: Vec::new(),
            ready: VecDeque::new(),
            filter: None,
        };
        if process.pending == 0 {
            process.within_host(Self::append_random)?;
        }
        Ok(process)
    }

    /// Lets a filter ([`Filter`]) remove noise from the directions of all following steps whose products have a stated error.
    #[must_use]
    pub fn filtered(self, filter: Filter) -> Self {
        Self { filter: Some(filter), ..self }
    }

    /// Widens the block of a Lanczos process by start vectors (length `n` each), to find further copies of an eigenvalue. The process keeps
    /// its state, and uses the new vectors from the next step on. Vectors in the span of the basis are left out.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a length differs; [`Error::Numerical`] for NaN or an infinity.
    pub fn widen(&mut self, starts: &[Vec<f64>]) -> Result<()> {
        self.settle();
        for start in starts {
            Error::check_size("a start vector's length", self.n(), start.len())?;
            if self.total() < self.n() && append(&mut self.host, start)? {
                self.pending += 1;
            }
        }
        self.block = (self.block + starts.len()).min(self.n());
        Ok(())
    }

    /// Takes one step: one product with `operator` (`n × n`). The operator must be the same in every step.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the operator is not `n × n`. [`Error::Numerical`] if the
    /// process needs a symmetric operator and this operator is not declared symmetric (no product is taken then), or if the product
    /// contains NaN or an infinity. The error of the product. After any error, the factorization is as before the step.
    pub fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step> {
        self.fits(operator)?;
        self.step(operator)
    }

    /// Takes up to `most` of the next products as one block of at most [`Operator::block_size`] products. The following steps use these
    /// products. Takes no product if the block size is 1, if only one vector waits, or if products of an earlier call are still unused. The
    /// caller must be certain to take these steps; the call does not change the results. Products taken before their step do not count in
    /// [`Factorization::products`] yet, and are not saved.
    ///
    /// # Errors
    /// The errors of [`Factorization::expand`]. The factorization is then unchanged.
    pub fn multiply_block(&mut self, operator: &mut dyn Operator, most: usize) -> Result<()> {
        self.fits(operator)?;
        self.take_block(operator, most)
    }

    /// Returns true if the process uses the symmetry of its operator.
    fn is_symmetric(&self) -> bool {
        self.kind != ProcessKind::Arnoldi
    }

    /// Refuses an operator of another size, or an operator without the symmetry that the process needs.
    fn fits(&self, operator: &dyn Operator) -> Result<()> {
        if self.is_symmetric() && operator.symmetry() != Symmetry::Symmetric {
            return Err(Error::Numerical(
                "Lanczos needs a symmetric operator (a coaxial rig's), and this one is not declared symmetric".into(),
            ));
        }
        check_square("the operator of a Krylov process", self.n(), operator)
    }

    /// Computes the `min(count, m)` most wanted Ritz pairs, the most wanted first.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the dense eigensolver fails on `H`. [`Error::Option`] naming
    /// `--which` if this process cannot find the requested end of the spectrum.
    pub fn ritz(&self, which: Which, count: usize) -> Result<Vec<RitzPair>> {
        if self.is_symmetric() {
            self.ritz_of_symmetric(which, count)
        } else {
            self.ritz_of_general(which, count)
        }
    }

    /// Thick restart: shrinks the subspace to the `keep` most wanted Ritz vectors without a product. The process continues from there (Wu
    /// and Simon, doi:10.1137/S0895479898334605). Does nothing for `keep ≥ m`.
    ///
    /// # Errors
    /// The errors of [`Factorization::ritz`]; [`Error::Numerical`] for an Arnoldi process, which has no restarts.
    pub fn shrink(&mut self, which: Which, keep: usize) -> Result<()> {
        if keep >= self.steps() {
            return Ok(());
        }
        if !self.is_symmetric() {
            return Err(Error::Numerical(
                "an Arnoldi process cannot be restarted; give it the memory for all steps".into(),
            ));
        }
        let pairs = self.all_of_symmetric(which)?;
        self.restart(&pairs[..keep]);
        Ok(())
    }

    /// The real Ritz vector `y = V s` of a pair from this factorization. It has length `n` and norm 1, and its entry of largest magnitude
    /// is positive. For a complex pair, the result is the real part of `y`, with its sign unchanged.
    pub fn ritz_vector(&self, pair: &RitzPair) -> Vec<f64> {
        let mut vector = self.combine(&pair.coefficients);
        if pair.is_real() {
            point_upwards(&mut vector);
        }
        vector
    }

    /// The imaginary part of a Ritz vector (length `n`): zero for a real pair.
    pub fn ritz_vector_imaginary(&self, pair: &RitzPair) -> Vec<f64> {
        self.combine(&pair.imaginary_coefficients)
    }

    /// Returns true if the subspace is the whole orthogonal complement of the known vectors. Further steps then take no product.
    pub fn is_exhausted(&self) -> bool {
        self.pending() == 0
    }

    /// `b`: the number of start vectors so far. [`Factorization::pending`] returns how many vectors still wait.
    pub fn block(&self) -> usize {
        self.block
    }

    /// `α_1 … α_m`, the diagonal of `H`.
    pub fn alphas(&self) -> Vec<f64> {
        (0..self.steps()).map(|j| self.entry(j, j)).collect()
    }

    /// `β_1 … β_m` of a process from one start vector: the diagonal of `H` below the main diagonal. The last entry `β_m` is the norm of the
    /// residual `β_m v e_mᵀ`. An entry is zero if the subspace was invariant. After [`Factorization::shrink`], the kept Ritz vectors couple
    /// to the first vector after them instead (see [`Factorization::entry`]).
    pub fn betas(&self) -> Vec<f64> {
        (0..self.steps()).map(|j| self.entry(j + 1, j)).collect()
    }

    /// `β_m`, or `h_{m+1,m}` for an Arnoldi process; 0 before the first step and after a breakdown.
    pub fn residual_norm(&self) -> f64 {
        self.betas().last().copied().unwrap_or(0.0)
    }

    /// Entry `(i, j)` of `H`, which is `v_iᵀ A v_j`. The indices count from 0: `j < m`, `i < m + p`.
    pub fn entry(&self, i: usize, j: usize) -> f64 {
        self.columns.get(j).and_then(|column| column.get(self.known + i)).copied().unwrap_or(0.0)
    }

    /// Entry `(i, j)` of `T`, the symmetric part of the upper `m × m` of `H`. The entry is the mean of `H_ij` and `H_ji`, which are two
    /// measurements of the same number. If the operator states the errors `e` of its products, the mean is weighted by `1/e²`, so that a
    /// noisy late product does not spoil the result of an accurate early product.
    fn symmetric(&self, i: usize, j: usize) -> f64 {
        let square = |k: usize| self.errors.get(k).map_or(0.0, |error| error * error);
        let (of_i, of_j) = (square(i), square(j));
        let (upper, lower) = (self.entry(i, j), self.entry(j, i));
        // Column j of H comes from the product with v_j.
        if of_i + of_j > 0.0 { (upper * of_i + lower * of_j) / (of_i + of_j) } else { 0.5 * (upper + lower) }
    }

    /// The dimension of the space.
    pub fn n(&self) -> usize {
        self.host.basis.rows()
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
        self.pending
    }

    /// `k + m + p`: the number of columns of the basis.
    fn total(&self) -> usize {
        self.known + self.steps() + self.pending
    }

    /// `V`: `m` orthonormal vectors of length `n`.
    pub fn basis(&self) -> &[Vec<f64>] {
        &self.host.basis.columns()[self.known..self.known + self.steps()]
    }

    /// `v_{m+1} … v_{m+p}`: orthonormal vectors of length `n`, which the next steps multiply. The last vector may have parts along the
    /// other basis vectors of up to 1e-12. They are usually far smaller. The next step removes these parts.
    pub fn waiting(&self) -> &[Vec<f64>] {
        &self.host.basis.columns()[self.known + self.steps()..]
    }

    /// `Q`: the known vectors, made orthonormal.
    pub fn known(&self) -> &[Vec<f64>] {
        &self.host.basis.columns()[..self.known]
    }

    /// The largest `‖A v_j‖` so far, a lower bound of `‖A‖₂`.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// The standard error of `A V s` due to the noise of the products, `√Σ (s_j ‖e_j‖)²` for independent errors `e_j` of the products
    /// `A v_j`. `imaginary` is the imaginary part of `s`, or empty. The result is 0 if the operator does not state its errors.
    fn noise(&self, s: &[f64], imaginary: &[f64]) -> f64 {
        let imaginary = imaginary.iter().chain(std::iter::repeat(&0.0));
        let squares = self.errors.iter().zip(s.iter().zip(imaginary));
        squares.map(|(error, (re, im))| error * error * (re * re + im * im)).sum::<f64>().sqrt()
    }

    /// The largest standard error that the operator stated for a product, or 0 if the operator states no errors.
    pub(in crate::krylov) fn largest_error(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, f64::max)
    }

    /// Returns true if random vectors have continued the process after its subspace became invariant.
    pub(in crate::krylov) fn broke_down(&self) -> bool {
        self.draws > 0
    }

    /// The asymmetry of the products, `‖H − Hᵀ‖_F / ‖H‖_F` for `H = VᵀAV`. For a symmetric operator it is about 1e-16; for noisy products,
    /// it is their relative noise. Takes no product.
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
        self.host.basis.reserve(self.known + steps.min(self.n()) + self.block);
    }

    /// `V s`, for `s` of length `m`.
    fn combine(&self, s: &[f64]) -> Vec<f64> {
        let mut vector = vec![0.0; self.n()];
        // The coefficients of the waiting vectors are zero.
        let mut padded = s.to_vec();
        padded.resize(self.total() - self.known, 0.0);
        self.host.basis.accumulate(self.known, &padded, 1.0, &mut vector);
        vector
    }

    /// Calls `change` with the vectors in the host's memory.
    fn within_host<T>(&mut self, change: impl FnOnce(&mut Self, &mut dyn Vectors) -> T) -> T {
        let mut host = std::mem::take(&mut self.host);
        let changed = change(self, &mut host);
        self.host = host;
        changed
    }

    /// Appends a random vector orthogonal to the basis, if there is such a vector.
    fn append_random(&mut self, vectors: &mut dyn Vectors) -> Result<()> {
        let n = vectors.rows();
        // In a space of few dimensions a random vector may lie almost in the span, so several are tried.
        for _ in 0..8 {
            if self.total() >= n {
                break;
            }
            self.draws += 1;
            if append(vectors, &seeded(n, self.draws))? {
                self.pending += 1;
                break;
            }
        }
        Ok(())
    }
}

/// Appends the part of `vector` that is orthogonal to the basis, normalized. Returns false if this part is only rounding error.
fn append(vectors: &mut dyn Vectors, vector: &[f64]) -> Result<bool> {
    let length = norm(vector);
    if !length.is_finite() {
        return Err(Error::Numerical("a start or known vector holds a NaN or an infinity".into()));
    }
    if length == 0.0 {
        return Ok(false);
    }
    vectors.load(&vector.iter().map(|value| value / length).collect::<Vec<f64>>())?;
    let left = orthogonalize(vectors)?.norm;
    let is_new = exceeds_rounding(left, 1.0, vector.len());
    if is_new {
        vectors.push(left)?;
    }
    Ok(is_new)
}

/// Flips the sign of `vector` if its entry of largest magnitude is negative. Returns true if the sign changed.
pub(super) fn point_upwards(vector: &mut [f64]) -> bool {
    let largest = vector.iter().fold(0.0_f64, |a, &b| if b.abs() > a.abs() { b } else { a });
    if largest < 0.0 {
        for value in vector {
            *value = -*value;
        }
    }
    largest < 0.0
}

/// A function of the remainder of a product and of the share of noise in the remainder; see [`Filter::new`].
type Of = dyn Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync;

/// Removes noise from the next direction of a Krylov process.
///
/// The next direction is the remainder of a product: the part that is orthogonal to the basis. If it is mostly noise, the process continues
/// into noise and finds nothing. A filter can distinguish noise from light, and returns a direction with most of the noise removed.
/// Eigenvalues are not distorted, because they come from the products themselves, projected on the directions of the process.
#[derive(Clone)]
pub struct Filter(Arc<Of>);

impl Filter {
    /// Makes a filter from a function. The function receives the remainder of a product, of length `n`, and the expected share of noise in
    /// its norm, above 0 and up to 1. It returns the direction for the next step, of length `n`, or `None` to keep the remainder. It is not
    /// called for products whose operator states no error.
    pub fn new(of: impl Fn(&[f64], f64) -> Option<Vec<f64>> + Send + Sync + 'static) -> Self {
        Self(Arc::new(of))
    }

    /// Returns the direction for the next step.
    pub fn apply(&self, rest: &[f64], share: f64) -> Option<Vec<f64>> {
        (self.0)(rest, share)
    }
}

impl std::fmt::Debug for Filter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str("Filter")
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    use super::*;
    use crate::krylov::{Which, dot, norm};
    use crate::operator::Symmetry;

    /// `Σ λ_k u_k u_kᵀ` with three slow waves `u_k`. Each product has noise of norm about 0.5.
    struct Noisy {
        random: Pcg64,
    }

    const N: usize = 400;

    /// A wave of `periods` half periods, with norm 1.
    fn wave(periods: usize) -> Vec<f64> {
        let at = |i: usize| (std::f64::consts::PI * periods as f64 * (i as f64 + 0.5) / N as f64).cos();
        let wave: Vec<f64> = (0..N).map(at).collect();
        let length = norm(&wave);
        wave.into_iter().map(|value| value / length).collect()
    }

    impl Operator for Noisy {
        fn rows(&self) -> usize {
            N
        }

        fn cols(&self) -> usize {
            N
        }

        fn symmetry(&self) -> Symmetry {
            Symmetry::Symmetric
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            y.fill(0.0);
            for (periods, value) in [(1, 1.0), (2, 0.9), (3, 0.5)] {
                let wave = wave(periods);
                let along = value * dot(&wave, x);
                y.iter_mut().zip(&wave).for_each(|(y, wave)| *y += along * wave);
            }
            let noise = crate::krylov::start::gaussian(N, &mut self.random);
            let scale = 0.5 / (N as f64).sqrt();
            y.iter_mut().zip(&noise).for_each(|(y, noise)| *y += scale * noise);
            Ok(())
        }

        fn standard_errors(&self) -> Vec<f64> {
            vec![0.5]
        }
    }

    /// Measures how much of each of the first two slow waves lies in the span of two Ritz vectors after twelve products. Returns the
    /// smaller share.
    fn found(filter: Option<Filter>) -> Result<f64> {
        let start: Vec<f64> = (0..N).map(|i| 1.0 + i as f64 / N as f64 + wave(1)[i] + wave(2)[i]).collect();
        let mut process = Factorization::block_lanczos(&[start], &[])?;
        if let Some(filter) = filter {
            process = process.filtered(filter);
        }
        let mut operator = Noisy { random: Pcg64::seed_from_u64(4) };
        for _ in 0..12 {
            process.expand(&mut operator)?;
        }
        let pairs = process.ritz(Which::LargestAlgebraic, 2)?;
        let vectors: Vec<Vec<f64>> = pairs.iter().map(|pair| process.ritz_vector(pair)).collect();
        let part = |wave: &[f64]| vectors.iter().map(|v| dot(v, wave).powi(2)).sum::<f64>();
        Ok(part(&wave(1)).min(part(&wave(2))))
    }

    #[test]
    fn a_low_pass_finds_slow_eigenvectors_in_noise() -> Result<()> {
        let low_pass = Filter::new(|rest, share| {
            let mean = |i: usize| {
                let near = &rest[i.saturating_sub(20)..(i + 21).min(N)];
                near.iter().sum::<f64>() / near.len() as f64
            };
            (share > 0.3).then(|| (0..N).map(mean).collect())
        });
        let (with, without) = (found(Some(low_pass))?, found(None)?);
        assert!(with > 0.95 && without < 0.85, "{with} {without}");
        Ok(())
    }
}
