//! The conjugate gradient method.

use super::system::System;
use super::{Advance, SolveOptions, Solver};
use crate::error::Result;
use crate::krylov::basis::{axpy, dot, norm, update};
use crate::krylov::completeness::Status;
use crate::operator::Adjoint;

/// Conjugate gradients: solves `A x = b` for a symmetric positive definite `A` of `n × n`.
///
/// With a symmetric positive definite `M` it is conjugate gradients on `M^-½ A M^-½`, without computing the roots.
///
/// `‖x − A⁻¹b‖_A` falls monotonically. `‖r‖` may rise, so the best iterate is returned. A step takes one product. The method ends with
/// [`Status::Breakdown`] if a curvature `pᵀAp ≤ 0` shows that `A` is not positive definite. It ends with [`Status::NotSymmetric`] if
/// `zᵀAp ≠ pᵀAp` (in exact arithmetic `p` and the previous direction are conjugate). The method stores seven `n`-vectors: `b, x`, the best
/// `x`, `r, z, p` and `A p`.
///
/// References: Hestenes and Stiefel (1952), doi:10.6028/jres.049.044.
#[derive(Clone)]
pub struct Cg {
    system: System,
    /// `M⁻¹ r`.
    z: Vec<f64>,
    p: Vec<f64>,
    /// `rᵀ z` of the previous step; 0 at the start.
    rho: f64,
    /// True if `p` was computed from the current residual.
    directed: bool,
    /// The relative noise of a product, from the options.
    noise: f64,
}

impl Cg {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0`, `preconditioner` and, to judge symmetry, `noise` of the
    /// options.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) if lengths differ, [`Error::Numerical`](crate::Error::Numerical) for NaN,
    /// [`Error::Option`](crate::Error::Option) for a preconditioner that is not positive definite or an impossible option.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        let n = b.len();
        Ok(Self {
            system: System::split("CG", true, n, b, options)?,
            z: vec![0.0; n],
            p: vec![0.0; n],
            rho: 0.0,
            directed: false,
            noise: options.noise,
        })
    }
}

/// The asymmetry that is tolerated in `uᵀ A v`, relative to `‖u‖ ‖A v‖`. The last product was `A v`, with this standard error and this
/// length. Rounding causes an asymmetry of 1e-16 times a growth that stays small before convergence, so a value above 1e-6 is not rounding.
/// Noise causes an asymmetry of the size of the noise.
pub(super) fn symmetry_tolerance(noise: f64, error: f64, length: f64) -> f64 {
    (10.0 * noise.max(error / length)).max(1e-6)
}

impl Solver for Cg {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let system = &mut self.system;
        if system.open(operator, Some("CG"))? {
            return Ok(Advance::Continuing);
        }
        if !self.directed {
            system.precondition(&system.r, &mut self.z)?;
            let rho = dot(&system.r, &self.z);
            if rho <= 0.0 {
                return Ok(Advance::Ended(if system.tally.residual == 0.0 {
                    Status::ReachedTolerance
                } else {
                    Status::Breakdown("the preconditioner is not positive definite")
                }));
            }
            let beta = if self.rho > 0.0 { rho / self.rho } else { 0.0 };
            update(&mut self.p, &self.z, |p, z| z + beta * p);
            self.rho = rho;
            self.directed = true;
        }
        system.tally.product(operator, &self.p, &mut system.work)?;
        let curvature = dot(&self.p, &system.work);
        let asymmetry = (dot(&self.z, &system.work) - curvature).abs();
        let length = norm(&system.work);
        let tolerance = symmetry_tolerance(self.noise, system.tally.standard_error(operator), length);
        if asymmetry > tolerance * norm(&self.z) * length {
            return Ok(Advance::Ended(Status::NotSymmetric));
        }
        if curvature <= f64::EPSILON * norm(&self.p) * length {
            return Ok(Advance::Ended(Status::Breakdown("the operator is not positive definite")));
        }
        let alpha = self.rho / curvature;
        axpy(alpha, &self.p, &mut system.x);
        axpy(-alpha, &system.work, &mut system.r);
        self.directed = false;
        let residual = norm(&system.r);
        system.note(residual);
        Ok(Advance::Continuing)
    }

    fn system(&self) -> &System {
        &self.system
    }
}
