//! The three processes: Lanczos and block Lanczos for symmetric operators, Arnoldi for any operator. Each takes one product per step.

use std::io::{Read, Write};

use super::ritz::{RitzPair, Which, ritz_of_general};
use super::save::{ProcessKind, load, save};
use super::{Expansion, Factorization, Filter, Step};
use crate::error::{Error, Result};
use crate::operator::{Operator, Symmetry};

/// A Lanczos factorization of a symmetric operator `A` of `n × n`, with full reorthogonalization.
///
/// After `m` steps, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric tridiagonal (diagonal `α`, off-diagonal `β`) and `v` the next
/// basis vector,
///
/// ```text
/// A V = V T + β_m v e_mᵀ,    VᵀV = I,    Vᵀv = 0,    QᵀV = 0
/// ```
///
/// where `Q` are known vectors (deflation). The process projects them out of the start and of every new vector. If `Q` are eigenvectors of
/// `A`, the process sees `A` only on the rest of the space. A further copy of one of their eigenvalues then appears as a simple eigenvalue.
///
/// A step takes exactly one product. If the product fails, the factorization is bitwise unchanged and the step can be taken again. Storage:
/// `m + 1 + k` vectors of `n` for `k` known vectors, and one work vector.
///
/// Reorthogonalization computes the coefficients of `A v_j` on all basis vectors, and the process keeps them. If `A` is symmetric, the
/// coefficients outside the tridiagonal are zero to rounding. Otherwise they measure the asymmetry ([`Lanczos::asymmetry`]) and keep the
/// residual norms correct.
///
/// References: Lanczos (1950), doi:10.6028/jres.045.026; Paige, *The computation of eigenvalues and eigenvectors of very large sparse
/// matrices* (1971); Parlett, *The Symmetric Eigenvalue Problem*, chapter 13, doi:10.1137/1.9781611971163. With photos for products:
/// O'Toole and Kutulakos, sections 3 and 4; *Optical computing for fast light transport analysis* (2010), doi:10.1145/1882261.1866165.
#[derive(Clone, Debug)]
pub struct Lanczos {
    expansion: Expansion,
}

impl Lanczos {
    /// Starts a process from `start` (length `n`) and projects out the vectors of `deflate`. These have length `n` each and are
    /// independent; they need not be normalized or orthogonal. A start within their span is replaced by a random vector.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a length differs from the length of the start. [`Error::Numerical`] if a vector holds NaN or an infinity, if
    /// `n = 0`, or if a known vector is zero or depends on the vectors before it.
    pub fn new(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        Ok(Self { expansion: Expansion::new(&[start.to_vec()], deflate)? })
    }

    /// `α_1 … α_m`, the diagonal of `T`.
    pub fn alphas(&self) -> Vec<f64> {
        (0..self.steps()).map(|j| self.expansion.entry(j, j)).collect()
    }

    /// `β_1 … β_m`: the off-diagonal of `T`, followed by the norm of the residual `β_m v e_mᵀ`. An entry is zero if the subspace was
    /// invariant. After [`Factorization::shrink`], the kept Ritz vectors couple to the first vector after them instead (see
    /// [`Expansion::entry`]).
    pub fn betas(&self) -> Vec<f64> {
        (0..self.steps()).map(|j| self.expansion.entry(j + 1, j)).collect()
    }

    /// `β_m`, or 0 before the first step.
    pub fn residual_norm(&self) -> f64 {
        self.betas().last().copied().unwrap_or(0.0)
    }

    /// Saves the state. The process that [`Lanczos::load`] returns continues with bitwise equal results.
    ///
    /// All factorizations use the same format. Numbers are little endian, floats IEEE 754 binary64:
    ///
    /// | bytes | what |
    /// |---|---|
    /// | 8 | `KRYLUXFZ` |
    /// | u32 | version, 3 |
    /// | u32 | kind: 1 Lanczos, 2 block Lanczos, 3 Arnoldi |
    /// | u64 × 7 | `n`, known vectors `k`, block size, columns `k + m + p`, steps `m`, products, random vectors drawn |
    /// | f64 × 2 | the largest `‖A v_j‖`; a bound on what restarts discarded |
    /// | `m` times | u64 count, as many f64: the coefficients of `A v_j` on `Q, v_1, …`; f64: its standard error |
    /// | u64 count, as many f64 | the parts that the last column still has along those before it (not in version 2) |
    /// | `(k + m + p) n` f64 | `Q`, then `v_1 … v_{m+p}`, one after the other |
    /// | 32 | BLAKE3 of everything before |
    ///
    /// A file is accepted only if its checksum is right. A damaged length causes no large allocation.
    ///
    /// # Errors
    /// [`Error::Write`] if the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save(ProcessKind::Lanczos, &self.expansion, writer)
    }

    /// Loads the state that [`Lanczos::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] if the state is damaged, of another version, or of another factorization.
    pub fn load(reader: impl Read) -> Result<Self> {
        Ok(Self { expansion: load(ProcessKind::Lanczos, reader)? })
    }
}

