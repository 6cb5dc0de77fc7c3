//! Sparse matrices in compressed rows with `f64` values. Files and callers exchange matrices in this form.

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::operator::{Adjoint, Operator, Symmetry, delegate, product};

const ROWS_PER_TASK: usize = 256;

/// A matrix in compressed sparse rows. Row `j` holds the values `weights[row_start[j]..row_start[j + 1]]` at the columns
/// `columns[row_start[j]..row_start[j + 1]]`, which ascend strictly. The arrays never change, and copies of a matrix share them.
#[derive(Clone, Debug, PartialEq)]
pub struct Csr {
    cols: usize,
    row_start: Arc<Vec<usize>>,
    columns: Arc<Vec<u32>>,
    weights: Arc<Vec<f64>>,
}

impl Csr {
    /// Makes the matrix with `cols` columns and `row_start.len() − 1` rows from its three arrays.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the arrays do not describe a matrix in compressed sparse rows.
    pub fn new(cols: usize, row_start: Vec<usize>, columns: Vec<u32>, weights: Vec<f64>) -> Result<Self> {
        let mismatch = |what, expected: String, found: String| Err(Error::dimension(what, expected, found));
        if columns.len() != weights.len() {
            let found = columns.len().to_string();
            return mismatch("columns of a sparse matrix", weights.len().to_string(), found);
        }
        let ends = (row_start.first(), row_start.last());
        if ends != (Some(&0), Some(&weights.len())) || !row_start.is_sorted() {
            let expected = format!("ascending from 0 to {}", weights.len());
            return mismatch("row starts of a sparse matrix", expected, format!("{ends:?}"));
        }
        let (row_start, columns, weights) = (Arc::new(row_start), Arc::new(columns), Arc::new(weights));
        let matrix = Self { cols, row_start, columns, weights };
        for row in 0..matrix.rows() {
            let columns = matrix.row(row).0;
            let ascends = columns.is_sorted_by(|a, b| a < b);
            if !ascends || columns.last().is_some_and(|&last| last as usize >= cols) {
                let expected = format!("strictly ascending below {cols}");
                return mismatch("columns of a sparse matrix", expected, format!("others in row {row}"));
            }
        }
        Ok(matrix)
    }

