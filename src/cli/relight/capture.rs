//! The capture: direct light kept apart, a Krylov process on the rest, and how good the model is.

use anyhow::Result;

use super::super::console::Console;
use super::super::light::{Light, direct_diagonal};
use super::super::live::Live;
use crate::analysis::LowRank;
use crate::analysis::low_rank::SavedModel;
use crate::analysis::low_rank::{
    ErrorRow, LowRankCapture, capture, error_curve as curve_of, optimal_errors, smooth_starts,
};
use crate::error::Error;
use crate::image::Resolution;
use crate::krylov::{LowRankOptions, Start, randomized_svd};
use crate::observer::{OnStep, Step};
use crate::operator::{Observed, Operator, Symmetry};
use crate::report::relighting::RankRow;
use crate::sparse::Csr;
use crate::transport::Part;

/// Products for the best approximation of each rank, beyond four times the rank: converged to well below a per cent.
const EXTRA_PRODUCTS: usize = 40;

/// How the photos are chosen.
pub(super) struct Process {
    /// Photos in all.
    pub(super) photos: usize,
    /// Patterns that are projected before any photo comes back.
    pub(super) block: usize,
    /// Chooses all of these but the first, white.
    pub(super) seed: u64,
}

/// Captures every channel of a source of this name, whose photos are in this unit; `[camera, projector]` are the sizes of photos and
/// patterns.
pub(super) fn model(
    light: &mut Light<'_>,
    Process { photos, block, seed }: Process,
    [source, unit]: [&str; 2],
    [resolution, projector]: [Resolution; 2],
    live: &Live,
    console: &Console,
) -> Result<SavedModel> {
    if resolution.pixels() != projector.pixels() {
        return Err(Error::Option {
            option: "--projector-size".into(),
            fault: format!(
                "the camera has {resolution} pixels and the projector {projector}, but a Krylov process projects its photos"
            ),
            help: "give both as many pixels".into(),
        }
        .into());
    }
    let ambient = light.ambient(console)?;
    let direct = direct(light, console)?;
    let beside = smooth_starts(projector, block.max(1) - 1, seed);
    let options = LowRankCapture { photos, start: None, beside };
    live.expect(photos);
    let channels = light.with_channels(Part::Global, console, |channels| {
        let mut found = Vec::new();
        let observer = OnStep::new(|step: &Step<'_>| live.so_far(step.estimate));
        for (operator, direct) in live.watch_all(channels).iter_mut().zip(direct) {
            let operator = &mut Observed::new(operator, &observer);
            // A coaxial rig's photos come back to where they were projected from.
            found.push(match direct {
                Direct::Diagonal(diagonal) => capture(operator, &diagonal, &options)?,
                Direct::Matrix(matrix) => capture(operator, &[], &options)?.with_direct_matrix(matrix)?,
            });
        }
        crate::Result::Ok(found)
    })?;
    live.pause();
    if console.check().is_break() {
        return Err(Error::Interrupted.into());
    }
    Ok(SavedModel {
        channels,
        ambient,
        resolution,
        projector,
        unit: unit.to_owned(),
        source: source.to_owned(),
    })
}

enum Direct {
    Diagonal(Vec<f64>),
    Matrix(Csr),
}

/// The direct light of each channel: a diagonal where it is one.
fn direct(light: &mut Light<'_>, console: &Console) -> Result<Vec<Direct>> {
    if let Some(traced) = light.matrix() {
        if let Some(diagonals) = direct_diagonal(traced) {
            return Ok(diagonals.into_iter().map(Direct::Diagonal).collect());
        }
        let matrix = &traced.matrix;
        let channel = |channel: usize| Ok(Direct::Matrix(matrix.to_csr(Part::Direct, channel)?));
        return (0..matrix.channels().count()).map(channel).collect();
    }
    // Random signs tell a diagonal from anything else.
    light.with_channels(Part::Direct, console, |channels| {
        let one = |operator: &mut dyn Operator| -> Result<Direct> {
            let n = operator.cols();
            let mut product = |x: &[f64]| -> crate::Result<Vec<f64>> {
                let mut y = vec![0.0; n];
                operator.apply(x, &mut y)?;
                Ok(y)
            };
            let diagonal = product(&vec![1.0; n])?;
            let signs = Start::Rademacher { seed: 0 }.vector(n);
            let signed = product(&signs)?;
            let most = diagonal.iter().copied().fold(0.0, f64::max);
            let is_diagonal = (0..n).all(|i| (signed[i] - signs[i] * diagonal[i]).abs() <= 1e-6 * most);
            if !is_diagonal {
                return Err(Error::Option {
                    option: "--operator".into(),
                    fault: "the direct light of this rig is no diagonal, and without a matrix it cannot be kept apart"
                        .into(),
                    help: "use --operator replay, or pinholes behind one beam splitter".into(),
                }
                .into());
            }
            Ok(Direct::Diagonal(diagonal))
        };
        channels.iter_mut().map(|operator| one(operator)).collect()
    })
}

/// The model's error for each number of photos, of all channels together, against the true matrix; empty where there is none.
pub(super) fn error_curve(
    light: &mut Light<'_>,
    model: &SavedModel,
    console: &Console,
) -> Result<Vec<RankRow>> {
    let Some(traced) = light.matrix() else { return Ok(Vec::new()) };
    let mut totals = Vec::new();
    for channel in 0..model.channels.len() {
        let global = traced.matrix.to_csr(Part::Global, channel)?;
        totals.push(global.weights().iter().map(|weight| weight * weight).sum::<f64>().sqrt());
    }
    let whole = totals.iter().map(|total| total * total).sum::<f64>();
    let ranks = model.channels.iter().map(LowRank::rank).max().unwrap_or(0);
    // Nothing bounces twice: there is nothing to be missed.
    if whole == 0.0 || ranks == 0 {
        return Ok(Vec::new());
    }
    let curves: Vec<Vec<ErrorRow>> =
        model.channels.iter().zip(&totals).map(|(model, &total)| curve_of(model, total)).collect();
    let best = light.with_channels(Part::Global, console, |channels| {
        let mut best = Vec::new();
        for (operator, &total) in channels.iter_mut().zip(&totals) {
            best.push(match operator.symmetry() {
                Symmetry::Symmetric => optimal_errors(operator, total, ranks, 4 * ranks + EXTRA_PRODUCTS)?,
                Symmetry::General => {
                    let options = LowRankOptions {
                        rank: ranks,
                        oversampling: 20,
                        power: 2,
                        ..LowRankOptions::default()
                    };
                    let mut rest = total * total;
                    let values = randomized_svd(operator, &options)?.values;
                    let after = |value: &f64| {
                        rest -= value * value;
                        (rest.max(0.0)).sqrt() / total
                    };
                    values.iter().map(after).collect()
                }
            });
        }
        crate::Result::Ok(best)
    })?;
    // Squares of errors add up; a channel that ended early stays where it was.
    let together = |of: &dyn Fn(usize) -> f64| -> f64 {
        let square: f64 = totals.iter().enumerate().map(|(c, total)| (of(c) * total).powi(2)).sum();
        (square / whole).sqrt()
    };
    let row = |k: usize| -> Option<RankRow> {
        let at = |c: usize| curves[c].get(k.min(curves[c].len().saturating_sub(1)));
        (0..curves.len()).all(|c| at(c).is_some()).then(|| RankRow {
            photos: k + 1,
            error: together(&|c| at(c).map_or(0.0, |row| row.error)),
            one_sided: together(&|c| at(c).map_or(0.0, |row| row.one_sided)),
            optimal: best
                .iter()
                .all(|best| best.len() > k)
                .then(|| together(&|c| best[c][k]))
                .filter(|&optimal| optimal > 0.0),
        })
    };
    Ok((0..ranks).filter_map(row).collect())
}