impl Factorization for Lanczos {
    fn expansion(&self) -> &Expansion {
        &self.expansion
    }

    fn expansion_mut(&mut self) -> &mut Expansion {
        &mut self.expansion
    }

    fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step> {
        check_symmetric(operator)?;
        // A v_j lies in the span of v_{j−1}, v_j, v_{j+1}.
        self.expansion.step(operator, 2)
    }
}

pub(super) fn check_symmetric(operator: &dyn Operator) -> Result<()> {
    if operator.symmetry() == Symmetry::Symmetric {
        return Ok(());
    }
    Err(Error::Numerical(
        "Lanczos needs a symmetric operator (a coaxial rig's), and this one is not declared symmetric".into(),
    ))
}

/// A block Lanczos factorization of a symmetric operator `A` of `n × n`, with full reorthogonalization.
///
/// After `m` steps from a block of `b` vectors, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric with `b` diagonals beside the
/// main one, and `W` the `p ≤ b` waiting vectors,
///
/// ```text
/// A V = V T + W B,    [V W]ᵀ[V W] = I,    Qᵀ[V W] = 0
/// ```
///
/// where `Q` are known vectors that are projected out (see [`crate::krylov::factor::Lanczos`]). A single start vector sees one vector of
/// each eigenspace. A block of `b` start vectors sees `b` of them, and finds all copies of an eigenvalue that is repeated up to `b` times.
/// A full round over the block costs `b` products and raises the polynomial degree by one, like one Lanczos step.
///
/// A step takes one product (Ruhe's band form), so the process can stop and resume within a block. The products with the waiting vectors
/// may be taken together before their steps ([`Factorization::multiply_block`]). The block becomes narrower if a product lies in the span
/// or if start vectors are dependent. When the block is used up, the subspace is invariant, and the process continues from `b` random
/// vectors. The process stores `m + p + k` vectors of `n` for `k` known vectors, and one work vector.
///
/// References: Golub and Underwood, *The block Lanczos method for computing eigenvalues*, Mathematical Software III (1977); Ruhe,
/// *Implementation aspects of band Lanczos algorithms*, Math. Comp. 33 (1979), doi:10.1090/S0025-5718-1979-0521282-9.
#[derive(Clone, Debug)]
pub struct BlockLanczos {
    expansion: Expansion,
}

impl BlockLanczos {
    /// Starts a process from the vectors of `starts` (`b ≥ 1`, length `n` each) and leaves out dependent ones. The vectors of `deflate` are
    /// projected out, as in [`crate::krylov::factor::Lanczos::new`]. Fails with the errors of [`crate::krylov::factor::Lanczos::new`].
    pub fn new(starts: &[Vec<f64>], deflate: &[Vec<f64>]) -> Result<Self> {
        Ok(Self { expansion: Expansion::new(starts, deflate)? })
    }

    /// From the next step on, filters the directions that noise dominates; see [`Filter`].
    #[must_use]
    pub fn filtered(mut self, filter: Filter) -> Self {
        self.expansion.filter = Some(filter);
        self
    }

    /// Widens the block by vectors (length `n` each) that start with the next step, to find further copies of an eigenvalue. The process
    /// keeps its state. Vectors in the span of the basis are left out.
    ///
    /// # Errors
    /// [`Error::Dimension`] if a length differs; [`Error::Numerical`] for NaN or an infinity.
    pub fn widen(&mut self, starts: &[Vec<f64>]) -> Result<()> {
        self.expansion.widen(starts)
    }

    /// `b`: the number of start vectors so far. [`Expansion::pending`] returns how many are left.
    pub fn block(&self) -> usize {
        self.expansion.block
    }

