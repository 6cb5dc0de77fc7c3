//! A step of a factorization: one product, and the part of it that is new.

use super::super::basis::{dot, norm};
use super::super::orthogonalize::orthogonalize;
use super::Expansion;
use crate::error::{Error, Result};
use crate::operator::{Operator, block, block_mut};

/// The outcome of a step of a factorization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The subspace grew by one, and can grow further.
    Extended,
    /// The subspace grew by one, but the product was in its span: the block is narrower by one from now on.
    Deflated,
    /// The subspace grew by one and is now invariant (no residual is left): all its Ritz pairs are
    /// eigenpairs. The next step continues from random vectors orthogonal to the basis, and finds, for
    /// example, further copies of a repeated eigenvalue.
    Invariant,
    /// The subspace is the whole space without the known vectors. A further step takes no product.
    Exhausted,
}

impl Expansion {
    /// Takes the products with up to `most` of the waiting vectors as one block of the operator's size; the
    /// next steps use them.
    pub(super) fn multiply_block(&mut self, operator: &mut dyn Operator, most: usize) -> Result<()> {
        let count = operator.block_size().min(most).min(self.pending());
        if count < 2 || !self.ready.is_empty() {
            return Ok(());
        }
        self.fits(operator)?;
        let mut products = vec![vec![0.0; self.n()]; count];
        // The last vector as it will be by the time of its step.
        let late = count == self.pending() && !self.late.is_empty();
        let last = late.then(|| self.basis.settled_last(&self.late));
        let mut vectors = block(&self.waiting()[..count]);
        if let (Some(last), Some(vector)) = (&last, vectors.last_mut()) {
            *vector = last;
        }
        operator.apply_block(&vectors, &mut block_mut(&mut products))?;
        let errors = operator.standard_errors();
        let errors = errors.into_iter().chain(std::iter::repeat(0.0));
        self.ready = products.into_iter().zip(errors).collect();
        Ok(())
    }

    /// One step: one product. `recent` last columns contain, up to rounding, the part of `A v` in the
    /// span (0: not known).
    pub(super) fn step(&mut self, operator: &mut dyn Operator, recent: usize) -> Result<Step> {
        let n = self.n();
        self.fits(operator)?;
        let waiting = &self.basis.columns()[self.known + self.steps()..];
        let Some(next) = waiting.first() else { return Ok(Step::Exhausted) };
        let error = match self.ready.pop_front() {
            Some((product, error)) => {
                self.work = product;
                error
            }
            None => {
                operator.apply(next, &mut self.work)?;
                operator.standard_error()
            }
        };
        let first = self.basis.len().saturating_sub(recent);
        let (along, length) = self.basis.dots_and_norm(first, &self.work);
        if !length.is_finite() {
            // The step can be taken again, with a new product.
            self.ready.clear();
            return Err(Error::Numerical(format!(
                "product {} with the operator holds a NaN or an infinity",
                self.products + 1
            )));
        }

        // Nothing can fail from here on.
        self.products += 1;
        self.scale = self.scale.max(length);
        let mut removed = self.orthogonalize_product(&along);
        // The rest of A v is at most the rounding errors of a product of n terms.
        let nothing_new = removed.norm <= self.scale * f64::EPSILON * (10.0 + (n as f64).sqrt());
        if !nothing_new && self.basis.len() < n {
            let (error, along) = match self.filtered(error, removed.norm) {
                Some((direction, along)) => {
                    self.basis.push_scaled(&direction, 1.0);
                    // What the filter removes counts as noise of the product.
                    let noise = (removed.norm.powi(2) - along * along).max(0.0).sqrt();
                    (noise.max(error), along)
                }
                None => {
                    self.basis.push_scaled(&self.work, removed.norm);
                    self.late = removed.late.iter().map(|part| part / removed.norm).collect();
                    (error, removed.norm)
                }
            };
            self.errors.push(error);
            removed.coefficients.push(along);
            self.columns.push(removed.coefficients);
            return Ok(Step::Extended);
        }
        self.errors.push(error);
        self.columns.push(removed.coefficients);
        if self.pending() > 0 {
            return Ok(Step::Deflated);
        }
        for _ in 0..self.block {
            self.append_random();
        }
        Ok(if self.pending() > 0 { Step::Invariant } else { Step::Exhausted })
    }

    /// The filtered direction of the rest of a product, orthogonal to the basis and of length 1, and the product's part along it; `None` where
    /// the rest is taken as it is.
    fn filtered(&self, error: f64, rest: f64) -> Option<(Vec<f64>, f64)> {
        let mut direction = self.filter.as_ref()?.apply(&self.work, (error / rest).min(1.0))?;
        if direction.len() != self.n() || !direction.iter().all(|value| value.is_finite()) {
            return None;
        }
        let before = norm(&direction);
        let left = orthogonalize(&self.basis, &mut direction).norm;
        if left <= before * f64::EPSILON * (10.0 + (self.n() as f64).sqrt()) {
            return None;
        }
        direction.iter_mut().for_each(|value| *value /= left);
        let along = dot(&direction, &self.work);
        Some((direction, along))
    }
}
