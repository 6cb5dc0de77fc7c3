//! Matrices and right-hand sides of any size: each answer is that of ordinary size times a power of two, or an error.

#![allow(clippy::panic, reason = "a failed test panics")]

use krylux::error::Error;
use krylux::krylov::{
    Constraint, EigsMethod, EigsOptions, METHODS, MethodFacts, SingularOptions, Solution, SolveOptions,
    Which, dot, eigs, norm, singular, solve_adjoint,
};
use krylux::operator::{Adjoint, Operator, Symmetry};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Powers of two, from the least that leaves normal numbers to the largest that leaves finite ones.
const POWERS: [i32; 13] = [-1000, -900, -560, -300, -150, -97, 0, 96, 170, 333, 600, 900, 1000];

/// A small symmetric, positive definite matrix without negative entries.
#[derive(Clone)]
struct Dense {
    rows: Vec<Vec<f64>>,
}

impl Dense {
    fn random(rng: &mut Pcg64, n: usize) -> Self {
        let values: Vec<f64> = (0..n * n).map(|_| rng.random_range(0.01..0.1)).collect();
        let entry = |i: usize, j: usize| values[i.min(j) * n + i.max(j)] + if i == j { 1.0 } else { 0.0 };
        let rows = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
        Self { rows }
    }

    fn times(&self, power: i32) -> Self {
        let scaled = |row: &Vec<f64>| row.iter().map(|&value| times(value, power)).collect();
        Self { rows: self.rows.iter().map(scaled).collect() }
    }
}

impl Operator for Dense {
    fn rows(&self) -> usize {
        self.rows.len()
    }
    fn cols(&self) -> usize {
        self.rows.len()
    }
    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }
    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
        y.iter_mut().zip(&self.rows).for_each(|(y, row)| *y = dot(row, x));
        Ok(())
    }
}

impl Adjoint for Dense {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> krylux::Result<()> {
        self.apply(y, x)
    }
}

/// `value · 2^power`, which may leave the range of double precision.
fn times(value: f64, power: i32) -> f64 {
    let half = power / 2;
    value * 2_f64.powi(half) * 2_f64.powi(power - half)
}

/// The options of a test: the box bounds nothing, or is far away for some.
fn options(facts: &MethodFacts) -> SolveOptions {
    let upper = if facts.constraint == Constraint::Box { f64::INFINITY } else { 1.0 };
    SolveOptions { products: 40, rtol: 1e-10, upper, ..SolveOptions::default() }
}

/// The effect of rounding on a vector in a few dozen steps: roots of sums of squares round differently for other powers.
const ROUNDING: f64 = 1e-12;

/// Like [`ROUNDING`], for krylov-box: its model is minimized to a millionth, and rounding decides where it rests.
const OF_MODEL: f64 = 1e-6;

/// Asserts that vectors are equal but for a power of two and this share of the second.
#[track_caller]
fn is_close(what: &str, found: &[f64], known: &[f64], power: i32) {
    let share = if what.contains("krylov-box") { OF_MODEL } else { ROUNDING };
    let off: Vec<f64> = found.iter().zip(known).map(|(&found, known)| times(found, -power) - known).collect();
    assert!(norm(&off) <= share * norm(known), "{what}: {found:?} is not {known:?} times 2^{power}");
}

/// Asserts that `found` is `known` times a power of two, with the same status after as many products; an error must say that a number is too large or
/// too small. Returns whether there is an answer.
#[track_caller]
fn is_known_times(what: &str, known: &Solution, found: krylux::Result<Solution>, power: i32) -> bool {
    let found = match found {
        Ok(found) => found,
        Err(Error::Numerical(text)) => {
            let says = ["too large for double precision", "too small for double precision"];
            assert!(says.iter().any(|says| text.contains(says)), "{what}: {text}");
            return false;
        }
        Err(other) => panic!("{what}: {other}"),
    };
    // Rounding decides when the model of krylov-box sees no further gain, and whether that is before its products are spent.
    assert!(
        found.stats == known.stats || what.contains("krylov-box"),
        "{what}: {:?}, {:?}",
        found.stats,
        known.stats
    );
    is_close(what, &found.x, &known.x, power);
    let apart = (found.residual - known.residual).abs();
    assert!(apart < if what.contains("krylov-box") { OF_MODEL } else { 1e-9 }, "{what}: {apart}");
    true
}

#[test]
fn solutions_of_any_size_are_those_of_ordinary_size_times_a_power_of_two() {
    let rng = &mut Pcg64::seed_from_u64(38);
    for case in 0..3 {
        let n = rng.random_range(3..20);
        let matrix = Dense::random(rng, n);
        let x: Vec<f64> = (0..n).map(|_| rng.random_range(0.1..1.0)).collect();
        let mut b = vec![0.0; n];
        matrix.clone().apply(&x, &mut b).expect("a product in memory");
        for facts in &METHODS {
            let solve = |of_matrix: i32, of_rhs: i32, from: Option<i32>| {
                let b: Vec<f64> = b.iter().map(|&value| times(value, of_rhs)).collect();
                let x0 = from.map(|power| x.iter().map(|&value| times(0.75 * value + 0.01, power)).collect());
                let options = SolveOptions { x0, ..options(facts) };
                solve_adjoint(facts.method, &mut matrix.times(of_matrix), &b, &options)
            };
            let known = solve(0, 0, None).unwrap_or_else(|error| panic!("{}: {error}", facts.name));
            let known_from = solve(0, 0, Some(0)).unwrap_or_else(|error| panic!("{}: {error}", facts.name));
            let mut answers = 0;
            for of_matrix in POWERS {
                for of_rhs in POWERS {
                    let what =
                        format!("case {case}, {}: matrix 2^{of_matrix}, right side 2^{of_rhs}", facts.name);
                    let power = of_rhs - of_matrix;
                    answers +=
                        u32::from(is_known_times(&what, &known, solve(of_matrix, of_rhs, None), power));
                    if power.abs() < 900 {
                        let found = solve(of_matrix, of_rhs, Some(power));
                        assert!(is_known_times(&format!("{what}, from x0"), &known_from, found, power));
                    }
                }
            }
            // All those whose answer is not beyond double precision, and some whose answer is near its end.
            let within =
                POWERS.iter().flat_map(|a| POWERS.map(|b| (a - b).abs())).filter(|&power| power < 960);
            assert!(answers >= within.count() as u32, "{}: {answers} answers", facts.name);
        }
    }
}

