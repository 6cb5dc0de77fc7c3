//! CG and MINRES, for symmetric operators.

use super::place::At;
use super::system::{System, rotation};
use super::{Advance, Recurrence, SolveOptions, Solver, ended};
use crate::error::Result;
use crate::krylov::basis::norm;
use crate::krylov::completeness::Status;
use crate::operator::Adjoint;

/// Conjugate gradients: solves `A x = b` for a symmetric positive definite `A` of `n × n`.
///
/// With a symmetric positive definite `M`, the method is conjugate gradients on `M^-½ A M^-½`, without computing the roots.
///
/// `‖x − A⁻¹b‖_A` falls monotonically. `‖r‖` may rise, so the best iterate is returned. A step takes one product. The method ends with
/// [`Status::Breakdown`] if a curvature `pᵀAp ≤ 0` shows that `A` is not positive definite. It ends with [`Status::NotSymmetric`] if
/// `zᵀAp ≠ pᵀAp` (in exact arithmetic `p` and the previous direction are conjugate). The method stores six `n`-vectors: `b, x`, the best
/// `x`, `r, p` and `A p`; with a preconditioner also `M⁻¹ r`.
///
/// References: Hestenes and Stiefel (1952), doi:10.6028/jres.049.044.
#[derive(Default)]
pub struct Cg {
    /// `rᵀ z` of the previous step; 0 at the start.
    rho: f64,
    /// `‖r‖²`, if it is known for the current residual.
    square: Option<f64>,
    /// `‖p‖`, and `‖M⁻¹ r‖`.
    length: f64,
    length_of_z: f64,
    /// True if `p` was computed from the current residual.
    directed: bool,
    /// The relative noise of a product, from the options.
    noise: f64,
}

/// The direction of CG.
const P: At = At::Own(0);
/// `M⁻¹ r`, if there is a preconditioner.
const Z: At = At::Own(1);

