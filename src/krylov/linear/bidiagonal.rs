//! Golub–Kahan bidiagonalization, one product a step: the process of LSQR and LSMR.

use std::sync::Arc;

use super::super::basis::norm;
use super::super::precondition::Preconditioner;
use super::super::vectors::update;
use super::system::System;
use super::{SolveOptions, precondition, refuse_left, require_positive_definite};
use crate::error::Result;
use crate::operator::Adjoint;

/// `C V = U B`, `Cᵀ U = V Bᵀ + α v eᵀ` for `C = A M⁻¹`, with `B` lower bidiagonal: `α_k` on its diagonal,
/// `β_{k+1}` below. It starts from the residual of its system.
///
/// # References
/// Golub and Kahan (1965), doi:10.1137/0702016.
#[derive(Clone)]
pub(super) struct Bidiagonal {
    pub(super) system: System,
    preconditioner: Option<Arc<dyn Preconditioner>>,
    pub(super) u: Vec<f64>,
    v: Vec<f64>,
    /// `M⁻¹ v`; empty without a preconditioner.
    hat: Vec<f64>,
    pub(super) alpha: f64,
    pub(super) beta: f64,
    /// `‖B‖_F` so far: a lower bound of `‖C‖_F`.
    pub(super) scale: f64,
    next: Next,
    work: Vec<f64>,
}

#[derive(Clone, Copy, PartialEq)]
enum Next {
    Start,
    Adjoint,
    Forward,
}

/// The product that a step took.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Half {
    /// `A x_0`, for the residual of the first iterate.
    Residual,
    /// The first `Cᵀ u`, which gives `α_1`.
    First,
    /// `C v`, which gives `β_{k+1}`.
    Forward,
    /// `Cᵀ u`, which gives `α_{k+1}`.
    Adjoint,
}

impl Bidiagonal {
    /// For `b` of length `rows` and `x` of length `cols`. A preconditioner must be symmetric, as it is
    /// applied with `Aᵀ` too.
    pub(super) fn new(method: &str, cols: usize, b: &[f64], options: &SolveOptions) -> Result<Self> {
        require_positive_definite(method, options)?;
        refuse_left(method, options)?;
        let preconditioner = options.preconditioner.clone();
        Ok(Self {
            system: System::new(cols, b, options)?,
            u: vec![0.0; b.len()],
            v: vec![0.0; cols],
            hat: preconditioner.as_ref().map_or_else(Vec::new, |_| vec![0.0; cols]),
            preconditioner,
            alpha: 0.0,
            beta: 0.0,
            scale: 0.0,
            next: Next::Start,
            work: vec![0.0; cols],
        })
    }

    /// `M⁻¹ v`, of length `cols`: the direction in which the iterate can move.
    pub(super) fn direction(&self) -> &[f64] {
        if self.preconditioner.is_some() { &self.hat } else { &self.v }
    }

    /// Takes one product. A vector that vanishes (to rounding) becomes zero, and so does its `α` or `β`.
    pub(super) fn advance(&mut self, operator: &mut dyn Adjoint) -> Result<Half> {
        self.system.fits(operator)?;
        if self.system.pending {
            self.system.first_residual(operator)?;
            return Ok(Half::Residual);
        }
        if self.next == Next::Start {
            let length = norm(&self.system.r);
            self.beta = length;
            if length > 0.0 {
                update(&mut self.u, &self.system.r, |_, r| r / length);
            }
            self.next = Next::Adjoint;
        }
        if self.next == Next::Forward {
            let System { tally, work, .. } = &mut self.system;
            let direction = if self.preconditioner.is_some() { &self.hat } else { &self.v };
            tally.product(operator, direction, work)?;
            let alpha = self.alpha;
            update(&mut self.u, work, |u, av| av - alpha * u);
            self.beta = normalize(&mut self.u, alpha, &mut self.scale);
            self.next = Next::Adjoint;
            return Ok(Half::Forward);
        }
        self.system.tally.adjoint(operator, &self.u, &mut self.work)?;
        if self.preconditioner.is_some() {
            precondition(self.preconditioner.as_ref(), &self.work, &mut self.hat)?;
            self.work.copy_from_slice(&self.hat);
        }
        let half = if self.alpha == 0.0 { Half::First } else { Half::Adjoint };
        // Before the first product, both α and v are 0.
        let beta = if half == Half::First { 0.0 } else { self.beta };
        update(&mut self.v, &self.work, |v, atu| atu - beta * v);
        self.alpha = normalize(&mut self.v, beta, &mut self.scale);
        if self.preconditioner.is_some() {
            precondition(self.preconditioner.as_ref(), &self.v, &mut self.hat)?;
        }
        self.next = Next::Forward;
        Ok(half)
    }
}

fn normalize(w: &mut [f64], other: f64, scale: &mut f64) -> f64 {
    let length = norm(w);
    *scale = scale.hypot(length);
    if length <= 10.0 * f64::EPSILON * other.abs().max(*scale) {
        w.fill(0.0);
        return 0.0;
    }
    for value in w {
        *value /= length;
    }
    length
}
