//! Eigenpairs of a matrix of your own by the Krylov methods: first as a sparse matrix, then as a function.
//!
//! `cargo run --release --example own_matrix`

use krylux::krylov::{EigsOptions, eigs};
use krylux::operator::{Closure, Symmetry};
use krylux::sparse::{Csr, SparseOperator};

/// Nodes of a path graph, whose Laplacian has the eigenvalues `2 − 2 cos(k π / N)`.
const N: usize = 60;

fn main() -> krylux::Result<()> {
    let options = EigsOptions { count: 3, products: N, ..EigsOptions::default() };
    let exact = |k: usize| 2.0 - 2.0 * ((N - k) as f64 * std::f64::consts::PI / N as f64).cos();

    let (mut row_start, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for row in 0..N {
        let neighbours = [row.checked_sub(1), Some(row + 1).filter(|&next| next < N)];
        let degree = neighbours.iter().flatten().count() as f64;
        for (column, weight) in [(neighbours[0], -1.0), (Some(row), degree), (neighbours[1], -1.0)] {
            let Some(column) = column else { continue };
            columns.push(column as u32);
            weights.push(weight);
        }
        row_start.push(columns.len());
    }
    let mut matrix = SparseOperator::new(Csr::new(N, row_start, columns, weights)?);
    let found = eigs(&mut matrix, &options)?;

    let mut function = Closure::new(N, N, Symmetry::Symmetric, |x: &[f64], y: &mut [f64]| {
        for i in 0..N {
            let step = |j: usize| x.get(j).map_or(0.0, |neighbour| x[i] - neighbour);
            y[i] = step(i.wrapping_sub(1)) + step(i + 1);
        }
        Ok(())
    });
    let again = eigs(&mut function, &options)?;

    for k in 0..3 {
        println!(
            "{}: {:.10} by the matrix, {:.10} by the function, {:.10} exactly; residual {:.1e}",
            k + 1,
            found.values[k],
            again.values[k],
            exact(k + 1),
            found.residuals[k]
        );
    }
    Ok(())
}
