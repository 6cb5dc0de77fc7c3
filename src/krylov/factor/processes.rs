//! The three processes: Lanczos and block Lanczos for symmetric operators, Arnoldi for any. Each takes one product a step.

use std::io::{Read, Write};

use super::ritz::{RitzPair, Which, ritz_of_general};
use super::save::{ProcessKind, load, save};
use super::{Expansion, Factorization, Filter, Step};
use crate::error::{Error, Result};
use crate::operator::{Operator, Symmetry};

/// A Lanczos factorization of a symmetric operator `A` of `n × n`, with full reorthogonalization.
///
/// After `m` steps, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric tridiagonal (diagonal `α`,
/// off-diagonal `β`) and `v` the next basis vector,
///
/// ```text
/// A V = V T + β_m v e_mᵀ,    VᵀV = I,    Vᵀv = 0,    QᵀV = 0
/// ```
///
/// where `Q` are known vectors (deflation): they are projected out of the start and of every new vector. For
/// eigenvectors `Q` of `A` the process then sees `A` on the rest of the space only, and a further copy of
/// their eigenvalue as a simple one.
///
/// A step takes exactly one product. When it fails, the factorization is as before, to the bit, and the step
/// can be taken again. Storage: `m + 1 + k` vectors of `n` for `k` known ones, and one work vector.
///
/// The coefficients of `A v_j` on all basis vectors, which reorthogonalization computes anyway, are kept.
/// They are zero to rounding where `A` is symmetric. Otherwise they show by how much it is not
/// ([`Lanczos::asymmetry`]), and keep the residual norms correct.
///
/// # References
/// Lanczos (1950), doi:10.6028/jres.045.026; Paige, *The computation of eigenvalues and eigenvectors of very
/// large sparse matrices* (1971); Parlett, *The Symmetric Eigenvalue Problem*, chapter 13,
/// doi:10.1137/1.9781611971163. With photos for products: O'Toole and Kutulakos, sections 3 and 4; *Optical
/// computing for fast light transport analysis* (2010), doi:10.1145/1882261.1866165.
#[derive(Clone, Debug)]
pub struct Lanczos {
    expansion: Expansion,
}

impl Lanczos {
    /// A process that starts from `start` (length `n`) with the vectors of `deflate` (length `n` each,
    /// independent; they need be neither normalized nor orthogonal) projected out. A start within their span
    /// is replaced by a random one.
    ///
    /// # Errors
    /// [`Error::Dimension`] when a length differs from the start's. [`Error::Numerical`] when a vector holds
    /// NaN or an infinity, when `n = 0`, or when a known vector is zero or depends on those before it.
    pub fn new(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        Ok(Self { expansion: Expansion::new(&[start.to_vec()], deflate)? })
    }

    /// `α_1 … α_m`, the diagonal of `T`.
    pub fn alphas(&self) -> Vec<f64> {
        (0..self.steps()).map(|j| self.expansion.entry(j, j)).collect()
    }

    /// `β_1 … β_m`: the off-diagonal of `T`, and last the norm of the residual `β_m v e_mᵀ`. Zero where the
    /// subspace was invariant. (After [`Factorization::shrink`] the kept Ritz vectors couple to the first
    /// vector after them instead, see [`Expansion::entry`].)
    pub fn betas(&self) -> Vec<f64> {
        (0..self.steps()).map(|j| self.expansion.entry(j + 1, j)).collect()
    }

    /// `β_m`, or 0 before the first step.
    pub fn residual_norm(&self) -> f64 {
        self.betas().last().copied().unwrap_or(0.0)
    }

    /// Saves the state, so that the process that [`Lanczos::load`] returns continues with the same bits.
    ///
    /// The format is the same for all factorizations. Numbers are little endian, floats IEEE 754 binary64:
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
    /// A file is accepted only when the checksum is right, and a damaged length causes no large allocation.
    ///
    /// # Errors
    /// [`Error::Write`] when the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save(ProcessKind::Lanczos, &self.expansion, writer)
    }

    /// The state that [`Lanczos::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] when it is damaged, of another version, or of another factorization.
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
/// After `m` steps from a block of `b` vectors, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric
/// with `b` diagonals beside the main one, and `W` the `p ≤ b` waiting vectors,
///
/// ```text
/// A V = V T + W B,    [V W]ᵀ[V W] = I,    Qᵀ[V W] = 0
/// ```
///
/// with `Q` known vectors that are projected out ([`crate::krylov::factor::Lanczos`]). A single start vector sees one vector
/// of each eigenspace; `b` of them see `b`, so that an eigenvalue repeated up to `b` times comes with all its
/// copies. A full round over the block costs `b` products and adds as much to the polynomial degree as one
/// Lanczos step.
///
/// It takes one product a step (Ruhe's band form): it stops and resumes within a block as anywhere else. The
/// products with the vectors that wait may be taken together before their steps
/// ([`Factorization::multiply_block`]). A product in the span makes the block narrower; so do dependent start
/// vectors. When the block is used up, the subspace is invariant, and the process goes on from `b` random
/// vectors.
///
/// Storage: `m + p + k` vectors of `n` for `k` known ones, and one work vector.
///
/// # References
/// Golub and Underwood, *The block Lanczos method for computing eigenvalues*, Mathematical Software III
/// (1977); Ruhe, *Implementation aspects of band Lanczos algorithms*, Math. Comp. 33 (1979),
/// doi:10.1090/S0025-5718-1979-0521282-9.
#[derive(Clone, Debug)]
pub struct BlockLanczos {
    expansion: Expansion,
}

