//! Factorizations `A V = V⁺ H`: what products teach about an operator, apart from any question.

mod arnoldi;
mod block_lanczos;
mod expansion;
mod factorization;
mod lanczos;
mod restart;
mod ritz;
mod save;

pub use arnoldi::Arnoldi;
pub use block_lanczos::BlockLanczos;
pub use expansion::{Expansion, Step};
pub use factorization::Factorization;
pub(super) use factorization::point_upwards;
pub use lanczos::Lanczos;
pub use ritz::{PairStatus, RitzPair, Which};
