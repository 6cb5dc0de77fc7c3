//! Vectors, products, and dense reference solutions for Krylov methods.

use faer::{Mat, Side};

use crate::error::{Error, Result};
pub(super) use crate::krylov::dot;
use crate::krylov::norm;
pub(super) use crate::operator::product;
use crate::sparse::Csr;

/// `a − b`.
pub(super) fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// `y ← y + share · x`.
pub(super) fn add(y: &mut [f64], share: f64, x: &[f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y += share * x);
}

/// The vector scaled to norm 1.
pub(super) fn unit(mut vector: Vec<f64>) -> Vec<f64> {
    let length = norm(&vector);
    vector.iter_mut().for_each(|value| *value /= length);
    vector
}

/// Makes the first vector of `pair` orthogonal to the first vector of each pair in `known`, which must be orthonormal, and scales it to
/// norm 1. The second vector is a linear function of the first, and changes in the same way. Returns the norm of the first vector before it
/// is scaled. If this norm is 0, nothing is scaled.
pub(super) fn make_orthonormal(pair: &mut [Vec<f64>; 2], known: &[[Vec<f64>; 2]]) -> f64 {
    let [vector, image] = pair;
    // A second pass is necessary, because rounding leaves some of the basis after the first pass.
    for _ in 0..2 {
        for [of, image_of] in known {
            let share = dot(of, vector);
            add(vector, -share, of);
            add(image, -share, image_of);
        }
    }
    let left = norm(vector);
    if left > 0.0 {
        vector.iter_mut().chain(image).for_each(|value| *value /= left);
    }
    left
}

/// The largest relative norm of a pattern outside the span of `known`, and of the patterns and images of the pairs before it.
pub(super) fn largest_outside(known: Vec<Vec<f64>>, pairs: impl IntoIterator<Item = [Vec<f64>; 2]>) -> f64 {
    let mut basis = Vec::new();
    known.into_iter().for_each(|vector| extend(&mut basis, vector));
    let mut most = 0.0_f64;
    for [pattern, image] in pairs {
        let rest = make_orthonormal(&mut [pattern.clone(), Vec::new()], &basis);
        most = most.max(rest / norm(&pattern));
        extend(&mut basis, pattern);
        extend(&mut basis, image);
    }
    most
}

/// Adds a vector to an orthonormal basis, unless it depends on the basis and leaves only rounding errors.
fn extend(basis: &mut Vec<[Vec<f64>; 2]>, vector: Vec<f64>) {
    let before = norm(&vector);
    let mut pair = [vector, Vec::new()];
    if make_orthonormal(&mut pair, basis) > 1e-12 * before {
        basis.push(pair);
    }
}

/// The norm of the part of a vector outside the span of `known`, relative to the vector.
pub(super) fn outside(vector: &[f64], known: &[Vec<f64>]) -> f64 {
    largest_outside(known.to_vec(), [[vector.to_vec(), Vec::new()]])
}

/// `|xᵀ y| / (‖x‖ ‖y‖)`, the absolute cosine of the angle between two vectors.
pub(super) fn overlap(x: &[f64], y: &[f64]) -> f64 {
    dot(x, y).abs() / (norm(x) * norm(y))
}

/// All eigenvalues of a symmetric matrix, the largest first, and its eigenvectors of norm 1.
pub(super) struct Spectrum {
    pub(super) values: Vec<f64>,
    pub(super) vectors: Vec<Vec<f64>>,
}

fn dense(matrix: &Csr) -> Mat<f64> {
    let mut dense = Mat::<f64>::zeros(matrix.rows(), matrix.cols());
    matrix.entries().for_each(|(row, column, weight)| dense[(row, column)] += weight);
    dense
}

/// The spectrum by a dense eigensolver, with `16 n²` bytes and O(`n³`) operations.
pub(super) fn spectrum(matrix: &Csr) -> Result<Spectrum> {
    of_dense(&dense(matrix))
}

/// The spectrum of the symmetric part of a small matrix, given by its rows.
pub(super) fn spectrum_of_rows(rows: &[Vec<f64>]) -> Result<Spectrum> {
    let half = |i: usize, j: usize| 0.5 * (rows[i][j] + rows[j][i]);
    of_dense(&Mat::from_fn(rows.len(), rows.len(), half))
}

fn of_dense(dense: &Mat<f64>) -> Result<Spectrum> {
    let n = dense.nrows();
    let found = dense
        .self_adjoint_eigen(Side::Lower)
        .map_err(|error| Error::Numerical(format!("the dense eigensolver: {error:?}")))?;
    // The solver's eigenvalues are in ascending order, so they are reversed.
    let values = (0..n).rev().map(|at| found.S().column_vector()[at]).collect();
    let vector = |at: usize| (0..n).map(|row| found.U()[(row, at)]).collect();
    Ok(Spectrum { values, vectors: (0..n).rev().map(vector).collect() })
}

