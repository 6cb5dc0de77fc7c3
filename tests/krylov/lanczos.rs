//! Lanczos and `eigs` on a gallery of small matrices, against the dense eigensolver.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use std::ops::ControlFlow;

use crate::comb::Comb;
use crate::krylov_support::{Dense, spread};
use krylux::Error;
use krylux::krylov::{
    Completeness, Eigs, EigsOptions, Factorization, PairStatus, Start, Status, Step, Which, dot, eigs,
    eigs_from,
};
use krylux::observer::{self, Estimate, OnStep};
use krylux::operator::{Observed, Operator, Symmetry};
use proptest::prelude::*;

fn solve(matrix: &mut Dense, count: usize, products: usize, which: Which) -> Eigs {
    let options = EigsOptions { count, products, which, ..EigsOptions::default() };
    let found = eigs(matrix, &options).unwrap();
    assert_eq!(found.stats.products, matrix.products, "the products reported are those taken");
    assert!(matrix.products <= products, "the budget holds");
    found
}

/// Residuals as reported against residuals as they are, by another product each.
fn check_residuals(matrix: &mut Dense, found: &Eigs, norm: f64) {
    let n = matrix.n;
    for ((value, vector), residual) in found.values.iter().zip(&found.vectors).zip(&found.residuals) {
        let mut product = vec![0.0; n];
        matrix.apply(vector, &mut product).unwrap();
        let difference: Vec<f64> = product.iter().zip(vector).map(|(p, v)| p - value * v).collect();
        let truth = dot(&difference, &difference).sqrt();
        // Rounding of a product of n terms, and of the basis.
        let rounding = n as f64 * 1e-14 * norm;
        assert!((truth - residual).abs() <= rounding, "residual {residual:e} reported, {truth:e} true");
    }
}

#[test]
fn leading_eigenvalues_of_a_spread_spectrum_come_long_before_n_products() {
    let mut matrix = Dense::turned(&spread(300));
    let truth = matrix.eigenvalues();
    let found = solve(&mut matrix, 5, 80, Which::LargestAlgebraic);
    assert_eq!(found.stats.status, Status::ReachedTolerance);
    assert!(found.statuses.iter().all(|&status| status == PairStatus::Converged));
    for (value, truth) in found.values.iter().zip(&truth) {
        // A Ritz value is as near as the square of its residual (1e-8) over the gap; then rounding, 300 terms.
        assert!((value - truth).abs() < 1e-12, "{value} {truth}");
    }
    check_residuals(&mut matrix, &found, 1.0);
}

#[test]
fn indefinite_matrices_give_either_end_or_the_largest_magnitudes() {
    let values: Vec<f64> = (0..60).map(|k| f64::from(k) - 40.0).collect();
    for (which, wanted) in [
        (Which::LargestAlgebraic, [19.0, 18.0, 17.0]),
        (Which::SmallestAlgebraic, [-40.0, -39.0, -38.0]),
        (Which::LargestMagnitude, [-40.0, -39.0, -38.0]),
    ] {
        let mut matrix = Dense::turned(&values);
        let found = solve(&mut matrix, 3, 60, which);
        for (value, wanted) in found.values.iter().zip(wanted) {
            assert!((value - wanted).abs() < 40.0 * 60.0 * 1e-14, "{which:?}: {value}, not {wanted}");
        }
    }
}

#[test]
fn repeated_eigenvalues_end_in_an_invariant_subspace_and_their_copies_come_after_it() {
    // Diagonal: a turned one has its eigenvalues repeated only up to rounding.
    let mut matrix = Dense::diagonal(&[3.0, 3.0, 3.0, 1.0, 1.0, 0.5]);
    let mut lanczos = Factorization::lanczos(&Start::default().vector(6), &[]).unwrap();
    let mut steps = Vec::new();
    while !lanczos.is_exhausted() {
        steps.push(lanczos.expand(&mut matrix).unwrap());
    }
    // Three distinct eigenvalues: the third step finds β = 0.
    assert_eq!(steps[..3], [Step::Extended, Step::Extended, Step::Invariant]);
    assert_eq!(steps.last(), Some(&Step::Exhausted));
    assert_eq!((matrix.products, lanczos.products()), (6, 6));
    assert_eq!(lanczos.expand(&mut matrix).unwrap(), Step::Exhausted);
    assert_eq!(matrix.products, 6, "an exhausted process takes no product");
    let values: Vec<f64> =
        lanczos.ritz(Which::LargestAlgebraic, 6).unwrap().iter().map(|p| p.value).collect();
    for (value, wanted) in values.iter().zip([3.0, 3.0, 3.0, 1.0, 1.0, 0.5]) {
        assert!((value - wanted).abs() < 1e-13, "{values:?}");
    }
}