#[test]
fn a_box_around_the_solution_holds_at_any_size() {
    let rng = &mut Pcg64::seed_from_u64(5);
    let matrix = Dense::random(rng, 12);
    let x: Vec<f64> = (0..12).map(|_| rng.random_range(-0.5..1.5)).collect();
    let mut b = vec![0.0; 12];
    matrix.clone().apply(&x, &mut b).expect("a product in memory");
    for facts in METHODS.iter().filter(|facts| facts.constraint == Constraint::Box) {
        for (lower, upper) in [(0.0, 1.0), (0.2, 1.0), (-1.0, 0.5)] {
            let solve = |power: i32| {
                let b: Vec<f64> = b.iter().map(|&value| times(value, power)).collect();
                let options = SolveOptions { lower, upper, ..options(facts) };
                solve_adjoint(facts.method, &mut matrix.times(power), &b, &options)
                    .expect("both are of one size")
            };
            let known = solve(0);
            for power in POWERS {
                let found = solve(power);
                is_close(&format!("{}: 2^{power}", facts.name), &found.x, &known.x, 0);
                assert_eq!(found.stats.status, known.stats.status, "{}: 2^{power}", facts.name);
            }
        }
        // Nothing in the box comes near: an error instead of a fit of noise. And a black target is black.
        let bright: Vec<f64> = b.iter().map(|value| value * 2_f64.powi(500)).collect();
        let error = solve_adjoint(facts.method, &mut matrix.clone(), &bright, &SolveOptions::default())
            .expect_err("the target is far brighter than white");
        assert!(error.to_string().contains("the right-hand side is about 2^"), "{error}");
        let dark: Vec<f64> = b.iter().map(|value| value.abs() * 2_f64.powi(-1000)).collect();
        let floor = SolveOptions { lower: 0.2, ..SolveOptions::default() };
        let found = solve_adjoint(facts.method, &mut matrix.clone(), &dark, &floor).expect("it is the floor");
        assert_eq!(found.x, vec![0.2; 12], "{}", facts.name);
    }
}

#[test]
fn eigenvalues_and_singular_values_of_any_size_are_those_of_ordinary_size_times_a_power_of_two() {
    let rng = &mut Pcg64::seed_from_u64(7);
    for _ in 0..3 {
        let matrix = Dense::random(rng, 14);
        for method in [
            EigsMethod::Power,
            EigsMethod::Lanczos,
            EigsMethod::BlockLanczos { block: 2 },
            EigsMethod::Arnoldi,
        ] {
            let count = if method == EigsMethod::Power { 1 } else { 3 };
            let which = if method == EigsMethod::Power { Which::LargestMagnitude } else { Which::default() };
            let find = |power: i32| {
                let options = EigsOptions { count, method, which, products: 30, ..EigsOptions::default() };
                eigs(&mut matrix.times(power), &options).expect("the operator is finite")
            };
            let known = find(0);
            for power in POWERS {
                let found = find(power);
                is_close(&format!("{method:?}, 2^{power}"), &found.values, &known.values, power);
                for (found, known) in found.vectors.iter().zip(&known.vectors) {
                    is_close(&format!("a vector, {method:?}, 2^{power}"), found, known, 0);
                }
                assert_eq!(
                    (found.stats.status, &found.statuses),
                    (known.stats.status, &known.statuses),
                    "2^{power}"
                );
            }
        }
        let find = |power: i32| {
            let options = SingularOptions { count: 3, products: 40, ..SingularOptions::default() };
            singular(&mut matrix.times(power), &options).expect("the operator is finite")
        };
        let known = find(0);
        for power in POWERS {
            let found = find(power);
            is_close(&format!("singular values, 2^{power}"), &found.values, &known.values, power);
            assert_eq!(found.stats.status, known.stats.status, "2^{power}");
        }
    }
}

#[test]
fn numbers_that_are_too_large_are_not_called_nan() {
    let matrix = Dense { rows: vec![vec![1e308; 4]; 4] };
    for facts in &METHODS {
        let error =
            solve_adjoint(facts.method, &mut matrix.clone(), &[1e308, 0.0, 1e308, 0.0], &options(facts));
        if let Err(error) = error {
            let text = error.to_string();
            assert!(
                text.contains("too large for double precision") && !text.contains("NaN"),
                "{}: {text}",
                facts.name
            );
        }
    }
    let error = solve_adjoint(
        METHODS[0].method,
        &mut matrix.clone(),
        &[f64::NAN, 0.0, 1.0, 0.0],
        &options(&METHODS[0]),
    );
    assert!(error.is_err_and(|error| error.to_string().contains("the right-hand side holds a NaN")));
    assert!(norm(&[1.7e308; 4]).is_infinite(), "the numbers of this test are finite, and their norm is not");
}