    /// Saves the state in the format of [`crate::krylov::factor::Lanczos::save`].
    ///
    /// # Errors
    /// [`Error::Write`] if the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save(ProcessKind::BlockLanczos, &self.expansion, writer)
    }

    /// Loads the state that [`BlockLanczos::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] if the state is damaged, of another version, or of another factorization.
    pub fn load(reader: impl Read) -> Result<Self> {
        Ok(Self { expansion: load(ProcessKind::BlockLanczos, reader)? })
    }
}

impl Factorization for BlockLanczos {
    fn expansion(&self) -> &Expansion {
        &self.expansion
    }

    fn expansion_mut(&mut self) -> &mut Expansion {
        &mut self.expansion
    }

    fn multiply_block(&mut self, operator: &mut dyn Operator, most: usize) -> Result<()> {
        check_symmetric(operator)?;
        self.expansion.multiply_block(operator, most)
    }

    fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step> {
        check_symmetric(operator)?;
        // A v_j lies in the span of v_{j−b} … v_{j+b}. The last of these is not in the basis yet.
        self.expansion.step(operator, 2 * self.expansion.block)
    }
}

/// An Arnoldi factorization of any operator `A` of `n × n`, with full reorthogonalization.
///
/// After `m` steps, with `V` of `n × m` orthonormal, `H` of `m × m` upper Hessenberg and `v` the next basis vector,
///
/// ```text
/// A V = V H + h_{m+1,m} v e_mᵀ,    VᵀV = I,    Vᵀv = 0,    QᵀV = 0
/// ```
///
/// where `Q` are known vectors, projected out of the start and of every new vector. The process then sees `(I − QQᵀ) A` on the rest of the
/// space. If `Q` spans an invariant subspace, the eigenvalues there are the other eigenvalues of `A`. The Ritz vectors then approximate
/// Schur vectors and not eigenvectors, unless `Q` is also invariant under `Aᵀ`. The residual norms are the norms for `A`, and show the
/// difference.
///
/// A breakdown, `h_{m+1,m} = 0`, is harmless: `V` is invariant, its Ritz pairs are eigenpairs, and the process continues from a random
/// vector. The process stores `m + 1 + k` vectors of `n` for `k` known vectors, and one work vector.
///
/// References: Arnoldi, *The principle of minimized iterations in the solution of the matrix eigenvalue problem* (1951),
/// doi:10.1090/qam/42792; Saad, *Numerical Methods for Large Eigenvalue Problems*, chapter 6, doi:10.1137/1.9781611970739. With photos for
/// products: O'Toole and Kutulakos, sections 3 and 4.
#[derive(Clone, Debug)]
pub struct Arnoldi {
    expansion: Expansion,
}

impl Arnoldi {
    /// Starts a process from `start` (length `n`) and projects out the vectors of `deflate`, as in [`crate::krylov::factor::Lanczos::new`].
    /// Fails with the errors of [`crate::krylov::factor::Lanczos::new`].
    pub fn new(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        Ok(Self { expansion: Expansion::new(&[start.to_vec()], deflate)? })
    }

    /// `h_{m+1,m}`, or 0 before the first step and after a breakdown.
    pub fn residual_norm(&self) -> f64 {
        let m = self.steps();
        if m == 0 { 0.0 } else { self.expansion.entry(m, m - 1) }
    }

    /// Saves the state in the format of [`crate::krylov::factor::Lanczos::save`].
    ///
    /// # Errors
    /// [`Error::Write`] if the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save(ProcessKind::Arnoldi, &self.expansion, writer)
    }

    /// Loads the state that [`Arnoldi::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] if the state is damaged, of another version, or of another factorization.
    pub fn load(reader: impl Read) -> Result<Self> {
        Ok(Self { expansion: load(ProcessKind::Arnoldi, reader)? })
    }
}

impl Factorization for Arnoldi {
    fn expansion(&self) -> &Expansion {
        &self.expansion
    }

    fn expansion_mut(&mut self) -> &mut Expansion {
        &mut self.expansion
    }

    fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step> {
        self.expansion.step(operator, 0)
    }

    fn ritz(&self, which: Which, count: usize) -> Result<Vec<RitzPair>> {
        ritz_of_general(&self.expansion, which, count)
    }

    fn shrink(&mut self, _: Which, keep: usize) -> Result<()> {
        if keep >= self.steps() {
            return Ok(());
        }
        Err(Error::Numerical(
            "an Arnoldi process cannot be restarted; give it the memory for all steps".into(),
        ))
    }
}