#[test]
fn zero_matrix_takes_one_product_per_pair() {
    let mut matrix = Dense::diagonal(&[0.0; 20]);
    let found = solve(&mut matrix, 3, 3, Which::LargestAlgebraic);
    assert_eq!((found.stats.products, found.stats.status), (3, Status::ReachedTolerance));
    assert_eq!((&found.values[..], found.completeness), (&[0.0; 3][..], Completeness::NotExcluded));
    // The remaining products show that none is missing.
    let mut matrix = Dense::diagonal(&[0.0; 20]);
    let found = solve(&mut matrix, 3, 50, Which::LargestAlgebraic);
    assert_eq!((found.stats.products, found.completeness), (20, Completeness::Exact));
}

#[test]
fn identity_is_found_in_one_product() {
    let mut matrix = Dense::diagonal(&[1.0; 1000]);
    let found = solve(&mut matrix, 1, 50, Which::LargestAlgebraic);
    // The others confirm that none is larger.
    assert_eq!((found.stats.products, found.confirming), (50, 49));
    assert!((found.values[0] - 1.0).abs() < 1e-14);
}

#[test]
fn tiny_spaces_are_used_up() {
    for n in 1..5 {
        let values: Vec<f64> = (1..=n).map(f64::from).collect();
        let mut matrix = Dense::turned(&values);
        let found = solve(&mut matrix, 10, 50, Which::LargestAlgebraic);
        assert_eq!((found.stats.products, found.stats.status), (n as usize, Status::SpaceExhausted));
        for (value, wanted) in found.values.iter().zip(values.iter().rev()) {
            assert!((value - wanted).abs() < 1e-13, "n = {n}: {:?}", found.values);
        }
        assert_eq!(found.values.len(), n as usize);
    }
}

#[test]
fn nearly_degenerate_pair_is_reported_with_an_honest_residual() {
    let mut values = spread(200);
    values[0] = 1.5;
    values[1] = 1.5 - 1e-9;
    let mut matrix = Dense::turned(&values);
    let found = solve(&mut matrix, 2, 60, Which::LargestAlgebraic);
    check_residuals(&mut matrix, &found, 1.5);
    // Its residual is tiny whichever mixture of the two vectors was found, and an eigenvalue is that near.
    assert!((found.values[0] - 1.5).abs() <= 1e-9 + found.residuals[0] + 1e-13);
    assert_eq!(found.statuses[0], PairStatus::Converged);
}

#[test]
fn deflating_a_known_vector_brings_up_the_second_copy() {
    let mut values = spread(100);
    values[0] = 2.0;
    values[1] = 2.0;
    let mut matrix = Dense::diagonal(&values);
    let mut known = vec![0.0; 100];
    known[0] = 5.0;
    let options = EigsOptions { count: 2, products: 60, deflate: vec![known], ..EigsOptions::default() };
    let found = eigs(&mut matrix, &options).unwrap();
    assert!((found.values[0] - 2.0).abs() < 1e-13);
    // The known vector is exactly a unit vector: nothing may be left along it but rounding.
    assert!(found.vectors.iter().all(|vector| vector[0].abs() < 1e-14));
    assert!((found.vectors[0][1].abs() - 1.0).abs() < 1e-7, "the other copy's vector, to its residual");
}

