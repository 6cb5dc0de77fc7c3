//! Singular values and vectors from few products with a matrix and its transpose, against the dense truth.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use krylux::Error;
use krylux::krylov::{EigsOptions, PairStatus, SingularOptions, Start, Status, dot, eigs, norm, singular};
use krylux::operator::{Adjoint, Gram, Operator, Symmetry};

/// `A = U diag(σ) Vᵀ` of `rows × cols` with cosine bases, which has these singular values, and errors of a given norm in its products.
struct Known {
    sigma: Vec<f64>,
    rows: usize,
    cols: usize,
    noise: f64,
    products: u64,
}

/// Vector `k` of the orthonormal cosine basis of length `n`.
fn cosine(n: usize, k: usize) -> Vec<f64> {
    let scale = if k == 0 { (1.0 / n as f64).sqrt() } else { (2.0 / n as f64).sqrt() };
    (0..n).map(|i| scale * (std::f64::consts::PI * (i as f64 + 0.5) * k as f64 / n as f64).cos()).collect()
}

impl Known {
    fn new(sigma: Vec<f64>, rows: usize, cols: usize) -> Self {
        Self { sigma, rows, cols, noise: 0.0, products: 0 }
    }

    fn multiply(&mut self, x: &[f64], y: &mut [f64], back: bool) {
        y.fill(0.0);
        for (k, sigma) in self.sigma.iter().enumerate() {
            let (from, to) = if back { (self.rows, self.cols) } else { (self.cols, self.rows) };
            let share = sigma * dot(&cosine(from, k), x);
            y.iter_mut().zip(cosine(to, k)).for_each(|(y, u)| *y += share * u);
        }
        self.products += 1;
        let error = Start::Gaussian { seed: self.products }.vector(y.len());
        let scale = self.noise * norm(x) / (y.len() as f64).sqrt();
        y.iter_mut().zip(error).for_each(|(y, error)| *y += scale * error);
    }
}

impl Operator for Known {
    fn rows(&self) -> usize {
        self.rows
    }
    fn cols(&self) -> usize {
        self.cols
    }
    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
        self.multiply(x, y, false);
        Ok(())
    }
    fn standard_errors(&self) -> Vec<f64> {
        vec![self.noise]
    }
}

impl Adjoint for Known {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> krylux::Result<()> {
        self.multiply(y, x, true);
        Ok(())
    }
}

fn decaying(n: usize) -> Vec<f64> {
    (0..n).map(|k| 0.7_f64.powi(k as i32)).collect()
}

#[test]
fn triplets_are_those_of_the_matrix_within_their_residuals() {
    for (rows, cols) in [(60, 60), (80, 50), (50, 80)] {
        let mut matrix = Known::new(decaying(40), rows, cols);
        let found =
            singular(&mut matrix, &SingularOptions { count: 5, ..SingularOptions::default() }).unwrap();
        assert_eq!(found.stats.status, Status::ReachedTolerance, "{rows}x{cols}");
        assert!(found.stats.products <= 50 && found.stats.products == matrix.products as usize);
        for (k, value) in found.values.iter().enumerate() {
            let truth = 0.7_f64.powi(k as i32);
            // Weyl's bound, and the rounding of sums of some dozen terms of size 1.
            assert!((value - truth).abs() <= found.residuals[k] + 1e-14, "{k}: {value} {truth}");
            assert_eq!(found.statuses[k], PairStatus::Converged);
            // Residuals of 1e-8 over gaps of at least 0.07 turn a vector by 1.5e-7, which is 1e-14 of its cosine.
            let [left, right] = [(&found.left[k], rows), (&found.right[k], cols)]
                .map(|(vector, n)| dot(vector, &cosine(n, k)));
            assert!(
                (left.abs() - 1.0).abs() < 1e-12 && (right.abs() - 1.0).abs() < 1e-12,
                "{k}: {left} {right}"
            );
            assert!(left * right > 0.0, "the photo of a pattern has the pattern's sign");
        }
        assert!(found.disagreement < 1e-13, "rounding: {:e}", found.disagreement);
    }
}

#[test]
fn a_matrix_of_low_rank_exhausts_the_space() {
    let mut matrix = Known::new(vec![3.0, 2.0, 1.0], 30, 20);
    let found = singular(&mut matrix, &SingularOptions { count: 6, ..SingularOptions::default() }).unwrap();
    assert_eq!(found.stats.status, Status::SpaceExhausted);
    for (value, truth) in found.values.iter().zip([3.0, 2.0, 1.0]) {
        assert!((value - truth).abs() < 1e-13, "rounding: {value}");
    }
    assert!(found.values[3..].iter().all(|value| *value < 1e-13));
}