impl Cg {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0`, `preconditioner` and, to judge symmetry, `noise` of the
    /// options.
    ///
    /// # Errors
    /// [`Error::Dimension`](crate::Error::Dimension) if lengths differ, [`Error::Numerical`](crate::Error::Numerical) for NaN,
    /// [`Error::Option`](crate::Error::Option) for a preconditioner that is not positive definite or an impossible option.
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let system = System::split("CG", true, b.len(), b, options)?;
        let recurrence = Self { noise: options.noise, ..Self::default() };
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
        let is_plain = system.inverse.is_identity();
        if system.begin(operator, [0, if is_plain { 1 } else { 2 }])? {
            return Ok(Advance::Continuing);
        }
        let z = if is_plain { At::R } else { Z };
        if !self.directed {
            system.preconditioned(At::R, Z)?;
            let rho = match self.square.filter(|_| is_plain) {
                Some(square) => square,
                None => system.inner(At::R, z)?,
            };
            if rho <= 0.0 {
                return Ok(Advance::Ended(if system.tally.residual == 0.0 {
                    Status::ReachedTolerance
                } else {
                    Status::Breakdown("the preconditioner is not positive definite")
                }));
            }
            let beta = if self.rho > 0.0 { rho / self.rho } else { 0.0 };
            self.length_of_z = if is_plain { system.tally.residual } else { system.length(Z)? };
            system.combine(At::Work, &[(1.0, z), (beta, P)], 1.0)?;
            self.length = system.dots([])?.norm;
            system.keep(P)?;
            self.rho = rho;
            self.directed = true;
        }
        let product = system.multiply(operator, (P, self.length), [P, z])?;
        let [curvature, with_z] = product.with;
        let asymmetry = (with_z - curvature).abs();
        let length = product.norm;
        let tolerance = symmetry_tolerance(self.noise, system.tally.standard_error(operator), length);
        if asymmetry > tolerance * self.length_of_z * length {
            return ended(Status::NotSymmetric);
        }
        if curvature <= f64::EPSILON * self.length * length {
            return ended(Status::Breakdown("the operator is not positive definite"));
        }
        let alpha = self.rho / curvature;
        self.directed = false;
        system.combine(At::Work, &[(1.0, At::R), (-alpha, At::Work)], 1.0)?;
        let residual = system.dots([])?;
        self.square = Some(residual.square);
        system.keep(At::R)?;
        system.accept((alpha, P), residual.norm)?;
        Ok(Advance::Continuing)
    }

    fn leave(&mut self, system: &mut System) {
        if system.leave() {
            *self = Self { noise: self.noise, ..Self::default() };
        }
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
/// `‖r‖` in the norm of `M⁻¹` falls monotonically, unless the memory of the operator fails. Without a preconditioner, this norm is the
/// reported residual. With a preconditioner, the best iterate in the 2-norm is returned. The true residual comes from a recurrence and
/// costs no product. A step takes one product. The method ends where `‖A r‖` vanishes (a least-squares solution of a singular system). It
/// also ends where `v_{j−1}ᵀ A v_j` differs from `β_j` by more than rounding or noise (the operator is not symmetric). The method stores
/// nine `n`-vectors: `b, x`, the best `x`, `r`, two Lanczos vectors, two directions, and a product; with a preconditioner also three
/// preconditioned Lanczos vectors.
///
/// References: Paige and Saunders (1975), doi:10.1137/0712047; with preconditioner: Elman, Silvester and Wathen, *Finite Elements and Fast
/// Iterative Solvers*, algorithm 4.1, doi:10.1093/acprof:oso/9780199678792.001.0001. O'Toole and Kutulakos introduce it for light transport
/// compensation in section 6.2, and make all their results of compensation with it (section 8.3).
pub struct Minres {
    /// `β_j`, and `η`, the signed residual norm in the metric of `M⁻¹`.
    beta: f64,
    eta: f64,
    /// The last two rotations.
    cosines: [f64; 2],
    sines: [f64; 2],
    /// The norms of `M⁻¹ v` for the current and the previous Lanczos vector.
    lengths: [f64; 2],
    /// A lower bound of the preconditioned operator's norm.
    scale: f64,
    started: bool,
    /// The relative noise of a product, from the options.
    noise: f64,
}

/// The current and the previous Lanczos vector, orthonormal in the inner product of `M⁻¹`.
const V: [At; 2] = [At::Own(0), At::Own(1)];
/// The directions of the two previous steps, the later one first.
const W: [At; 2] = [At::Own(2), At::Own(3)];
/// `M⁻¹` times the Lanczos vectors, and times the next one, if there is a preconditioner.
const MV: [At; 2] = [At::Own(4), At::Own(5)];
const MV_NEXT: At = At::Own(6);

impl Minres {
    /// Makes the state before the first step, for `b` of length `n`. Reads `x0`, `preconditioner` and, to judge symmetry, `noise` of the
    /// options. Fails with the errors of [`Cg::solver`](crate::krylov::linear::Cg::solver).
    pub fn solver(b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let system = System::split("MINRES", true, b.len(), b, options)?;
        Ok(Solver::new(system, Self::new(options.noise)).symmetric("MINRES"))
    }

    fn new(noise: f64) -> Self {
        let (cosines, sines, lengths) = ([1.0; 2], [0.0; 2], [1.0; 2]);
        Self { beta: 0.0, eta: 0.0, cosines, sines, lengths, scale: 0.0, started: false, noise }
    }

    /// Makes the first Lanczos vector, which is `r / ‖r‖` in the norm of `M⁻¹`.
    fn start(&mut self, system: &mut System) -> Result<Option<Status>> {
        let z = system.preconditioned(At::R, MV[0])?;
        let square = system.inner(At::R, z)?;
        if square <= 0.0 || !square.is_finite() {
            return Ok(Some(if system.tally.residual == 0.0 {
                Status::ReachedTolerance
            } else {
                Status::Breakdown("the preconditioner is not positive definite")
            }));
        }
        let length = square.sqrt();
        system.combine(V[0], &[(1.0, At::R)], length)?;
        if z == MV[0] {
            system.combine(z, &[(1.0, z)], length)?;
            self.lengths[0] = system.length(z)?;
        }
        self.eta = length;
        self.started = true;
        Ok(None)
    }

    /// Makes the next Lanczos vector from `w`, and its image from `image`, both of length `β`. Returns the norm of the image.
    fn next_vector(system: &mut System, image: At, beta: f64) -> Result<f64> {
        // A vector of length 0 holds only rounding errors, and the space is invariant.
        let (factor, divisor) = if beta > 0.0 { (1.0, beta) } else { (0.0, 1.0) };
        system.combine(V[1], &[(factor, At::Work)], divisor)?;
        if image != MV_NEXT {
            return Ok(1.0);
        }
        system.combine(MV[1], &[(factor, image)], divisor)?;
        system.length(MV[1])
    }
}

impl Recurrence for Minres {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        let is_plain = system.inverse.is_identity();
        if system.begin(operator, [0, if is_plain { 4 } else { 7 }])? {
            return Ok(Advance::Continuing);
        }
        if !self.started
            && let Some(status) = self.start(system)?
        {
            return Ok(Advance::Ended(status));
        }
        let [z, z_old] = if is_plain { V } else { MV };
        let product = system.multiply(operator, (z, self.lengths[0]), [z, z_old])?;
        let [alpha, with_old] = product.with;
        let beta = self.beta;
        let asymmetry = if beta > 0.0 { (with_old - beta).abs() } else { 0.0 };
        let error = system.tally.standard_error(operator);
        let tolerance = symmetry_tolerance(self.noise, error, product.norm);
        if asymmetry > tolerance * product.norm * self.lengths[1] {
            return ended(Status::NotSymmetric);
        }
        system.combine(At::Work, &[(1.0, At::Work), (-alpha, V[0]), (-beta, V[1])], 1.0)?;
        let image = system.preconditioned(At::Work, MV_NEXT)?;
        let rest = system.dots([image])?;
        let [square] = rest.with;
        let mut beta_next = square.max(0.0).sqrt();
        // A diagonal preconditioner, which need not be on the host, is positive definite.
        if square < 0.0 && square < -f64::EPSILON * rest.norm * norm(system.host(image)) {
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
        let length = Self::next_vector(system, image, beta_next)?;
        system.combine(W[1], &[(1.0, z), (-far, W[1]), (-above, W[0])], rho)?;
        system.exchange(W[0], W[1]);
        system.exchange(V[0], V[1]);
        if !is_plain {
            system.exchange(MV[0], MV[1]);
        }
        let moved = c * self.eta;
        self.eta *= -s;
        self.beta = beta_next;
        self.lengths = [length, self.lengths[0]];
        self.cosines = [c, c1];
        self.sines = [s, s1];
        // r_j = s² r_{j−1} + c η v_{j+1}
        system.combine(At::Work, &[(s * s, At::R), (c * self.eta, V[0])], 1.0)?;
        let residual = system.dots([])?.norm;
        system.keep(At::R)?;
        let rises = residual > system.tally.residual * (1.0 + RISE) && is_plain;
        system.accept((moved, W[0]), residual)?;
        Ok(if beta_next == 0.0 || rises { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing })
    }

    fn leave(&mut self, system: &mut System) {
        if system.leave() {
            *self = Self::new(self.noise);
        }
    }
}
