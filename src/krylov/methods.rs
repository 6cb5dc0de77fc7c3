//! All methods for `A x = b` as a table, and one call for any of them.

use super::boxed::{Fista, KrylovBox, Mrnsd, Multiplicative, ProjectedJacobi};
use super::linear::system::square;
use super::linear::{
    BiCgStab, Cg, Cgs, ForwardOnly, Gmres, Lsmr, Lsqr, Minres, Solution, SolveOptions, Solver, solve_from,
};
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Operator};

/// A method for `A x = b`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// [`Minres`].
    Minres,
    /// [`Gmres`].
    Gmres,
    /// [`Gmres::flexible`].
    Fgmres,
    /// [`Cg`].
    Cg,
    /// [`Cgs`].
    Cgs,
    /// [`BiCgStab`].
    BiCgStab,
    /// [`Lsqr`].
    Lsqr,
    /// [`Lsmr`].
    Lsmr,
    /// [`ProjectedJacobi`].
    Jacobi,
    /// [`Fista`].
    Fista,
    /// [`KrylovBox`].
    #[serde(rename = "krylov-box")]
    KrylovBox,
    /// [`Mrnsd`].
    Mrnsd,
    /// [`Multiplicative`].
    Multiplicative,
}

/// The constraint that all iterates of a method satisfy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// None.
    None,
    /// `x ≥ 0`.
    NonNegative,
    /// `lower ≤ x ≤ upper`.
    Box,
}

/// The needs, storage and cost of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MethodFacts {
    /// The method.
    pub method: Method,
    /// Its name on the command line.
    pub name: &'static str,
    /// Whether it takes products with `Aᵀ`. (For a symmetric operator they are products with `A`.)
    pub needs_transpose: bool,
    /// Whether it refuses an operator that is not symmetric.
    pub needs_symmetry: bool,
    /// The constraint on its iterates.
    pub constraint: Constraint,
    /// Vectors of length `n` that it stores, right-hand side and solution included: a fixed number …
    pub images: usize,
    /// … and the number that each product adds.
    pub images_per_product: usize,
    /// Products before the first iteration, from the default start (with [`SolveOptions::diagonal`] for the
    /// methods with bounds).
    pub products_to_start: usize,
    /// Products per iteration.
    pub products_per_iteration: usize,
}

/// One row per method.
#[rustfmt::skip]
pub const METHODS: [MethodFacts; 13] = [
    // Aᵀ    A=Aᵀ                          images  start/iteration
    row(Method::Minres,         "minres",         [false, true],  Constraint::None,        [12, 0], [0, 1]),
    row(Method::Gmres,          "gmres",          [false, false], Constraint::None,        [7, 1],  [0, 1]),
    row(Method::Fgmres,         "fgmres",         [false, false], Constraint::None,        [7, 2],  [0, 1]),
    row(Method::Cg,             "cg",             [false, true],  Constraint::None,        [7, 0],  [0, 1]),
    row(Method::Cgs,            "cgs",            [false, false], Constraint::None,        [12, 0], [0, 2]),
    row(Method::BiCgStab,       "bicgstab",       [false, false], Constraint::None,        [9, 0],  [0, 2]),
    row(Method::Lsqr,           "lsqr",           [true, false],  Constraint::None,        [9, 0],  [1, 2]),
    row(Method::Lsmr,           "lsmr",           [true, false],  Constraint::None,        [10, 0], [1, 2]),
    row(Method::Jacobi,         "jacobi",         [false, false], Constraint::Box,         [7, 0],  [0, 1]),
    row(Method::Fista,          "fista",          [true, false],  Constraint::Box,         [11, 0], [1, 2]),
    row(Method::KrylovBox,      "krylov-box",     [false, false], Constraint::Box,         [14, 2], [0, 1]),
    row(Method::Mrnsd,          "mrnsd",          [true, false],  Constraint::NonNegative, [7, 0],  [1, 2]),
    row(Method::Multiplicative, "multiplicative", [true, false],  Constraint::NonNegative, [8, 0],  [2, 2]),
];

