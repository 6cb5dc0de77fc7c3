//! Arnoldi on operators that are not symmetric, against the dense eigensolver.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::krylov_support::{Dense, general_gallery, spread};
use krylux::krylov::{EigsMethod, EigsOptions, Factorization, Start, Status, Step, Which, dot, eigs};

fn nearest(value: (f64, f64), truth: &[(f64, f64)]) -> f64 {
    truth.iter().map(|other| (other.0 - value.0).hypot(other.1 - value.1)).fold(f64::INFINITY, f64::min)
}

const ENDS: [Which; 4] =
    [Which::LargestMagnitude, Which::LargestAlgebraic, Which::LargestImaginary, Which::SmallestAlgebraic];

#[test]
fn residuals_are_true_on_the_whole_gallery_however_early_it_stops() {
    for (name, mut matrix) in general_gallery() {
        let rounding = 1e-13 * (1.0 + matrix.size()) * matrix.n as f64;
        for which in ENDS {
            for products in [1, 3, 8, 20] {
                let options = EigsOptions {
                    count: 4,
                    which,
                    products,
                    method: EigsMethod::Arnoldi,
                    ..EigsOptions::default()
                };
                let before = matrix.products;
                let found = eigs(&mut matrix, &options).unwrap();
                assert_eq!(found.stats.products, matrix.products - before);
                assert!(found.stats.products <= products);
                for k in 0..found.values.len() {
                    let pair = (found.values[k], found.imaginary_values[k]);
                    let (re, im) = (&found.vectors[k], &found.imaginary_vectors[k]);
                    assert_eq!(pair.1 == 0.0, im.is_empty(), "{name}: a real pair has a real vector");
                    let length = dot(re, re) + dot(im, im);
                    assert!((length - 1.0).abs() < 1e-12, "{name}: ‖y‖² = {length}");
                    let residual = matrix.residual(pair, re, im);
                    assert!(
                        (residual - found.residuals[k]).abs() < rounding,
                        "{name}, {which:?}, {products}: {residual:e} true, {:e} reported",
                        found.residuals[k]
                    );
                }
            }
        }
    }
}

#[test]
fn whole_spectrum_comes_with_as_many_products_as_there_are_dimensions() {
    for (name, mut matrix) in general_gallery() {
        let truth = matrix.complex_eigenvalues();
        let n = matrix.n;
        let options = EigsOptions {
            count: n,
            which: Which::LargestMagnitude,
            products: n + 10,
            tolerance: 0.0,
            method: EigsMethod::Arnoldi,
            ..EigsOptions::default()
        };
        let found = eigs(&mut matrix, &options).unwrap();
        // Tolerance 0 is reached early only where the residual is exactly 0, which is as good.
        assert!(matches!(found.stats.status, Status::SpaceExhausted | Status::ReachedTolerance), "{name}");
        assert_eq!((matrix.products, found.values.len()), (n, n), "{name}");
        for k in 0..n {
            let error = nearest((found.values[k], found.imaginary_values[k]), &truth);
            // The bound is condition × rounding here, to first order (conditions reach 1e10); 10 for the second.
            let allowed = 10.0 * found.bounds[k].max(1e-15 * matrix.size());
            assert!(error <= allowed, "{name}: eigenvalue {k} is {error:e} off, {allowed:e} allowed");
        }
        let sums = (found.values.iter().sum::<f64>(), (0..n).map(|i| matrix.entries[i * n + i]).sum::<f64>());
        assert!((sums.0 - sums.1).abs() < 1e-12 * n as f64 * (1.0 + matrix.size()), "{name}: the trace");
    }
}

#[test]
fn wanted_ends_of_the_spectrum_come_first_and_their_bounds_hold() {
    for (name, mut matrix) in general_gallery() {
        let truth = matrix.complex_eigenvalues();
        for which in [Which::LargestMagnitude, Which::LargestAlgebraic, Which::LargestImaginary] {
            let key = |(re, im): (f64, f64)| match which {
                Which::LargestMagnitude => re.hypot(im),
                Which::LargestImaginary => im.abs(),
                _ => re,
            };
            let best = truth.iter().map(|value| key(*value)).fold(f64::NEG_INFINITY, f64::max);
            let options = EigsOptions {
                count: 1,
                which,
                products: matrix.n,
                method: EigsMethod::Arnoldi,
                ..EigsOptions::default()
            };
            let found = eigs(&mut matrix, &options).unwrap();
            let value = (found.values[0], found.imaginary_values[0]);
            let size = 1.0 + matrix.size();
            let allowed = 2.0 * found.bounds[0] + 1e-12 * size;
            assert!(nearest(value, &truth) <= allowed, "{name}, {which:?}: {value:?}");
            assert!(
                (key(value) - best).abs() <= allowed + 1e-7 * size,
                "{name}, {which:?}: {} is not {best}",
                key(value)
            );
            assert!(value.1 >= 0.0, "{name}: of a complex pair the upper one comes first");
        }
    }
}

