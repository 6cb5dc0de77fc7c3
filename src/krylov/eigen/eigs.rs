//! `eigs`: a few eigenpairs within a budget of products.

use super::super::factor::{Arnoldi, BlockLanczos, Lanczos};
use super::super::monitor::Monitor;
use super::driver::eigs_from;
use super::options::{Eigs, EigsMethod, EigsOptions};
use super::power::power;
use crate::error::Result;
use crate::operator::Operator;

/// Eigenpairs `A y = θ y` of an operator (`n × n`) by the method of the options, within a budget of products.
///
/// Returns the best so far when the budget ends or the monitor stops it. By Lanczos a repeated eigenvalue is found
/// once: its further copies come only with an exactly invariant subspace, or when rounding has let them grow. Deflate
/// what is known, or use block Lanczos.
///
/// # Errors
/// [`Error::Option`](crate::Error::Option) naming `--count`, `--photos`, `--block`, `--max-basis`, `--noise` or `--which` when its value
/// cannot be used; else as [`Lanczos::new`] and [`Factorization::expand`](super::super::Factorization::expand). To keep what was taken before an operator
/// failed, hold the factorization yourself and use [`eigs_from`].
pub fn eigs(operator: &mut dyn Operator, options: &EigsOptions, monitor: &mut Monitor<'_>) -> Result<Eigs> {
    options.check()?;
    let n = operator.cols();
    let start = || options.start.vector(n);
    match options.method {
        EigsMethod::Power => power(operator, options, monitor),
        EigsMethod::Lanczos => {
            let mut lanczos = Lanczos::new(&start(), &options.deflate)?;
            eigs_from(&mut lanczos, operator, options, monitor)
        }
        EigsMethod::BlockLanczos { block } => {
            let mut lanczos = BlockLanczos::new(&options.start.block(n, block), &options.deflate)?;
            eigs_from(&mut lanczos, operator, options, monitor)
        }
        EigsMethod::Arnoldi => {
            let mut arnoldi = Arnoldi::new(&start(), &options.deflate)?;
            eigs_from(&mut arnoldi, operator, options, monitor)
        }
    }
}
