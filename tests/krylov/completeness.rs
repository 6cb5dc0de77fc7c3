//! No eigenvalue or singular value is missed in silence: matrices of structured spectra against dense solvers.

#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use faer::Side;
use krylux::krylov::{
    Completeness, Confirm, Eigs, EigsMethod, EigsOptions, PairStatus, SingularOptions, Start, Status, Which,
    eigs, singular,
};
use krylux::operator::Adjoint;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::krylov_support::{Dense, Noisy};

/// A symmetric matrix of a kind on which searches from one vector miss eigenvalues.
pub(super) fn structured(random: &mut Pcg64) -> Dense {
    // One in eight is too large for a confirmation to span it.
    let n = if random.random_range(0..8) == 0 {
        random.random_range(80..=150)
    } else {
        random.random_range(1..=40_usize)
    };
    match random.random_range(0..9) {
        // Few distinct values, each many times.
        0 => {
            let values: Vec<f64> = (0..n).map(|_| f64::from(random.random_range(-2..=3_i32))).collect();
            Dense::turned(&values)
        }
        // Low rank.
        1 => {
            let values: Vec<f64> =
                (0..n).map(|i| if i < 3 { random.random_range(-1.0..2.0) } else { 0.0 }).collect();
            Dense::turned(&values)
        }
        // Identical cells that exchange nothing.
        2 => {
            let cells = random.random_range(1..=6_usize);
            let size = n.div_ceil(cells).max(1);
            let cell: Vec<f64> = (0..size * size).map(|_| random.random_range(0.0..1.0)).collect();
            Dense::new(cells * size, |i, j| {
                let at = |i: usize, j: usize| cell[i % size * size + j % size];
                if i / size == j / size { 0.5 * (at(i, j) + at(j, i)) } else { 0.0 }
            })
        }
        // A circulant: equal row sums, every eigenvalue but one or two twice.
        3 => {
            let row: Vec<f64> = (0..n).map(|_| random.random_range(0.0..1.0)).collect();
            Dense::new(n, |i, j| {
                let apart = i.abs_diff(j);
                row[apart.min(n - apart)]
            })
        }
        // Bipartite: the spectrum is symmetric about zero.
        4 => {
            let half = n.div_ceil(2);
            let block: Vec<f64> = (0..half * half).map(|_| random.random_range(0.0..1.0)).collect();
            Dense::new(2 * half, |i, j| match (i < half, j < half) {
                (true, false) => block[i * half + j - half],
                (false, true) => block[j * half + i - half],
                _ => 0.0,
            })
        }
        // Pairs of pixels that light each other.
        5 => {
            let light: Vec<f64> = (0..n).map(|_| f64::from(random.random_range(0..=4_i32))).collect();
            Dense::new(2 * n, |i, j| if i != j && i / 2 == j / 2 { light[i / 2] } else { 0.0 })
        }
        // [[1, 5], [5, 1]] and the like: the eigenvectors are vectors of signs.
        6 => {
            let (a, b) = (random.random_range(-3.0..3.0), random.random_range(-3.0..3.0));
            let n = n.next_power_of_two().min(32);
            Dense::new(n, |i, j| {
                if i == j {
                    a + b
                } else if i ^ j == n - 1 {
                    b
                } else {
                    0.0
                }
            })
        }
        // A diagonal, most of it zero.
        7 => {
            let values: Vec<f64> =
                (0..n).map(|_| f64::from(random.random_range(0..10_i32) / 8) * 0.3).collect();
            Dense::diagonal(&values)
        }
        _ => {
            let entries: Vec<f64> = (0..n * n).map(|_| random.random_range(-1.0..1.0)).collect();
            Dense::new(n, |i, j| entries[i.min(j) * n + i.max(j)])
        }
    }
}

/// The `count` wanted ones of all eigenvalues, which descend.
fn wanted(all: &[f64], which: Which, count: usize) -> Vec<f64> {
    let mut sorted = all.to_vec();
    match which {
        Which::SmallestAlgebraic => sorted.reverse(),
        Which::LargestMagnitude => sorted.sort_by(|a, b| b.abs().total_cmp(&a.abs())),
        Which::BothEnds => {
            let n = all.len();
            sorted = (0..n).map(|k| if k % 2 == 0 { all[k / 2] } else { all[n - 1 - k / 2] }).collect();
        }
        _ => {}
    }
    sorted.truncate(count);
    sorted
}

