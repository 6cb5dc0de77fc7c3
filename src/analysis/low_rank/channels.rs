//! The capture of every channel with separate direct light, and the error of the model.

use super::{ErrorRow, LowRank, LowRankCapture, capture, error_curve, optimal_errors};
use crate::error::{Error, Result};
use crate::finding::Ratio;
use crate::krylov::{LowRankOptions, Start, randomized_svd};
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::sparse::Csr;

/// Products for the best approximation of each rank, besides four times the rank. Its error is then well below one per cent.
const EXTRA_PRODUCTS: usize = 40;

/// The direct light of a channel of `n` pixels.
#[derive(Clone, Debug)]
pub enum DirectPart {
    /// A diagonal of `n` values. A coaxial pinhole rig has one, because direct light returns to the pixel that projected it.
    Diagonal(Vec<f64>),
    /// A matrix (`n × n`).
    Matrix(Csr),
}

/// The model's error after a number of photos, relative in the Frobenius norm of the global part of the matrix.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RankRow {
    /// Number of photos.
    pub photos: usize,
    /// The error of the model, which uses symmetry if the rig has it.
    pub error: f64,
    /// The error of `W Qᵀ` alone.
    pub one_sided: f64,
    /// The least error of any matrix of this rank.
    pub optimal: Option<f64>,
}

/// Captures every channel. `global` holds operators of the light of two and more bounces (`n × n`), `direct` their direct light.
/// Fails as [`capture()`] does.
pub fn capture_channels<O: Adjoint>(
    global: &mut [O],
    direct: Vec<DirectPart>,
    options: &LowRankCapture,
) -> Result<Vec<LowRank>> {
    let mut found = Vec::new();
    for (operator, direct) in global.iter_mut().zip(direct) {
        found.push(match direct {
            DirectPart::Diagonal(diagonal) => capture(operator, &diagonal, options)?,
            DirectPart::Matrix(matrix) => capture(operator, &[], options)?.with_direct_matrix(matrix)?,
        });
    }
    Ok(found)
}

/// Measures the direct light of one channel by products with white and with random signs, which reveal any matrix but a diagonal.
/// Fails with [`Error::Option`] if it is not a diagonal, or as the products do.
pub fn diagonal_of(direct: &mut dyn Operator) -> Result<DirectPart> {
    let n = direct.cols();
    let mut product = |x: &[f64]| -> Result<Vec<f64>> {
        let mut y = vec![0.0; n];
        direct.apply(x, &mut y)?;
        Ok(y)
    };
    let diagonal = product(&vec![1.0; n])?;
    let signs = Start::Rademacher { seed: 0 }.vector(n);
    let signed = product(&signs)?;
    let most = diagonal.iter().copied().fold(0.0, f64::max);
    let is_diagonal = (0..n).all(|i| (signed[i] - signs[i] * diagonal[i]).abs() <= 1e-6 * most);
    if is_diagonal {
        return Ok(DirectPart::Diagonal(diagonal));
    }
    Err(Error::option(
        "--operator",
        "the direct light of this rig is not a diagonal, and without a matrix it cannot be kept apart",
    )
    .help("use --operator replay, or pinholes behind one beam splitter"))
}

/// The models' error over all channels for each number of photos, against the true matrices. `matrices` are the global parts of
/// the true matrices, one per channel, and `global` holds their operators.
pub fn rank_curve<O: Adjoint>(
    models: &[LowRank],
    matrices: &[Csr],
    global: &mut [O],
) -> Result<Vec<RankRow>> {
    let total = |matrix: &Csr| matrix.weights().iter().map(|weight| weight * weight).sum::<f64>().sqrt();
    let totals: Vec<f64> = matrices.iter().map(total).collect();
    let whole = totals.iter().map(|total| total * total).sum::<f64>();
    let ranks = models.iter().map(LowRank::rank).max().unwrap_or(0);
    // Without a second bounce there is no global light and no error.
    if whole == 0.0 || ranks == 0 {
        return Ok(Vec::new());
    }
    let curves: Vec<Vec<ErrorRow>> =
        models.iter().zip(&totals).map(|(model, &total)| error_curve(model, total)).collect();
    let mut best = Vec::new();
    for (operator, &total) in global.iter_mut().zip(&totals) {
        best.push(best_errors(operator, total, ranks)?);
    }
    // Squares of errors add up. A channel that ended early keeps its last error.
    let together = |of: &dyn Fn(usize) -> f64| -> f64 {
        let square: f64 = totals.iter().enumerate().map(|(c, total)| (of(c) * total).powi(2)).sum();
        (square / whole).sqrt()
    };
    let row = |k: usize| -> Option<RankRow> {
        let at = |c: usize| curves[c].get(k.min(curves[c].len().saturating_sub(1)));
        let has_all = best.iter().all(|best: &Vec<f64>| best.len() > k);
        (0..curves.len()).all(|c| at(c).is_some()).then(|| RankRow {
            photos: k + 1,
            error: together(&|c| at(c).map_or(0.0, |row| row.error)),
            one_sided: together(&|c| at(c).map_or(0.0, |row| row.one_sided)),
            optimal: has_all.then(|| together(&|c| best[c][k])).filter(|&optimal| optimal > 0.0),
        })
    };
    Ok((0..ranks).filter_map(row).collect())
}

fn best_errors<O: Adjoint>(operator: &mut O, total: f64, ranks: usize) -> Result<Vec<f64>> {
    if operator.symmetry() == Symmetry::Symmetric {
        return optimal_errors(operator, total, ranks, 4 * ranks + EXTRA_PRODUCTS);
    }
    let options = LowRankOptions { rank: ranks, oversampling: 20, power: 2, ..LowRankOptions::default() };
    let mut rest = total * total;
    let values = randomized_svd(operator, &options)?.values;
    let after = |value: &f64| {
        rest -= value * value;
        Ratio::of(rest.max(0.0).sqrt(), total, 0.0).value().unwrap_or(0.0)
    };
    Ok(values.iter().map(after).collect())
}