#[test]
fn deflating_a_vector_that_is_no_eigenvector_shows_in_the_residuals() {
    let mut matrix = Dense::turned(&spread(50));
    let mut lanczos =
        Factorization::lanczos(&Start::default().vector(50), &[Start::Gaussian { seed: 4 }.vector(50)])
            .unwrap();
    let options = EigsOptions { count: 2, products: 49, tolerance: 0.0, ..EigsOptions::default() };
    let found = eigs_from(&mut lanczos, &mut matrix, &options).unwrap();
    assert_eq!(found.stats.status, Status::SpaceExhausted);
    assert!(found.residuals[0] > 1e-3, "a pair of the projected matrix is none of the matrix");
    check_residuals(&mut matrix, &found, 1.0);
}

#[test]
fn products_that_are_not_symmetric_are_noticed_and_residuals_stay_true() {
    let clean = Dense::turned(&spread(80));
    let mut noisy = clean.clone();
    for (k, entry) in noisy.entries.iter_mut().enumerate() {
        *entry += 1e-4 * (k as f64).sin();
    }
    let mut clean = clean;
    assert!(solve(&mut clean, 4, 20, Which::LargestAlgebraic).asymmetry < 1e-14);
    let found = solve(&mut noisy, 4, 20, Which::LargestAlgebraic);
    assert!(found.asymmetry > 1e-6, "{:e}", found.asymmetry);
    check_residuals(&mut noisy, &found, 1.0);
}

#[test]
fn failed_product_leaves_a_factorization_that_resumes_to_the_same_bits() {
    let options = EigsOptions { count: 4, products: 30, tolerance: 0.0, ..EigsOptions::default() };
    let matrix = Dense::turned(&spread(3000)[..400]);
    let start = options.start.vector(400);
    let mut whole = Factorization::lanczos(&start, &[]).unwrap();
    let unfailed = eigs_from(&mut whole, &mut matrix.clone(), &options).unwrap();
    for fault in [1, 7, 30] {
        let mut failing = matrix.clone();
        failing.fail_at = Some(fault);
        let mut lanczos = Factorization::lanczos(&start, &[]).unwrap();
        let error = eigs_from(&mut lanczos, &mut failing, &options).unwrap_err();
        assert!(matches!(error, Error::Interrupted), "the operator's own error comes through");
        assert_eq!(lanczos.products(), fault - 1, "everything before the failure is there");
        let resumed = eigs_from(&mut lanczos, &mut failing, &options).unwrap();
        assert_eq!(resumed.stats.products, 30);
        assert_eq!(resumed.values, unfailed.values);
        assert_eq!(resumed.vectors, unfailed.vectors);
        assert_eq!(lanczos.basis(), whole.basis());
        assert_eq!((lanczos.alphas(), lanczos.betas()), (whole.alphas(), whole.betas()));
    }
}

#[test]
fn nan_in_a_product_is_an_error_and_the_step_can_be_taken_again() {
    let mut matrix = Dense::turned(&spread(30));
    matrix.spoil_at = Some(3);
    let mut lanczos = Factorization::lanczos(&Start::default().vector(30), &[]).unwrap();
    let options = EigsOptions { count: 1, products: 10, tolerance: 0.0, ..EigsOptions::default() };
    let error = eigs_from(&mut lanczos, &mut matrix, &options).unwrap_err();
    assert!(error.to_string().contains("product 3"), "{error}");
    let found = eigs_from(&mut lanczos, &mut matrix, &options).unwrap();
    assert!(found.values.iter().all(|value| value.is_finite()));
}

#[test]
fn general_operators_and_wrong_sizes_are_refused_without_a_product() {
    let mut matrix = Dense::turned(&spread(10));
    matrix.symmetry = Symmetry::General;
    let error = eigs(&mut matrix, &EigsOptions::default()).unwrap_err();
    assert!(error.to_string().contains("symmetric"), "{error}");
    matrix.symmetry = Symmetry::Symmetric;
    let start = Start::Given(vec![1.0; 9]);
    let error = eigs(&mut matrix, &EigsOptions { start, ..EigsOptions::default() }).unwrap_err();
    assert!(error.to_string().contains("9x9"), "{error}");
    assert_eq!(matrix.products, 0);
    let known = vec![vec![1.0, 0.0], vec![3.0, 0.0]];
    assert!(Factorization::lanczos(&[1.0, 2.0], &known).unwrap_err().to_string().contains("known vector 2"));
    assert!(Factorization::lanczos(&[f64::NAN, 2.0], &[]).is_err());
    assert!(Factorization::lanczos(&[], &[]).is_err());
}

