//! Krylov methods: eigenvalues, singular values and solutions of linear systems from a few dozen products with an operator.
//!
//! A product may be a photo, so the cost of a method is its number of products. A method has two parts:
//!
//! * A *factorization* ([`Factorization`], by a Lanczos or Arnoldi process) takes exactly one product per step. It can be stopped,
//!   inspected, saved and resumed after any step. If a product fails, the factorization is unchanged.
//! * A *driver* ([`eigs()`]) computes eigenpairs from a factorization without any further product ([`Factorization::ritz`]). It expands the
//!   factorization until the pairs are good enough or the budget is spent.
//!
//! | needs `A = Aᵀ` | method | finds | vectors of `n`, for `m` products |
//! |---|---|---|---|
//! | no | [`EigsMethod::Power`] | the eigenpair of largest magnitude | 4 |
//! | yes | [`Factorization::lanczos`] | eigenpairs at the ends of the spectrum | `m + 2` |
//! | yes | [`Factorization::block_lanczos`] | eigenpairs at the ends of the spectrum, with up to `b` copies of each | `m + b + 1` |
//! | no | [`Factorization::arnoldi`] | complex eigenpairs at the edge of the spectrum | `m + 2` |
//! | no, but needs `Aᵀ` | [`singular()`] | the largest singular values and their vectors | `m + 2` |
//!
//! [`Solver`]s, which also take steps, solve linear systems, with or without bounds on the solution. [`solve`] runs any [`Method`] of the
//! table [`METHODS`] with [`SolveOptions`].
//!
//! Results are bitwise equal from run to run and for any number of threads. All sums are taken over fixed blocks of rows, which are added
//! in the order of the rows.
//!
//! The observer of the operator ([`Operator::observer`](crate::operator::Operator::observer)) sees each step, and may stop the method.
//!
//! Power iteration and the use of a Krylov subspace of photos follow O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace
//! Illumination*, section 4. MINRES and GMRES on photos follow section 6.2. The other methods have their own references.

mod basis;
mod boxed;
mod claim;
mod completeness;
mod eigen;
mod estimators;
mod factor;
mod kernels;
mod linear;
mod methods;
mod powers;
mod precondition;
mod singular;
mod start;
mod sweeps;

pub use basis::{dot, norm};
pub use boxed::{Fista, KrylovBox, Mrnsd, Multiplicative, ProjectedJacobi, Surrogate};
pub(crate) use claim::{ClaimQuestion, Claimed, confirming};
pub use completeness::{Completeness, Confirm, Confirmed, Stats, Status};
pub(crate) use eigen::search_from;
pub use eigen::{
    Beside, Eigs, EigsMethod, EigsOptions, HistoryRow, confirm, eigs, eigs_from, largest_beside,
};
pub use estimators::{
    DiagonalEstimate, Estimate, LowRankOptions, RandomizedSvd, diagonal, hutch_plus_plus, hutchinson,
    randomized_svd,
};
pub use factor::{Factorization, Filter, PairStatus, ProcessKind, RitzPair, Step, Which, temple_kato};
pub use linear::{
    Advance, BiCgStab, Cg, Cgs, ForwardOnly, Gmres, Lsmr, Lsqr, Minres, Side, Solution, SolveOptions,
    SolveRow, Solver, Tally, solve_from,
};
pub use methods::{Constraint, METHODS, Method, MethodFacts, solve, solve_adjoint};
pub use precondition::{Diagonal, Multiscale, Preconditioner, UserPreconditioner};
pub use singular::{Singular, SingularOptions, confirm_singular, singular};
pub use start::Start;
