//! A comparison of all separation methods with the exact bounces, at several numbers of photos.

use crate::analysis::low_rank::{LowRankCapture, capture};
use crate::analysis::planes::{Planes, difference, norm, relative_error, relative_to, sum};
use crate::analysis::probe::{Homes, Probing, probe};
use crate::analysis::separate::{SeparateBy, Separation, from_capture, separate};
use crate::error::Result;
use crate::finding::Ratio;
use crate::image::Resolution;
use crate::krylov::Start;
use crate::operator::Operator;
use crate::sparse::Csr;

/// The result of a method with certain settings, compared with the exact first bounce.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ComparisonRow {
    /// The method's name.
    pub method: &'static str,
    /// The settings in words.
    pub setting: String,
    /// Number of photos.
    pub photos: usize,
    /// The relative error `‖direct − exact‖ / ‖exact‖`. It has no value if there is no direct light.
    pub error: Ratio,
    /// The relative error of the global light. It has no value if there is no global light.
    pub global_error: Ratio,
}

/// Compares all methods. `full` holds operators of all light (`n × n`), one per channel. `exact` holds the light of one bounce, and the
/// light of two or more bounces, under white. `period` is the period of the sinusoids in pixels.
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
        let one = |operator: &mut O| separate(operator, (resolution, None), by, seed);
        row(by, &full.iter_mut().map(one).collect::<Result<Vec<_>>>()?);
    }
    // A single capture serves all numbers of photos, because its first photos equal the photos of a shorter capture.
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

/// Global light, split by the distance between the pixel where it starts and the pixel where it returns. The distance is in pixels of the
/// projector.
#[derive(Clone, Debug)]
pub struct NearFar {
    /// Light with the weight `exp(−d²/2σ²)` for a distance of `d` pixels.
    pub near: Planes,
    /// The remaining global light.
    pub far: Planes,
    /// `σ` in pixels.
    pub sigma: f64,
    /// Number of photos of random patterns.
    pub photos: usize,
    /// The norm of the standard errors of `near`, relative to the norm of `near`. It has no value if `near` is only noise.
    pub noise: Ratio,
    /// The relative error of `near`, computed from the true matrix if it is known.
    pub error: Option<f64>,
}

/// The options of [`near_far()`].
#[derive(Clone, Copy, Debug)]
pub struct NearFarOptions {
    /// `σ` in pixels.
    pub sigma: f64,
    /// Number of photos of random patterns per channel.
    pub photos: usize,
    /// Seed of the random patterns.
    pub seed: u64,
}

/// Probes the near part of `light`, which is the global light of each channel under white. `global` holds the operators of the global light
/// (`m × n`), and `matrices` holds their true matrices, if known. The resolution is that of patterns, and the homes are as for [`probe`].
pub fn near_far<O: Operator>(
    global: &mut [O],
    (resolution, homes): (Resolution, Option<&Homes>),
    options: NearFarOptions,
    light: &Planes,
    matrices: Option<&[Csr]>,
) -> Result<NearFar> {
    let NearFarOptions { sigma, photos, seed } = options;
    let probing = Probing::Near { sigma };
    let one = |operator: &mut O| probe(operator, (resolution, homes), probing, photos, seed);
    let found = global.iter_mut().map(one).collect::<Result<Vec<_>>>()?;
    let near: Planes = found.iter().map(|found| found.values.clone()).collect();
    let errors: Planes = found.into_iter().map(|found| found.standard_errors).collect();
    let error = matrices.and_then(|matrices| {
        let truth: Planes = matrices.iter().map(|matrix| probing.exact(matrix, resolution, homes)).collect();
        relative_error(&near, &truth).value()
    });
    let far = difference(light, &near);
    Ok(NearFar { far, noise: relative_to(norm(&errors), &near, &errors), near, sigma, photos, error })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::SparseOperator;

    #[test]
    fn near_light_between_two_sizes_is_that_of_the_dense_matrix() -> Result<()> {
        let (camera, projector) = (Resolution::new(8, 6), Resolution::new(5, 4));
        let place = |pixel: usize, size: Resolution| [pixel % size.width, pixel / size.width];
        let home = |row: usize| {
            let [x, y] = place(row, camera);
            y * projector.height / camera.height * projector.width + x * projector.width / camera.width
        };
        // The first pixel of the camera sees nothing that the projector lights.
        let homes: Vec<Option<usize>> =
            (0..camera.pixels()).map(|row| (row > 0).then(|| home(row))).collect();
        let weight = |row: usize, column: usize| ((row * 7 + column * 11) % 13) as f64 / 13.0;
        let (rows, columns) = (camera.pixels(), projector.pixels());
        let entries = (0..rows).flat_map(|row| (0..columns).map(move |column| weight(row, column))).collect();
        let starts = (0..=rows).map(|row| row * columns).collect();
        let matrix =
            Csr::new(columns, starts, (0..columns as u32).cycle().take(rows * columns).collect(), entries)?;

        let sigma = 1.2;
        let dense = |home_of: &dyn Fn(usize) -> usize| -> Vec<f64> {
            let near = |row: usize, column: usize| {
                let ([x, y], [u, v]) = (place(home_of(row), projector), place(column, projector));
                (-0.5 * (x.abs_diff(u).pow(2) + y.abs_diff(v).pow(2)) as f64 / (sigma * sigma)).exp()
            };
            let sum = |row| (0..columns).map(|column| near(row, column) * weight(row, column)).sum();
            (0..rows).map(|row| if row > 0 { sum(row) } else { 0.0 }).collect()
        };
        let light = vec![matrix.times(&vec![1.0; columns])];
        let options = NearFarOptions { sigma, photos: 4000, seed: 3 };
        let mut operators = [SparseOperator::new(matrix.clone())];
        let found = near_far(&mut operators, (projector, Some(&homes)), options, &light, Some(&[matrix]))?;
        let noise = found.noise.value().unwrap_or(f64::NAN);
        let error = |truth: Vec<f64>| relative_error(&found.near, &vec![truth]).value().unwrap_or(f64::NAN);
        // The norm of the error is that of the standard errors up to the spread of some tens of independent values. The kernel, which is
        // cut at four deviations, adds less than 1e-3.
        let [right, wrong] = [error(dense(&home)), error(dense(&|row| columns - 1 - home(row)))];
        assert!(noise < 0.05 && right < 1.6 * noise + 1e-3, "{right} {noise}");
        assert!(wrong > 1.6 * noise + 1e-3, "the homes of a mirrored projector pass: {wrong} {noise}");
        assert!((found.error.unwrap_or(f64::NAN) - right).abs() < 1e-12);
        assert!(relative_error(&sum(&found.near, &found.far), &light).value().is_some_and(|of| of < 1e-12));
        assert_eq!(found.near[0][0], 0.0);
        Ok(())
    }
}
