//! The state of all solvers: the system, the iterate and the residual. This module also counts and checks all products.

use std::sync::Arc;

use super::place::Place;
use super::{Side, SolveOptions};
use crate::error::{Error, Result};
use crate::krylov::basis::{norm, update, update2};
use crate::krylov::powers::{exponent, finite_norm, power, scale, scaled};
use crate::krylov::precondition::Preconditioner;
use crate::operator::{Adjoint, Direction, Sums, Vectors};

/// A solver's progress. Reading it takes no product.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tally {
    /// The number of products with `A` and `Aᵀ` so far.
    pub products: usize,
    /// `‖b‖`.
    pub rhs_norm: f64,
    /// `‖b − A x‖` of the current iterate; infinite until the residual of `x0` is known.
    pub residual: f64,
    /// The smallest residual norm so far, which is the residual norm of the best iterate. After a failure of the memory of the operator, it
    /// is that of an earlier iterate.
    pub best: f64,
    /// The relative noise `‖y − A v‖ / ‖y‖` of the least noisy product so far, from the errors that the operator states
    /// ([`Operator::standard_errors`](crate::operator::Operator::standard_errors)); 0 if the operator states no errors.
    pub noise: f64,
    /// The exponent of the power of two that divides products; `None` before the first product that is not zero.
    pub(crate) operator_power: Option<i32>,
    /// The exponent of the power of two that multiplied the last product.
    multiplied: i32,
    /// True if the last product was the first in the memory of an operator that is not of ordinary size.
    pub(super) is_refused: bool,
}

/// Until the size of the operator is known, vectors of norm `2^-NEAR` to `2^NEAR` are multiplied without scaling.
const NEAR: i32 = 32;

/// A product whose length is beyond `2^±FAR` is near the ends of double precision.
const FAR: i32 = 900;

impl Tally {
    /// `residual / ‖b‖`, or the residual itself for `b = 0`.
    pub fn relative(&self, residual: f64) -> f64 {
        if self.rhs_norm > 0.0 { residual / self.rhs_norm } else { residual }
    }

    /// Takes `y = A x`, counts it, checks it for NaN and divides it by the operator's power of two. A product that fails is not counted.
    pub(crate) fn product(&mut self, operator: &mut dyn Adjoint, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.take(operator, x, y, |operator, x, y| operator.apply(x, y))
    }

    /// Takes `x = Aᵀ y` in the same way as [`Tally::product`].
    pub(crate) fn adjoint(&mut self, operator: &mut dyn Adjoint, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.take(operator, y, x, |operator, y, x| operator.apply_adjoint(y, x))
    }

    /// Takes a product with the vector `of`. The vector is first scaled to about length 1 in two cases: the operator is not of ordinary
    /// size, or the operator's size is unknown and the vector is not of ordinary size. Without scaling, the product would leave the range
    /// of double precision.
    fn take(
        &mut self,
        operator: &mut dyn Adjoint,
        of: &[f64],
        product: &mut [f64],
        apply: fn(&mut dyn Adjoint, &[f64], &mut [f64]) -> Result<()>,
    ) -> Result<()> {
        let mut multiply = |shift: i32, product: &mut [f64]| {
            if shift == 0 {
                return apply(operator, of, product);
            }
            let mut unit = of.to_vec();
            scale(&mut unit, -shift);
            apply(operator, &unit, product)
        };
        let size = if self.operator_power == Some(0) { 0 } else { exponent(norm(of)) };
        let is_zero = size < -2 * FAR;
        let mut shift = match self.operator_power {
            _ if is_zero => 0,
            None if size.abs() <= NEAR => 0,
            _ => size,
        };
        multiply(shift, product)?;
        if self.operator_power.is_none() && shift != size && !is_zero {
            let length = exponent(norm(product));
            if length > FAR || (-2 * FAR..-FAR).contains(&length) {
                shift = size;
                multiply(shift, product)?;
            }
        }
        let length = finite_norm(&format!("product {} with the operator", self.products + 1), product)?;
        self.count(length, operator.standard_error());
        if length > 0.0 {
            self.operator_power.get_or_insert(power(exponent(length) - (size - shift)));
        }
        self.multiplied = shift - self.operator_power.unwrap_or(0);
        scale(product, self.multiplied);
        Ok(())
    }

    /// Takes `w = A v`, or `w = Aᵀ v`, for a column `v`, about of norm `size`, of vectors in the memory of the operator, and counts it.
    /// Returns `Vᵀ w` and `‖w‖`. Fails with [`Error::Device`], and refuses that memory, if the operator is not of ordinary size.
    pub(super) fn product_within(
        &mut self,
        operator: &mut dyn Adjoint,
        vectors: &mut dyn Vectors,
        (column, direction, size): (usize, Direction, f64),
    ) -> Result<Sums> {
        operator.apply_within(vectors, column, direction)?;
        let (dots, length) = vectors.dots_and_norm(0)?;
        let is_known = self.operator_power.is_some();
        if is_known && !length.is_finite() {
            let product = self.products + 1;
            let fault = format!("product {product} with the operator holds a NaN or an infinity");
            return Err(Error::Numerical(fault));
        }
        self.count(length, operator.standard_error());
        let is_ordinary = length.is_finite() && length > 0.0 && power(exponent(length) - exponent(size)) == 0;
        if !is_known && !is_ordinary {
            self.is_refused = true;
            return Err(Error::device("the numbers of the operator are not of ordinary size"));
        }
        self.operator_power = Some(0);
        self.multiplied = 0;
        Ok((dots, length))
    }

