//! Orthogonality of the bases of all factorizations, held to the bound that `src/krylov/factor/step.rs` states.
#![allow(clippy::unwrap_used, reason = "in a test a panic is the report")]

use crate::krylov_support::{Dense, Noisy, general_gallery, spread, symmetric_gallery};
use krylux::krylov::{Factorization, Start, Which, dot};

/// `‖I − UᵀU‖_F` for the known vectors and the basis, and the largest part that a waiting vector has along them.
fn losses(state: &Factorization) -> (f64, f64) {
    let columns: Vec<&Vec<f64>> = state.known().iter().chain(state.basis()).collect();
    let mut square = 0.0;
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            square += (dot(a, b) - f64::from(u8::from(i == j))).powi(2);
        }
    }
    let along = |w: &Vec<f64>| columns.iter().map(|v| dot(v, w).powi(2)).sum::<f64>().sqrt();
    (square.sqrt(), state.waiting().iter().map(along).fold(0.0, f64::max))
}

/// Runs up to `steps` steps and holds the basis to the bound.
fn check(name: &str, process: &mut Factorization, matrix: &mut Dense, steps: usize) {
    while process.steps() < steps && !process.is_exhausted() {
        process.expand(matrix).unwrap();
    }
    let state = &*process;
    let (m, n) = ((state.known().len() + state.steps()) as f64, state.n() as f64);
    let (loss, waiting) = losses(state);
    // The longest chain of roundings: 512 rows in 4 lanes, then the blocks, then a few; and removals from m columns.
    let additions = 128.0 + n / 512.0 + 2.0 * m + 12.0;
    let bound = |gamma: f64| m * 2.0_f64.sqrt() * gamma;
    assert!(loss <= bound(additions * f64::EPSILON / 2.0), "{name}: {loss:e} after {m} steps");
    // Rounding errors have either sign, and n numbers of either sign cancel: the root of as many.
    assert!(loss <= bound(additions.sqrt() * f64::EPSILON / 2.0), "{name}: {loss:e} after {m} steps");
    // The part that may wait for the next step.
    assert!(waiting <= 1.01e-12, "{name}: {waiting:e}");
    // The coefficients belong to the vectors as they are now.
    let (mut product, size) = (vec![0.0; state.n()], matrix.size());
    for (j, v) in state.basis().iter().enumerate() {
        krylux::operator::Operator::apply(matrix, v, &mut product).unwrap();
        for (i, u) in state.basis().iter().enumerate() {
            let error = (dot(u, &product) - state.entry(i, j)).abs();
            // Rounding of products of n terms.
            assert!(error <= 1e-14 * n * size, "{name}: entry {i}, {j} is off by {error:e}");
        }
    }
}

/// Spectra of 200 dimensions and more, for runs of 90 steps.
fn hard_cases() -> Vec<(&'static str, Dense)> {
    let turned =
        |n: usize, value: &dyn Fn(usize) -> f64| Dense::turned(&(0..n).map(value).collect::<Vec<_>>());
    vec![
        ("spread", Dense::turned(&spread(200))),
        // Converged far outside the others, where the inner products grow fastest.
        ("outliers", turned(200, &|k| if k < 4 { 10.0 - k as f64 } else { k as f64 / 200.0 })),
        ("one far away", turned(200, &|k| if k == 0 { 1e6 } else { (k as f64).cos() })),
        ("repeated", turned(240, &|k| 1.0 + (k % 100) as f64 + 1e-9 * (k as f64).sin())),
        ("pairs of both signs", turned(200, &|k| if k % 2 == 0 { 1.0 + k as f64 } else { -(k as f64) })),
        ("graded", turned(200, &|k| 10.0_f64.powf(-(k as f64) / 10.0))),
        ("large dynamic range", turned(200, &|k| 10.0_f64.powf((k * 7 % 25) as f64 - 12.0))),
        ("two clusters", turned(200, &|k| f64::from(u8::from(k % 2 == 0)) + 1e-3 * (k as f64).sin())),
    ]
}