#[test]
fn basis_is_orthonormal_and_carries_the_relation() {
    for (name, matrix) in general_gallery() {
        let n = matrix.n;
        let mut arnoldi = Factorization::arnoldi(&Start::Gaussian { seed: 5 }.vector(n), &[]).unwrap();
        while !arnoldi.is_exhausted() {
            arnoldi.expand(&mut matrix.clone()).unwrap();
        }
        let state = &arnoldi;
        for (j, v) in state.basis().iter().enumerate() {
            let product: Vec<f64> = matrix.entries.chunks(n).map(|row| dot(row, v)).collect();
            for (i, u) in state.basis().iter().enumerate() {
                let expected = f64::from(u8::from(i == j));
                assert!((dot(u, v) - expected).abs() < n as f64 * f64::EPSILON * 4.0, "{name}: {i}, {j}");
                assert!(
                    (dot(u, &product) - state.entry(i, j)).abs() < 1e-13 * (1.0 + matrix.size()),
                    "{name}"
                );
                assert!(i <= j + 1 || state.entry(i, j) == 0.0, "H is Hessenberg");
            }
        }
        // Norms do not depend on the basis of the whole space: the departure from symmetry is that of the matrix.
        let (mut difference, mut total) = (0.0, 0.0);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            difference += (matrix.entries[i * n + j] - matrix.entries[j * n + i]).powi(2);
            total += matrix.entries[i * n + j].powi(2);
        }
        let truth = if total > 0.0 { f64::sqrt(difference / total) } else { 0.0 };
        assert!(
            (state.asymmetry() - truth).abs() < 1e-12 * n as f64,
            "{name}: {} {truth}",
            state.asymmetry()
        );
    }
}

#[test]
fn breakdown_is_an_invariant_subspace_and_not_the_end() {
    let mut matrix = Dense::general(12, |i, j| f64::from(u8::from((j + 1) % 12 == i)));
    // Period three: A³ x = x.
    let start: Vec<f64> = (0..12).map(|i| f64::from(i % 3)).collect();
    let mut arnoldi = Factorization::arnoldi(&start, &[]).unwrap();
    let steps: Vec<Step> = (0..3).map(|_| arnoldi.expand(&mut matrix).unwrap()).collect();
    assert_eq!(steps, [Step::Extended, Step::Extended, Step::Invariant]);
    let found = arnoldi.ritz(Which::LargestImaginary, 3).unwrap();
    let root = 0.75_f64.sqrt();
    for (pair, wanted) in found.iter().zip([(-0.5, root), (-0.5, -root), (1.0, 0.0)]) {
        assert!((pair.value - wanted.0).abs() < 1e-14 && (pair.imaginary - wanted.1).abs() < 1e-14);
        assert!(pair.residual < 1e-14 && (pair.condition - 1.0).abs() < 1e-12, "normal: condition 1");
    }
    while !arnoldi.is_exhausted() {
        arnoldi.expand(&mut matrix).unwrap();
    }
    assert_eq!(matrix.products, 12);
}

#[test]
fn on_a_symmetric_operator_it_is_lanczos() {
    let mut matrix = Dense::turned(&spread(80));
    let start = Start::default().vector(80);
    let (mut arnoldi, mut lanczos) =
        (Factorization::arnoldi(&start, &[]).unwrap(), Factorization::lanczos(&start, &[]).unwrap());
    for _ in 0..25 {
        arnoldi.expand(&mut matrix).unwrap();
        lanczos.expand(&mut matrix).unwrap();
    }
    let (a, b) = (
        arnoldi.ritz(Which::LargestAlgebraic, 5).unwrap(),
        lanczos.ritz(Which::LargestAlgebraic, 5).unwrap(),
    );
    for (a, b) in a.iter().zip(&b) {
        assert!((a.value - b.value).abs() < 1e-13 && (a.residual - b.residual).abs() < 1e-13);
        assert_eq!(a.imaginary, 0.0);
    }
}

#[test]
fn deflation_takes_an_invariant_subspace_out_of_the_spectrum() {
    // The leading unit vectors span invariant subspaces of an upper triangular matrix.
    let mut matrix = Dense::general(30, |i, j| {
        if i == j {
            30.0 - i as f64
        } else if j > i {
            0.2
        } else {
            0.0
        }
    });
    let known: Vec<Vec<f64>> =
        (0..2).map(|k| (0..30).map(|i| f64::from(u8::from(i == k))).collect()).collect();
    let options = EigsOptions {
        count: 2,
        products: 28,
        tolerance: 0.0,
        method: EigsMethod::Arnoldi,
        deflate: known,
        ..EigsOptions::default()
    };
    let found = eigs(&mut matrix, &options).unwrap();
    for (value, wanted) in found.values.iter().zip([28.0, 27.0]) {
        assert!((value - wanted).abs() < 1e-8, "{value}");
    }
    // Schur vectors: zero along the known ones. They are not eigenvectors, and the residual says so.
    assert!(found.vectors[0][0].abs() < 1e-14);
    let residual = matrix.residual((found.values[0], 0.0), &found.vectors[0], &[]);
    assert!(residual > 0.01 && (residual - found.residuals[0]).abs() < 1e-10, "{residual:e}");
}

/// `A e₁ = 2 e₁ + 3 e₂` and `A e₂ = e₁ + 5 e₃`: what is new has the lengths 3 and 5; nothing is new after three steps.
#[test]
fn the_residual_norm_is_the_length_of_what_the_last_product_has_outside_the_basis() {
    let entries = [[2.0, 1.0, 0.0], [3.0, 0.0, 2.0], [0.0, 5.0, 1.0]];
    let mut matrix = Dense::general(3, |i, j| entries[i][j]);
    let mut arnoldi = Factorization::arnoldi(&[1.0, 0.0, 0.0], &[]).unwrap();
    let mut norms = vec![arnoldi.residual_norm()];
    for _ in 0..2 {
        arnoldi.expand(&mut matrix).unwrap();
        norms.push(arnoldi.residual_norm());
    }
    assert_eq!(norms, [0.0, 3.0, 5.0]);
    let pair = &arnoldi.ritz(Which::LargestMagnitude, 1).unwrap()[0];
    assert!(pair.is_resolved(0.75 * pair.residual, 2.0) && !pair.is_resolved(0.25 * pair.residual, 2.0));
    // It cannot be restarted, unless there is nothing to leave out.
    assert!(arnoldi.shrink(Which::LargestMagnitude, 1).is_err());
    assert!(arnoldi.shrink(Which::LargestMagnitude, 2).is_ok());
}