/// Whether nothing is wrong: each value is within its bound of that of its rank. `true` magnitudes where signs may be swapped.
fn differs(found: &[f64], truth: &[f64], magnitudes: bool, tolerance: f64) -> bool {
    let size = |value: f64| if magnitudes { value.abs() } else { value };
    found.len() != truth.len()
        || found.iter().zip(truth).any(|(a, b)| (size(*a) - size(*b)).abs() > tolerance)
}

#[test]
fn no_eigenvalue_of_a_structured_matrix_is_missed() {
    let mut random = Pcg64::seed_from_u64(38);
    let (mut wrong, mut claimed, mut confirming, mut exact) = (0, 0, 0, 0);
    for trial in 0..2000 {
        let mut matrix = structured(&mut random);
        let all = matrix.eigenvalues();
        let which =
            [Which::LargestAlgebraic, Which::SmallestAlgebraic, Which::LargestMagnitude, Which::BothEnds]
                [random.random_range(0..4)];
        let block = random.random_range(1..=3);
        let method =
            if random.random::<bool>() { EigsMethod::Lanczos } else { EigsMethod::BlockLanczos { block } };
        let options = EigsOptions {
            count: random.random_range(1..=6),
            which,
            products: 400,
            method,
            start: Start::Random { seed: trial },
            confirm: Some(Confirm::default()),
            ..EigsOptions::default()
        };
        let found = eigs(&mut matrix, &options).unwrap();
        assert!(found.completeness.is_known(), "{trial}: {:?}", found.stats);
        claimed += 1;
        confirming += found.confirming;
        exact += usize::from(found.completeness == Completeness::Exact);
        let truth = wanted(&all, which, options.count);
        // The tolerance of a residual is 1e-8 of the norm; rounding of dense solvers is far below.
        let tolerance = 2e-8 * matrix.size().max(f64::MIN_POSITIVE);
        if differs(&found.values, &truth, which == Which::LargestMagnitude, tolerance) {
            wrong += 1;
            println!("{trial}: {which:?} {:?} of {truth:?}, {}", found.values, found.completeness);
        }
    }
    assert!(claimed - exact > 150, "claims with a chance are tried, too");
    println!("{claimed} claims, {exact} of them exact, {wrong} wrong; {confirming} products confirmed them");
    // Each claim that is not exact may be wrong with a chance of 0.002 at most, and most chances are far smaller: two are expected
    // at most, and more than seven have a chance below 0.001.
    assert!(wrong <= 7, "{wrong} of {claimed}");
}

#[test]
fn no_singular_value_of_a_structured_matrix_is_missed() {
    let mut random = Pcg64::seed_from_u64(39);
    let (mut wrong, mut confirming) = (0, 0);
    for trial in 0..1000 {
        let square = structured(&mut random);
        let (rows, cols) = (random.random_range(1..=square.n), random.random_range(1..=square.n));
        let mut matrix = Part { square: square.clone(), rows, cols };
        let mut truth: Vec<f64> = {
            let dense = faer::Mat::from_fn(rows, cols, |i, j| square.entries[i * square.n + j]);
            dense.singular_values().unwrap()
        };
        truth.sort_by(|a, b| b.total_cmp(a));
        let options = SingularOptions {
            count: random.random_range(1..=6),
            products: 800,
            start: Start::Random { seed: trial },
            confirm: Some(Confirm::default()),
            ..SingularOptions::default()
        };
        truth.truncate(options.count);
        let found = singular(&mut matrix, &options).unwrap();
        assert!(found.completeness.is_known(), "{trial}: {:?}", found.stats);
        confirming += found.confirming;
        // A residual of 1e-8 of the largest, and rounding.
        let tolerance = 2e-8 * square.size().max(f64::MIN_POSITIVE);
        if differs(&found.values, &truth, false, tolerance) {
            wrong += 1;
            println!("{trial}: {rows}x{cols} {:?} of {truth:?}, {}", found.values, found.completeness);
        }
    }
    println!("{wrong} of 1000 wrong; {confirming} products confirmed them");
    // One is expected at most; more than five have a chance below 0.001.
    assert!(wrong <= 5, "{wrong}");
}

