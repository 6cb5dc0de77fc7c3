//! Krylov methods: the largest eigenvalues of an operator, and more, from a few dozen products with it.
//!
//! Nothing here knows what a product is; it may be a photo, so it is the currency. A method is in two parts:
//!
//! * a *factorization* ([`Lanczos`], [`BlockLanczos`], [`Arnoldi`]) takes exactly one product a step. It can be
//!   stopped, inspected, saved and resumed after any step, and a product that fails leaves it as it was;
//! * a *question* is answered from a factorization without any further product ([`Factorization::ritz`]), or drives
//!   one until the answer is good enough or the budget is spent ([`eigs()`]).
//!
//! | needs `A = Aᵀ` | method | answers | vectors of `n`, for `m` products |
//! |---|---|---|---|
//! | no | [`EigsMethod::Power`] | the eigenpair of largest magnitude | 4 |
//! | yes | [`Lanczos`] | eigenpairs at the ends of the spectrum | `m + 2` |
//! | yes | [`BlockLanczos`] | the same, with up to `b` copies of each | `m + b + 1` |
//! | no | [`Arnoldi`] | complex eigenpairs at the rim of the spectrum | `m + 2` |
//!
//! Linear systems, with or without a box around the solution, are [`Solver`]s of the same kind: [`solve`] takes any
//! [`Method`] of the table [`METHODS`], by value, with [`SolveOptions`].
//!
//! Everything is bit-identical from run to run and for any number of threads: sums are taken over fixed blocks of
//! rows and added in the order of the rows.

mod basis;
mod boxed;
mod eigen;
mod estimators;
mod factor;
mod inexact;
mod kernels;
mod linear;
mod methods;
mod orthogonalize;
mod precondition;
mod start;
mod stats;
mod vectors;

pub use basis::{dot, norm};
pub use boxed::{Fista, KrylovBox, Mrnsd, Multiplicative, ProjectedJacobi, Surrogate};
pub use eigen::{Eigs, EigsMethod, EigsOptions, HistoryRow, eigs, eigs_from};
pub use estimators::{
    DiagonalEstimate, Estimate, LowRankOptions, Nystrom, RandomizedSvd, SelfAdjoint, SpectralDensity,
    diagonal, hutch_plus_plus, hutchinson, nystrom, randomized_svd, spectral_density,
};
pub use factor::{
    Arnoldi, BlockLanczos, Expansion, Factorization, Lanczos, PairStatus, RitzPair, Step, Which,
};
pub use inexact::{Relaxation, relaxed_noise};
pub use linear::{
    Advance, BiCgStab, Cg, Cgs, ForwardOnly, Gmres, Lsmr, Lsqr, Minres, Side, Solution, SolveOptions,
    SolveRow, Solver, Tally, solve_from,
};
pub use methods::{Constraint, METHODS, Method, MethodFacts, solve, solve_adjoint};
pub use precondition::{Diagonal, Multiscale, Preconditioner, UserPreconditioner};
pub use start::Start;
pub use stats::{Stats, Status};