/// The largest singular values of a matrix, descending, with their left and right vectors of norm 1.
pub(super) struct DenseTriplets {
    pub(super) values: Vec<f64>,
    pub(super) left: Vec<Vec<f64>>,
    pub(super) right: Vec<Vec<f64>>,
}

/// The `count` largest singular values by a dense solver. It needs `24 n²` bytes and O(`n³`) operations.
pub(super) fn singular_triplets(matrix: &Csr, count: usize) -> Result<DenseTriplets> {
    let found = dense(matrix).thin_svd().map_err(no_svd)?;
    let count = count.min(matrix.rows()).min(matrix.cols());
    let column = |of: faer::MatRef<'_, f64>, at: usize| of.col(at).iter().copied().collect();
    Ok(DenseTriplets {
        values: (0..count).map(|at| found.S().column_vector()[at]).collect(),
        left: (0..count).map(|at| column(found.U(), at)).collect(),
        right: (0..count).map(|at| column(found.V(), at)).collect(),
    })
}

fn no_svd(error: faer::linalg::solvers::SvdError) -> Error {
    Error::Numerical(format!("the dense SVD: {error:?}"))
}

/// The condition numbers `σ_max / σ_min` of the matrix of the first `k` vectors, each scaled to norm 1, for `k` from 1 to all. A number is
/// infinite if its vectors are linearly dependent.
pub(super) fn conditions(vectors: &[Vec<f64>]) -> Result<Vec<f64>> {
    let (rows, columns) = (vectors.first().map_or(0, Vec::len), vectors.len());
    let norms: Vec<f64> = vectors.iter().map(|vector| norm(vector)).collect();
    let scaled = Mat::from_fn(rows, columns, |row, column| vectors[column][row] / norms[column]);
    // A = Q R: the first k columns of A and the leading block of R have the same singular values.
    let triangle = scaled.qr().thin_R().to_owned();
    let condition = |k: usize| {
        let block = triangle.submatrix(0, 0, k.min(rows), k);
        let found = block.svd().map_err(no_svd)?;
        let values = found.S().column_vector();
        let (largest, smallest) = (values[0], values[k.min(rows) - 1]);
        Ok(if smallest > 0.0 { largest / smallest } else { f64::INFINITY })
    };
    (1..=columns).map(condition).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spectrum_of_two_coupled_pixels() -> Result<()> {
        // The matrix [[2, 1], [1, 2]] has the eigenvalues 3 and 1. The eigenvector of 3 is (1, 1).
        let matrix = Csr::new(2, vec![0, 2, 4], vec![0, 1, 0, 1], vec![2.0, 1.0, 1.0, 2.0])?;
        for found in [spectrum(&matrix)?, spectrum_of_rows(&[vec![2.0, 0.5], vec![1.5, 2.0]])?] {
            assert!((found.values[0] - 3.0).abs() < 1e-14, "rounding of a 2×2 matrix: {:?}", found.values);
            assert!((found.values[1] - 1.0).abs() < 1e-14);
            assert!((found.vectors[0][0] - found.vectors[0][1]).abs() < 1e-14, "{:?}", found.vectors);
        }
        Ok(())
    }

    #[test]
    fn singular_triplets_of_a_shear() -> Result<()> {
        // The matrix [[0, 2], [0, 0]] sends light from the projector's second pixel to the camera's first.
        let found = singular_triplets(&Csr::new(2, vec![0, 1, 1], vec![1], vec![2.0])?, 5)?;
        assert_eq!(found.values.len(), 2);
        assert!((found.values[0] - 2.0).abs() < 1e-15 && found.values[1].abs() < 1e-15, "{:?}", found.values);
        assert!(
            (found.left[0][0].abs() - 1.0).abs() < 1e-15 && (found.right[0][1].abs() - 1.0).abs() < 1e-15
        );
        Ok(())
    }

    #[test]
    fn condition_numbers_are_of_the_first_vectors_whatever_their_lengths() -> Result<()> {
        // Two vectors of norm 1 at an angle of 2t have the condition number 1 / tan t.
        let [c, s] = [0.1_f64.cos(), 0.1_f64.sin()];
        let vectors = [vec![c, s, 0.0], vec![7.0 * c, -7.0 * s, 0.0], vec![0.0, 0.0, 5.0]];
        let found = conditions(&vectors)?;
        let wanted = 1.0 / 0.1_f64.tan();
        for (found, wanted) in found.iter().zip([1.0, wanted, wanted]) {
            assert!((found - wanted).abs() < 1e-12 * wanted, "rounding: {found} {wanted}");
        }
        Ok(())
    }
}
