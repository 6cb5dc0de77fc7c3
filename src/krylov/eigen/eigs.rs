//! `eigs`: a few eigenpairs within a budget of products.

use super::super::factor::{Arnoldi, BlockLanczos, Lanczos};
use super::super::powers::{Rescaled, multiply_eigs, scaled};
use super::driver::drive;
use super::options::{Eigs, EigsMethod, EigsOptions};
use super::power::power;
use crate::error::Result;
use crate::operator::Operator;

/// Eigenpairs `A y = θ y` of an operator (`n × n`) by the method of the options, within a budget of products.
///
/// The operator's observer sees each product
/// ([`Estimate::Eigenpairs`](crate::observer::Estimate::Eigenpairs)). Returns the best so far when the budget
/// ends or the observer stops it. Lanczos finds a repeated eigenvalue once; further copies appear only after
/// an exactly invariant subspace, or when rounding has let them grow. Deflate known eigenvectors, or use
/// block Lanczos.
///
/// # Errors
/// [`Error::Option`](crate::Error::Option) naming `--count`, `--photos`, `--block`, `EigsOptions::max_basis` or `EigsOptions::noise`
/// or `--which` when its value cannot be used; else as [`Lanczos::new`] and
/// [`Factorization::expand`](super::super::Factorization::expand). To keep what was taken before an operator
/// failed, hold the factorization yourself and use [`eigs_from`](super::eigs_from).
pub fn eigs<O: Operator + ?Sized>(operator: &mut O, options: &EigsOptions) -> Result<Eigs> {
    let mut operator = Rescaled::new(operator);
    let found = eigs_of(&mut operator, options);
    let Some(power) = operator.begins_again() else { return found };
    let options = EigsOptions { noise: scaled(options.noise, -power), ..options.clone() };
    let mut found = eigs_of(&mut operator, &options)?;
    multiply_eigs(&mut found, power)?;
    Ok(found)
}

fn eigs_of(operator: &mut dyn Operator, options: &EigsOptions) -> Result<Eigs> {
    options.check()?;
    let n = operator.cols();
    let start = || options.start.vector(n);
    match options.method {
        EigsMethod::Power => power(operator, options),
        EigsMethod::Lanczos => {
            let mut lanczos = Lanczos::new(&start(), &options.deflate)?;
            drive(&mut lanczos, operator, options)
        }
        EigsMethod::BlockLanczos { block } => {
            let mut lanczos = BlockLanczos::new(&options.start.block(n, block), &options.deflate)?;
            drive(&mut lanczos, operator, options)
        }
        EigsMethod::Arnoldi => {
            let mut arnoldi = Arnoldi::new(&start(), &options.deflate)?;
            drive(&mut arnoldi, operator, options)
        }
    }
}
