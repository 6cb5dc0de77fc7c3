//! Every eigenvalue method on the gallery, against the dense eigensolver: values, residuals, bounds, statuses, products.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::krylov_support::{Dense, Noisy, spread, symmetric_gallery};
use krylux::Error;
use krylux::krylov::{
    Eigs, EigsMethod, EigsOptions, Factorization, PairStatus, Start, Status, Which, eigs, eigs_from,
};

fn solve(matrix: &mut Dense, options: &EigsOptions) -> Eigs {
    let before = matrix.products;
    let found = eigs(matrix, options).unwrap();
    assert_eq!(found.stats.products, matrix.products - before, "the products reported are those taken");
    assert!(found.stats.products <= options.products, "the budget holds");
    found
}

/// The distance to the nearest of `values`.
fn distance(value: f64, values: &[f64]) -> f64 {
    values.iter().map(|other| (other - value).abs()).fold(f64::INFINITY, f64::min)
}

const SYMMETRIC: [EigsMethod; 3] =
    [EigsMethod::Lanczos, EigsMethod::BlockLanczos { block: 3 }, EigsMethod::Arnoldi];

#[test]
fn residuals_and_bounds_are_true_on_the_whole_gallery_however_early_it_stops() {
    for (name, mut matrix) in symmetric_gallery() {
        let truth = matrix.eigenvalues();
        let size = truth.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        // Dense eigensolver and product, n terms each.
        let rounding = 1e-14 * matrix.n as f64 * size;
        for method in SYMMETRIC {
            for which in [Which::LargestAlgebraic, Which::SmallestAlgebraic, Which::BothEnds] {
                for products in [1, 4, 9, 25] {
                    let options = EigsOptions { count: 4, which, products, method, ..EigsOptions::default() };
                    let found = solve(&mut matrix, &options);
                    let case = format!("{name}, {method:?}, {which:?}, {products} products");
                    assert!(!found.values.is_empty(), "{case}");
                    for (k, &value) in found.values.iter().enumerate() {
                        let pair = (value, found.imaginary_values[k]);
                        let residual = matrix.residual(pair, &found.vectors[k], &found.imaginary_vectors[k]);
                        assert!(
                            (residual - found.residuals[k]).abs() <= rounding,
                            "{case}: {residual:e} is the residual of {k}, {:e} reported",
                            found.residuals[k]
                        );
                        let error = distance(value, &truth);
                        assert!(
                            error <= found.bounds[k] + rounding,
                            "{case}: {error:e} > {:e}",
                            found.bounds[k]
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn every_method_finds_both_ends_of_the_gallery() {
    for (name, mut matrix) in symmetric_gallery() {
        let truth = matrix.eigenvalues();
        let size = truth.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        for method in SYMMETRIC {
            for (which, wanted) in
                [(Which::LargestAlgebraic, truth[0]), (Which::SmallestAlgebraic, truth[truth.len() - 1])]
            {
                // Signs may be an eigenvector of a small matrix; normal numbers are none.
                let start = Start::Gaussian { seed: 0 };
                let options =
                    EigsOptions { count: 1, which, products: 200, method, start, ..EigsOptions::default() };
                let found = solve(&mut matrix, &options);
                assert_eq!(found.statuses[0], PairStatus::Converged, "{name}, {method:?}, {which:?}");
                // An eigenvalue is within the residual (Weyl); the test shows that it is the right one.
                assert!(
                    (found.values[0] - wanted).abs() <= 2e-8 * size,
                    "{name}, {method:?}, {which:?}: {} is not {wanted}",
                    found.values[0]
                );
            }
        }
    }
}

#[test]
fn temple_kato_bounds_hold_where_nothing_was_missed_and_are_sharper() {
    let mut matrix = Dense::turned(&(0..80).map(|k| 0.8_f64.powi(k)).collect::<Vec<_>>());
    let truth = matrix.eigenvalues();
    let mut sharper = 0;
    for products in [12, 16, 20] {
        let options = EigsOptions { count: 3, products, tolerance: 0.0, ..EigsOptions::default() };
        let found = solve(&mut matrix, &options);
        for (k, truth) in truth.iter().enumerate().take(3) {
            let error = (found.values[k] - truth).abs();
            assert!(error <= found.gap_bounds[k] + 1e-13, "{error:e} {:e}", found.gap_bounds[k]);
            sharper += usize::from(found.gap_bounds[k] < 0.1 * found.bounds[k]);
        }
    }
    assert!(sharper >= 5, "{sharper} of 9");
}

#[test]
fn both_ends_come_in_turns_and_the_smallest_magnitudes_at_last() {
    let values: Vec<f64> = (0..40).map(|k| f64::from(k) - 10.25).collect();
    let mut matrix = Dense::turned(&values);
    for method in SYMMETRIC {
        for (which, wanted) in [
            (Which::BothEnds, [28.75, -10.25, 27.75, -9.25]),
            (Which::SmallestMagnitude, [-0.25, 0.75, -1.25, 1.75]),
            (Which::LargestMagnitude, [28.75, 27.75, 26.75, 25.75]),
        ] {
            let options = EigsOptions {
                count: 4,
                which,
                products: 40,
                tolerance: 1e-10,
                method,
                ..EigsOptions::default()
            };
            let found = solve(&mut matrix, &options);
            for (value, wanted) in found.values.iter().zip(wanted) {
                assert!((value - wanted).abs() < 1e-9 * 29.0, "{method:?}, {which:?}: {value}, not {wanted}");
            }
        }
    }
}

#[test]
fn power_iteration_takes_its_rayleigh_quotient_from_the_next_product() {
    let mut matrix = Dense::turned(&(0..50).map(|k| 0.7_f64.powi(k)).collect::<Vec<_>>());
    let options = EigsOptions {
        count: 1,
        which: Which::LargestMagnitude,
        products: 200,
        method: EigsMethod::Power,
        tolerance: 1e-6,
        ..EigsOptions::default()
    };
    let found = solve(&mut matrix, &options);
    assert_eq!(found.stats.status, Status::ReachedTolerance);
    assert!((found.values[0] - 1.0).abs() < 1e-11, "the square of the residual: {}", found.values[0]);
    let residual = matrix.residual((found.values[0], 0.0), &found.vectors[0], &[]);
    assert!((residual - found.residuals[0]).abs() < 1e-13, "{residual:e} {:e}", found.residuals[0]);
    // The error falls by 0.7 a product: 1e-6 needs ln 1e-6/ln 0.7 = 39 and a few for the random start's share.
    assert!((35..48).contains(&found.stats.products), "{}", found.stats.products);
    assert_eq!(found.history.len(), found.stats.products);
    let lanczos = solve(&mut matrix, &EigsOptions { method: EigsMethod::Lanczos, ..options });
    assert!(lanczos.stats.products < found.stats.products / 2, "{}", lanczos.stats.products);
}

#[test]
fn power_iteration_with_the_first_vector_deflated_finds_the_second() {
    let mut matrix = Dense::diagonal(&[-4.0, 3.0, 1.0, 0.5]);
    let options = EigsOptions {
        count: 1,
        which: Which::LargestMagnitude,
        products: 60,
        method: EigsMethod::Power,
        ..EigsOptions::default()
    };
    let first = solve(&mut matrix, &options);
    assert!((first.values[0] + 4.0).abs() < 1e-12);
    let deflate = vec![vec![1.0, 0.0, 0.0, 0.0]];
    let second = solve(&mut matrix, &EigsOptions { deflate, ..options });
    assert!((second.values[0] - 3.0).abs() < 1e-12);
    assert!(second.vectors[0][1] > 0.999_999, "and its vector points upwards");
}

#[test]
fn thick_restart_keeps_the_memory_and_reaches_the_same_eigenvalues() {
    // Both ends stand apart.
    let values: Vec<f64> = (0..300).map(|k| (f64::from(k) / 149.5 - 1.0).powi(3)).collect();
    let mut matrix = Dense::turned(&values);
    let truth = matrix.eigenvalues();
    for (method, max_basis) in [(EigsMethod::Lanczos, 20), (EigsMethod::BlockLanczos { block: 3 }, 30)] {
        for which in [Which::LargestAlgebraic, Which::BothEnds] {
            let options = EigsOptions {
                count: 4,
                which,
                products: 400,
                method,
                max_basis: Some(max_basis),
                ..EigsOptions::default()
            };
            let found = solve(&mut matrix, &options);
            assert_eq!(found.stats.status, Status::ReachedTolerance, "{method:?} {which:?}");
            assert!(found.stats.products > max_basis, "it did restart");
            let wanted = match which {
                Which::BothEnds => [truth[0], truth[299], truth[1], truth[298]],
                _ => [truth[0], truth[1], truth[2], truth[3]],
            };
            for (k, wanted) in wanted.iter().enumerate() {
                assert!(
                    (found.values[k] - wanted).abs() < 1e-8,
                    "{method:?} {which:?}: {} {wanted}",
                    found.values[k]
                );
                let residual = matrix.residual((found.values[k], 0.0), &found.vectors[k], &[]);
                assert!(
                    (residual - found.residuals[k]).abs() < 1e-12,
                    "{residual:e} {:e}",
                    found.residuals[k]
                );
            }
        }
    }
}

#[test]
fn restarts_never_hold_more_vectors_than_allowed_and_stay_orthonormal() {
    let mut matrix = Dense::turned(&spread(200));
    let mut lanczos = Factorization::lanczos(&Start::default().vector(200), &[]).unwrap();
    for products in 1..60 {
        let options =
            EigsOptions { count: 3, products, tolerance: 0.0, max_basis: Some(12), ..EigsOptions::default() };
        eigs_from(&mut lanczos, &mut matrix, &options).unwrap();
        assert!(lanczos.steps() + lanczos.pending() <= 12, "{}", lanczos.steps());
        assert_eq!(lanczos.products(), products);
    }
    let columns: Vec<&Vec<f64>> = lanczos.basis().iter().chain(lanczos.waiting()).collect();
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            let expected = f64::from(u8::from(i == j));
            // Six rotations by matrices orthogonal to a few ε each.
            assert!((krylux::krylov::dot(a, b) - expected).abs() < 1e-13);
        }
    }
}

#[test]
fn hundreds_of_restarts_leave_residuals_as_true_as_before() {
    let mut matrix = Dense::turned(&spread(200));
    let options =
        EigsOptions { count: 2, products: 900, tolerance: 0.0, max_basis: Some(8), ..EigsOptions::default() };
    let found = solve(&mut matrix, &options);
    assert_eq!(found.stats.products, 900);
    for k in 0..2 {
        let residual = matrix.residual((found.values[k], 0.0), &found.vectors[k], &[]);
        // Rounding adds up over 300 restarts of a few ε each; it must not multiply.
        assert!((residual - found.residuals[k]).abs() < 1e-12, "{residual:e} {:e}", found.residuals[k]);
        assert!(found.residuals[k] < 1e-12, "{:e}", found.residuals[k]);
    }
}

#[test]
fn noise_ends_the_search_at_its_floor_with_bounds_that_hold() {
    let noise = 1e-4;
    let mut matrix = Dense::turned(&(0..150).map(|k| 0.85_f64.powi(k)).collect::<Vec<_>>());
    let truth = matrix.eigenvalues();
    for method in [EigsMethod::Lanczos, EigsMethod::BlockLanczos { block: 2 }] {
        let options = EigsOptions { count: 3, products: 100, noise, method, ..EigsOptions::default() };
        let mut noisy = Noisy::new(&mut matrix, |_| noise);
        let found = eigs(&mut noisy, &options).unwrap();
        assert_eq!(found.stats.status, Status::NoiseFloor, "{method:?}");
        assert!(found.stats.products < 60, "no photo is spent below the noise: {}", found.stats.products);
        assert!(found.statuses.iter().all(|&status| status == PairStatus::LimitedByNoise));
        // ‖E − Eᵀ‖_F ≤ 2 ‖E‖_F ≤ 2 √m noise, and ‖H‖_F ≥ 1; of E only what lies in the subspace shows.
        let most = 2.0 * (found.stats.products as f64).sqrt() * noise;
        assert!((0.01 * noise..most).contains(&found.asymmetry), "{:e}", found.asymmetry);
        for (k, value) in found.values.iter().enumerate() {
            let residual = matrix.residual((*value, 0.0), &found.vectors[k], &[]);
            assert!(
                (residual - found.residuals[k]).abs() <= found.bounds[k] - found.residuals[k],
                "the gap is noise · ‖s‖₁ at most"
            );
            assert!(
                residual > found.residuals[k],
                "the true residual holds the noise, the computed one does not"
            );
            assert!((value - truth[k]).abs() <= found.bounds[k]);
        }
        // Ignoring the noise spends the budget and gains nothing.
        let blind = EigsOptions { noise: 0.0, ..options };
        let found = eigs(&mut Noisy::new(&mut matrix, |_| noise), &blind).unwrap();
        assert_ne!(found.stats.status, Status::NoiseFloor);
        let residual = matrix.residual((found.values[0], 0.0), &found.vectors[0], &[]);
        assert!(residual > 0.1 * noise, "{residual:e}");
    }
}

#[test]
fn options_that_cannot_be_used_are_refused_by_name_and_without_a_product() {
    let mut matrix = Dense::turned(&spread(30));
    let base = EigsOptions::default;
    let cases = [
        (EigsOptions { count: 0, ..base() }, "--count"),
        (EigsOptions { products: 0, ..base() }, "--photos"),
        (EigsOptions { method: EigsMethod::BlockLanczos { block: 0 }, ..base() }, "--block"),
        (EigsOptions { max_basis: Some(8), ..base() }, "EigsOptions::max_basis"),
        (
            EigsOptions { max_basis: Some(20), method: EigsMethod::Arnoldi, ..base() },
            "EigsOptions::max_basis",
        ),
        (EigsOptions { noise: f64::NAN, ..base() }, "EigsOptions::noise"),
        (EigsOptions { method: EigsMethod::Power, ..base() }, "--count"),
        (EigsOptions { method: EigsMethod::Power, count: 1, which: Which::BothEnds, ..base() }, "--which"),
    ];
    for (options, name) in cases {
        match eigs(&mut matrix, &options).unwrap_err() {
            Error::Option { option, .. } => assert_eq!(option, name),
            other => panic!("{other}"),
        }
    }
    assert_eq!(matrix.products, 0);
    // Four pairs and two blocks of three and one more are eleven vectors.
    let blocks = |most: usize| EigsOptions {
        count: 4,
        method: EigsMethod::BlockLanczos { block: 3 },
        max_basis: Some(most),
        ..base()
    };
    assert!(eigs(&mut matrix, &blocks(10)).is_err() && eigs(&mut matrix, &blocks(11)).is_ok());
    let options = EigsOptions { which: Which::LargestImaginary, ..base() };
    assert!(matches!(eigs(&mut matrix, &options), Err(Error::Option { option, .. }) if option == "--which"));
}

#[test]
fn ritz_values_are_rayleigh_quotients_of_the_products_as_measured() {
    let mut matrix = Dense::turned(&(0..150).map(|k| 0.85_f64.powi(k)).collect::<Vec<_>>());
    let mut noisy = Noisy::new(&mut matrix, |_| 1e-2);
    let mut recorded = krylux::operator::Recorded::new(&mut noisy);
    let options = EigsOptions { count: 3, products: 20, tolerance: 0.0, ..EigsOptions::default() };
    let found = eigs(&mut recorded, &options).unwrap();
    for (value, vector) in found.values.iter().zip(&found.vectors) {
        // A y from the products that were taken: the patterns are orthonormal, and y lies in their span.
        let mut image = vec![0.0; 150];
        for product in &recorded.products {
            let share = krylux::krylov::dot(&product.from, vector);
            image.iter_mut().zip(&product.to).for_each(|(sum, value)| *sum += share * value);
        }
        let quotient = krylux::krylov::dot(vector, &image);
        // One triangle of H alone would miss it by the noise, 1e-2 / √150.
        assert!((quotient - value).abs() < 1e-12, "{quotient} {value}");
    }
}

#[test]
fn stated_errors_end_the_search_and_give_values_their_standard_error() {
    let noise = 1e-4;
    let mut matrix = Dense::turned(&(0..150).map(|k| 0.85_f64.powi(k)).collect::<Vec<_>>());
    let truth = matrix.eigenvalues();
    let options = EigsOptions { count: 3, products: 100, ..EigsOptions::default() };
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..20 {
        let start = Start::Random { seed };
        let mut noisy = Noisy::new(&mut matrix, |_| noise);
        (noisy.states, noisy.taken) = (true, 1000 * seed as usize);
        let found = eigs(&mut noisy, &EigsOptions { start, ..options.clone() }).unwrap();
        assert_eq!(found.stats.status, Status::NoiseFloor);
        assert!(found.stats.products < 60, "{}", found.stats.products);
        for (k, value) in found.values.iter().enumerate() {
            squares += ((value - truth[k]) / found.standard_errors[k]).powi(2);
            count += 1.0;
        }
    }
    // The root mean square of 60 independent errors is within 0.8 and 1.2 in 97 of 100 cases; the rest of the
    // search may add as much as the noise.
    let z = (squares / count).sqrt();
    assert!((0.7..1.5).contains(&z), "{z}");
}

/// A start without any part along an eigenvector hides it if the products have noise: residuals within the noise prove nothing.
#[test]
fn an_eigenvalue_that_the_noise_of_the_start_hides_is_found_before_the_search_ends() {
    let values: Vec<f64> =
        [1.0, 0.9, 0.6, 0.5, 0.4].into_iter().chain((0..395).map(|k| 0.1 - k as f64 * 2e-4)).collect();
    let start: Vec<f64> = (0..400).map(|k| if [0, 2, 3].contains(&k) { 1.0 } else { 0.0 }).collect();
    let mut matrix = Dense::diagonal(&values);
    for seed in 0..20 {
        let mut noisy = Noisy::new(&mut matrix, |_| 0.01);
        (noisy.states, noisy.taken) = (true, 1000 * seed);
        let options = EigsOptions { count: 2, start: Start::Given(start.clone()), ..EigsOptions::default() };
        let found = eigs(&mut noisy, &options).unwrap();
        assert_eq!(found.stats.status, Status::NoiseFloor);
        assert!(found.stats.products < 20, "{}", found.stats.products);
        for (value, truth) in found.values.iter().zip([1.0, 0.9]) {
            // An error of norm 0.01 has a component of 0.0005 along a vector; what is left of the search may be of its size. Four of both.
            assert!((value - truth).abs() < 4e-3, "{seed}: {value} for {truth}");
        }
    }
}

/// If eigenvalues are dense, a few products leave more than their noise does, and standard errors say so.
#[test]
fn standard_errors_hold_what_more_products_would_change() {
    let noise = 1e-4;
    let mut matrix = Dense::turned(&(0..150).map(|k| 1.0 - f64::from(k) / 150.0).collect::<Vec<_>>());
    let (mut squares, mut by_noise, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..20 {
        let mut noisy = Noisy::new(&mut matrix, |_| noise);
        (noisy.states, noisy.taken) = (true, 1000 * seed as usize);
        let options =
            EigsOptions { count: 2, products: 20, start: Start::Random { seed }, ..EigsOptions::default() };
        let found = eigs(&mut noisy, &options).unwrap();
        for (k, value) in found.values.iter().enumerate() {
            let off = value - (1.0 - k as f64 / 150.0);
            squares += (off / found.standard_errors[k]).powi(2);
            by_noise += (off * 150.0_f64.sqrt() / noise).powi(2);
            count += 1.0;
        }
    }
    let [z, by_noise] = [squares, by_noise].map(|sum| f64::sqrt(sum / count));
    assert!(by_noise > 100.0, "noise alone explains it: {by_noise}");
    // 0.64; the residual itself, which is a bound and no standard error, gives 0.37.
    assert!((0.5..1.5).contains(&z), "{z}");
}

/// A matrix whose forms have an error that all products share.
struct Biased(Dense);

impl krylux::operator::Operator for Biased {
    fn rows(&self) -> usize {
        self.0.rows()
    }
    fn cols(&self) -> usize {
        self.0.cols()
    }
    fn symmetry(&self) -> krylux::operator::Symmetry {
        self.0.symmetry()
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
        self.0.apply(x, y)
    }
    fn common_error(&mut self, x: &[f64]) -> krylux::Result<f64> {
        Ok(0.25 * x.iter().map(|x| x * x).sum::<f64>())
    }
}

#[test]
fn an_error_that_all_products_share_is_an_error_of_each_eigenvalue() {
    for method in [EigsMethod::Lanczos, EigsMethod::Arnoldi, EigsMethod::Power] {
        let mut biased = Biased(Dense::turned(&[5.0, 3.0, 1.0, 0.5]));
        let count = if method == EigsMethod::Power { 1 } else { 2 };
        let found = eigs(&mut biased, &EigsOptions { count, method, ..EigsOptions::default() }).unwrap();
        assert!(found.standard_errors.iter().all(|error| (error - 0.25).abs() < 1e-12), "{method:?}");
    }
}
