//! A sparse matrix as an operator for the Krylov methods.

use rayon::prelude::*;

use super::Csr;
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Operator, Symmetry};

/// Rows of one task of a product.
const ROWS_PER_TASK: usize = 256;

/// `y = A x` and `x = Aᵀ y` for a matrix in memory. Both run over rows, in a fixed order, so that results do
/// not depend on the number of threads.
#[derive(Clone, Debug)]
pub struct SparseOperator {
    matrix: Csr,
    /// `None` where the matrix is symmetric.
    transpose: Option<Csr>,
}

impl SparseOperator {
    /// The operator of `matrix`. Checks whether the matrix is symmetric to the last bit; if not, keeps its
    /// transpose too.
    pub fn new(matrix: Csr) -> Self {
        let transpose = (!matrix.is_symmetric()).then(|| matrix.transposed());
        Self { matrix, transpose }
    }

    /// The matrix.
    pub fn matrix(&self) -> &Csr {
        &self.matrix
    }
}

impl Operator for SparseOperator {
    fn rows(&self) -> usize {
        self.matrix.rows()
    }

    fn cols(&self) -> usize {
        self.matrix.cols()
    }

    fn symmetry(&self) -> Symmetry {
        if self.transpose.is_none() { Symmetry::Symmetric } else { Symmetry::General }
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        multiply(&self.matrix, x, y)
    }

    fn confirming(&mut self, _: bool) -> bool {
        true
    }
}

impl Adjoint for SparseOperator {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        multiply(self.transpose.as_ref().unwrap_or(&self.matrix), y, x)
    }
}

fn multiply(matrix: &Csr, x: &[f64], y: &mut [f64]) -> Result<()> {
    Error::check_size("entries of the vector to multiply", matrix.cols(), x.len())?;
    Error::check_size("entries of the product", matrix.rows(), y.len())?;
    y.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(task, rows)| {
        for (row, value) in (task * ROWS_PER_TASK..).zip(rows) {
            let (columns, weights) = matrix.row(row);
            *value = columns.iter().zip(weights).map(|(&column, weight)| weight * x[column as usize]).sum();
        }
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [[1, 0, 2], [0, 3, 0]]
    fn rectangular() -> SparseOperator {
        let matrix = Csr::new(3, vec![0, 2, 3], vec![0, 2, 1], vec![1.0, 2.0, 3.0]);
        SparseOperator::new(matrix.unwrap_or_else(|error| unreachable!("{error}")))
    }

    #[test]
    fn products_equal_those_of_the_dense_matrix() {
        let mut operator = rectangular();
        let (mut y, mut x) = ([0.0; 2], [0.0; 3]);
        assert!(operator.apply(&[1.0, 10.0, 100.0], &mut y).is_ok());
        assert!(operator.apply_adjoint(&[1.0, 10.0], &mut x).is_ok());
        assert_eq!((y, x), ([201.0, 30.0], [1.0, 30.0, 2.0]));
        assert_eq!(operator.symmetry(), Symmetry::General);
    }

    #[test]
    fn vectors_of_another_length_are_refused() {
        assert!(rectangular().apply(&[1.0; 2], &mut [0.0; 2]).is_err());
        assert!(rectangular().apply_adjoint(&[1.0; 2], &mut [0.0; 2]).is_err());
    }
}