#[test]
fn the_roots_of_the_eigenvalues_there_and_back_are_the_same() {
    let mut matrix = Known::new(decaying(40), 80, 50);
    let options = EigsOptions { count: 4, ..EigsOptions::default() };
    for of_photos in [false, true] {
        let mut gram = if of_photos { Gram::of_photos(&mut matrix) } else { Gram::of_patterns(&mut matrix) };
        assert_eq!(gram.rows(), if of_photos { 80 } else { 50 });
        let found = eigs(&mut gram, &options).unwrap();
        for (k, value) in found.values.iter().enumerate() {
            // A residual of 1e-8 of the largest is the error of σ² at most, of which σ has a half over σ: 1.5e-8 for 0.343.
            assert!((value.sqrt() - 0.7_f64.powi(k as i32)).abs() < 2e-8, "{k}: {value}");
        }
    }
}

#[test]
fn stated_errors_are_those_of_the_values() {
    let truth = decaying(3);
    let mut squares = [0.0; 3];
    let (mut stated, runs) = (vec![0.0; 3], 200);
    let mut matrix = Known { noise: 1e-3, ..Known::new(decaying(12), 60, 60) };
    for seed in 0..runs {
        let options = SingularOptions {
            count: 3,
            products: 40,
            tolerance: 0.0,
            start: Start::Random { seed },
            ..SingularOptions::default()
        };
        let found = singular(&mut matrix, &options).unwrap();
        for k in 0..3 {
            squares[k] += ((found.values[k] - truth[k]) / found.standard_errors[k]).powi(2);
            stated[k] += found.standard_errors[k];
        }
    }
    for k in 0..3 {
        let rms = (squares[k] / runs as f64).sqrt();
        // The standard error of a root mean square of 200 normal values is 5 %; four of them. The mean of two products of either kind is
        // not quite that of independent ones, which the upper bound allows for.
        assert!((0.75..1.3).contains(&rms), "value {k}: z of {rms}, stated {}", stated[k] / runs as f64);
    }
}

/// A start without any part along a singular vector hides it where the products have noise.
#[test]
fn a_singular_value_that_the_noise_of_the_start_hides_is_found_before_the_search_ends() {
    let start: Vec<f64> = cosine(400, 0).iter().zip(cosine(400, 2)).map(|(a, b)| a + b).collect();
    let mut matrix = Known { noise: 0.01, ..Known::new(vec![1.0, 0.9, 0.6, 0.4, 0.2], 400, 400) };
    for seed in 0..20 {
        matrix.products = 1000 * seed;
        let options =
            SingularOptions { count: 2, start: Start::Given(start.clone()), ..SingularOptions::default() };
        let found = singular(&mut matrix, &options).unwrap();
        assert_eq!(found.stats.status, Status::NoiseFloor);
        assert!(found.stats.products < 30, "{}", found.stats.products);
        for (value, truth) in found.values.iter().zip([1.0, 0.9]) {
            // An error of norm 0.01 has a component of 0.0005 along a vector; what is left of the search may be of its size. Four of both.
            assert!((value - truth).abs() < 4e-3, "{seed}: {value} for {truth}");
        }
    }
}

#[test]
fn wrong_questions_are_refused_by_name() {
    let mut matrix = Known::new(vec![1.0], 4, 4);
    let none = SingularOptions { count: 0, ..SingularOptions::default() };
    assert!(matches!(singular(&mut matrix, &none), Err(Error::Option { option, .. }) if option == "--count"));
    let few = SingularOptions { products: 1, ..SingularOptions::default() };
    assert!(matches!(singular(&mut matrix, &few), Err(Error::Option { option, .. }) if option == "--photos"));
    let long = SingularOptions { start: Start::Given(vec![1.0; 5]), ..SingularOptions::default() };
    assert!(matches!(singular(&mut matrix, &long), Err(Error::Dimension { .. })));
    let zero = SingularOptions { start: Start::Given(vec![0.0; 4]), ..SingularOptions::default() };
    assert!(matches!(singular(&mut matrix, &zero), Err(Error::Numerical(_))));
    assert_eq!(matrix.products, 0);
}
