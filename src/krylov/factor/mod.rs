//! Krylov factorizations `A V = V⁺ H`, which eigenpairs are computed from.

mod arnoldi;
mod block_lanczos;
mod delayed;
mod expansion;
mod factorization;
mod filter;
mod lanczos;
mod restart;
mod ritz;
mod save;
mod step;

pub use arnoldi::Arnoldi;
pub use block_lanczos::BlockLanczos;
pub use expansion::Expansion;
pub use factorization::Factorization;
pub(super) use factorization::point_upwards;
pub use filter::Filter;
pub use lanczos::Lanczos;
pub use ritz::{PairStatus, RitzPair, Which, temple_kato};
pub use step::Step;