    /// Counts a product of this length and standard error.
    fn count(&mut self, length: f64, error: f64) {
        self.products += 1;
        if error > 0.0 && length > 0.0 {
            let noise = error / length;
            self.noise = if self.noise > 0.0 { self.noise.min(noise) } else { noise };
        }
    }

    /// Records the residual norm of the current iterate. Returns true if the iterate is the best so far. If two residual norms are equal to
    /// rounding, the later iterate is better: when `‖r‖` has reached the residual of a least-squares solution, `x` still converges.
    pub(super) fn note(&mut self, residual: f64) -> bool {
        self.residual = residual;
        let is_best = residual <= self.best * (1.0 + 1e-12);
        if is_best {
            self.best = residual;
        }
        is_best
    }

    /// The standard error of the last product, scaled by the same power of two as the product.
    pub(crate) fn standard_error(&self, operator: &dyn Adjoint) -> f64 {
        scaled(operator.standard_error(), self.multiplied)
    }
}

/// The system `A x = b` with its preconditioner, the iterate and its residual `r = b − A x`, and the best iterate so far.
///
/// `A` and `b` are divided by powers of two with the exponents `p` and `q`, so that their numbers are of ordinary size. The stored iterate
/// is then `x · 2^(p − q)`. Both exponents are 0 for systems of ordinary size.
pub struct System {
    pub(crate) b: Vec<f64>,
    pub(crate) x: Vec<f64>,
    /// `b − A x`, which is not valid while `pending` is true.
    pub(crate) r: Vec<f64>,
    pub(crate) tally: Tally,
    /// True if the residual of `x0` has not been taken yet.
    pub(crate) pending: bool,
    pub(super) best: Vec<f64>,
    /// The exponent of the power of two that divides `b`, `r` and the norms of the tally.
    pub(crate) rhs_power: i32,
    /// True if the iterate is scaled as well. A first iterate is not scaled until the operator's power of two is known.
    is_divided: bool,
    pub(crate) work: Vec<f64>,
    pub(crate) inverse: Inverse,
    /// The vectors of a short recurrence.
    pub(super) place: Place,
    /// True if these vectors may not be in the memory of the operator. The memory has failed, or lacks what is needed, or the operator is
    /// not of ordinary size.
    pub(super) has_left: bool,
}

/// `M⁻¹`, or the identity.
pub(crate) struct Inverse(Option<Arc<dyn Preconditioner>>);

impl Inverse {
    pub(crate) fn is_identity(&self) -> bool {
        self.0.is_none()
    }

    /// Whether `M` is diagonal, and not the identity.
    pub(super) fn is_diagonal(&self) -> bool {
        self.0.as_ref().is_some_and(|m| m.diagonal().is_some())
    }

    /// The diagonal of `M⁻¹`, if `M` is diagonal and not the identity.
    pub(super) fn diagonal(&self) -> Option<Vec<f64>> {
        let diagonal = self.0.as_ref().and_then(|m| m.diagonal())?;
        Some(diagonal.iter().map(|d| d.recip()).collect())
    }

    /// `z ← M⁻¹ r`.
    pub(crate) fn apply(&self, r: &[f64], z: &mut [f64]) -> Result<()> {
        match &self.0 {
            Some(m) => m.apply(r, z),
            None => {
                z.copy_from_slice(r);
                Ok(())
            }
        }
    }
}

