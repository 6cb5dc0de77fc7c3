//! `eigs`: a few eigenpairs within a budget of products.

use super::super::completeness::{Confirm, confirming};
use super::super::factor::{Arnoldi, BlockLanczos, Factorization, Lanczos};
use super::super::powers::{Rescaled, multiply_eigs, scaled};
use super::confirm::confirm_dyn;
use super::driver::drive;
use super::options::{Eigs, EigsMethod, EigsOptions};
use super::power::power;
use crate::error::Result;
use crate::operator::Operator;

/// Eigenpairs `A y = θ y` of an operator (`n × n`) by the method of the options, within a budget of products.
///
/// The operator's observer sees each product
/// ([`Estimate::Eigenpairs`](crate::observer::Estimate::Eigenpairs)). Returns the best so far when the budget
/// ends or the observer stops it. Lanczos finds a repeated eigenvalue once, and blocks of `b` find up to `b` copies;
/// [`EigsOptions::confirm`] finds the others. [`Eigs::completeness`] says what is known of those that were missed.
///
/// # Errors
/// [`Error::Option`](crate::Error::Option) naming `--count`, `--photos`, `--block`, `EigsOptions::max_basis` or `EigsOptions::noise`
/// or `--which` when its value cannot be used; else as [`Lanczos::new`] and
/// [`Factorization::expand`]. To keep what was taken before an operator
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
    let mut factorization: Box<dyn Factorization> = match options.method {
        EigsMethod::Power => return power(operator, options),
        EigsMethod::Arnoldi => {
            return drive(&mut Arnoldi::new(&start(), &options.deflate)?, operator, options);
        }
        EigsMethod::Lanczos => Box::new(Lanczos::new(&start(), &options.deflate)?),
        EigsMethod::BlockLanczos { block } => {
            Box::new(BlockLanczos::new(&options.start.block(n, block), &options.deflate)?)
        }
    };
    let mut found = drive(&mut *factorization, operator, options)?;
    let broke_down = factorization.expansion().broke_down();
    drop(factorization);
    let left = options.products.saturating_sub(found.stats.products);
    let (is_free, _) = confirming(operator, |operator, is_free| {
        let how = Confirm::of(options.confirm, is_free, broke_down, left);
        how.map_or(Ok(()), |how| confirm_dyn(operator, &mut found, options, &how))
    })?;
    if !is_free {
        found.stats.products += found.confirming;
    }
    Ok(found)
}
