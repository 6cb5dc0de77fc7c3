//! Least squares by bidiagonalization: LSMR.

use super::super::stats::Status;
use super::super::vectors::{axpy, update};
use super::bidiagonal::{Bidiagonal, Half};
use super::minres::LEAST_SQUARES;
use super::rotation::rotation;
use super::system::Tally;
use super::{Advance, SolveOptions, Solver};
use crate::error::Result;
use crate::operator::Adjoint;

/// LSMR: solves `min ‖b − A x‖₂` for `A` of any shape, `rows × cols`; each step minimizes `‖Aᵀ r‖`.
///
/// With a symmetric positive definite `M` it is LSMR on `C = A M⁻¹`, which minimizes `‖M⁻¹ Aᵀ r‖` instead;
/// the residual that is reported is the true one.
///
/// # Properties
/// Equal to MINRES on the normal equations. Both `‖Aᵀ r‖` and `‖r‖` fall monotonically. It takes one product
/// with `Aᵀ` first, then two an iteration, `A v` and `Aᵀ u`; the iterate moves with the second. Ends where
/// `‖Aᵀ r‖` vanishes: at the least-squares solution nearest to the first iterate.
///
/// # Storage
/// `b`, `r`, `u` and a product of length `rows`; `x`, the best `x`, `v`, two directions and a product of
/// length `cols`, and with a preconditioner `M⁻¹ v`.
///
/// # References
/// Fong and Saunders (2011), doi:10.1137/10079687X; variables are named as there.
#[derive(Clone)]
pub struct Lsmr {
    process: Bidiagonal,
    h: Vec<f64>,
    h_bar: Vec<f64>,
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

/// The recurrence for `‖r_k‖` that does not need `r_k`: section 5 of Fong and Saunders.
#[derive(Clone, Copy)]
struct ResidualNorm {
    beta_dd: f64,
    beta_d: f64,
    rho_d: f64,
    tau: f64,
    theta: f64,
}

impl ResidualNorm {
    /// The next `‖r‖`: with `β̂ = c β̈`, `β̈ ← −s β̈`, `θ̄`, `ρ̄`, `ζ_{k−1}` and `ζ_k` of this iteration.
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
    /// The state before the first step, for `b` of length `rows` and `x` of length `cols`. Reads `x0` and
    /// `preconditioner` of the options.
    ///
    /// # Errors
    /// As [`Cg::new`](super::Cg::new).
    pub fn new(cols: usize, b: &[f64], options: &SolveOptions) -> Result<Self> {
        Ok(Self {
            process: Bidiagonal::new("LSMR", cols, b, options)?,
            h: vec![0.0; cols],
            h_bar: vec![0.0; cols],
            alpha_bar: 0.0,
            zeta_bar: 0.0,
            zeta: 0.0,
            rho: 1.0,
            rho_bar: 1.0,
            c_bar: 1.0,
            s_bar: 0.0,
            norm: ResidualNorm { beta_dd: 0.0, beta_d: 0.0, rho_d: 1.0, tau: 0.0, theta: 0.0 },
        })
    }
}

impl Solver for Lsmr {
    fn step(&mut self, operator: &mut dyn Adjoint) -> Result<Advance> {
        let half = self.process.advance(operator)?;
        let (alpha, beta) = (self.process.alpha, self.process.beta);
        match half {
            Half::Residual | Half::Forward => return Ok(Advance::Continuing),
            Half::First => {
                self.h.copy_from_slice(self.process.direction());
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
        update(&mut self.h_bar, &self.h, |bar, h| h - back * bar);
        axpy(zeta / (rho * rho_bar), &self.h_bar, &mut self.process.system.x);
        let ratio = theta_next / rho;
        update(&mut self.h, self.process.direction(), |h, v| v - ratio * h);
        (self.rho, self.rho_bar, self.zeta, self.c_bar, self.s_bar) = (rho, rho_bar, zeta, c_bar, s_bar);
        let residual = self.norm.advance((c, s), theta_bar, rho_bar, (zeta_old, zeta));
        self.process.system.note(residual);
        // |ζ̄| = ‖Cᵀ r‖
        let done = self.zeta_bar.abs() <= LEAST_SQUARES * self.process.scale * residual || alpha == 0.0;
        Ok(if done { Advance::Ended(Status::LeastSquares) } else { Advance::Continuing })
    }

    fn tally(&self) -> Tally {
        self.process.system.tally()
    }

    fn solution(&self) -> Vec<f64> {
        self.process.system.best()
    }
}
