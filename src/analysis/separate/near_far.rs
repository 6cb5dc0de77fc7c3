//! The split of global light by the distance at which it returns.

use crate::analysis::planes::{Planes, difference, norm, relative_error, relative_to};
use crate::analysis::probe::{Probing, probe};
use crate::error::Result;
use crate::finding::Ratio;
use crate::image::Resolution;
use crate::operator::Operator;
use crate::sparse::Csr;

/// Global light, split by the distance from its own pixel at which it returns.
#[derive(Clone, Debug)]
pub struct NearFar {
    /// Light weighted by `exp(−d²/2σ²)` of the distance `d` in pixels.
    pub near: Planes,
    /// All other global light.
    pub far: Planes,
    /// `σ` in pixels.
    pub sigma: f64,
    /// Number of photos of random patterns.
    pub photos: usize,
    /// The norm of the standard errors of `near` relative to the norm of `near`; nothing where `near` is noise alone.
    pub noise: Ratio,
    /// The relative error of `near` against the matrix, if it is known.
    pub error: Option<f64>,
}

/// The options of [`near_far()`].
#[derive(Clone, Copy, Debug)]
pub struct NearFarOptions {
    /// `σ` in pixels.
    pub sigma: f64,
    /// Photos of random patterns per channel.
    pub photos: usize,
    /// Seed of the random patterns.
    pub seed: u64,
}

/// Probes the near part of `light`, each channel's global light under white, with operators `global` of that light (`n × n`).
/// `matrices` are the true ones, if known.
pub fn near_far<O: Operator>(
    global: &mut [O],
    resolution: Resolution,
    options: NearFarOptions,
    light: &Planes,
    matrices: Option<&[Csr]>,
) -> Result<NearFar> {
    let NearFarOptions { sigma, photos, seed } = options;
    let probing = Probing::Near { sigma };
    let one = |operator: &mut O| probe(operator, resolution, probing, photos, seed);
    let found = global.iter_mut().map(one).collect::<Result<Vec<_>>>()?;
    let near: Planes = found.iter().map(|found| found.values.clone()).collect();
    let errors: Planes = found.into_iter().map(|found| found.standard_errors).collect();
    let error = matrices.and_then(|matrices| {
        let truth: Planes = matrices.iter().map(|matrix| probing.exact(matrix, resolution)).collect();
        relative_error(&near, &truth).value()
    });
    let far = difference(light, &near);
    Ok(NearFar { far, noise: relative_to(norm(&errors), &near, &errors), near, sigma, photos, error })
}