/// Some rows and columns of a matrix.
struct Part {
    square: Dense,
    rows: usize,
    cols: usize,
}

impl krylux::operator::Operator for Part {
    fn rows(&self) -> usize {
        self.rows
    }
    fn cols(&self) -> usize {
        self.cols
    }
    fn symmetry(&self) -> krylux::operator::Symmetry {
        krylux::operator::Symmetry::General
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
        let entry = |i: usize, j: usize| self.square.entries[i * self.square.n + j];
        for (i, y) in y.iter_mut().enumerate() {
            *y = x.iter().enumerate().map(|(j, x)| entry(i, j) * x).sum();
        }
        Ok(())
    }
}

impl Adjoint for Part {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> krylux::Result<()> {
        let entry = |i: usize, j: usize| self.square.entries[i * self.square.n + j];
        for (j, x) in x.iter_mut().enumerate() {
            *x = y.iter().enumerate().map(|(i, y)| entry(i, j) * y).sum();
        }
        Ok(())
    }
}

fn largest(matrix: &mut Dense, count: usize, confirm: Option<Confirm>) -> Eigs {
    eigs(matrix, &EigsOptions { count, confirm, ..EigsOptions::default() }).unwrap()
}

#[test]
fn an_eigenvector_of_signs_is_no_start() {
    // The product of [1, −1] is −4 [1, −1]: a search from there ends with −4.
    let matrix = Dense::new(2, |i, j| if i == j { 1.0 } else { 5.0 });
    for seed in 0..32 {
        let start = Start::Random { seed };
        let options = EigsOptions { count: 1, start, ..EigsOptions::default() };
        let found = eigs(&mut matrix.clone(), &options).unwrap();
        assert!((found.values[0] - 6.0).abs() < 1e-12, "{seed}: {:?}", found.values);
    }
    // From the eigenvector itself the process breaks down, and the products that are left find the other.
    let start = Start::Given(vec![1.0, -1.0]);
    let found =
        eigs(&mut matrix.clone(), &EigsOptions { count: 1, start, ..EigsOptions::default() }).unwrap();
    assert!((found.values[0] - 6.0).abs() < 1e-12, "{:?}", found.values);
    assert_eq!((found.completeness, found.stats.products, found.confirming), (Completeness::Exact, 2, 1));
}

#[test]
fn a_converged_search_alone_excludes_no_further_copies() {
    // Far more copies than products.
    let values: Vec<f64> =
        (0..400).map(|i| [2.0, 2.0, 2.0, 1.0].get(i).copied().unwrap_or(0.1 / i as f64)).collect();
    let found = largest(&mut Dense::turned(&values), 2, None);
    assert_eq!(found.stats.status, Status::ReachedTolerance);
    assert_eq!((found.completeness, found.confirming), (Completeness::NotExcluded, 0));
    assert!(found.values[1] < 1.1, "a copy is missed: {:?}", found.values);

    let found = largest(&mut Dense::turned(&values), 2, Some(Confirm::default()));
    assert!(found.values.iter().all(|value| (value - 2.0).abs() < 1e-7), "{:?}", found.values);
    let Completeness::Confirmed(claim) = found.completeness else { panic!("{:?}", found.completeness) };
    // Two vectors were drawn: one found the copy, one nothing beyond it.
    assert!((claim.chance - 0.002).abs() < 1e-12 && claim.share == 0.01, "{claim:?}");
    let limit = claim.limits[1].expect("the largest were asked for");
    // A hundredth of the spread, which is 2, above the second value.
    assert!((limit - 2.02).abs() < 1e-3, "{claim:?}");
}

