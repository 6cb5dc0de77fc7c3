//! The Arnoldi process: `A V = V H + h v eᵀ` for an operator that need not be symmetric, one product a step.

use std::io::{Read, Write};

use super::factorization::Factorization;
use super::ritz::{RitzPair, Which, general};
use super::save::{self, Kind};
use super::{Expansion, Step};
use crate::error::{Error, Result};
use crate::operator::Operator;

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
    /// [`super::Lanczos::new`].
    ///
    /// # Errors
    /// As [`super::Lanczos::new`].
    pub fn new(start: &[f64], deflate: &[Vec<f64>]) -> Result<Self> {
        Ok(Self { expansion: Expansion::new(&[start.to_vec()], deflate)? })
    }

    /// `h_{m+1,m}`, or 0 before the first step and after a breakdown.
    pub fn residual_norm(&self) -> f64 {
        let m = self.steps();
        if m == 0 { 0.0 } else { self.expansion.entry(m, m - 1) }
    }

    /// Saves the state, as [`super::Lanczos::save`].
    ///
    /// # Errors
    /// [`Error::Write`] when the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save::save(Kind::Arnoldi, &self.expansion, writer)
    }

    /// The state that [`Arnoldi::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`] when it is damaged, of another version, or of another factorization.
    pub fn load(reader: impl Read) -> Result<Self> {
        Ok(Self { expansion: save::load(Kind::Arnoldi, reader)? })
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
        general::ritz(&self.expansion, which, count)
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
