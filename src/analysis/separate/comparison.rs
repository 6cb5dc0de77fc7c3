//! A comparison of all methods of separation at several numbers of photos with the exact bounces.

use crate::analysis::low_rank::{LowRankCapture, capture};
use crate::analysis::planes::{Planes, difference, norm, relative_error, relative_to, sum};
use crate::analysis::probe::{Probing, probe};
use crate::analysis::separate::{SeparateBy, Separation, from_capture, separate};
use crate::error::Result;
use crate::finding::Ratio;
use crate::image::Resolution;
use crate::krylov::Start;
use crate::operator::Operator;
use crate::sparse::Csr;

/// The result of a method and its settings against the exact first bounce.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ComparisonRow {
    /// The method's name.
    pub method: &'static str,
    /// The settings in words.
    pub setting: String,
    /// Number of photos.
    pub photos: usize,
    /// The relative error `‖direct − exact‖ / ‖exact‖`; undefined without direct light.
    pub error: Ratio,
    /// The relative error of the global light; undefined without global light.
    pub global_error: Ratio,
}

/// Compares all methods. `full` holds operators of all light (`n × n`), one per channel. `exact` is the light of one bounce, and
/// of two and more, under white. `period` is the period of the sinusoids in pixels.
pub fn compare_separations<O: Operator>(
    full: &mut [O],
    resolution: Resolution,
    exact: &[Planes; 2],
    period: f64,
    seed: u64,
) -> Result<Vec<ComparisonRow>> {
    const COUNTS: [usize; 6] = [4, 8, 16, 32, 64, 128];
    let boards =
        [(1, 2), (2, 4), (3, 6), (4, 8)].map(|(square, shifts)| SeparateBy::Checkerboards { square, shifts });
    let waves = [3, 6, 12].map(|phases| SeparateBy::Sinusoids { period, phases });
    let codes = [4, 8, 16, 32, 64].map(|photos| SeparateBy::Codes { photos });
    let random = COUNTS.map(|photos| SeparateBy::Random { photos });
    let mut rows = Vec::new();
    let mut row = |by: SeparateBy, found: &[Separation]| {
        let of = |part: fn(&Separation) -> &Vec<f64>| -> Planes {
            found.iter().map(|f| part(f).clone()).collect()
        };
        rows.push(ComparisonRow {
            method: by.name(),
            setting: by.in_words(),
            photos: by.photos(),
            error: relative_error(&of(|found| &found.direct), &exact[0]),
            global_error: relative_error(&of(|found| &found.global), &exact[1]),
        });
    };
    for by in boards.into_iter().chain(waves).chain(codes).chain(random) {
        let one = |operator: &mut O| separate(operator, resolution, by, seed);
        row(by, &full.iter_mut().map(one).collect::<Result<Vec<_>>>()?);
    }
    // One capture serves all counts, because its first photos equal the photos of a shorter capture.
    let white = sum(&exact[0], &exact[1]);
    let most = COUNTS[COUNTS.len() - 1];
    let start = Some(Start::Rademacher { seed });
    let options = LowRankCapture { photos: most, start, ..LowRankCapture::default() };
    let one = |operator: &mut O| capture(operator, &[], &options);
    let captured = full.iter_mut().map(one).collect::<Result<Vec<_>>>()?;
    for photos in COUNTS {
        let models = captured.iter().zip(&white);
        let found = models.map(|(model, white)| from_capture(&model.truncated(photos), white));
        row(SeparateBy::Capture { photos }, &found.collect::<Result<Vec<_>>>()?);
    }
    Ok(rows)
}

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
    /// The norm of the standard errors of `near` relative to the norm of `near`; undefined where `near` is mere noise.
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

/// Probes the near part of `light`, each channel's global light under white. `global` holds operators of that light (`n × n`),
/// and `matrices` the true ones, if known.
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