    /// Makes the matrix with `cols` columns whose rows have these entries: columns, which ascend strictly, and their values.
    ///
    /// # Errors
    /// The errors of [`Csr::new`].
    pub(crate) fn of_rows<R: IntoIterator<Item = (u32, f64)>>(
        cols: usize,
        rows: impl IntoIterator<Item = R>,
    ) -> Result<Self> {
        let (mut row_start, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
        for row in rows {
            for (column, weight) in row {
                columns.push(column);
                weights.push(weight);
            }
            row_start.push(columns.len());
        }
        Self::new(cols, row_start, columns, weights)
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    /// The number of columns.
    pub fn cols(&self) -> usize {
        self.cols
    }

    /// The index of each row's first entry, followed by the number of entries.
    pub fn row_start(&self) -> &[usize] {
        &self.row_start
    }

    /// The column of each entry.
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// The value of each entry.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// The columns and values of one row.
    pub fn row(&self, row: usize) -> (&[u32], &[f64]) {
        let range = self.row_start[row]..self.row_start[row + 1];
        (&self.columns[range.clone()], &self.weights[range])
    }

    /// The entries as (row, column, value), row by row.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        (0..self.rows()).flat_map(move |row| {
            let (columns, values) = self.row(row);
            columns.iter().zip(values).map(move |(&column, &value)| (row, column as usize, value))
        })
    }

    /// The transpose.
    pub fn transposed(&self) -> Self {
        let mut row_start = vec![0; self.cols + 1];
        for &column in &*self.columns {
            row_start[column as usize + 1] += 1;
        }
        for row in 0..self.cols {
            row_start[row + 1] += row_start[row];
        }
        let mut next = row_start.clone();
        let mut columns = vec![0; self.columns.len()];
        let mut weights = vec![0.0; self.columns.len()];
        // Rows are visited in order, so each row of the transpose is filled from left to right.
        for (row, column, value) in self.entries() {
            let at = next[column];
            next[column] += 1;
            columns[at] = row as u32;
            weights[at] = value;
        }
        let (row_start, columns, weights) = (Arc::new(row_start), Arc::new(columns), Arc::new(weights));
        Self { cols: self.rows(), row_start, columns, weights }
    }

    /// `A x`, for a small matrix. [`SparseOperator`] uses all cores.
    pub(crate) fn times(&self, x: &[f64]) -> Vec<f64> {
        (0..self.rows()).map(|row| self.row_times(row, x)).collect()
    }

    fn row_times(&self, row: usize, x: &[f64]) -> f64 {
        let (columns, weights) = self.row(row);
        let products = columns.iter().zip(weights).map(|(&column, weight)| weight * x[column as usize]);
        // The sum of no products is −0 without this.
        products.sum::<f64>() + 0.0
    }

    /// The diagonal, with one value for each row. The value is 0 if the row stores no diagonal entry.
    pub fn diagonal(&self) -> Vec<f64> {
        let own = |row: usize| {
            let (columns, weights) = self.row(row);
            columns.binary_search(&(row as u32)).map_or(0.0, |at| weights[at])
        };
        (0..self.rows()).map(own).collect()
    }

    /// The entries on the diagonal alone. Fails only for a malformed matrix.
    pub fn only_diagonal(&self) -> Result<Self> {
        let own = |(row, value)| Some((row as u32, value)).filter(|_| value != 0.0);
        Self::of_rows(self.cols, self.diagonal().into_iter().enumerate().map(own))
    }

    /// The matrix with each row divided by the sum of its entries. A row whose sum is not positive becomes zero.
    #[must_use]
    pub fn with_row_sums_of_one(&self) -> Self {
        let mut weights = Vec::with_capacity(self.weights.len());
        for row in 0..self.rows() {
            let values = self.row(row).1;
            let sum: f64 = values.iter().sum();
            weights.extend(values.iter().map(|value| if sum > 0.0 { value / sum } else { 0.0 }));
        }
        Self { weights: Arc::new(weights), ..self.clone() }
    }

    /// The sum of `factor · matrix` over all terms, added in order. Entries that are zero are dropped.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the matrices have different shapes.
    pub fn sum(terms: &[(f64, &Self)]) -> Result<Self> {
        let shape = terms.first().map_or([0; 2], |(_, matrix)| [matrix.rows(), matrix.cols]);
        let (mut row_start, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
        if let Some((_, other)) = terms.iter().find(|(_, matrix)| [matrix.rows(), matrix.cols] != shape) {
            let [expected, found] =
                [shape, [other.rows(), other.cols]].map(|[rows, cols]| format!("{rows}x{cols}"));
            return Err(Error::dimension("rows and columns of a term", expected, found));
        }
        let mut entries: Vec<(u32, f64)> = Vec::new();
        for row in 0..shape[0] {
            entries.clear();
            for (factor, matrix) in terms {
                let (of_row, values) = matrix.row(row);
                entries.extend(of_row.iter().copied().zip(values.iter().map(|value| factor * value)));
            }
            entries.sort_by_key(|entry| entry.0);
            for run in entries.chunk_by(|a, b| a.0 == b.0) {
                let sum: f64 = run.iter().map(|entry| entry.1).sum();
                if sum != 0.0 {
                    columns.push(run[0].0);
                    weights.push(sum);
                }
            }
            row_start.push(columns.len());
        }
        Self::new(shape[1], row_start, columns, weights)
    }

    /// Returns true if the matrix is square and bitwise equal to its transpose.
    pub fn is_symmetric(&self) -> bool {
        self.rows() == self.cols
            && self.entries().all(|(row, column, value)| {
                let (columns, values) = self.row(column);
                columns.binary_search(&(row as u32)).is_ok_and(|at| values[at].to_bits() == value.to_bits())
            })
    }
}

/// `y = A x` and `x = Aᵀ y` for a matrix in memory. Both products sum in a fixed order, so results do not depend on the number of threads.
#[derive(Clone, Debug)]
pub struct SparseOperator {
    matrix: Csr,
    /// `None` if the matrix is symmetric.
    transpose: Option<Csr>,
}

impl SparseOperator {
    /// Makes the operator of `matrix`. If the matrix is not bitwise symmetric, keeps its transpose too.
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
            *value = matrix.row_times(row, x);
        }
    });
    Ok(())
}

/// `W A`, for the products of an operator `A` seen through a map `W`.
pub(crate) struct Mapped<'a, O> {
    pub(crate) operator: &'a mut O,
    pub(crate) map: &'a Csr,
}

