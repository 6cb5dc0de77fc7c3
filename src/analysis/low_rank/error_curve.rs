//! The error of a model of each rank against the true matrix, and the least error of any matrix of that rank.

use super::LowRank;
use crate::error::Result;
use crate::finding::Ratio;
use crate::krylov::{EigsOptions, Start, Which, dot, eigs};
use crate::operator::Operator;

/// The error after a number of photos.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ErrorRow {
    /// The number of photos, `k`.
    pub photos: usize,
    /// The model's error, `‖G − G_k‖_F / ‖G‖_F`.
    pub error: f64,
    /// The same for the capture's `W Qᵀ` alone, which needs no symmetry.
    pub one_sided: f64,
}

/// The error of each rank up to the model's, given `‖G‖_F` of the captured matrix (without direct light).
///
/// It needs no product. In the Frobenius norm, `‖G − W Qᵀ‖² = ‖G‖² − ‖W‖²`; for symmetric `G` and `T = QᵀW`, `‖G − G_k‖² = ‖G‖²
/// − 2‖W‖² + ‖T‖²`.
pub fn error_curve(model: &LowRank, frobenius: f64) -> Vec<ErrorRow> {
    let total = frobenius * frobenius;
    // Without global light the model is exact.
    let share = |square: f64| Ratio::of(square.max(0.0).sqrt(), frobenius, 0.0).value().unwrap_or(0.0);
    let (mut photos_square, mut projected_square) = (0.0, 0.0);
    let mut rows = Vec::with_capacity(model.rank());
    for k in 0..model.rank() {
        photos_square += dot(&model.photos()[k], &model.photos()[k]);
        // The new row and column of T.
        for j in 0..=k {
            let entry = dot(&model.basis()[j], &model.photos()[k]);
            projected_square += entry * entry * if j == k { 1.0 } else { 2.0 };
        }
        rows.push(ErrorRow {
            photos: k + 1,
            error: share(total - 2.0 * photos_square + projected_square),
            one_sided: share(total - photos_square),
        });
    }
    rows
}

/// The least error of any matrix of each rank up to `ranks` (Eckart and Young, doi:10.1007/BF02288367). It follows from the eigenvalues of
/// largest magnitude of a symmetric `G`, as far as they converge within `products` products. Fails as [`eigs`] does.
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
    let found = eigs(operator, &options)?;
    let mut rest = frobenius * frobenius;
    Ok(found
        .values
        .iter()
        .map(|value| {
            rest -= value * value;
            Ratio::of(rest.max(0.0).sqrt(), frobenius, 0.0).value().unwrap_or(0.0)
        })
        .collect())
}

#[cfg(test)]
mod tests {
    use super::super::{LowRankCapture, capture};
    use super::*;
    use crate::operator::Symmetry;

    /// `G_ij` of a small matrix without particular structure.
    struct Dense {
        n: usize,
        symmetric: bool,
    }

    impl Dense {
        fn entry(&self, i: usize, j: usize) -> f64 {
            let (i, j) = if self.symmetric { (i.min(j), i.max(j)) } else { (i, j) };
            ((3 * i + 7 * j + i * j) % 11) as f64 / 11.0 + 1.0 / (1.0 + i as f64 + j as f64)
        }
    }

    impl Operator for Dense {
        fn rows(&self) -> usize {
            self.n
        }

        fn cols(&self) -> usize {
            self.n
        }

        fn symmetry(&self) -> Symmetry {
            if self.symmetric { Symmetry::Symmetric } else { Symmetry::General }
        }

        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
            for (i, y) in y.iter_mut().enumerate() {
                *y = (0..self.n).map(|j| self.entry(i, j) * x[j]).sum();
            }
            Ok(())
        }
    }

    fn unit(n: usize, j: usize) -> Vec<f64> {
        (0..n).map(|i| f64::from(u8::from(i == j))).collect()
    }

    #[test]
    fn errors_diagonal_and_dual_are_those_of_the_dense_model() -> Result<()> {
        let n = 12;
        for symmetric in [true, false] {
            let mut dense = Dense { n, symmetric };
            let direct: Vec<f64> = (0..n).map(|i| 1.0 + i as f64).collect();
            let options = LowRankCapture { photos: 5, ..LowRankCapture::default() };
            let model = capture(&mut dense, &direct, &options)?;
            let square = |entry: &dyn Fn(usize, usize) -> f64| -> f64 {
                (0..n * n).map(|ij| entry(ij / n, ij % n).powi(2)).sum()
            };
            let frobenius = square(&|i, j| dense.entry(i, j)).sqrt();
            let curve = error_curve(&model, frobenius);
            let diagonal = model.diagonal();
            for k in 1..=5 {
                let truncated = model.truncated(k);
                let columns: Vec<Vec<f64>> = (0..n).map(|j| truncated.relight(&unit(n, j))).collect();
                let entry = |i: usize, j: usize| columns[j][i] - if i == j { direct[i] } else { 0.0 };
                let missed = square(&|i, j| dense.entry(i, j) - entry(i, j)).sqrt() / frobenius;
                let told = if symmetric { curve[k - 1].error } else { curve[k - 1].one_sided };
                // The cancellation of squares leaves half of the digits.
                assert!((missed - told).abs() < 1e-7, "{symmetric} {k}: {missed} {told}");
                for i in 0..n {
                    let row = truncated.dual(&unit(n, i));
                    assert!((0..n).all(|j| (row[j] - columns[j][i]).abs() < 1e-12), "dual of {i}");
                    assert!(k < 5 || (diagonal[i] - columns[i][i]).abs() < 1e-12, "diagonal at {i}");
                }
            }
            // The first pattern is white: its photo is exact.
            let mut white = vec![0.0; n];
            dense.apply(&vec![1.0; n], &mut white)?;
            for (i, relit) in model.relight(&vec![1.0; n]).iter().enumerate() {
                assert!((relit - white[i] - direct[i]).abs() < 1e-12);
            }
        }
        Ok(())
    }
}
