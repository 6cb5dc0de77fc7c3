//! Global light by how far from its own pixel it comes back.

use crate::analysis::planes::{Planes, difference, norm, relative_error};
use crate::analysis::probe::{Probing, probe};
use crate::error::Result;
use crate::image::Resolution;
use crate::operator::Operator;
use crate::sparse::Csr;

/// Global light by how far from its own pixel it comes back.
#[derive(Clone, Debug)]
pub struct NearFar {
    /// Weighted by `exp(−d²/2σ²)` of the distance `d` in pixels.
    pub near: Planes,
    /// The rest.
    pub far: Planes,
    /// `σ` in pixels.
    pub sigma: f64,
    /// Photos of random patterns that it took.
    pub photos: usize,
    /// The root mean square of the standard errors of `near`, relative to that of `near`.
    pub noise: f64,
    /// The relative error of `near` against the matrix, where there is one.
    pub error: Option<f64>,
}

/// Which near light is asked for, by how many photos.
#[derive(Clone, Copy, Debug)]
pub struct NearFarOptions {
    /// `σ` in pixels.
    pub sigma: f64,
    /// Photos of random patterns for each channel.
    pub photos: usize,
    /// Selects the patterns.
    pub seed: u64,
}

/// Probes the near part of `light`, the global light of each channel under white. `global` are operators of it (`n × n`),
/// `matrices` the true matrices of the same where they are known.
///
/// # Errors
/// As [`probe`].
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
    let error = matrices.map(|matrices| {
        let truth: Planes = matrices.iter().map(|matrix| probing.exact(matrix, resolution)).collect();
        relative_error(&near, &truth)
    });
    let far = difference(light, &near);
    Ok(NearFar { far, noise: norm(&errors) / norm(&near), near, sigma, photos, error })
}
