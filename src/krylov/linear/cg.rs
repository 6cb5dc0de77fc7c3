//! The conjugate gradient method.

use std::sync::Arc;

use super::system::{System, Tally, declared_symmetric, square};
use super::{Advance, SolveOptions, Solver, precondition, refuse_left, require_positive_definite};
use crate::error::Result;
use crate::krylov::basis::{axpy, dot, norm, update};
use crate::krylov::completeness::Status;
use crate::krylov::precondition::Preconditioner;
use crate::operator::Adjoint;

/// Conjugate gradients: solves `A x = b` for a symmetric positive definite `A` of `n × n`.
///
/// With a symmetric positive definite `M` it is conjugate gradients on `M^-½ A M^-½`, without computing the
/// roots.
///
/// # Properties
/// `‖x − A⁻¹b‖_A` falls monotonically. `‖r‖` may rise, so the best iterate is returned. One product a step.
/// Ends with [`Status::Breakdown`] when a curvature `pᵀAp ≤ 0` shows that `A` is not positive definite, and
/// with [`Status::NotSymmetric`] when `zᵀAp ≠ pᵀAp` (in exact arithmetic `p` and the direction before it are
/// conjugate).
///
/// # Storage
/// Seven `n`-vectors: `b, x`, the best `x`, `r, z, p` and `A p`.
///
/// # References
/// Hestenes and Stiefel (1952), doi:10.6028/jres.049.044.
#[derive(Clone)]
pub struct Cg {
    system: System,
    preconditioner: Option<Arc<dyn Preconditioner>>,
    /// `M⁻¹ r`.
    z: Vec<f64>,
    p: Vec<f64>,
    /// `rᵀ z` of the step before; 0 at the start.
    rho: f64,
    /// Whether `p` was computed from the current residual.
    directed: bool,
    /// The relative noise of a product, from the options.
    noise: f64,
}

impl Cg {
    /// The state before the first step, for `b` of length `n`. Reads `x0`, `preconditioner` and, to judge
    /// symmetry, `noise` of the options.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) when lengths differ,
    /// [`Error::Numerical`](crate::Error::Numerical) for NaN, [`Error::Option`](crate::Error::Option) for a
    /// preconditioner that is not positive definite or an impossible option.
    pub fn new(b: &[f64], options: &SolveOptions) -> Result<Self> {
        require_positive_definite("CG", options)?;
        refuse_left("CG", options)?;
        let n = b.len();
        Ok(Self {
            system: System::new(n, b, options)?,
            preconditioner: options.preconditioner.clone(),
            z: vec![0.0; n],
            p: vec![0.0; n],
            rho: 0.0,
            directed: false,
            noise: options.noise,
        })
    }
}

/// The departure from symmetry that is tolerated in `uᵀ A v`, relative to `‖u‖ ‖A v‖`, where the product with `v` was
/// just taken and has this standard error and this length. Rounding causes departures of 1e-16 times a growth that stays small before
/// convergence, so anything above 1e-6 is not rounding. Noise causes departures of the size of the noise.
pub(super) fn symmetry_tolerance(noise: f64, error: f64, length: f64) -> f64 {
    (10.0 * noise.max(error / length)).max(1e-6)
}

impl Solver for Cg {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let system = &mut self.system;
        system.fits(operator)?;
        square(system.b.len(), system.x.len())?;
        declared_symmetric("CG", operator)?;
        if system.pending {
            system.first_residual(operator)?;
            return Ok(Advance::Continuing);
        }
        if !self.directed {
            precondition(self.preconditioner.as_ref(), &system.r, &mut self.z)?;
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

    fn tally(&self) -> Tally {
        self.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.system.best()
    }
}
