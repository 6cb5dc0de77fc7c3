//! Golub–Kahan bidiagonalization, one product a step.

use super::super::basis::norm;
use super::super::vectors::update;
use super::system::System;
use crate::error::Result;
use crate::operator::Adjoint;

/// `A V = U B`, `Aᵀ U = V Bᵀ + α v eᵀ` with `B` lower bidiagonal: `α_k` on its diagonal, `β_{k+1}` below.
///
/// # References
/// Golub and Kahan (1965), doi:10.1137/0702016.
#[derive(Clone)]
pub(super) struct Bidiagonal {
    pub(super) u: Vec<f64>,
    pub(super) v: Vec<f64>,
    pub(super) alpha: f64,
    pub(super) beta: f64,
    /// `‖B‖_F` so far: a lower bound of `‖A‖_F`.
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

/// Which product was taken.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Half {
    /// The first `Aᵀ u`: `α_1` is there.
    First,
    /// `A v`: `β_{k+1}` is there.
    Forward,
    /// `Aᵀ u`: `α_{k+1}` is there.
    Adjoint,
}

impl Bidiagonal {
    pub(super) fn new(rows: usize, cols: usize) -> Self {
        Self {
            u: vec![0.0; rows],
            v: vec![0.0; cols],
            alpha: 0.0,
            beta: 0.0,
            scale: 0.0,
            next: Next::Start,
            work: vec![0.0; cols],
        }
    }

    /// One product. A vector that vanishes (to rounding) is zero from then on, and its `α` or `β` with it.
    pub(super) fn advance(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Half> {
        let mut half = Half::Adjoint;
        if self.next == Next::Start {
            let length = norm(&system.r);
            self.beta = length;
            if length > 0.0 {
                update(&mut self.u, &system.r, |_, r| r / length);
            }
            self.next = Next::Adjoint;
        }
        if self.next == Next::Forward {
            system.tally.product(operator, &self.v, &mut system.work)?;
            let alpha = self.alpha;
            update(&mut self.u, &system.work, |u, av| av - alpha * u);
            self.beta = normalize(&mut self.u, alpha, &mut self.scale);
            self.next = Next::Adjoint;
            return Ok(Half::Forward);
        }
        system.tally.adjoint(operator, &self.u, &mut self.work)?;
        if self.alpha == 0.0 {
            half = Half::First;
            self.v.copy_from_slice(&self.work);
            self.alpha = normalize(&mut self.v, 0.0, &mut self.scale);
        } else {
            let beta = self.beta;
            update(&mut self.v, &self.work, |v, atu| atu - beta * v);
            self.alpha = normalize(&mut self.v, beta, &mut self.scale);
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
