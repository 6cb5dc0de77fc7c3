//! LSQR and LSMR: least squares by Golub–Kahan bidiagonalization, one product per step.

use super::place::At;
use super::symmetric::LEAST_SQUARES;
use super::system::{System, rotation};
use super::{Advance, Recurrence, SolveOptions, Solver, ended};
use crate::error::Result;
use crate::krylov::completeness::Status;
use crate::operator::Adjoint;

/// The left vector `u`.
const U: At = At::Own(0);
/// The right vector `v`.
const V: At = At::Own(1);
/// The first direction of a method.
const H: At = At::Own(2);
/// The second direction of LSMR.
const H_BAR: At = At::Own(3);

/// The factorization `C V = U B`, `Cᵀ U = V Bᵀ + α v eᵀ` for `C = A M⁻¹`. `B` is lower bidiagonal, with `α_k` on its diagonal and `β_{k+1}`
/// below the diagonal. The process starts from the residual of the system.
///
/// References: Golub and Kahan (1965), doi:10.1137/0702016.
struct Bidiagonal {
    /// The number of vectors of the method of length `cols`, and after them the place of `M⁻¹ v`.
    own: usize,
    alpha: f64,
    beta: f64,
    /// `‖B‖_F` so far: a lower bound of `‖C‖_F`.
    scale: f64,
    next: Next,
}

#[derive(Clone, Copy, PartialEq)]
enum Next {
    Start,
    Adjoint,
    Forward,
}

/// The product that a step took.
#[derive(Clone, Copy, PartialEq)]
enum Half {
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
    /// Makes the process before its first step, for a method with this number of directions.
    fn new(directions: usize) -> Self {
        Self { own: 1 + directions, alpha: 0.0, beta: 0.0, scale: 0.0, next: Next::Start }
    }

    /// `M⁻¹ v`, of length `cols`: the direction in which the iterate moves.
    fn direction(&self, system: &System) -> At {
        if system.inverse.is_identity() { V } else { At::Own(1 + self.own) }
    }

