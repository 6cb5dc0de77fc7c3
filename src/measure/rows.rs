//! Sparse matrices of the measurement, as compressed rows.

use rayon::prelude::*;

/// A column and its weight.
pub(crate) type Entry = (u32, f64);

/// A sparse matrix in compressed rows.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    starts: Vec<usize>,
    entries: Vec<Entry>,
}

impl Rows {
    /// The matrix with these rows.
    pub(crate) fn new(rows: &[Vec<Entry>]) -> Self {
        let mut starts = vec![0];
        for row in rows {
            starts.push(starts[starts.len() - 1] + row.len());
        }
        Self { starts, entries: rows.concat() }
    }

    /// The transpose of the matrix with these rows, which has so many `columns`. Its entries ascend in each row.
    pub(crate) fn transposed(rows: &[Vec<Entry>], columns: usize) -> Self {
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

    /// One row.
    pub(crate) fn row(&self, row: usize) -> &[Entry] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// The product with `x`, where each entry counts as `weight` makes of it.
    pub(crate) fn apply(&self, x: &[f64], weight: impl Fn(f64) -> f64 + Sync) -> Vec<f64> {
        let sum = |row: usize| self.row(row).iter().map(|&(at, w)| weight(w) * x[at as usize]).sum();
        (0..self.starts.len() - 1).into_par_iter().map(sum).collect()
    }

    /// The sum of the squares of each row.
    pub(crate) fn squares(&self) -> Vec<f64> {
        let sum = |ends: &[usize]| self.entries[ends[0]..ends[1]].iter().map(|entry| entry.1 * entry.1).sum();
        self.starts.windows(2).map(sum).collect()
    }
}

/// The entries in ascending order of their columns, those of one column added up.
pub(crate) fn merged(mut entries: Vec<Entry>) -> Vec<Entry> {
    entries.sort_by_key(|entry| entry.0);
    let runs = entries.chunk_by(|a, b| a.0 == b.0);
    runs.map(|run| (run[0].0, run.iter().map(|entry| entry.1).sum())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_and_its_transpose_have_the_same_entries() {
        let rows = [vec![(1, 2.0), (2, 3.0)], vec![], vec![(1, 5.0)]];
        let (matrix, transpose) = (Rows::new(&rows), Rows::transposed(&rows, 3));
        assert_eq!(matrix.apply(&[1.0, 10.0, 100.0], |weight| weight), [320.0, 0.0, 50.0]);
        assert_eq!(
            [transpose.row(0), transpose.row(1), transpose.row(2)],
            [&[][..], &[(0, 2.0), (2, 5.0)], &[(0, 3.0)]]
        );
        assert_eq!(transpose.squares(), [0.0, 29.0, 9.0]);
        assert_eq!(merged(vec![(4, 1.0), (2, 3.0), (4, 0.5)]), [(2, 3.0), (4, 1.5)]);
    }
}