impl System {
    /// Makes the system for `b` of length `rows` and `x` of length `cols`.
    pub(crate) fn new(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Self> {
        options.check()?;
        let rhs_power = power(exponent(finite_norm("the right-hand side", b)?));
        let mut b = b.to_vec();
        scale(&mut b, -rhs_power);
        let rhs_norm = norm(&b);
        if let Some(size) = options.preconditioner.as_ref().and_then(|m| m.size()) {
            Error::check_size("the preconditioner's size", cols, size)?;
        }
        let pending = options.x0.is_some();
        let x = options.x0.clone().unwrap_or_else(|| vec![0.0; cols]);
        Error::check_size("the first iterate's length", cols, x.len())?;
        finite_norm("the first iterate", &x)?;
        let residual = if pending { f64::INFINITY } else { rhs_norm };
        Ok(Self {
            r: b.clone(),
            work: vec![0.0; b.len()],
            b,
            best: x.clone(),
            x,
            tally: Tally {
                products: 0,
                rhs_norm,
                residual,
                best: residual,
                noise: 0.0,
                operator_power: None,
                multiplied: 0,
                is_refused: false,
            },
            rhs_power,
            is_divided: !pending,
            pending,
            inverse: Inverse(options.preconditioner.clone()),
            place: Place::Host(Vec::new()),
            has_left: false,
        })
    }

    /// Makes the system like [`System::new`] for `method`, whose preconditioner is on the right or split between both sides. `is_definite`
    /// is true if the method needs a symmetric positive definite preconditioner.
    pub(crate) fn split(
        method: &str,
        is_definite: bool,
        cols: usize,
        b: &[f64],
        options: &SolveOptions,
    ) -> Result<Self> {
        match &options.preconditioner {
            Some(m) if is_definite && !m.is_positive_definite() => Err(Error::option(
                "--precondition",
                format!("{method} needs a symmetric positive definite preconditioner"),
            )
            .help("use such a one, or gmres")),
            Some(_) if options.side == Side::Left => {
                Err(Error::option("side", format!("{method} does not precondition from the left"))
                    .help("precondition from the right, or use gmres"))
            }
            _ => Self::new(cols, b, options),
        }
    }

    /// Scales the first iterate, once, by the ratio of the powers of two that divide the operator's products and `b`. If all products were
    /// zero so far, the operator's exponent is set to 0. Returns the exponent by which the iterate was scaled.
    pub(crate) fn divide(&mut self) -> Result<i32> {
        let shift = *self.tally.operator_power.get_or_insert(0) - self.rhs_power;
        if !std::mem::replace(&mut self.is_divided, true) {
            scale(&mut self.x, shift);
            finite_norm("the first iterate, relative to the right-hand side,", &self.x)?;
            self.best.copy_from_slice(&self.x);
        }
        Ok(shift)
    }

    /// Multiplies `b`, and all values in the unit of `b`, by a power of two.
    pub(crate) fn multiply_rhs(&mut self, power: i32) {
        self.rhs_power -= power;
        scale(&mut self.b, power);
        scale(&mut self.r, power);
        let Tally { rhs_norm, residual, best, .. } = &mut self.tally;
        for size in [rhs_norm, residual, best] {
            *size = scaled(*size, power);
        }
    }

    /// Refuses an operator whose shape does not fit the system.
    pub(crate) fn fits(&self, operator: &dyn Adjoint) -> Result<()> {
        let expected = format!("{}x{}", self.b.len(), self.x.len());
        let found = format!("{}x{}", operator.rows(), operator.cols());
        Error::check_size("the operator of a linear system", expected, found)
    }

    /// Takes the residual of the first iterate if it is not known yet: one product. Returns true if this call took the residual.
    pub(crate) fn open(&mut self, operator: &mut dyn Adjoint) -> Result<bool> {
        let pending = self.pending;
        if pending {
            self.first_residual(operator)?;
        }
        Ok(pending)
    }

    pub(crate) fn first_residual(&mut self, operator: &mut dyn Adjoint) -> Result<()> {
        self.tally.product(operator, &self.x, &mut self.work)?;
        if !self.is_divided {
            let shift = self.divide()?;
            scale(&mut self.work, shift);
        }
        self.settle();
        Ok(())
    }

    /// `r ← b − A x`, for the product `A x` in `work`.
    pub(crate) fn settle(&mut self) {
        update2(&mut self.r, &self.b, &self.work, |_, b, y| b - y);
        self.pending = false;
        self.note_residual();
    }

    /// Records and returns the norm of `r`.
    pub(crate) fn note_residual(&mut self) -> f64 {
        let residual = norm(&self.r);
        self.note(residual);
        residual
    }

    /// Records the residual norm of the current iterate, and keeps the iterate if it is the best so far.
    pub(crate) fn note(&mut self, residual: f64) {
        if self.tally.note(residual) {
            update(&mut self.best, &self.x, |_, x| x);
        }
    }

    /// Converts an iterate to the caller's units.
    pub(crate) fn undivided(&self, mut x: Vec<f64>) -> Vec<f64> {
        if self.is_divided {
            scale(&mut x, self.rhs_power - self.tally.operator_power.unwrap_or(0));
        }
        x
    }

    /// The tally in the caller's units.
    pub(crate) fn tally(&self) -> Tally {
        let [rhs_norm, residual, best] = [self.tally.rhs_norm, self.tally.residual, self.tally.best]
            .map(|size| scaled(size, self.rhs_power));
        Tally { rhs_norm, residual, best, ..self.tally }
    }
}

/// Refuses a system that is not square.
pub(crate) fn square(rows: usize, cols: usize) -> Result<()> {
    Error::check_size("the operator of a square system, in rows", cols, rows)
}

/// Returns `(c, s, ρ)` with `[c s; −s c] [a; b] = [ρ; 0]`, `ρ ≥ 0`. For `a = b = 0`, it is the identity.
pub(super) fn rotation(a: f64, b: f64) -> (f64, f64, f64) {
    let length = a.hypot(b);
    if length == 0.0 { (1.0, 0.0, 0.0) } else { (a / length, b / length, length) }
}
