//! Krylov methods: the largest eigenvalues of an operator, and more, from a few dozen products with it.
//!
//! Nothing here knows what a product is; it may be a photo, so it is the currency. A method is in two parts:
//!
//! * a *factorization* ([`Lanczos`]) takes exactly one product a step. It can be stopped, inspected and resumed after
//!   any step, and a product that fails leaves it as it was;
//! * a *question* is answered from a factorization without any further product ([`Lanczos::ritz`]), or drives one
//!   until the answer is good enough or the budget is spent ([`eigs()`]).
//!
//! | needs `A v` | needs `A = Aᵀ` | method | answers |
//! |---|---|---|---|
//! | yes | yes | [`Lanczos`], [`eigs()`] | eigenvalues at either end of the spectrum, and their vectors |
//!
//! Linear systems, with or without a box around the solution, are [`Solver`]s of the same kind: [`solve`] takes any
//! [`Method`] of the table [`METHODS`], by value, with [`SolveOptions`].
//!
//! Everything is bit-identical from run to run and for any number of threads: sums are taken over fixed blocks of
//! rows and added in the order of the rows.

mod basis;
mod boxed;
mod eigenpairs;
mod eigs;
mod lanczos;
mod linear;
mod methods;
mod monitor;
mod orthogonalize;
mod precondition;
mod start;
mod stats;
mod vectors;

pub use basis::{dot, norm};
pub use boxed::{Fista, KrylovBox, Mrnsd, Multiplicative, ProjectedJacobi};
pub use eigenpairs::{RitzPair, Which};
pub use eigs::{Eigs, EigsOptions, eigs, eigs_from};
pub use lanczos::{Lanczos, Step};
pub use linear::{
    Advance, BiCgStab, Cg, Cgs, ForwardOnly, Gmres, Lsmr, Lsqr, Minres, Side, Solution, SolveMonitor,
    SolveOptions, SolveProgress, SolveRow, Solver, Tally, keep_solving, solve_from,
};
pub use methods::{Constraint, METHODS, Method, MethodFacts, solve, solve_adjoint};
pub use monitor::{HistoryRow, Monitor, Progress, keep_going};
pub use precondition::{Diagonal, Given, Multiscale, Preconditioner};
pub use start::Start;
pub use stats::{Stats, Status};
