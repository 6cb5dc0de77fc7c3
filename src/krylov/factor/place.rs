//! The memory in which the vectors of a factorization are: the host's, or that of the operator while a search goes on.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::ops::Deref;

use super::{Factorization, RitzPair, Step, Which, point_upwards};
use crate::error::{Error, Result};
use crate::krylov::basis::{Basis, Removed, orthogonalized};
use crate::operator::vectors::accumulate;
use crate::operator::{Direction, Operator, Settling, Sums, Vectors};

/// Vectors in the host's memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Host {
    pub(super) basis: Basis,
    pub(super) work: Vec<f64>,
}

impl Vectors for Host {
    fn rows(&self) -> usize {
        self.basis.rows()
    }

    fn columns(&self) -> usize {
        self.basis.len()
    }

    fn column(&self, index: usize) -> Result<Cow<'_, [f64]>> {
        Ok(Cow::Borrowed(&self.basis.columns()[index]))
    }

    fn work(&self) -> Result<Cow<'_, [f64]>> {
        Ok(Cow::Borrowed(&self.work))
    }

    fn load(&mut self, x: &[f64]) -> Result<()> {
        self.work.copy_from_slice(x);
        Ok(())
    }

    fn clear(&mut self) {
        self.basis.clear();
    }

    fn push(&mut self, divisor: f64) -> Result<()> {
        self.basis.push_scaled(&self.work, divisor);
        Ok(())
    }

    fn remove(&mut self, h: &[f64]) -> Result<()> {
        self.basis.accumulate_first(h, -1.0, &mut self.work);
        Ok(())
    }

    fn dots_and_norm(&mut self, first: usize) -> Result<Sums> {
        Ok(self.basis.dots_and_norm(first, &self.work))
    }

    fn remove_and_dot(&mut self, h: &[f64]) -> Result<Sums> {
        Ok(self.basis.remove_and_dot(h, &mut self.work))
    }

    fn settle_and_dot(&mut self, settling: &Settling<'_>) -> Result<Sums> {
        let (mut dots, length) = self.basis.settle_and_dot(settling, &mut self.work);
        if !settling.late.is_empty() {
            dots.iter_mut().zip(settling.ahead).for_each(|(dot, ahead)| *dot -= ahead);
        }
        Ok((dots, length))
    }
}

/// Removes from `w` its part in the span of the columns, as [`orthogonalize`](crate::krylov::basis::orthogonalize).
pub(super) fn orthogonalize(vectors: &mut dyn Vectors) -> Result<Removed> {
    let start = vectors.dots_and_norm(0)?;
    orthogonalized(start, |h| vectors.remove_and_dot(h))
}

/// The largest number of columns in the memory of an operator. Longer processes keep their vectors in the host's memory, of which there is
/// more.
pub(in crate::krylov) const MOST: usize = 256;

/// The vectors of a factorization while they are in the memory of an operator.
struct Resident {
    vectors: Box<dyn Vectors>,
    /// The largest number of columns.
    room: usize,
    /// The factorization when its vectors were uploaded, without vectors.
    before: Factorization,
    /// Whether an error has left the vectors, or the factorization, in the middle of a step.
    is_broken: bool,
}

impl Factorization {
    /// Copies the vectors to the memory of `operator`, if it has one with room for a subspace of `steps` dimensions. Until
    /// [`Factorization::download`], only [`Factorization::expand_resident`] may change the factorization, and the vectors in the host's
    /// memory are out of date. Fails as [`Operator::vectors`].
    fn upload(&self, operator: &dyn Operator, steps: usize) -> Result<Option<Resident>> {
        let columns = self.known + steps.max(self.steps()).min(self.n()) + self.block;
        if !self.ready.is_empty() || columns > MOST {
            return Ok(None);
        }
        let Some(mut vectors) = operator.vectors(columns, None)? else { return Ok(None) };
        for column in self.host.basis.columns() {
            vectors.load(column)?;
            vectors.push(1.0)?;
        }
        Ok(Some(Resident { vectors, room: columns, before: self.without_vectors(), is_broken: false }))
    }

    /// Takes one step as [`Factorization::expand`], with the vectors in the memory of the operator.
    fn expand_resident(&mut self, resident: &mut Resident, operator: &mut dyn Operator) -> Result<Step> {
        self.fits(operator)?;
        if self.pending == 0 {
            return Ok(Step::Exhausted);
        }
        let (products, column) = (self.products, self.known + self.steps());
        let taken = operator.apply_within(&mut *resident.vectors, column, Direction::Forward);
        resident.is_broken = matches!(taken, Err(Error::Device { .. }));
        taken?;
        let step = self.extend(&mut *resident.vectors, operator.standard_error());
        // A product that is not finite is refused before anything changes.
        let is_refused = matches!(step, Err(Error::Numerical(_))) && self.products == products;
        resident.is_broken = step.is_err() && !is_refused;
        step
    }

    /// Copies the vectors back from the memory of an operator. If that memory fails or has failed, the factorization is as it was when its
    /// vectors were uploaded.
    ///
    /// # Errors
    /// The error of that memory, unless an earlier call has returned one.
    fn download(&mut self, resident: Resident) -> Result<()> {
        // A step changes the last column, and the columns before it are still here.
        let kept = resident.before.total() - 1;
        let column = |index| Ok(resident.vectors.column(index)?.into_owned());
        let columns: Result<Vec<Vec<f64>>> = match resident.is_broken {
            true => Ok(Vec::new()),
            false => (kept..self.total()).map(column).collect(),
        };
        match columns {
            Ok(columns) if !resident.is_broken => {
                self.host.basis.truncate(kept);
                columns.iter().for_each(|column| self.host.basis.push_scaled(column, 1.0));
                Ok(())
            }
            failed => {
                *self = Self { host: std::mem::take(&mut self.host), ..resident.before };
                failed.map(drop)
            }
        }
    }