impl<O: Operator> Operator for Mapped<'_, O> {
    delegate!(operator: block_size, observer, frames, confirming);

    fn rows(&self) -> usize {
        self.map.rows()
    }

    fn cols(&self) -> usize {
        self.operator.cols()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        y.copy_from_slice(&self.map.times(&product(self.operator, x)?));
        Ok(())
    }
}

/// A column and its weight.
pub(crate) type WeightedColumn = (u32, f64);

/// A sparse matrix in compressed rows, for products within the program. [`Csr`] is the form of files.
#[derive(Clone, Debug)]
pub(crate) struct SparseRows {
    starts: Vec<usize>,
    entries: Vec<WeightedColumn>,
}

impl SparseRows {
    pub(crate) fn new(rows: &[Vec<WeightedColumn>]) -> Self {
        let mut starts = vec![0];
        for row in rows {
            starts.push(starts[starts.len() - 1] + row.len());
        }
        Self { starts, entries: rows.concat() }
    }

    /// The transpose of the matrix with these rows and this number of `columns`. The columns ascend in each row.
    pub(crate) fn transposed(rows: &[Vec<WeightedColumn>], columns: usize) -> Self {
        let mut starts = vec![0; columns + 1];
        for &(column, _) in rows.iter().flatten() {
            starts[column as usize + 1] += 1;
        }
        for column in 0..columns {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, 0.0); starts[columns]];
        for (row, of_row) in rows.iter().enumerate() {
            for &(column, weight) in of_row {
                let at = &mut next[column as usize];
                entries[*at] = (row as u32, weight);
                *at += 1;
            }
        }
        Self { starts, entries }
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = &[WeightedColumn]> {
        self.starts.windows(2).map(|ends| &self.entries[ends[0]..ends[1]])
    }

    pub(crate) fn row(&self, row: usize) -> &[WeightedColumn] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// The product with `x`, where `weight` transforms each entry of the matrix.
    pub(crate) fn apply(&self, x: &[f64], weight: impl Fn(f64) -> f64 + Sync) -> Vec<f64> {
        let sum = |row: usize| self.row(row).iter().map(|&(at, w)| weight(w) * x[at as usize]).sum();
        (0..self.starts.len() - 1).into_par_iter().map(sum).collect()
    }

    pub(crate) fn squares(&self) -> Vec<f64> {
        self.rows().map(|row| row.iter().map(|entry| entry.1 * entry.1).sum()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn symmetric(cols: usize, start: &[usize], columns: &[u32], weights: &[f64]) -> Option<bool> {
        let matrix = Csr::new(cols, start.to_vec(), columns.to_vec(), weights.to_vec());
        matrix.ok().map(|matrix| matrix.is_symmetric())
    }

    #[test]
    fn symmetry_is_exact() {
        assert_eq!(symmetric(2, &[0, 2, 3], &[0, 1, 0], &[2.0, 0.5, 0.5]), Some(true));
        assert_eq!(symmetric(2, &[0, 2, 3], &[0, 1, 0], &[2.0, 0.5, 0.500_000_000_000_000_1]), Some(false));
        assert_eq!(symmetric(2, &[0, 1], &[1], &[1.0]), Some(false), "not square");
    }

    #[test]
    fn a_missing_entry_of_the_diagonal_is_zero() -> Result<()> {
        let matrix = Csr::new(2, vec![0, 2, 3, 4], vec![0, 1, 0, 1], vec![2.0, 0.5, 0.5, 7.0])?;
        assert_eq!(matrix.diagonal(), [2.0, 0.0, 0.0]);
        Ok(())
    }

    #[test]
    fn inconsistent_arrays_are_refused() {
        assert_eq!(symmetric(3, &[0, 1, 2], &[2, 0], &[1.0, 1.0]), Some(false), "this one is fine");
        assert_eq!(symmetric(3, &[0, 2, 1], &[0, 1], &[1.0, 1.0]), None, "descending");
        assert_eq!(symmetric(3, &[0, 5, 2], &[0, 1], &[1.0, 1.0]), None, "beyond the end");
        assert_eq!(symmetric(3, &[0, 1, 2], &[3, 0], &[1.0, 1.0]), None, "column out of range");
        assert_eq!(symmetric(3, &[0, 2, 2], &[1, 1], &[1.0, 1.0]), None, "column twice");
        assert_eq!(symmetric(3, &[0, 1, 2], &[0, 1], &[1.0]), None, "a value is missing");
        assert_eq!(symmetric(3, &[], &[], &[]), None, "not even zero rows");
    }

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
