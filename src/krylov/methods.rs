//! A list of all methods for `A x = b`, and one function that runs any of them.

use super::boxed::{Fista, KrylovBox, Mrnsd, Multiplicative, ProjectedJacobi};
use super::linear::{
    BiCgStab, Cg, Cgs, ForwardOnly, Gmres, Lsmr, Lsqr, Minres, Solution, SolveOptions, Solver, solve_from,
    square,
};
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Operator};

/// The constraint that all iterates of a method satisfy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// No constraint.
    None,
    /// `x ≥ 0`.
    NonNegative,
    /// `lower ≤ x ≤ upper`.
    Box,
}

/// The requirements, storage and cost of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MethodFacts {
    /// The method.
    pub method: Method,
    /// The name on the command line.
    pub name: &'static str,
    /// True if the method takes products with `Aᵀ`. For a symmetric operator these are products with `A`.
    pub needs_transpose: bool,
    /// True if the method refuses an operator that is not symmetric.
    pub needs_symmetry: bool,
    /// The constraint that all iterates satisfy.
    pub constraint: Constraint,
    /// The fixed number of stored vectors of length `n`, including the right-hand side and the solution, without a preconditioner (FGMRES:
    /// with one).
    pub images: usize,
    /// The number of further stored vectors per product.
    pub images_per_product: usize,
    /// The number of products before the first iteration, from the default start. The methods with bounds are assumed to have
    /// [`SolveOptions::diagonal`].
    pub products_to_start: usize,
    /// The number of products per iteration.
    pub products_per_iteration: usize,
}

/// Declares one method per line. A line lists the name in Rust and on the command line, and whether the method needs `Aᵀ` and `A = Aᵀ`. The
/// constraint and the numbers of images and products of [`MethodFacts`] follow. The line ends with the function that makes the state of the
/// method from `cols`, `b` and the options.
macro_rules! methods {
    ($($method:ident $name:literal [$transpose:literal, $symmetry:literal] $constraint:ident [$images:literal, $more:literal]
        [$start:literal, $products:literal] $new:expr;)*) => {
        /// A method for `A x = b`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum Method {
            $(#[doc = concat!("`", $name, "` on the command line.")] #[serde(rename = $name)] $method),*
        }

        /// The facts of all methods, one row per method.
        pub const METHODS: [MethodFacts; [$($name),*].len()] = [$(MethodFacts {
            method: Method::$method,
            name: $name,
            needs_transpose: $transpose,
            needs_symmetry: $symmetry,
            constraint: Constraint::$constraint,
            images: $images,
            images_per_product: $more,
            products_to_start: $start,
            products_per_iteration: $products,
        }),*];

        /// Makes the state of a method before its first step.
        fn state(method: Method, cols: usize, b: &[f64], options: &SolveOptions) -> Result<Solver> {
            match method {
                $(Method::$method => {
                    let new: fn(usize, &[f64], &SolveOptions) -> Result<Solver> = $new;
                    new(cols, b, options)
                })*
            }
        }
    };
}

#[rustfmt::skip]
methods! {
    //                                 Aᵀ     A=Aᵀ               images   start/iteration
    Minres         "minres"           [false, true]  None        [9, 0]  [0, 1] |_, b, options| Minres::solver(b, options);
    Gmres          "gmres"            [false, false] None        [7, 1]  [0, 1] |_, b, options| Gmres::solver(b, options);
    Fgmres         "fgmres"           [false, false] None        [7, 2]  [0, 1] |_, b, options| Gmres::flexible(b, options);
    Cg             "cg"               [false, true]  None        [6, 0]  [0, 1] |_, b, options| Cg::solver(b, options);
    Cgs            "cgs"              [false, false] None        [11, 0] [0, 2] |_, b, options| Cgs::solver(b, options);
    BiCgStab       "bicgstab"         [false, false] None        [9, 0]  [0, 2] |_, b, options| BiCgStab::solver(b, options);
    Lsqr           "lsqr"             [true, false]  None        [8, 0]  [1, 2] Lsqr::solver;
    Lsmr           "lsmr"             [true, false]  None        [9, 0]  [1, 2] Lsmr::solver;
    Jacobi         "jacobi"           [false, false] Box         [7, 0]  [0, 1] |_, b, options| ProjectedJacobi::solver(b, options);
    Fista          "fista"            [true, false]  Box         [11, 0] [1, 2] Fista::solver;
    KrylovBox      "krylov-box"       [false, false] Box         [14, 2] [0, 1] |_, b, options| KrylovBox::solver(b, options);
    Mrnsd          "mrnsd"            [true, false]  NonNegative [7, 0]  [1, 2] |_, b, options| Mrnsd::solver(b, options);
    Multiplicative "multiplicative"   [true, false]  NonNegative [8, 0]  [2, 2] |_, b, options| Multiplicative::solver(b, options);
}

impl Method {
    /// The requirements, storage and cost of the method.
    pub fn facts(self) -> MethodFacts {
        METHODS[self as usize]
    }

    /// Finds the method with this name.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--method` and all method names.
    pub fn from_name(name: &str) -> Result<Self> {
        METHODS.iter().find(|facts| facts.name == name).map(|facts| facts.method).ok_or_else(|| {
            let names: Vec<&str> = METHODS.iter().map(|facts| facts.name).collect();
            Error::option("--method", format!("there is no method {name:?} for A x = b"))
                .help(format!("use one of {}", names.join(", ")))
        })
    }

    /// Makes the method's state before its first step, for `b` and `x` of length `cols`.
    ///
    /// # Errors
    /// The errors of the method's `new`. [`Error::Dimension`] if the method is for square systems and `b` does not have the length `cols`.
    /// FISTA is for square systems unless the options have `x0` and `diagonal`.
    pub fn solver(self, cols: usize, b: &[f64], options: &SolveOptions) -> Result<Solver> {
        match self {
            Self::Lsqr | Self::Lsmr => {}
            Self::Fista if options.x0.is_some() && options.diagonal.is_some() => {}
            _ => square(b.len(), cols)?,
        }
        state(self, cols, b, options)
    }
}

/// Solves `A x = b`, with `A` of `rows × cols` and `b` of length `rows`, by any method, within a budget of products.
///
/// If a method needs `Aᵀ`, `A` must be symmetric, and the method multiplies by `A` instead. For other operators, use [`solve_adjoint`].
///
/// # Errors
/// The errors of [`Method::solver`] and [`solve_from`]. If an operator fails, the products taken so far are lost. To keep them, make the
/// solver separately and use [`solve_from`].
pub fn solve(
    method: Method,
    operator: &mut dyn Operator,
    b: &[f64],
    options: &SolveOptions,
) -> Result<Solution> {
    solve_adjoint(method, &mut ForwardOnly(operator), b, options)
}

/// Solves like [`solve`], for an operator whose transpose can be applied. Fails with the errors of [`solve`].
pub fn solve_adjoint(
    method: Method,
    operator: &mut dyn Adjoint,
    b: &[f64],
    options: &SolveOptions,
) -> Result<Solution> {
    let mut solver = method.solver(operator.cols(), b, options)?;
    solve_from(&mut solver, operator, options)
}
