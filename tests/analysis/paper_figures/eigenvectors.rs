//! Figure 2: the principal eigenvector of light transport, by power iteration and Krylov methods.

use faer::{Mat, Side};
use krylux::krylov::{EigsMethod, EigsOptions, Start, Which, dot, eigs, norm};
use krylux::transport::{Channels, MatrixOperator, Part};

use crate::common::{csr, load, settings, trace, tracer};

#[test]
fn figure_2_the_principal_eigenvector_is_the_dense_one_and_not_negative() {
    let side = 32;
    let n = side * side;
    for name in ["corner", "two-sheets", "carton-eggs"] {
        let traced = trace(&mut tracer(&load(name)), settings(side, 256, 6, 0), Channels::Luma);
        let matrix = csr(&traced.matrix, Part::Full, 0);
        let mut dense = Mat::<f64>::zeros(n, n);
        matrix.entries().for_each(|(row, column, weight)| dense[(row, column)] += weight);
        let decomposition = dense.self_adjoint_eigen(Side::Lower).unwrap();
        let values = decomposition.S();
        let last = (0..n).map(|i| decomposition.U()[(i, n - 1)]).collect::<Vec<f64>>();
        let mut operator = MatrixOperator::new(&traced.matrix, Part::Full, 0);
        for method in [EigsMethod::Lanczos, EigsMethod::Arnoldi] {
            let options = EigsOptions {
                count: 1,
                which: Which::LargestAlgebraic,
                products: 50,
                method,
                start: Start::Given(vec![1.0; n]),
                ..EigsOptions::default()
            };
            let found = eigs(&mut operator, &options).unwrap();
            let vector = &found.vectors[0];
            let overlap = (dot(vector, &last) / norm(vector) / norm(&last)).abs();
            let sign = if vector.iter().sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
            let largest = vector.iter().fold(0.0_f64, |largest, v| largest.max(v.abs()));
            let least = vector.iter().map(|v| sign * v / largest).fold(f64::INFINITY, f64::min);
            println!(
                "fig2: {name}, {method:?}: overlap {overlap:.6}, least entry {least:.1e} of the largest, {} photos; λ {:.5} {:.5}",
                found.stats.products,
                found.values[0],
                values[n - 1]
            );
            assert!(overlap >= 0.999, "{name}, {method:?}: {overlap}");
            // Perron and Frobenius, to what the residual leaves open.
            assert!(least >= -1e-3, "{name}, {method:?}: {least}");
        }
    }
}
