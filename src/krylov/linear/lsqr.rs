//! Least squares by bidiagonalization: LSQR.

use super::super::basis::norm;
use super::super::stats::Status;
use super::super::vectors::{axpy, update};
use super::bidiagonal::{Bidiagonal, Half};
use super::minres::LEAST_SQUARES;
use super::rotation::rotation;
use super::system::Tally;
use super::{Advance, SolveOptions, Solver};
use crate::error::Result;
use crate::operator::Adjoint;

/// LSQR: solves `min ‖b − A x‖₂` for `A` of any shape, `rows × cols`, and finds the solution nearest to the
/// first iterate.
///
/// With a symmetric positive definite `M` it is LSQR on `A M⁻¹`: it minimizes the true residual, and finds
/// the solution nearest in the norm of `M²`.
///
/// # Properties
/// Equal to conjugate gradients on the normal equations, but more stable. `‖r‖` falls monotonically. It takes
/// one product with `Aᵀ` first, then two an iteration, `A v` and `Aᵀ u`; the iterate moves with the first.
/// Ends where `‖Aᵀ r‖` vanishes (a least-squares solution).
///
/// # Storage
/// `b`, `r`, `u` and a product of length `rows`; `x`, the best `x`, `v`, a direction and a product of length
/// `cols`, and with a preconditioner `M⁻¹ v`.
///
/// # References
/// Paige and Saunders (1982), doi:10.1145/355984.355989.
#[derive(Clone)]
pub struct Lsqr {
    process: Bidiagonal,
    w: Vec<f64>,
    /// `φ̄`, the residual norm with its sign, and `ρ̄`.
    phi: f64,
    rho: f64,
    /// `θ / ρ` for the next direction.
    ratio: f64,
    cosine: f64,
}

impl Lsqr {
    /// The state before the first step, for `b` of length `rows` and `x` of length `cols`. Reads `x0` and
    /// `preconditioner` of the options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new).
    pub fn new(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Self> {
        Ok(Self {
            process: Bidiagonal::new("LSQR", cols, b, options)?,
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
        let half = self.process.advance(operator)?;
        let (alpha, beta) = (self.process.alpha, self.process.beta);
        match half {
            Half::Residual => return Ok(Advance::Continuing),
            Half::Forward => {
                let (c, s, rho) = rotation(self.rho, beta);
                if rho == 0.0 {
                    return Ok(Advance::Ended(Status::LeastSquares));
                }
                let system = &mut self.process.system;
                axpy(c * self.phi / rho, &self.w, &mut system.x);
                self.phi *= s;
                self.cosine = c;
                self.ratio = s / rho;
                // r_k = s² r_{k−1} + (φ̄ c, with the rotation's sign) u_{k+1}
                let along = -c * self.phi;
                update(&mut system.r, &self.process.u, |r, u| s * s * r + along * u);
                let residual = norm(&system.r);
                system.note(residual);
                let done = self.phi.abs() <= f64::EPSILON * system.tally.rhs_norm;
                return Ok(if done { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing });
            }
            Half::First => {
                self.phi = beta;
                self.rho = alpha;
                self.w.copy_from_slice(self.process.direction());
            }
            Half::Adjoint => {
                // ‖Cᵀ r‖ = φ̄ α c
                if alpha * self.cosine.abs() <= LEAST_SQUARES * self.process.scale {
                    return Ok(Advance::Ended(Status::LeastSquares));
                }
                let ratio = self.ratio * alpha;
                update(&mut self.w, self.process.direction(), |w, v| v - ratio * w);
                self.rho = -self.cosine * alpha;
            }
        }
        Ok(if alpha == 0.0 { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing })
    }

    fn tally(&self) -> Tally {
        self.process.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.process.system.best()
    }
}
