//! The block Lanczos process in band form: as many copies of an eigenvalue as the block is wide.

use std::io::{Read, Write};

use super::factorization::Factorization;
use super::lanczos::check_symmetric;
use super::save::{self, Kind};
use super::{Expansion, Filter, Step};
use crate::error::Result;
use crate::operator::Operator;

/// A block Lanczos factorization of a symmetric operator `A` of `n × n`, with full reorthogonalization.
///
/// After `m` steps from a block of `b` vectors, with `V` of `n × m` orthonormal, `T` of `m × m` symmetric
/// with `b` diagonals beside the main one, and `W` the `p ≤ b` waiting vectors,
///
/// ```text
/// A V = V T + W B,    [V W]ᵀ[V W] = I,    Qᵀ[V W] = 0
/// ```
///
/// with `Q` known vectors that are projected out ([`super::Lanczos`]). A single start vector sees one vector
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
    /// out) with those of `deflate` projected out, as [`super::Lanczos::new`].
    ///
    /// # Errors
    /// As [`super::Lanczos::new`].
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
    /// [`Error::Dimension`](crate::Error::Dimension) when a length differs; [`Error::Numerical`](crate::Error::Numerical)
    /// for NaN or an infinity.
    pub fn widen(&mut self, starts: &[Vec<f64>]) -> Result<()> {
        self.expansion.widen(starts)
    }

    /// `b`: the starting vectors so far. [`Expansion::pending`] tells how many are left.
    pub fn block(&self) -> usize {
        self.expansion.block
    }

    /// Saves the state, as [`super::Lanczos::save`].
    ///
    /// # Errors
    /// [`Error::Write`](crate::Error::Write) when the writer fails.
    pub fn save(&self, writer: impl Write) -> Result<()> {
        save::save(Kind::BlockLanczos, &self.expansion, writer)
    }

    /// The state that [`BlockLanczos::save`] saved.
    ///
    /// # Errors
    /// [`Error::Data`](crate::Error::Data) when it is damaged, of another version, or of another
    /// factorization.
    pub fn load(reader: impl Read) -> Result<Self> {
        Ok(Self { expansion: save::load(Kind::BlockLanczos, reader)? })
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
