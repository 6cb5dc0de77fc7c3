//! What a solver is asked for, as a plain value.

use std::fmt;
use std::sync::Arc;

use super::super::boxed::Surrogate;
use super::super::precondition::Preconditioner;
use crate::error::{Error, Result};

/// On which side GMRES has its preconditioner. (CG and MINRES split theirs, which keeps the operator symmetric; CGS,
/// BiCGStab and FGMRES have it on the right.)
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// `A M⁻¹ u = b`, `x = M⁻¹ u`: the residual that is minimized is the true one.
    #[default]
    Right,
    /// `M⁻¹ A x = M⁻¹ b`: minimizes `‖M⁻¹ r‖`.
    Left,
}

/// What a solver of `A x = b` is asked for. The defaults: 50 products, `x_0 = 0`, no preconditioner, the box [0, 1].
#[derive(Clone)]
pub struct SolveOptions {
    /// How many products at most, of `A` and `Aᵀ` together. Default 50.
    pub products: usize,
    /// Done when `‖b − A x‖ ≤ rtol ‖b‖ + atol`. Default 1e-6; 0 asks for all that the budget gives.
    pub rtol: f64,
    /// See `rtol`. Default 0.
    pub atol: f64,
    /// The relative noise `δ` of a product: what it returns is within `δ ‖A v‖` of `A v`. Going on below
    /// `‖b − A x‖ ≤ δ ‖b‖` fits noise, so the method stops there (the discrepancy principle: Morozov (1966);
    /// Simoncini and Szyld (2003), doi:10.1137/S1064827502406415, for products that are inexact). Default 0.
    pub noise: f64,
    /// The first iterate, of length `cols`; its residual takes a product. Default `None`: zero, whose residual is `b`
    /// (inside a box: `clip(b / diagonal)`).
    pub x0: Option<Vec<f64>>,
    /// `M⁻¹`. Default none.
    pub preconditioner: Option<Arc<dyn Preconditioner>>,
    /// Where GMRES puts it. Default right.
    pub side: Side,
    /// GMRES and FGMRES start afresh after so many products. Default `None`: never within the budget.
    pub restart: Option<usize>,
    /// The box's lower bound (α of the paper's [α, 1]). Default 0. Only for methods inside a box.
    pub lower: f64,
    /// The box's upper bound. Default 1.
    pub upper: f64,
    /// `D`, of length `n`, by which methods inside a box scale their steps: `A 1`, the white photo. Default `None`:
    /// they take it by themselves, for one product.
    pub diagonal: Option<Vec<f64>>,
    /// What krylov-box takes the operator for where no product has told of it yet. Default none: a multiple of `D`.
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

    /// Refuses values that no method can work with.
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
