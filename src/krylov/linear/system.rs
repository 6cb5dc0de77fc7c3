//! The state shared by all solvers: the system, the iterate and its residual, and products that are counted
//! and checked.

use super::super::basis::norm;
use super::super::vectors::{axpy, update};
use super::options::SolveOptions;
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Symmetry};

/// A solver's progress; known without a product.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tally {
    /// Products with `A` and `Aᵀ` so far.
    pub products: usize,
    /// `‖b‖`.
    pub rhs_norm: f64,
    /// `‖b − A x‖` of the current iterate; infinite until the residual of `x0` is known.
    pub residual: f64,
    /// The smallest residual norm so far: that of the solution that would be returned now.
    pub best: f64,
    /// The relative noise `‖y − A v‖ / ‖y‖` of the least noisy product so far, from the errors that the operator
    /// states ([`Operator::standard_errors`](crate::operator::Operator::standard_errors)); 0 where it states none.
    pub noise: f64,
}

impl Tally {
    /// `residual / ‖b‖`, or the residual itself for `b = 0`.
    pub fn relative(&self, residual: f64) -> f64 {
        if self.rhs_norm > 0.0 { residual / self.rhs_norm } else { residual }
    }

    /// Takes `y = A x`, counts it and checks it for NaN. A product that fails is not counted.
    pub(crate) fn product(&mut self, operator: &mut dyn Adjoint, x: &[f64], y: &mut [f64]) -> Result<()> {
        operator.apply(x, y)?;
        self.count(operator, y)
    }

    /// Takes `x = Aᵀ y`, as [`Tally::product`].
    pub(crate) fn adjoint(&mut self, operator: &mut dyn Adjoint, y: &[f64], x: &mut [f64]) -> Result<()> {
        operator.apply_adjoint(y, x)?;
        self.count(operator, x)
    }

    fn count(&mut self, operator: &dyn Adjoint, product: &[f64]) -> Result<()> {
        let length = norm(product);
        if !length.is_finite() {
            return Err(Error::Numerical(format!(
                "product {} with the operator holds a NaN or an infinity",
                self.products + 1
            )));
        }
        self.products += 1;
        let error = operator.standard_error();
        if error > 0.0 && length > 0.0 {
            let noise = error / length;
            self.noise = if self.noise > 0.0 { self.noise.min(noise) } else { noise };
        }
        Ok(())
    }
}

/// The system `A x = b`, the iterate and its residual `r = b − A x`, and the best iterate so far.
#[derive(Clone, Debug)]
pub(crate) struct System {
    pub(crate) b: Vec<f64>,
    pub(crate) x: Vec<f64>,
    /// `b − A x`; not yet valid while `pending`.
    pub(crate) r: Vec<f64>,
    pub(crate) tally: Tally,
    /// Whether the residual of `x0` has yet to be taken.
    pub(crate) pending: bool,
    best: Vec<f64>,
    /// A product, of length `rows`.
    pub(crate) work: Vec<f64>,
}

impl System {
    /// For `b` of length `rows` and `x` of length `cols`.
    pub(crate) fn new(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Self> {
        options.check()?;
        let rhs_norm = norm(b);
        if !rhs_norm.is_finite() {
            return Err(Error::Numerical("the right-hand side holds a NaN or an infinity".into()));
        }
        if let Some(size) = options.preconditioner.as_ref().and_then(|m| m.size()) {
            same_length("the preconditioner's size", cols, size)?;
        }
        let pending = options.x0.is_some();
        let x = options.x0.clone().unwrap_or_else(|| vec![0.0; cols]);
        same_length("the first iterate's length", cols, x.len())?;
        if !norm(&x).is_finite() {
            return Err(Error::Numerical("the first iterate holds a NaN or an infinity".into()));
        }
        let residual = if pending { f64::INFINITY } else { rhs_norm };
        Ok(Self {
            b: b.to_vec(),
            r: b.to_vec(),
            best: x.clone(),
            x,
            tally: Tally { products: 0, rhs_norm, residual, best: residual, noise: 0.0 },
            pending,
            work: vec![0.0; b.len()],
        })
    }

    /// Refuses an operator of another shape.
    pub(crate) fn fits(&self, operator: &dyn Adjoint) -> Result<()> {
        let (rows, cols) = (operator.rows(), operator.cols());
        if rows == self.b.len() && cols == self.x.len() {
            return Ok(());
        }
        Err(Error::Dimension {
            what: "the operator of a linear system",
            expected: format!("{}x{}", self.b.len(), self.x.len()),
            found: format!("{rows}x{cols}"),
        })
    }

    /// The residual of the first iterate: one product.
    pub(crate) fn first_residual(&mut self, operator: &mut dyn Adjoint) -> Result<()> {
        self.tally.product(operator, &self.x, &mut self.work)?;
        self.r.copy_from_slice(&self.b);
        axpy(-1.0, &self.work, &mut self.r);
        self.pending = false;
        self.note(norm(&self.r));
        Ok(())
    }

    /// Records the residual norm of the current iterate, and keeps the iterate if it is the best. If two are
    /// equal to rounding, the later one is better: when `‖r‖` has reached that of a least-squares solution,
    /// `x` still converges.
    pub(crate) fn note(&mut self, residual: f64) {
        self.tally.residual = residual;
        if residual <= self.tally.best * (1.0 + 1e-12) {
            self.tally.best = residual;
            update(&mut self.best, &self.x, |_, x| x);
        }
    }

    /// The best iterate.
    pub(crate) fn best(&self) -> &[f64] {
        &self.best
    }
}

/// Refuses a system that is not square.
pub(crate) fn square(rows: usize, cols: usize) -> Result<()> {
    same_length("the operator of a square system, in rows", cols, rows)
}

/// Refuses an operator that is not declared symmetric, on behalf of `method`.
pub(crate) fn declared_symmetric(method: &str, operator: &dyn Adjoint) -> Result<()> {
    if operator.symmetry() == Symmetry::Symmetric {
        return Ok(());
    }
    Err(Error::Numerical(format!(
        "{method} needs a symmetric operator (a coaxial rig's), and this one is not declared symmetric; GMRES does not"
    )))
}

pub(crate) fn same_length(what: &'static str, expected: usize, found: usize) -> Result<()> {
    if expected == found {
        return Ok(());
    }
    Err(Error::Dimension { what, expected: expected.to_string(), found: found.to_string() })
}
