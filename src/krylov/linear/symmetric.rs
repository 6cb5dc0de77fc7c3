//! CG and MINRES, for symmetric operators.

use super::system::{System, rotation};
use super::{Advance, Recurrence, SolveOptions, Solver, ended};
use crate::error::Result;
use crate::krylov::basis::{axpy, dot, norm, update, update2};
use crate::krylov::completeness::Status;
use crate::operator::Adjoint;

/// Conjugate gradients: solves `A x = b` for a symmetric positive definite `A` of `n × n`.
///
/// With a symmetric positive definite `M`, the method is conjugate gradients on `M^-½ A M^-½`, without computing the roots.
///
/// `‖x − A⁻¹b‖_A` falls monotonically. `‖r‖` may rise, so the best iterate is returned. A step takes one product. The method ends with
/// [`Status::Breakdown`] if a curvature `pᵀAp ≤ 0` shows that `A` is not positive definite. It ends with [`Status::NotSymmetric`] if
/// `zᵀAp ≠ pᵀAp` (in exact arithmetic `p` and the previous direction are conjugate). The method stores seven `n`-vectors: `b, x`, the best
/// `x`, `r, z, p` and `A p`.
///
/// References: Hestenes and Stiefel (1952), doi:10.6028/jres.049.044.
pub struct Cg {
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
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let n = b.len();
        let system = System::split("CG", true, n, b, options)?;
        let recurrence =
            Self { z: vec![0.0; n], p: vec![0.0; n], rho: 0.0, directed: false, noise: options.noise };
        Ok(Solver::new(system, recurrence).symmetric("CG"))
    }
}

/// The tolerated asymmetry of `uᵀ A v`, relative to `‖u‖ ‖A v‖`. `error` and `length` are the standard error and the length of the last
/// product `A v`. Rounding causes an asymmetry of 1e-16 times a growth factor that stays small before convergence, so an asymmetry above
/// 1e-6 is not caused by rounding. Noise causes an asymmetry of the size of the noise.
pub(super) fn symmetry_tolerance(noise: f64, error: f64, length: f64) -> f64 {
    (10.0 * noise.max(error / length)).max(1e-6)
}

impl Recurrence for Cg {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if system.open(operator)? {
            return Ok(Advance::Continuing);
        }
        if !self.directed {
            system.inverse.apply(&system.r, &mut self.z)?;
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
            return ended(Status::NotSymmetric);
        }
        if curvature <= f64::EPSILON * norm(&self.p) * length {
            return ended(Status::Breakdown("the operator is not positive definite"));
        }
        let alpha = self.rho / curvature;
        axpy(alpha, &self.p, &mut system.x);
        axpy(-alpha, &system.work, &mut system.r);
        self.directed = false;
        system.note_residual();
        Ok(Advance::Continuing)
    }
}

/// If `‖A r‖ ≤ 1e-10 ‖A‖ ‖r‖`, no better `x` exists within double precision.
pub(super) const LEAST_SQUARES: f64 = 1e-10;

/// In exact arithmetic the residual never rises. If it rises by more than the rounding of its norm, the Lanczos vectors are no longer
/// orthogonal to the remaining least-squares residual. Further steps would only increase the residual (Choi, Paige and Saunders (2011),
/// doi:10.1137/100787921).
const RISE: f64 = 1e-14;

/// MINRES: solves `min ‖b − A x‖₂` for a symmetric `A` of `n × n`, definite or not.
///
/// With a symmetric positive definite `M`, the method minimizes `‖b − A x‖` in the norm of `M⁻¹`. It is MINRES on `M^-½ A M^-½` without
/// computing the roots, so symmetry is kept. With `M = D`, this scales the system symmetrically.
///
/// `‖r‖` in the norm of `M⁻¹` falls monotonically. Without a preconditioner, this norm is the reported residual. With a preconditioner, the
/// best iterate in the 2-norm is returned. The true residual comes from a recurrence and costs no product. A step takes one product. The
/// method ends where `‖A r‖` vanishes (a least-squares solution of a singular system). It also ends where `v_{j−1}ᵀ A v_j` differs from
/// `β_j` by more than rounding or noise (the operator is not symmetric). The method stores twelve `n`-vectors: `b, x`, the best `x`, `r`,
/// two Lanczos vectors, three preconditioned Lanczos vectors (these two and the next), two directions, and a product.
///
/// References: Paige and Saunders (1975), doi:10.1137/0712047; with preconditioner: Elman, Silvester and Wathen, *Finite Elements and Fast
/// Iterative Solvers*, algorithm 4.1, doi:10.1093/acprof:oso/9780199678792.001.0001. O'Toole and Kutulakos introduce it for light transport
/// compensation in section 6.2, and make all their results of compensation with it (section 8.3).
pub struct Minres {
    /// The previous and the current Lanczos vector, orthonormal in the inner product of `M⁻¹`.
    v_old: Vec<f64>,
    v: Vec<f64>,
    /// `M⁻¹` times `v_old`, times `v`, and times the next Lanczos vector.
    z_old: Vec<f64>,
    z: Vec<f64>,
    z_next: Vec<f64>,
    /// The directions of the two previous steps.
    w_old: Vec<f64>,
    w: Vec<f64>,
    /// `β_j`, and `η`, the signed residual norm in the metric of `M⁻¹`.
    beta: f64,
    eta: f64,
    /// The last two rotations.
    cosines: [f64; 2],
    sines: [f64; 2],
    /// A lower bound of the preconditioned operator's norm.
    scale: f64,
    started: bool,
    /// The relative noise of a product, from the options.
    noise: f64,
}

