//! Least squares by bidiagonalization: LSQR.

use super::super::basis::norm;
use super::super::stats::Status;
use super::super::vectors::{axpy, update};
use super::bidiagonal::{Bidiagonal, Half};
use super::minres::LEAST_SQUARES;
use super::rotation::rotation;
use super::system::{System, Tally};
use super::{Advance, SolveOptions, Solver, refuse_preconditioner};
use crate::error::Result;
use crate::operator::Adjoint;

/// LSQR: `min ‖b − A x‖₂` for `A` of any shape, `rows × cols`; of all solutions the one nearest to the first iterate.
///
/// # Properties
/// Equal to conjugate gradients on the normal equations, and more stable. `‖r‖` falls monotonically. One product with
/// `Aᵀ` to begin with, then two an iteration, `A v` and `Aᵀ u`; the iterate moves with the first. Ends where
/// `‖Aᵀ r‖` vanishes (a least-squares solution). Stores `b`, `r`, `u` and a product of length `rows`, and `x`, the
/// best `x`, `v`, a direction and a product of length `cols`.
///
/// # References
/// Paige and Saunders (1982), doi:10.1145/355984.355989.
#[derive(Clone)]
pub struct Lsqr {
    system: System,
    bidiagonal: Bidiagonal,
    w: Vec<f64>,
    /// `φ̄`, the residual norm with its sign, and `ρ̄`.
    phi: f64,
    rho: f64,
    /// `θ / ρ` for the next direction.
    ratio: f64,
    cosine: f64,
}

impl Lsqr {
    /// For `b` of length `rows` and `x` of length `cols`. Looks at `x0` of the options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new); any preconditioner is refused.
    pub fn new(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Self> {
        refuse_preconditioner("LSQR", options)?;
        Ok(Self {
            system: System::new(cols, b, options)?,
            bidiagonal: Bidiagonal::new(b.len(), cols),
            w: vec![0.0; cols],
            phi: 0.0,
            rho: 0.0,
            ratio: 0.0,
            cosine: 0.0,
        })
    }
}

impl Solver for Lsqr {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let system = &mut self.system;
        system.fits(operator)?;
        if system.pending {
            system.first_residual(operator)?;
            return Ok(Advance::Continuing);
        }
        let half = self.bidiagonal.advance(system, operator)?;
        let (alpha, beta) = (self.bidiagonal.alpha, self.bidiagonal.beta);
        if half == Half::Forward {
            let (c, s, rho) = rotation(self.rho, beta);
            if rho == 0.0 {
                return Ok(Advance::Ended(Status::LeastSquares));
            }
            axpy(c * self.phi / rho, &self.w, &mut system.x);
            self.phi *= s;
            self.cosine = c;
            self.ratio = s / rho;
            // r_k = s² r_{k−1} + (φ̄ c, with the rotation's sign) u_{k+1}
            let along = -c * self.phi;
            update(&mut system.r, &self.bidiagonal.u, |r, u| s * s * r + along * u);
            let residual = norm(&system.r);
            system.note(residual);
            let done = self.phi.abs() <= f64::EPSILON * system.tally.rhs_norm;
            return Ok(if done { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing });
        }
        if half == Half::First {
            self.phi = beta;
            self.rho = alpha;
            self.w.copy_from_slice(&self.bidiagonal.v);
        } else {
            // ‖Aᵀ r‖ = φ̄ α c
            if alpha * self.cosine.abs() <= LEAST_SQUARES * self.bidiagonal.scale {
                return Ok(Advance::Ended(Status::LeastSquares));
            }
            let ratio = self.ratio * alpha;
            update(&mut self.w, &self.bidiagonal.v, |w, v| v - ratio * w);
            self.rho = -self.cosine * alpha;
        }
        Ok(if alpha == 0.0 { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing })
    }

    fn tally(&self) -> Tally {
        self.system.tally
    }

    fn solution(&self) -> Vec<f64> {
        self.system.best().to_vec()
    }
}