    /// Takes one product. If a vector vanishes (to rounding), it is set to zero, together with its `α` or `β`.
    fn advance(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Half> {
        let direction = self.direction(system);
        let own = if direction == V { self.own } else { self.own + 1 };
        if system.begin(operator, [1, own])? {
            return Ok(Half::Residual);
        }
        if self.next == Next::Start {
            self.beta = system.length(At::R)?;
            if self.beta > 0.0 {
                system.combine(U, &[(1.0, At::R)], self.beta)?;
            }
            self.next = Next::Adjoint;
        }
        if self.next == Next::Forward {
            system.multiply(operator, (direction, 1.0), [])?;
            system.combine(At::Work, &[(1.0, At::Work), (-self.alpha, U)], 1.0)?;
            self.beta = self.normalize(system, U, self.alpha)?;
            self.next = Next::Adjoint;
            return Ok(Half::Forward);
        }
        system.multiply_adjoint(operator, U)?;
        let half = if self.alpha == 0.0 { Half::First } else { Half::Adjoint };
        // Before the first product, both α and v are 0.
        let beta = if half == Half::First { 0.0 } else { self.beta };
        let image = system.preconditioned(At::Work, direction)?;
        system.combine(At::Work, &[(1.0, image), (-beta, V)], 1.0)?;
        self.alpha = self.normalize(system, V, beta)?;
        system.preconditioned(V, direction)?;
        self.next = Next::Forward;
        Ok(half)
    }

    /// `to ← w/‖w‖`, or 0 if `w` vanishes. Returns the norm.
    fn normalize(&mut self, system: &mut System, to: At, other: f64) -> Result<f64> {
        let length = system.dots([])?.norm;
        self.scale = self.scale.hypot(length);
        let vanishes = length <= 10.0 * f64::EPSILON * other.abs().max(self.scale);
        let (share, length, divisor) = if vanishes { (0.0, 0.0, 1.0) } else { (1.0, length, length) };
        system.combine(to, &[(share, At::Work)], divisor)?;
        Ok(length)
    }
}

/// LSQR: solves `min ‖b − A x‖₂` for `A` of any shape, `rows × cols`. Among several solutions, it finds the nearest to the first iterate.
///
/// With a symmetric positive definite `M`, the method is LSQR on `A M⁻¹`. It then still minimizes the true residual, and finds the solution
/// that is nearest to the first iterate in the norm of `M²`.
///
/// LSQR is mathematically equal to conjugate gradients on the normal equations, but more stable. `‖r‖` falls monotonically. LSQR first
/// takes one product with `Aᵀ`, and then two products per iteration, `A v` and `Aᵀ u`. The iterate changes after the product `A v`. LSQR
/// ends where `‖Aᵀ r‖` vanishes (a least-squares solution). It stores `b`, `r`, `u` and a product of length `rows`; `x`, the best `x`, `v`
/// and a direction of length `cols`; with a preconditioner also `M⁻¹ v`.
///
/// References: Paige and Saunders (1982), doi:10.1145/355984.355989.
pub struct Lsqr {
    process: Bidiagonal,
    /// `φ̄`, the residual norm with its sign, and `ρ̄`.
    phi: f64,
    rho: f64,
    /// `θ / ρ` for the next direction.
    ratio: f64,
    cosine: f64,
}

impl Lsqr {
    /// Makes the state before the first step, for `b` of length `rows` and `x` of length `cols`. Reads `x0` and `preconditioner` of the
    /// options. Fails with the errors of [`Cg::solver`](crate::krylov::linear::Cg::solver).
    pub fn solver(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let system = System::split("LSQR", true, cols, b, options)?;
        Ok(Solver::new(system, Self::default()))
    }
}

impl Default for Lsqr {
    fn default() -> Self {
        Self { process: Bidiagonal::new(1), phi: 0.0, rho: 0.0, ratio: 0.0, cosine: 0.0 }
    }
}

impl Recurrence for Lsqr {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        let half = self.process.advance(system, operator)?;
        let (alpha, beta) = (self.process.alpha, self.process.beta);
        let direction = self.process.direction(system);
        match half {
            Half::Residual => return Ok(Advance::Continuing),
            Half::Forward => {
                let (c, s, rho) = rotation(self.rho, beta);
                if rho == 0.0 {
                    return ended(Status::LeastSquares);
                }
                let moved = c * self.phi / rho;
                self.phi *= s;
                self.cosine = c;
                self.ratio = s / rho;
                // r_k = s² r_{k−1} − φ̄ c u_{k+1}, with the new φ̄.
                system.combine(At::Work, &[(s * s, At::R), (-c * self.phi, U)], 1.0)?;
                let residual = system.dots([])?.norm;
                system.keep(At::R)?;
                system.accept((moved, H), residual)?;
                let done = self.phi.abs() <= f64::EPSILON * system.tally.rhs_norm;
                return Ok(if done { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing });
            }
            Half::First => {
                self.phi = beta;
                self.rho = alpha;
                system.combine(H, &[(1.0, direction)], 1.0)?;
            }
            Half::Adjoint => {
                // ‖Cᵀ r‖ = φ̄ α c
                if alpha * self.cosine.abs() <= LEAST_SQUARES * self.process.scale {
                    return ended(Status::LeastSquares);
                }
                let ratio = self.ratio * alpha;
                system.combine(H, &[(1.0, direction), (-ratio, H)], 1.0)?;
                self.rho = -self.cosine * alpha;
            }
        }
        Ok(if alpha == 0.0 { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing })
    }

    fn leave(&mut self, system: &mut System) {
        if system.leave() {
            *self = Self::default();
        }
    }
}

/// LSMR: solves `min ‖b − A x‖₂` for `A` of any shape, `rows × cols`. Each step minimizes `‖Aᵀ r‖`.
///
/// With a symmetric positive definite `M`, the method is LSMR on `C = A M⁻¹`, which minimizes `‖M⁻¹ Aᵀ r‖` instead. The reported residual
/// is the true residual.
///
/// LSMR is mathematically equal to MINRES on the normal equations. Both `‖Aᵀ r‖` and `‖r‖` fall monotonically. LSMR first takes one product
/// with `Aᵀ`, and then two products per iteration, `A v` and `Aᵀ u`. The iterate changes after the product `Aᵀ u`. LSMR ends where `‖Aᵀ r‖`
/// vanishes, at the least-squares solution nearest to the first iterate. It stores `b`, `r`, `u` and a product of length `rows`; `x`, the
/// best `x`, `v` and two directions of length `cols`; with a preconditioner also `M⁻¹ v`.
///
/// References: Fong and Saunders (2011), doi:10.1137/10079687X. The variables here have the names used in that paper.
pub struct Lsmr {
    process: Bidiagonal,
    alpha_bar: f64,
    zeta_bar: f64,
    zeta: f64,
    rho: f64,
    rho_bar: f64,
    c_bar: f64,
    s_bar: f64,
    /// `‖r‖`, from a recurrence of scalars.
    norm: ResidualNorm,
}