impl BlockLanczos {
    /// A process that starts from the vectors of `starts` (`b ≥ 1`, length `n` each; dependent ones are left
    /// out) with the vectors of `deflate` projected out, as [`crate::krylov::factor::Lanczos::new`].
    ///
    /// # Errors
    /// The errors of [`crate::krylov::factor::Lanczos::new`].
    pub fn new(starts: &[Vec<f64>], deflate: &[Vec<f64>]) -> Result<Self> {
        Ok(Self { expansion: Expansion::new(starts, deflate)? })
    }

    /// Filters the directions that noise dominates, from the next step on; see [`Filter`].
    #[must_use]
    pub fn filtered(mut self, filter: Filter) -> Self {
        self.expansion.filter = Some(filter);
        self
    }

    /// Widens the block by vectors (length `n` each) that start with the next step, to find further copies of an
    /// eigenvalue. What the process knows stays; vectors that lie in the span of the basis are left out.
    ///
    /// # Errors
    /// [`Error::Dimension`] when a length differs; [`Error::Numerical`]
    /// for NaN or an infinity.
    pub fn widen(&mut self, starts: &[Vec<f64>]) -> Result<()> {
        self.expansion.widen(starts)
    }

    /// `b`: the starting vectors so far. [`Expansion::pending`] tells how many are left.
    pub fn block(&self) -> usize {
        self.expansion.block
    }

    /// Saves the state, as [`crate::krylov::factor::Lanczos::save`].
    ///
    /// # Errors
    /// [`Error::Write`] when the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save(ProcessKind::BlockLanczos, &self.expansion, writer)
    }

    /// The state that [`BlockLanczos::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] when it is damaged, of another version, or of another
    /// factorization.
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
        // A v_j lies in the span of v_{j−b} … v_{j+b}, of which the last is not there yet.
        self.expansion.step(operator, 2 * self.expansion.block)
    }
}

/// An Arnoldi factorization of any operator `A` of `n × n`, with full reorthogonalization.
///
/// After `m` steps, with `V` of `n × m` orthonormal, `H` of `m × m` upper Hessenberg and `v` the next basis
/// vector,
///
/// ```text
/// A V = V H + h_{m+1,m} v e_mᵀ,    VᵀV = I,    Vᵀv = 0,    QᵀV = 0
/// ```
///
/// where `Q` are known vectors, projected out of the start and of every new vector. The process then sees
/// `(I − QQᵀ) A` on the rest of the space. For a `Q` that spans an invariant subspace its eigenvalues are the
/// others of `A`, but its Ritz vectors approximate Schur vectors and not eigenvectors, unless `Q` is
/// invariant under `Aᵀ` too. The residual norms are those for `A`, and show the difference.
///
/// A breakdown, `h_{m+1,m} = 0`, is harmless: `V` is invariant, its Ritz pairs are eigenpairs, and the
/// process continues from a random vector.
///
/// Storage: `m + 1 + k` vectors of `n` for `k` known ones, and one work vector.
///
/// # References
/// With photos for products: O'Toole and Kutulakos, sections 3 and 4. Arnoldi, *The principle of minimized
/// iterations in the solution of the matrix eigenvalue problem* (1951), doi:10.1090/qam/42792; Saad,
/// *Numerical Methods for Large Eigenvalue Problems*, chapter 6, doi:10.1137/1.9781611970739.
#[derive(Clone, Debug)]
pub struct Arnoldi {
    expansion: Expansion,
}

impl Arnoldi {
    /// A process that starts from `start` (length `n`) with the vectors of `deflate` projected out, as
    /// [`crate::krylov::factor::Lanczos::new`].
    ///
    /// # Errors
    /// The errors of [`crate::krylov::factor::Lanczos::new`].
    pub fn new(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        Ok(Self { expansion: Expansion::new(&[start.to_vec()], deflate)? })
    }

    /// `h_{m+1,m}`, or 0 before the first step and after a breakdown.
    pub fn residual_norm(&self) -> f64 {
        let m = self.steps();
        if m == 0 { 0.0 } else { self.expansion.entry(m, m - 1) }
    }

    /// Saves the state, as [`crate::krylov::factor::Lanczos::save`].
    ///
    /// # Errors
    /// [`Error::Write`] when the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save(ProcessKind::Arnoldi, &self.expansion, writer)
    }

    /// The state that [`Arnoldi::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] when it is damaged, of another version, or of another factorization.
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