    /// A copy of everything but the vectors and prepared products.
    fn without_vectors(&self) -> Self {
        Self {
            kind: self.kind,
            host: Host::default(),
            known: self.known,
            pending: self.pending,
            block: self.block,
            columns: self.columns.clone(),
            errors: self.errors.clone(),
            leak: self.leak,
            products: self.products,
            scale: self.scale,
            draws: self.draws,
            late: self.late.clone(),
            ready: VecDeque::new(),
            filter: self.filter.clone(),
        }
    }
}

/// A factorization whose vectors may be in the memory of the operator. While they are there, the vectors in the host's memory are out of
/// date. Ritz vectors must therefore come from [`Placed::ritz_vector`] and [`Placed::combine`].
pub(in crate::krylov) struct Placed {
    factorization: Factorization,
    resident: Option<Resident>,
}

impl Deref for Placed {
    type Target = Factorization;

    fn deref(&self) -> &Factorization {
        &self.factorization
    }
}

/// A factorization on loan, which goes back even if the work with it panics.
struct Lent<'a> {
    placed: Placed,
    home: &'a mut Factorization,
}

impl Drop for Lent<'_> {
    fn drop(&mut self) {
        // Only after a panic, vectors are still in the memory of the operator. An error of that memory brings back an earlier state.
        let _ = self.placed.leave();
        std::mem::swap(self.home, &mut self.placed.factorization);
    }
}

impl Placed {
    /// A factorization in the host's memory.
    pub(in crate::krylov) fn new(factorization: Factorization) -> Self {
        Self { factorization, resident: None }
    }

    /// Does `work` with a factorization, whose vectors come back to the host's memory. Fails with the error of `work`, or else as
    /// [`Factorization::download`].
    pub(in crate::krylov) fn within<T>(
        factorization: &mut Factorization,
        work: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let moved = factorization.without_vectors();
        let placed = Self::new(std::mem::replace(factorization, moved));
        let mut lent = Lent { placed, home: factorization };
        let done = work(&mut lent.placed);
        let back = lent.placed.leave();
        done.and_then(|done| back.map(|()| done))
    }

    /// Makes room for a subspace of `steps` dimensions, in the memory of the operator if it has one. The vectors must be in the host's
    /// memory. Fails as [`Factorization::upload`].
    pub(in crate::krylov) fn place(&mut self, operator: &dyn Operator, steps: usize) -> Result<()> {
        debug_assert!(self.resident.is_none());
        self.factorization.reserve(steps);
        self.resident = self.factorization.upload(operator, steps)?;
        Ok(())
    }

    /// Copies the vectors back to the host's memory, as [`Factorization::download`].
    fn leave(&mut self) -> Result<()> {
        self.resident.take().map_or(Ok(()), |resident| self.factorization.download(resident))
    }

    /// Takes one step as [`Factorization::expand`]. After an error of the memory of the operator, the factorization is as it was when its
    /// vectors were copied there.
    pub(in crate::krylov) fn expand(&mut self, operator: &mut dyn Operator) -> Result<Step> {
        let total = self.factorization.total();
        if self.resident.as_ref().is_some_and(|resident| resident.room <= total) {
            self.leave()?;
        }
        let Some(resident) = &mut self.resident else { return self.factorization.expand(operator) };
        let step = self.factorization.expand_resident(resident, operator);
        if resident.is_broken {
            self.leave()?;
        }
        step
    }

    /// Takes products in advance as [`Factorization::multiply_block`], unless the vectors are in the memory of the operator.
    pub(in crate::krylov) fn multiply_block(
        &mut self,
        operator: &mut dyn Operator,
        most: usize,
    ) -> Result<()> {
        if self.resident.is_some() { Ok(()) } else { self.factorization.multiply_block(operator, most) }
    }

    /// Shrinks the subspace as [`Factorization::shrink`]. If the vectors are in the memory of the operator, the new ones are there, too, with
    /// room for a subspace of `steps` dimensions.
    pub(in crate::krylov) fn shrink(
        &mut self,
        operator: &dyn Operator,
        (which, keep): (Which, usize),
        steps: usize,
    ) -> Result<()> {
        let is_resident = self.resident.is_some();
        self.leave()?;
        self.factorization.shrink(which, keep)?;
        if is_resident { self.place(operator, steps) } else { Ok(()) }
    }

    /// [`Factorization::ritz_vector`]. Fails with the error of the memory of the operator.
    pub(in crate::krylov) fn ritz_vector(&mut self, pair: &RitzPair) -> Result<Vec<f64>> {
        let mut vector = self.combine(&pair.coefficients)?;
        if pair.is_real() {
            point_upwards(&mut vector);
        }
        Ok(vector)
    }

    /// `V s`, for the basis without the waiting vectors. Fails with the error of the memory of the operator.
    pub(in crate::krylov) fn combine(&mut self, coefficients: &[f64]) -> Result<Vec<f64>> {
        let Some(Resident { vectors, .. }) = &mut self.resident else {
            return Ok(self.factorization.combine(coefficients));
        };
        let mut vector = vec![0.0; self.factorization.n()];
        accumulate(&mut **vectors, self.factorization.known, coefficients, &mut vector)?;
        Ok(vector)
    }
}