const fn row(
    method: Method,
    name: &'static str,
    needs: [bool; 2],
    constraint: Constraint,
    images: [usize; 2],
    products: [usize; 2],
) -> MethodFacts {
    MethodFacts {
        method,
        name,
        needs_transpose: needs[0],
        needs_symmetry: needs[1],
        constraint,
        images: images[0],
        images_per_product: images[1],
        products_to_start: products[0],
        products_per_iteration: products[1],
    }
}

impl Method {
    /// The needs, storage and cost of the method.
    pub fn facts(self) -> MethodFacts {
        // The table is in the order of the enum, which a test checks.
        METHODS[self as usize]
    }

    /// The method of this name.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--method` and all names there are.
    pub fn from_name(name: &str) -> Result<Self> {
        METHODS.iter().find(|facts| facts.name == name).map(|facts| facts.method).ok_or_else(|| {
            let names: Vec<&str> = METHODS.iter().map(|facts| facts.name).collect();
            Error::Option {
                option: "--method".into(),
                fault: format!("there is no method {name:?} for A x = b"),
                help: format!("use one of {}", names.join(", ")),
            }
        })
    }

    /// The method's state before its first step, for `b` and `x` of length `cols`.
    ///
    /// # Errors
    /// As the method's own `new`. [`Error::Dimension`] when `cols` differs from `b`'s length and the method
    /// is for square systems.
    pub fn solver(self, cols: usize, b: &[f64], options: &SolveOptions) -> Result<Box<dyn Solver>> {
        if !matches!(self, Self::Lsqr | Self::Lsmr) {
            square(b.len(), cols)?;
        }
        Ok(match self {
            Self::Minres => Box::new(Minres::new(b, options)?),
            Self::Gmres => Box::new(Gmres::new(b, options)?),
            Self::Fgmres => Box::new(Gmres::flexible(b, options)?),
            Self::Cg => Box::new(Cg::new(b, options)?),
            Self::Cgs => Box::new(Cgs::new(b, options)?),
            Self::BiCgStab => Box::new(BiCgStab::new(b, options)?),
            Self::Lsqr => Box::new(Lsqr::new(cols, b, options)?),
            Self::Lsmr => Box::new(Lsmr::new(cols, b, options)?),
            Self::Jacobi => Box::new(ProjectedJacobi::new(b, options)?),
            Self::Fista => Box::new(Fista::new(b, options)?),
            Self::KrylovBox => Box::new(KrylovBox::new(b, options)?),
            Self::Mrnsd => Box::new(Mrnsd::new(b, options)?),
            Self::Multiplicative => Box::new(Multiplicative::new(b, options)?),
        })
    }
}

/// Solves `A x = b`, `A` of `rows × cols` and `b` of length `rows`, by any method, within a budget of
/// products.
///
/// A method that needs `Aᵀ` takes products with `A` instead where `A` is symmetric, and fails otherwise: use
/// [`solve_adjoint`].
///
/// # Errors
/// As [`Method::solver`] and [`solve_from`]. To keep what was taken before an operator failed, make the
/// solver yourself and use [`solve_from`].
pub fn solve<O: Operator + ?Sized>(
    method: Method,
    operator: &mut O,
    b: &[f64],
    options: &SolveOptions,
) -> Result<Solution> {
    let mut operator = operator;
    solve_adjoint(method, &mut ForwardOnly(&mut operator), b, options)
}

/// As [`solve`], for an operator whose transpose can be applied.
///
/// # Errors
/// As [`solve`].
pub fn solve_adjoint<O: Adjoint + ?Sized>(
    method: Method,
    operator: &mut O,
    b: &[f64],
    options: &SolveOptions,
) -> Result<Solution> {
    let mut solver = method.solver(operator.cols(), b, options)?;
    solve_from(solver.as_mut(), operator, options)
}
