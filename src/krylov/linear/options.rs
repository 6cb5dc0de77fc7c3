//! The options of the solvers.

use std::fmt;
use std::sync::Arc;

use super::super::boxed::Surrogate;
use super::super::precondition::Preconditioner;
use crate::error::{Error, Result};

/// The side of the preconditioner of GMRES. (CG and MINRES split theirs, which keeps the operator symmetric;
/// CGS, BiCGStab, FGMRES, LSQR and LSMR have it on the right.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// `A M⁻¹ u = b`, `x = M⁻¹ u`: minimizes the true residual.
    #[default]
    Right,
    /// `M⁻¹ A x = M⁻¹ b`: minimizes `‖M⁻¹ r‖`.
    Left,
}

/// The options of the solvers of `A x = b`. Each field says which methods read it; the others ignore it
/// unless stated otherwise. By default: 50 products, `x_0 = 0`, no preconditioner, the box [0, 1].
#[derive(Clone)]
pub struct SolveOptions {
    /// The most products, with `A` and `Aᵀ` together. Read by all methods. Default 50.
    pub products: usize,
    /// Done when `‖b − A x‖ ≤ rtol ‖b‖ + atol`. Read by all methods; krylov-box also ends where its model
    /// predicts no gain beyond it. Default 1e-6; 0 uses the whole budget.
    pub rtol: f64,
    /// See `rtol`. Read by all methods. Default 0.
    pub atol: f64,
    /// The relative noise `δ` of a product, which is within `δ ‖A v‖` of `A v`. Steps below
    /// `‖b − A x‖ ≤ δ ‖b‖` would fit noise, so the method stops there (the discrepancy principle: Morozov
    /// (1966); for inexact products: Simoncini and Szyld (2003), doi:10.1137/S1064827502406415). Read by all
    /// methods; CG and MINRES also tolerate this departure from symmetry. For an operator that does not state its
    /// noise: a stated one ([`Operator::standard_errors`](crate::operator::Operator::standard_errors)) counts as
    /// well, unless `rtol` and `atol` are 0. Default 0.
    pub noise: f64,
    /// The first iterate, of length `cols`; its residual takes a product. Read by all methods. Default
    /// `None`: zero, whose residual is `b`, or `b / diagonal` for the methods with bounds, clipped to them.
    pub x0: Option<Vec<f64>>,
    /// `M⁻¹`. Read by CG, MINRES, LSQR and LSMR (`M` must be symmetric positive definite), and by CGS,
    /// BiCGStab, GMRES and FGMRES; the methods with bounds refuse one. Default none.
    pub preconditioner: Option<Arc<dyn Preconditioner>>,
    /// The side of the preconditioner. Read by GMRES; the other methods refuse [`Side::Left`] together with a
    /// preconditioner. Default right.
    pub side: Side,
    /// Products after which the method restarts. Read by GMRES and FGMRES. Default `None`: no restart.
    pub restart: Option<usize>,
    /// The lower bound of the box (α of the paper's [α, 1]). Read by Jacobi, FISTA and krylov-box. Default 0.
    pub lower: f64,
    /// The upper bound of the box. Read by Jacobi, FISTA and krylov-box. Default 1.
    pub upper: f64,
    /// `D = A 1`, the white photo, of length `n`, which scales the steps and the first iterate. Read by
    /// Jacobi, FISTA, krylov-box, MRNSD and the multiplicative method. Default `None`: the method takes it
    /// first, for one product.
    pub diagonal: Option<Vec<f64>>,
    /// The approximation of `A` on directions that no product has explored yet. Read by krylov-box. Default
    /// none: a multiple of `D`.
    pub surrogate: Option<Arc<dyn Surrogate>>,
}

impl Default for SolveOptions {
    fn default() -> Self {
        Self {
            products: 50,
            rtol: 1e-6,
            atol: 0.0,
            noise: 0.0,
            x0: None,
            preconditioner: None,
            side: Side::default(),
            restart: None,
            lower: 0.0,
            upper: 1.0,
            diagonal: None,
            surrogate: None,
        }
    }
}

impl fmt::Debug for SolveOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SolveOptions")
            .field("products", &self.products)
            .field("rtol", &self.rtol)
            .field("atol", &self.atol)
            .field("noise", &self.noise)
            .field("x0", &self.x0.as_ref().map(Vec::len))
            .field("preconditioner", &self.preconditioner.is_some())
            .field("side", &self.side)
            .field("restart", &self.restart)
            .field("lower", &self.lower)
            .field("upper", &self.upper)
            .field("diagonal", &self.diagonal.as_ref().map(Vec::len))
            .field("surrogate", &self.surrogate.is_some())
            .finish()
    }
}

impl SolveOptions {
    /// The residual norm at which the tolerance is reached, for `‖b‖`.
    pub(crate) fn target(&self, rhs_norm: f64) -> f64 {
        self.rtol * rhs_norm + self.atol
    }

    /// Refuses values that no method accepts.
    pub(crate) fn check(&self) -> Result<()> {
        let refuse = |option: &str, fault: String, help: &str| {
            Err(Error::Option { option: option.into(), fault, help: help.into() })
        };
        if self.products == 0 {
            return refuse("--photos", "0 products were asked for".into(), "ask for at least 1");
        }
        for (option, value) in [("rtol", self.rtol), ("atol", self.atol), ("noise", self.noise)] {
            if value.is_nan() || value < 0.0 {
                return refuse(option, format!("{value} is no tolerance"), "give 0 or a positive number");
            }
        }
        if self.restart == Some(0) {
            return refuse("restart", "a cycle of 0 products".into(), "give at least 1, or none");
        }
        if self.lower.is_nan() || self.upper.is_nan() || self.lower >= self.upper {
            let fault = format!("the box [{}, {}] is empty", self.lower, self.upper);
            return refuse("--floor", fault, "the lower bound must be below the upper one");
        }
        Ok(())
    }
}