#[test]
fn bases_of_ninety_steps_stay_within_the_stated_bound() {
    for (name, matrix) in hard_cases() {
        let n = matrix.n;
        let known = [Start::Gaussian { seed: 5 }.vector(n)];
        for deflate in [&known[..0], &known[..]] {
            let mut lanczos = Factorization::lanczos(&Start::default().vector(n), deflate).unwrap();
            check(name, &mut lanczos, &mut matrix.clone(), 90);
            let mut block = Factorization::block_lanczos(&Start::default().block(n, 3), deflate).unwrap();
            check(name, &mut block, &mut matrix.clone(), 90);
            let mut arnoldi = Factorization::arnoldi(&Start::default().vector(n), deflate).unwrap();
            check(name, &mut arnoldi, &mut matrix.clone(), 90);
        }
    }
}

#[test]
fn bases_of_the_whole_gallery_stay_within_the_stated_bound() {
    for (name, matrix) in symmetric_gallery() {
        let n = matrix.n;
        let mut lanczos = Factorization::lanczos(&Start::default().vector(n), &[]).unwrap();
        check(name, &mut lanczos, &mut matrix.clone(), n);
        let mut block = Factorization::block_lanczos(&Start::default().block(n, n.min(4)), &[]).unwrap();
        check(name, &mut block, &mut matrix.clone(), n);
    }
    for (name, matrix) in general_gallery() {
        let mut arnoldi = Factorization::arnoldi(&Start::default().vector(matrix.n), &[]).unwrap();
        check(name, &mut arnoldi, &mut matrix.clone(), matrix.n);
    }
}

#[test]
fn noise_and_restarts_leave_bases_orthonormal() {
    let mut matrix = Dense::turned(&spread(150));
    let mut lanczos = Factorization::lanczos(&Start::default().vector(150), &[]).unwrap();
    for round in 0..6 {
        for step in 0..12 {
            // Noise of all sizes, some of it where the removal may just wait.
            let noise = |_| 10.0_f64.powi(-(2 * step + round));
            lanczos.expand(&mut Noisy::new(&mut matrix, noise)).unwrap();
        }
        lanczos.shrink(Which::LargestAlgebraic, 5).unwrap();
        let (loss, waiting) = losses(&lanczos);
        // Rotations by matrices orthogonal to a few ε each, and the waiting vector is settled before them.
        assert!(loss < 1e-13 && waiting < 1e-13, "{round}: {loss:e} {waiting:e}");
    }
}

#[test]
fn vectors_that_wait_are_multiplied_alike_alone_and_in_a_block() {
    /// Takes blocks of the given size.
    struct Blocks(Dense, usize);
    impl krylux::operator::Operator for Blocks {
        fn rows(&self) -> usize {
            self.0.n
        }
        fn cols(&self) -> usize {
            self.0.n
        }
        fn symmetry(&self) -> krylux::operator::Symmetry {
            krylux::operator::Symmetry::Symmetric
        }
        fn block_size(&self) -> usize {
            self.1
        }
        fn apply(&mut self, x: &[f64], y: &mut [f64]) -> krylux::Result<()> {
            self.0.apply(x, y)
        }
    }
    let run = |size: usize| {
        let mut operator = Blocks(Dense::turned(&spread(160)), size);
        let mut process = Factorization::block_lanczos(&Start::default().block(160, 4), &[]).unwrap();
        for _ in 0..70 {
            process.multiply_block(&mut operator, 70).unwrap();
            process.expand(&mut operator).unwrap();
        }
        (process.basis().to_vec(), process.ritz(Which::LargestAlgebraic, 6).unwrap())
    };
    let alone = run(1);
    for size in 2..6 {
        assert!(run(size) == alone, "blocks of {size} change the bits");
    }
}
