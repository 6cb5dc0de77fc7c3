//! Every method at equal photos.

use super::{CompensateOptions, CompensationRow, Prior, Target, compensate_with};
use crate::error::Result;
use crate::krylov::{Constraint, METHODS, Method};
use crate::operator::{Adjoint, Symmetry};

/// One method of a comparison.
#[derive(Clone, Debug)]
pub struct MethodRun {
    /// The method.
    pub method: Method,
    /// Its name on the command line.
    pub name: &'static str,
    /// The residual of its own answer after each photo, as it knows it: the least so far.
    pub history: Vec<CompensationRow>,
    /// The residual of what is seen: of its answer after each photo, clipped to what can be projected.
    pub displayed: Vec<CompensationRow>,
    /// Photos taken, those before the method's own not counted.
    pub photos: usize,
    /// The relative residual of what is seen in the end.
    pub residual: f64,
    /// Structural similarity of what is seen and what is wished; none below 11×11 pixels.
    pub ssim: Option<f64>,
}

/// Runs every method that the operators allow (MINRES and CG are for symmetric ones) with as many photos as `options` grant;
/// `options.method` is not looked at, and its preconditioner is for the methods that take one.
///
/// # Errors
/// As [`compensate_with`].
pub fn compare_methods<O: Adjoint>(
    channels: &mut [O],
    wish: &Target,
    options: &CompensateOptions,
    prior: &Prior,
) -> Result<Vec<MethodRun>> {
    let coupled = prior.crosstalk.as_ref().is_some_and(|crosstalk| crosstalk.coupled);
    let symmetric = !coupled && channels.iter().all(|operator| operator.symmetry() == Symmetry::Symmetric);
    let mut runs = Vec::new();
    for facts in METHODS.iter().filter(|facts| symmetric || !facts.needs_symmetry) {
        let free = facts.constraint == Constraint::None;
        let options = CompensateOptions {
            method: facts.method,
            precondition: options.precondition.filter(|_| free),
            baseline: facts.constraint != Constraint::Box,
            ..*options
        };
        let found = compensate_with(channels, wish, &options, prior)?;
        let displayed = match found.clamping {
            Some(clamping) => clamping.displayed,
            None => found.history.clone(),
        };
        runs.push(MethodRun {
            method: facts.method,
            name: facts.name,
            history: found.history,
            displayed,
            photos: found.photos,
            residual: found.residual,
            ssim: found.similarity.ssim,
        });
    }
    Ok(runs)
}