#[test]
fn the_observer_sees_every_product_and_can_stop() {
    let mut matrix = Dense::turned(&spread(100));
    let mut seen = Vec::new();
    let options = EigsOptions { count: 3, ..EigsOptions::default() };
    let stop_at_five = OnStep::new(|step: &observer::Step<'_>| {
        let Estimate::Eigenpairs { values, residuals } = step.estimate else { panic!("{step:?}") };
        assert_eq!([values.len() as u64, residuals.len() as u64], [step.done.min(3); 2]);
        seen.push(step.done);
        if step.done == 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    let found = eigs(&mut Observed::new(&mut matrix, &stop_at_five), &options).unwrap();
    assert_eq!(seen, [1, 2, 3, 4, 5]);
    assert_eq!(found.stats.status, Status::Stopped);
    assert_eq!((matrix.products, found.values.len(), found.history.len()), (5, 3, 5));
}

#[test]
fn start_in_the_span_of_known_vectors_is_replaced() {
    let mut matrix = Dense::diagonal(&[4.0, 3.0, 2.0]);
    let known = vec![vec![1.0, 0.0, 0.0]];
    let start = Start::Given(vec![2.0, 0.0, 0.0]);
    let options = EigsOptions { start, deflate: known, ..EigsOptions::default() };
    let found = eigs(&mut matrix, &options).unwrap();
    assert_eq!(found.values.len(), 2);
    assert!((found.values[0] - 3.0).abs() < 1e-14 && (found.values[1] - 2.0).abs() < 1e-14);
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let options = EigsOptions { products: 20, ..EigsOptions::default() };
            let found = eigs(&mut Comb::indefinite(20_001), &options).unwrap();
            (found.values, found.vectors)
        })
    };
    assert_eq!(with(1), with(3));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    /// The basis is orthonormal whatever the spectrum: clustered, graded over many orders of magnitude, or singular.
    #[test]
    fn basis_is_orthonormal_to_working_precision(
        exponents in prop::collection::vec(-12.0..2.0_f64, 5..60),
        sign in any::<bool>(),
        known in 0_usize..3,
        seed in any::<u64>(),
    ) {
        let values: Vec<f64> = exponents
            .iter()
            .enumerate()
            .map(|(k, e)| if sign && k % 2 == 0 { -(10.0_f64.powf(*e)) } else { 10.0_f64.powf(*e) })
            .collect();
        let n = values.len();
        let mut matrix = Dense::turned(&values);
        let deflate: Vec<Vec<f64>> = (0..known).map(|k| Start::Gaussian { seed: k as u64 }.vector(n)).collect();
        let mut lanczos = Factorization::lanczos(&Start::Gaussian { seed }.vector(n), &deflate).unwrap();
        while !lanczos.is_exhausted() {
            lanczos.expand(&mut matrix).unwrap();
        }
        prop_assert_eq!(lanczos.steps(), n - known);
        prop_assert_eq!(matrix.products, n - known);
        let columns: Vec<&Vec<f64>> = lanczos.known().iter().chain(lanczos.basis()).collect();
        let mut square = 0.0;
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate() {
                square += (dot(a, b) - f64::from(u8::from(i == j))).powi(2);
            }
        }
        // Giraud et al.: twice is enough leaves ε times a small polynomial of n; n ε each for up to n² entries is
        // generous by far, and a single unneeded pass left out overshoots it by orders of magnitude on the graded
        // spectra.
        prop_assert!(square.sqrt() < (n * n) as f64 * f64::EPSILON, "‖VᵀV − I‖ = {:e}, n = {}", square.sqrt(), n);
    }
}
