//! A comparison of all methods at equal numbers of photos.

use super::{CompensateOptions, CompensationRow, Prior, Target, compensate_with};
use crate::error::Result;
use crate::krylov::{Constraint, METHODS, Method};
use crate::operator::{Adjoint, Symmetry};

/// The result of one method in a comparison.
#[derive(Clone, Debug)]
pub struct MethodRun {
    /// The method.
    pub method: Method,
    /// Its name on the command line.
    pub name: &'static str,
    /// The residual of its unclipped answer after each photo, as the method computes it. Each row has the least residual so far.
    pub history: Vec<CompensationRow>,
    /// The residual of the photo of its answer after each step, clipped to the projector's range.
    pub displayed: Vec<CompensationRow>,
    /// Photos taken by the method, without preparation.
    pub photos: usize,
    /// The frames that the camera had taken for the method after each photo: signs, bit planes, exposures, takes and
    /// sentinels. Empty where photos are computed.
    pub frames: Vec<u64>,
    /// The relative residual of the final photo.
    pub residual: f64,
    /// Structural similarity of the final photo and the target; `None` below 11×11 pixels.
    pub ssim: Option<f64>,
}

/// Runs every method that the operators allow (MINRES and CG need symmetry) with the number of photos in `options`.
/// `options.method` is ignored. Only methods that take a preconditioner use it. Fails as [`compensate_with`] does.
pub fn compare_methods<O: Adjoint>(
    channels: &mut [O],
    target: &Target,
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
        let found = compensate_with(channels, target, &options, prior)?;
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
            frames: found.frames,
            residual: found.residual,
            ssim: found.similarity.ssim,
        });
    }
    Ok(runs)
}
