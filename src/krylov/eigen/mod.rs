//! Eigenvalues and eigenvectors: answered from a factorization, or driven to within a budget of products.

mod confirm;
mod driver;
mod eigs;
mod options;
mod power;

pub use confirm::{Beside, confirm, largest_beside};
pub use driver::eigs_from;
pub use eigs::eigs;
pub use options::{Eigs, EigsMethod, EigsOptions, HistoryRow};
