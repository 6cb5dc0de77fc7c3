//! The dense reference solution for Krylov methods.

use faer::{Mat, Side};

use crate::error::{Error, Result};
use crate::sparse::Csr;

/// The largest eigenvalue of a symmetric matrix and its eigenvector, of norm 1 and with a positive sum, from a dense eigensolver.
/// It needs `8 n²` bytes and O(`n³`) operations.
pub(super) fn principal(matrix: &Csr) -> Result<(f64, Vec<f64>)> {
    let n = matrix.rows();
    let mut dense = Mat::<f64>::zeros(n, n);
    matrix.entries().for_each(|(row, column, weight)| dense[(row, column)] += weight);
    let found = dense
        .self_adjoint_eigen(Side::Lower)
        .map_err(|error| Error::Numerical(format!("the dense eigensolver: {error:?}")))?;
    // The eigenvalues are in ascending order.
    let vector: Vec<f64> = (0..n).map(|row| found.U()[(row, n - 1)]).collect();
    let sign = vector.iter().sum::<f64>().signum();
    let value = found.S().column_vector()[n - 1];
    Ok((value, vector.into_iter().map(|entry| sign * entry).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_pair_of_two_coupled_pixels() -> Result<()> {
        // [[2, 1], [1, 2]] has eigenvalue 3 with eigenvector (1, 1).
        let matrix = Csr::new(2, vec![0, 2, 4], vec![0, 1, 0, 1], vec![2.0, 1.0, 1.0, 2.0])?;
        let (value, vector) = principal(&matrix)?;
        assert!((value - 3.0).abs() < 1e-14, "rounding of a 2×2 matrix: {value}");
        assert!(vector.iter().all(|entry| (entry - 0.5_f64.sqrt()).abs() < 1e-14), "{vector:?}");
        Ok(())
    }
}
