//! Linear systems `A x = b`, one product a step.
//!
//! Each method is a state ([`Solver`]) that takes at most one product a step, so that a product that fails can be
//! taken again and loses nothing; [`solve`](super::solve) drives one until the tolerance is reached, the residual is
//! down to the noise, or the budget is spent. What each needs and stores stands in [`METHODS`](super::METHODS).

mod bicgstab;
mod bidiagonal;
mod cg;
mod cgs;
mod gmres;
mod lsmr;
mod lsqr;
mod minres;
mod options;
mod rotation;
mod shadow;
mod solve;
pub(super) mod system;

pub use bicgstab::BiCgStab;
pub use cg::Cg;
pub use cgs::Cgs;
pub use gmres::Gmres;
pub use lsmr::Lsmr;
pub use lsqr::Lsqr;
pub use minres::Minres;
pub use options::{Side, SolveOptions};
pub use solve::{Advance, ForwardOnly, Solution, SolveRow, Solver, solve_from};
pub use system::Tally;

use super::precondition::Preconditioner;
use crate::error::{Error, Result};

/// `z ← M⁻¹ r`, or a copy without a preconditioner.
pub(super) fn precondition(
    preconditioner: Option<&std::sync::Arc<dyn Preconditioner>>,
    r: &[f64],
    z: &mut [f64],
) -> Result<()> {
    match preconditioner {
        Some(m) => m.apply(r, z),
        None => {
            z.copy_from_slice(r);
            Ok(())
        }
    }
}

fn refuse_left(method: &str, options: &SolveOptions) -> Result<()> {
    if options.preconditioner.is_none() || options.side == Side::Right {
        return Ok(());
    }
    Err(Error::Option {
        option: "side".into(),
        fault: format!("{method} does not precondition from the left"),
        help: "precondition from the right, or use gmres".into(),
    })
}

fn require_positive_definite(method: &str, options: &SolveOptions) -> Result<()> {
    match &options.preconditioner {
        Some(m) if !m.is_positive_definite() => Err(Error::Option {
            option: "--precondition".into(),
            fault: format!("{method} needs a symmetric positive definite preconditioner"),
            help: "use such a one, or gmres".into(),
        }),
        _ => Ok(()),
    }
}
