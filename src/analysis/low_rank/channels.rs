//! The capture of every channel with separate direct light, and the error of the model.

use super::{LowRank, LowRankCapture, capture};
use crate::error::{Error, Result};
use crate::finding::Ratio;
use crate::krylov::{EigsOptions, LowRankOptions, Start, Which, dot, eigs, randomized_svd};
use crate::operator::{Adjoint, Operator, Symmetry, product};
use crate::sparse::Csr;

/// The best approximation takes this number of products in addition to four times its rank. Its error is then known to well below one per
/// cent.
const EXTRA_PRODUCTS: usize = 40;

/// The direct light of a channel of `n` pixels.
#[derive(Clone, Debug)]
pub enum DirectPart {
    /// A diagonal of `n` values. A coaxial pinhole rig has one, because direct light returns to the pixel that projected it.
    Diagonal(Vec<f64>),
    /// A matrix (`n × n`).
    Matrix(Csr),
}

/// The model's error after a number of photos, relative to the global part of the matrix, in the Frobenius norm.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct RankRow {
    /// Number of photos.
    pub photos: usize,
    /// The error of the model. The model uses symmetry if the rig is symmetric.
    pub error: f64,
    /// The error of `W Qᵀ` alone.
    pub one_sided: f64,
    /// The smallest error of any matrix of this rank.
    pub optimal: Option<f64>,
}

/// Captures every channel. `global` holds operators of the light of two or more bounces (`m × n`), `direct` holds the direct light, and
/// `maps` the maps from camera to projector ([`LowRankCapture::map`]) or nothing.
/// Fails as [`capture()`] does.
pub fn capture_channels<O: Adjoint>(
    global: &mut [O],
    direct: Vec<DirectPart>,
    options: &LowRankCapture,
    maps: &[Csr],
) -> Result<Vec<LowRank>> {
    let mut found = Vec::new();
    for (channel, (operator, direct)) in global.iter_mut().zip(direct).enumerate() {
        let options = &LowRankCapture { map: maps.get(channel).cloned(), ..options.clone() };
        found.push(match direct {
            DirectPart::Diagonal(diagonal) => capture(operator, &diagonal, options)?,
            DirectPart::Matrix(matrix) => capture(operator, &[], options)?.with_direct_matrix(matrix)?,
        });
    }
    Ok(found)
}

/// Measures the direct light of one channel by products with white and with random signs. These products reveal any matrix that is not a
/// diagonal. Fails with [`Error::Option`] if the matrix is not a diagonal, or with the errors of the products.
pub fn diagonal_of(direct: &mut dyn Operator) -> Result<DirectPart> {
    let n = direct.cols();
    let diagonal = product(direct, &vec![1.0; n])?;
    let signs = Start::Rademacher { seed: 0 }.vector(n);
    let signed = product(direct, &signs)?;
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

/// The error of the models over all channels for each number of photos, compared with the true matrices. `matrices` are the global parts of
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
    // Squares of errors add up. A channel that has ended early keeps its last error.
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
    Ok(errors_after(&randomized_svd(operator, &options)?.values, total))
}

/// The error of a model after a number of photos.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ErrorRow {
    /// The number of photos, `k`.
    pub photos: usize,
    /// The model's error, `‖G − G_k‖_F / ‖G‖_F`.
    pub error: f64,
    /// The error of the capture's `W Qᵀ` alone, which needs no symmetry.
    pub one_sided: f64,
}

/// The error of the model truncated to each rank, given `‖G‖_F` of the captured matrix (without direct light).
///
/// The errors need no product. In the Frobenius norm, `‖G − W Qᵀ‖² = ‖G‖² − ‖W‖²`. For a symmetric model and `T = QᵀW`,
/// `‖G − G_k‖² = ‖G‖² − 2‖W‖² + ‖T‖²`.
pub fn error_curve(model: &LowRank, frobenius: f64) -> Vec<ErrorRow> {
    let total = frobenius * frobenius;
    // Without global light, the model is exact.
    let share = |square: f64| Ratio::of(square.max(0.0).sqrt(), frobenius, 0.0).value().unwrap_or(0.0);
    let (mut photos_square, mut projected_square) = (0.0, 0.0);
    let mut rows = Vec::with_capacity(model.rank());
    for k in 0..model.rank() {
        photos_square += dot(&model.photos()[k], &model.photos()[k]);
        // Adds the new row and column of T.
        for j in 0..=k {
            // Only a symmetric model uses T, and only its photos are sure to have the pixels of its patterns.
            let entry = if model.is_symmetric() { dot(&model.basis()[j], &model.photos()[k]) } else { 0.0 };
            projected_square += entry * entry * if j == k { 1.0 } else { 2.0 };
        }
        let one_sided = share(total - photos_square);
        let error = match model.is_symmetric() {
            true => share(total - 2.0 * photos_square + projected_square),
            false => one_sided,
        };
        rows.push(ErrorRow { photos: k + 1, error, one_sided });
    }
    rows
}

