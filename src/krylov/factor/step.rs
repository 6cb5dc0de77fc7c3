//! A step of a factorization: takes one product, and adds the new part of the product to the basis.

use super::Factorization;
use super::place::orthogonalize;
use crate::error::{Error, Result};
use crate::krylov::basis::{ENOUGH_LEFT, PASSES, dot, exceeds_rounding, norm};
use crate::operator::{Operator, Settling, Vectors, block, block_mut};

/// The outcome of a step of a factorization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The subspace grew by one, and can grow further.
    Extended,
    /// The subspace grew by one, but the product was in the span of the basis. From now on, the block has one vector less.
    Deflated,
    /// The subspace grew by one and is now invariant (there is no residual): all its Ritz pairs are eigenpairs. The next step continues
    /// from random vectors orthogonal to the basis, and may find further copies of a repeated eigenvalue.
    Invariant,
    /// The subspace is the whole orthogonal complement of the known vectors. A further step takes no product.
    Exhausted,
}

impl Factorization {
    /// Multiplies up to `most` of the waiting vectors, at most [`Operator::block_size`], as one block. The next steps use these products.
    pub(super) fn take_block(&mut self, operator: &mut dyn Operator, most: usize) -> Result<()> {
        let count = operator.block_size().min(most).min(self.pending());
        if count < 2 || !self.ready.is_empty() {
            return Ok(());
        }
        let mut products = vec![vec![0.0; self.n()]; count];
        // The last waiting vector is multiplied without its late parts, because the steps before its own step remove them.
        let late = count == self.pending() && !self.late.is_empty();
        let last = late.then(|| self.host.basis.settled_last(&self.late));
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

    /// Takes one step with one product `A v`, with the vectors in the host's memory.
    pub(super) fn step(&mut self, operator: &mut dyn Operator) -> Result<Step> {
        let waiting = &self.host.basis.columns()[self.known + self.steps()..];
        let Some(next) = waiting.first() else { return Ok(Step::Exhausted) };
        let error = match self.ready.pop_front() {
            Some((product, error)) => {
                self.host.work = product;
                error
            }
            None => {
                operator.apply(next, &mut self.host.work)?;
                operator.standard_error()
            }
        };
        self.within_host(|process, host| process.extend(host, error))
    }

    /// Adds the new part of the product `w` of the first waiting vector, with this standard error, to the basis. A product that is not
    /// finite changes nothing.
    pub(super) fn extend(&mut self, vectors: &mut dyn Vectors, error: f64) -> Result<Step> {
        let (n, total) = (vectors.rows(), vectors.columns());
        // For a symmetric operator, A v_j lies in the span of v_{j−b} … v_{j+b}. The vector v_{j+b} is not in the basis yet.
        let recent = if self.is_symmetric() { 2 * self.block } else { 0 };
        let (along, length) = vectors.dots_and_norm(total.saturating_sub(recent))?;
        if !length.is_finite() {
            // The prepared products are discarded, so that the step can be taken again with a new product.
            self.ready.clear();
            return Err(Error::Numerical(format!(
                "product {} with the operator holds a NaN or an infinity",
                self.products + 1
            )));
        }

        // The following statements cannot fail with vectors in the host's memory.
        self.products += 1;
        self.scale = self.scale.max(length);
        let filters = self.filter.is_some() && error > 0.0;
        let mut removed = self.orthogonalize_product(vectors, &along, filters)?;
        if exceeds_rounding(removed.norm, self.scale, n) && total < n {
            let (error, along) = match self.denoised(vectors, error, removed.norm)? {
                // The part that the filter removes counts as noise of the product.
                Some(along) => {
                    let noise = (removed.norm.powi(2) - along * along).max(0.0).sqrt();
                    (noise.max(error), along)
                }
                None => {
                    vectors.push(removed.norm)?;
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
        self.pending -= 1;
        if self.pending > 0 {
            return Ok(Step::Deflated);
        }
        for _ in 0..self.block {
            self.append_random(vectors)?;
        }
        Ok(if self.pending > 0 { Step::Invariant } else { Step::Exhausted })
    }

    /// Filters `w`, the remainder of a product. Adds a direction, orthogonal to the basis and of length 1, to the basis, and returns the
    /// product's part along it. Returns `None`, with the same `w`, if the remainder is used without change.
    fn denoised(&self, vectors: &mut dyn Vectors, error: f64, rest: f64) -> Result<Option<f64>> {
        let Some(filter) = self.filter.as_ref().filter(|_| error > 0.0) else { return Ok(None) };
        let product = vectors.work()?.into_owned();
        let Some(direction) = filter.apply(&product, (error / rest).min(1.0)) else { return Ok(None) };
        if direction.len() != product.len() || !direction.iter().all(|value| value.is_finite()) {
            return Ok(None);
        }
        vectors.load(&direction)?;
        let left = orthogonalize(vectors)?.norm;
        if !exceeds_rounding(left, norm(&direction), product.len()) {
            vectors.load(&product)?;
            return Ok(None);
        }
        vectors.push(left)?;
        let direction = vectors.column(vectors.columns() - 1)?;
        Ok(Some(dot(&direction, &product)))
    }
}

/// The largest norm, relative to the vector, of parts along the basis that may be removed in the next step instead of at once. Rounding
/// leaves about `ε ‖A‖/β`: 1e-14 to 1e-13 for most spectra.
const LATE: f64 = 1e-12;

/// A product without its part in the span of the basis.
struct Rest {
    /// The coefficients of the product on the basis.
    coefficients: Vec<f64>,
    norm: f64,
    /// The parts along the basis that are still in the remainder; empty if there are none.
    late: Vec<f64>,
}

impl Factorization {
    /// Orthogonalizes the product `w` against the basis, and reads the basis once. `along` holds the product's inner products with
    /// the last columns. Up to rounding, these columns contain the product's entire part in the span of the basis. `along` is empty if this
    /// is unknown. If a filter is about to replace the remainder (`filters`), all its parts are removed at once.
    ///
    /// Full reorthogonalization takes the inner products of the product with all basis vectors and then removes these components. It reads
    /// the basis twice, or four times for Arnoldi. Here the removal waits for the next step, which reads the basis anyway for its inner
    /// products (delayed reorthogonalization: Bielich, Langou, Thomas, Świrydowicz, Yamazaki and Boman, *Low-synch Gram–Schmidt with
    /// delayed reorthogonalization for Krylov solvers*, Parallel Computing 112 (2022), doi:10.1016/j.parco.2022.102940). A step then reads
    /// the basis once, or twice for Arnoldi.
    ///
    /// The next product therefore multiplies a vector `û = v + V s`, which still has small parts `s` along the other basis vectors. By
    /// linearity `A v = A û − A V s`, and `A V s = V⁺H s` is known from the coefficients of earlier products. `V⁺H s` is also the part of
    /// `A û` along the basis in addition to the three terms of Lanczos. It is removed in the sweep that takes the inner products; otherwise
    /// it would grow like `(‖A‖/β)^k` over `k` steps.
    ///
    /// # Bound
    /// Only parts of norm at most [`LATE`] wait for the next step. Larger parts (from noise, or of a product nearly in the span) are
    /// removed at once, by passes as in [`orthogonalize`], so `v` has norm `1 + O(ε)`. With the `γ` defined there,
    /// `‖V_jᵀv‖ ≤ √j γ + LATE ‖I − V_jᵀV_j‖`, so errors do not accumulate. `m` vectors satisfy `‖I − VᵀV‖_F ≤ √2 m γ`, as if each vector
    /// had been reorthogonalized at once. The tests check this bound on difficult cases.
    fn orthogonalize_product(
        &mut self,
        vectors: &mut dyn Vectors,
        along: &[f64],
        filters: bool,
    ) -> Result<Rest> {
        let total = vectors.columns();
        let first = total - along.len();
        let late = std::mem::take(&mut self.late);
        // The multiplied vector has late parts only if no other vector waits.
        let shown = if self.pending == 1 { self.product_of(&late) } else { vec![0.0; total] };
        let of_last = along.last().copied().unwrap_or(0.0);
        let late_at = |i: usize| late.get(i).copied().unwrap_or(0.0);
        let mut ahead = vec![0.0; total - 1];
        if !late.is_empty() && !along.is_empty() {
            for (i, ahead) in ahead.iter_mut().enumerate().take(first) {
                *ahead = shown[i] - of_last * late_at(i);
            }
        }
        let settling = Settling { late: &late, along, ahead: &ahead };
        let (mut rest, mut length) = vectors.settle_and_dot(&settling)?;
        // The coefficients removed so far, with respect to the settled basis, minus the contribution of the late parts to the product.
        let mut coefficients: Vec<f64> = (0..total)
            .map(|i| {
                let near = if i < first { ahead.get(i).copied().unwrap_or(0.0) } else { along[i - first] };
                near + of_last * late_at(i) - shown[i]
            })
            .collect();
        let mut enough = false;
        for _ in 0..=PASSES {
            if enough && filters {
                break;
            }
            coefficients.iter_mut().zip(&rest).for_each(|(sum, part)| *sum += part);
            if !filters && norm(&rest) <= LATE * length {
                let late = self.without_known(vectors, rest)?;
                return Ok(Rest { coefficients, norm: length, late });
            }
            let before = length;
            (rest, length) = vectors.remove_and_dot(&rest)?;
            enough = length > ENOUGH_LEFT * before;
        }
        Ok(Rest { coefficients, norm: length, late: Vec::new() })
    }

    /// `V⁺ᵀ A V s`, from the products so far, for parts `s` of the last column along the columns before it.
    fn product_of(&self, late: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; self.total()];
        for (column, s) in self.columns.iter().zip(late.iter().skip(self.known)) {
            product.iter_mut().zip(column).for_each(|(sum, entry)| *sum += entry * s);
        }
        product
    }

    /// Removes the parts along the known vectors at once, because their products are unknown.
    fn without_known(&self, vectors: &mut dyn Vectors, mut rest: Vec<f64>) -> Result<Vec<f64>> {
        if self.known > 0 {
            vectors.remove(&rest[..self.known])?;
            rest[..self.known].fill(0.0);
        }
        Ok(rest)
    }

    /// Removes the late parts of the last basis vector now.
    pub(super) fn settle(&mut self) {
        self.host.basis.settle_last(&std::mem::take(&mut self.late));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::krylov::Start;
    use crate::operator::{Closure, Symmetry};

    #[test]
    fn what_rounding_leaves_waits_and_what_noise_leaves_does_not() -> Result<()> {
        let n = 600;
        for noise in [0.0, 1e-4] {
            let diagonal = move |x: &[f64], y: &mut [f64]| {
                for (i, (y, x)) in y.iter_mut().zip(x).enumerate() {
                    *y = (1.0 + (i as f64).sqrt() + noise * (x * 1e6).sin()) * x;
                }
                Ok(())
            };
            let mut operator = Closure::new(n, n, Symmetry::Symmetric, diagonal);
            let mut lanczos = Factorization::lanczos(&Start::default().vector(n), &[])?;
            let mut largest = 0.0_f64;
            for step in 1..=60 {
                lanczos.expand(&mut operator)?;
                // The first two steps remove all parts in advance, so only later steps count.
                if step > 2 {
                    largest = largest.max(norm(&lanczos.late));
                }
            }
            if noise == 0.0 {
                // ‖A‖/β is about 5 here. A few ε of ‖A‖ remain, more than after an immediate removal.
                assert!((8.0 * f64::EPSILON..1e-13).contains(&largest), "{largest:e}");
            } else {
                // A second pass finds only the rounding errors of a removal.
                assert!(largest < 4.0 * f64::EPSILON, "{largest:e}");
            }
        }
        Ok(())
    }
}