impl Minres {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0`, `preconditioner` and, to judge symmetry, `noise` of the
    /// options. Fails with the errors of [`Cg::solver`](crate::krylov::linear::Cg::solver).
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let zero = vec![0.0; b.len()];
        let system = System::split("MINRES", true, b.len(), b, options)?;
        let recurrence = Self {
            v_old: zero.clone(),
            v: zero.clone(),
            z_old: zero.clone(),
            z: zero.clone(),
            z_next: zero.clone(),
            w_old: zero.clone(),
            w: zero,
            beta: 0.0,
            eta: 0.0,
            cosines: [1.0; 2],
            sines: [0.0; 2],
            scale: 0.0,
            started: false,
            noise: options.noise,
        };
        Ok(Solver::new(system, recurrence).symmetric("MINRES"))
    }

    /// Makes the first Lanczos vector, which is `r / ‖r‖` in the norm of `M⁻¹`.
    fn start(&mut self, system: &System) -> Result<Option<Status>> {
        system.inverse.apply(&system.r, &mut self.z)?;
        let square = dot(&system.r, &self.z);
        if square <= 0.0 || !square.is_finite() {
            return Ok(Some(if system.tally.residual == 0.0 {
                Status::ReachedTolerance
            } else {
                Status::Breakdown("the preconditioner is not positive definite")
            }));
        }
        let length = square.sqrt();
        self.eta = length;
        update(&mut self.v, &system.r, |_, r| r / length);
        for z in &mut self.z {
            *z /= length;
        }
        self.started = true;
        Ok(None)
    }
}

impl Recurrence for Minres {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        if system.open(operator)? {
            return Ok(Advance::Continuing);
        }
        if !self.started
            && let Some(status) = self.start(system)?
        {
            return Ok(Advance::Ended(status));
        }
        system.tally.product(operator, &self.z, &mut system.work)?;
        let length = norm(&system.work);
        let alpha = dot(&system.work, &self.z);
        let asymmetry =
            if self.beta > 0.0 { (dot(&system.work, &self.z_old) - self.beta).abs() } else { 0.0 };
        let tolerance = symmetry_tolerance(self.noise, system.tally.standard_error(operator), length);
        if asymmetry > tolerance * length * norm(&self.z_old) {
            return ended(Status::NotSymmetric);
        }
        let beta = self.beta;
        update2(&mut system.work, &self.v, &self.v_old, |q, v, old| q - alpha * v - beta * old);
        system.inverse.apply(&system.work, &mut self.z_next)?;
        let square = dot(&system.work, &self.z_next);
        let mut beta_next = square.max(0.0).sqrt();
        if square < -f64::EPSILON * norm(&system.work) * norm(&self.z_next) {
            return ended(Status::Breakdown("the preconditioner is not positive definite"));
        }
        self.scale = self.scale.max(alpha.hypot(beta).hypot(beta_next));
        if beta_next <= f64::EPSILON * 10.0 * self.scale {
            // The subspace is invariant: the next vector consists only of rounding errors.
            beta_next = 0.0;
        }
        let [c1, c0] = self.cosines;
        let [s1, s0] = self.sines;
        let diagonal = c1 * alpha - c0 * s1 * beta;
        // This value times ‖r‖ is ‖A r‖, for the residual r before this step.
        let gradient = diagonal.hypot(c1 * beta_next);
        let (c, s, rho) = rotation(diagonal, beta_next);
        if gradient <= LEAST_SQUARES * self.scale || rho == 0.0 {
            return ended(Status::LeastSquares);
        }
        let above = s1 * alpha + c0 * c1 * beta;
        let far = s0 * beta;
        update2(&mut self.w_old, &self.z, &self.w, |old, z, w| (z - far * old - above * w) / rho);
        std::mem::swap(&mut self.w_old, &mut self.w);
        axpy(c * self.eta, &self.w, &mut system.x);
        self.eta *= -s;
        let eta = self.eta;
        if beta_next > 0.0 {
            update(&mut self.v_old, &system.work, |_, q| q / beta_next);
            update(&mut self.z_old, &self.z_next, |_, z| z / beta_next);
        } else {
            self.v_old.fill(0.0);
            self.z_old.fill(0.0);
        }
        std::mem::swap(&mut self.v_old, &mut self.v);
        std::mem::swap(&mut self.z_old, &mut self.z);
        self.beta = beta_next;
        self.cosines = [c, c1];
        self.sines = [s, s1];
        // r_j = s² r_{j−1} + c η v_{j+1}
        update(&mut system.r, &self.v, |r, v| s * s * r + c * eta * v);
        let before = system.tally.residual;
        let rises = system.note_residual() > before * (1.0 + RISE) && system.inverse.is_identity();
        Ok(if beta_next == 0.0 || rises { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing })
    }
}