/// A recurrence for `‖r_k‖` that does not need `r_k` (section 5 of Fong and Saunders).
#[derive(Clone, Copy)]
struct ResidualNorm {
    beta_dd: f64,
    beta_d: f64,
    rho_d: f64,
    tau: f64,
    theta: f64,
}

impl ResidualNorm {
    /// Computes the next `‖r‖`, with `β̂ = c β̈`, `β̈ ← −s β̈`, `θ̄`, `ρ̄`, `ζ_{k−1}` and `ζ_k` of this iteration.
    fn advance(&mut self, (c, s): (f64, f64), theta_bar: f64, rho_bar: f64, zetas: (f64, f64)) -> f64 {
        let beta_hat = c * self.beta_dd;
        self.beta_dd *= -s;
        let theta_old = self.theta;
        let (ct, st, rho_tilde) = rotation(self.rho_d, theta_bar);
        self.theta = st * rho_bar;
        self.rho_d = ct * rho_bar;
        self.beta_d = -st * self.beta_d + ct * beta_hat;
        self.tau = (zetas.0 - theta_old * self.tau) / rho_tilde;
        let tau_d = (zetas.1 - self.theta * self.tau) / self.rho_d;
        (self.beta_d - tau_d).hypot(self.beta_dd)
    }
}

impl Lsmr {
    /// Makes the state before the first step, for `b` of length `rows` and `x` of length `cols`. Reads `x0` and `preconditioner` of the
    /// options. Fails with the errors of [`Cg::solver`](crate::krylov::linear::Cg::solver).
    pub fn solver(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Solver> {
        let system = System::split("LSMR", true, cols, b, options)?;
        Ok(Solver::new(system, Self::default()))
    }
}

impl Default for Lsmr {
    fn default() -> Self {
        Self {
            process: Bidiagonal::new(2),
            alpha_bar: 0.0,
            zeta_bar: 0.0,
            zeta: 0.0,
            rho: 1.0,
            rho_bar: 1.0,
            c_bar: 1.0,
            s_bar: 0.0,
            norm: ResidualNorm { beta_dd: 0.0, beta_d: 0.0, rho_d: 1.0, tau: 0.0, theta: 0.0 },
        }
    }
}

impl Recurrence for Lsmr {
    fn step(&mut self, system: &mut System, operator: &mut dyn Adjoint) -> Result<Advance> {
        let half = self.process.advance(system, operator)?;
        let (alpha, beta) = (self.process.alpha, self.process.beta);
        let direction = self.process.direction(system);
        match half {
            Half::Residual | Half::Forward => return Ok(Advance::Continuing),
            Half::First => {
                system.combine(H, &[(1.0, direction)], 1.0)?;
                self.alpha_bar = alpha;
                self.zeta_bar = alpha * beta;
                self.norm.beta_dd = beta;
                let done = alpha == 0.0;
                return Ok(if done { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing });
            }
            Half::Adjoint => {}
        }
        let rho_old = self.rho;
        let (c, s, rho) = rotation(self.alpha_bar, beta);
        let theta_next = s * alpha;
        self.alpha_bar = c * alpha;
        let rho_bar_old = self.rho_bar;
        let zeta_old = self.zeta;
        let theta_bar = self.s_bar * rho;
        let (c_bar, s_bar, rho_bar) = rotation(self.c_bar * rho, theta_next);
        let zeta = c_bar * self.zeta_bar;
        self.zeta_bar *= -s_bar;
        let back = theta_bar * rho / (rho_old * rho_bar_old);
        system.combine(H_BAR, &[(1.0, H), (-back, H_BAR)], 1.0)?;
        (self.rho, self.rho_bar, self.zeta, self.c_bar, self.s_bar) = (rho, rho_bar, zeta, c_bar, s_bar);
        let residual = self.norm.advance((c, s), theta_bar, rho_bar, (zeta_old, zeta));
        system.accept((zeta / (rho * rho_bar), H_BAR), residual)?;
        system.combine(H, &[(1.0, direction), (-theta_next / rho, H)], 1.0)?;
        // |ζ̄| = ‖Cᵀ r‖
        let done = self.zeta_bar.abs() <= LEAST_SQUARES * self.process.scale * residual || alpha == 0.0;
        Ok(if done { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing })
    }

    fn leave(&mut self, system: &mut System) {
        if system.leave() {
            *self = Self::default();
        }
    }
}