/// The smallest error of any matrix of each rank up to `ranks` (Eckart and Young, doi:10.1007/BF02288367). It follows from the eigenvalues
/// of largest magnitude of a symmetric `G`, as far as they converge within `products` products. Fails as [`eigs`] does.
pub fn optimal_errors(
    operator: &mut dyn Operator,
    frobenius: f64,
    ranks: usize,
    products: usize,
) -> Result<Vec<f64>> {
    let options = EigsOptions {
        count: ranks,
        which: Which::LargestMagnitude,
        products,
        start: Start::Random { seed: 0 },
        ..EigsOptions::default()
    };
    Ok(errors_after(&eigs(operator, &options)?.values, frobenius))
}

/// The relative error that remains after each eigenvalue or singular value, for a matrix with this Frobenius norm.
fn errors_after(values: &[f64], frobenius: f64) -> Vec<f64> {
    let mut rest = frobenius * frobenius;
    let after = |value: &f64| {
        rest -= value * value;
        Ratio::of(rest.max(0.0).sqrt(), frobenius, 0.0).value().unwrap_or(0.0)
    };
    values.iter().map(after).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{LowRankCapture, capture};
    use super::*;
    use crate::operator::{Closure, Symmetry};

    /// `G_ij` of a small matrix without particular structure.
    fn entry(symmetric: bool, i: usize, j: usize) -> f64 {
        let (i, j) = if symmetric { (i.min(j), i.max(j)) } else { (i, j) };
        ((3 * i + 7 * j + i * j) % 11) as f64 / 11.0 + 1.0 / (1.0 + i as f64 + j as f64)
    }

    fn unit(n: usize, j: usize) -> Vec<f64> {
        (0..n).map(|i| f64::from(u8::from(i == j))).collect()
    }

    #[test]
    fn errors_diagonal_and_dual_are_those_of_the_dense_model() -> Result<()> {
        let n = 12;
        for symmetric in [true, false] {
            let symmetry = if symmetric { Symmetry::Symmetric } else { Symmetry::General };
            let of = |i: usize, j: usize| entry(symmetric, i, j);
            let mut dense = Closure::new(n, n, symmetry, |x: &[f64], y: &mut [f64]| {
                for (i, y) in y.iter_mut().enumerate() {
                    *y = (0..n).map(|j| of(i, j) * x[j]).sum();
                }
                Ok(())
            });
            let direct: Vec<f64> = (0..n).map(|i| 1.0 + i as f64).collect();
            let options = LowRankCapture { photos: 5, ..LowRankCapture::default() };
            let model = capture(&mut dense, &direct, &options)?;
            let square = |entry: &dyn Fn(usize, usize) -> f64| -> f64 {
                (0..n * n).map(|ij| entry(ij / n, ij % n).powi(2)).sum()
            };
            let frobenius = square(&of).sqrt();
            let curve = error_curve(&model, frobenius);
            let diagonal = model.diagonal();
            for k in 1..=5 {
                let truncated = model.truncated(k);
                let columns: Vec<Vec<f64>> = (0..n).map(|j| truncated.relight(&unit(n, j))).collect();
                let entry = |i: usize, j: usize| columns[j][i] - if i == j { direct[i] } else { 0.0 };
                let missed = square(&|i, j| of(i, j) - entry(i, j)).sqrt() / frobenius;
                let told = curve[k - 1].error;
                // The cancellation between the squares loses half of the digits.
                assert!((missed - told).abs() < 1e-7, "{symmetric} {k}: {missed} {told}");
                for i in 0..n {
                    let row = truncated.dual(&unit(n, i));
                    assert!((0..n).all(|j| (row[j] - columns[j][i]).abs() < 1e-12), "dual of {i}");
                    assert!(k < 5 || (diagonal[i] - columns[i][i]).abs() < 1e-12, "diagonal at {i}");
                }
            }
            // The first pattern is white, so the relit white photo is exact.
            let mut white = vec![0.0; n];
            dense.apply(&vec![1.0; n], &mut white)?;
            for (i, relit) in model.relight(&vec![1.0; n]).iter().enumerate() {
                assert!((relit - white[i] - direct[i]).abs() < 1e-12);
            }
        }
        Ok(())
    }
}