#[test]
fn a_confirmation_takes_what_it_says_and_no_more_than_it_may() {
    let values: Vec<f64> = (0..2000).map(|i| 0.8_f64.powi(i)).collect();
    let confirm = Confirm { share: 0.05, ..Confirm::default() };
    let found = largest(&mut Dense::turned(&values), 3, Some(confirm));
    assert_eq!(found.confirming, confirm.steps(2000 - 3));
    // With fewer products it reaches a larger share, and with too few it claims nothing.
    let found = largest(&mut Dense::turned(&values), 3, Some(Confirm { products: 12, ..confirm }));
    let Completeness::Confirmed(claim) = found.completeness else { panic!("{:?}", found.completeness) };
    assert!(found.confirming == 12 && claim.share > 0.2, "{claim:?}");
    let found = largest(&mut Dense::turned(&values), 3, Some(Confirm { products: 2, ..confirm }));
    assert_eq!((found.confirming, found.completeness), (0, Completeness::NotExcluded));
}

#[test]
fn noise_is_neither_a_breakdown_nor_a_missed_value() {
    let values: Vec<f64> = (0..300).map(|i| if i < 4 { 1.0 } else { 0.3 / (1.0 + i as f64) }).collect();
    let mut matrix = Dense::turned(&values);
    let options = EigsOptions {
        count: 4,
        noise: 0.01,
        products: 60,
        confirm: Some(Confirm { share: 0.05, ..Confirm::default() }),
        ..EigsOptions::default()
    };
    let found = eigs(&mut Noisy::new(&mut matrix, |_| 0.01), &options).unwrap();
    assert_ne!(found.completeness, Completeness::Exact, "noise makes nothing exact");
    if found.completeness.is_known() {
        // Noise changes an eigenvalue by 0.01·√(60/300) at most.
        assert!(found.values.iter().all(|value| (value - 1.0).abs() < 0.02), "{:?}", found.values);
    }
}

#[test]
fn more_values_than_there_are_end_with_all_of_them() {
    let found = largest(&mut Dense::new(2, |i, j| if i == j { 1.0 } else { 5.0 }), 6, None);
    assert_eq!((found.values.len(), found.stats.status), (2, Status::SpaceExhausted));
    assert_eq!(found.completeness, Completeness::Exact);
    // A matrix of rank 1 has three singular values of zero.
    let mut ones = Dense::new(4, |_, _| 1.0);
    let found = singular(&mut ones, &SingularOptions::default()).unwrap();
    assert_eq!((found.values.len(), found.completeness), (4, Completeness::Exact));
    assert!((found.values[0] - 4.0).abs() < 1e-12 && found.values[1..].iter().all(|v| v.abs() < 1e-12));
    assert!(found.statuses.iter().all(|&status| status == PairStatus::Converged));
    for (k, left) in found.left.iter().enumerate() {
        for (l, other) in found.left.iter().enumerate() {
            let product = krylux::krylov::dot(left, other);
            assert!((product - f64::from(u8::from(k == l))).abs() < 1e-12, "the photos are orthonormal");
        }
    }
}

#[test]
fn the_dense_solver_agrees_with_itself() {
    // The truth for the tests above: the eigenvalues of a matrix whose spectrum is known.
    let dense = Dense::turned(&[3.0, 3.0, 2.0, -1.0]);
    let values = dense.matrix().self_adjoint_eigenvalues(Side::Lower).unwrap();
    assert!(values.iter().zip([-1.0, 2.0, 3.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-13));
}

#[test]
fn a_search_that_ended_within_noise_is_confirmed_within_its_residuals() {
    // A dense spectrum: the rest of its eigenvectors is in the complement, and does not count as a missed eigenvalue.
    let values: Vec<f64> = (0..400).map(|i| 1.0 - f64::from(i) / 400.0).collect();
    let mut matrix = Dense::turned(&values);
    let options = EigsOptions { count: 6, noise: 0.02, products: 100, ..EigsOptions::default() };
    let mut found = eigs(&mut matrix, &options).unwrap();
    assert_eq!(found.stats.status, Status::NoiseFloor);
    let how = Confirm { is_frozen: true, ..Confirm::default() };
    krylux::krylov::confirm(&mut matrix, &mut found, &options, &how).unwrap();
    assert!(found.completeness.is_known(), "{:?}", found.stats);
    assert!(found.confirming <= 4 * how.steps(394), "{} products", found.confirming);
}
