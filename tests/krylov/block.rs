//! Block Lanczos: repeated eigenvalues, dependent starts, invariant subspaces, stopping within a block.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::krylov_support::{Dense, spread};
use krylux::Error;
use krylux::krylov::{EigsMethod, EigsOptions, Factorization, Start, Status, Step, Which, dot, eigs};

/// The normalized adjacency `D^-½ W D^-½` of regions that exchange no light, each of another structure: from a
/// kernel that falls off with distance to nearly the same light everywhere. Also `D^½ 1`.
fn regions(sizes: &[usize]) -> (Dense, Vec<f64>) {
    let n: usize = sizes.iter().sum();
    let place: Vec<(usize, usize, usize)> = sizes
        .iter()
        .enumerate()
        .flat_map(|(region, &size)| (0..size).map(move |index| (region, index, size)))
        .collect();
    let weight = |i: usize, j: usize| {
        let ((region, a, size), (other, b, _)) = (place[i], place[j]);
        if region != other {
            return 0.0;
        }
        let (x, y) = (a as f64 / size as f64, b as f64 / size as f64);
        match region % 3 {
            // Two facing walls: light goes to the other half only, less to what is far.
            0 => {
                if (x < 0.5) == (y < 0.5) {
                    0.02
                } else {
                    1.0 / (0.3 + (x + y - 1.0).powi(2))
                }
            }
            // A wide kernel on a curve.
            1 => 0.1 + (-((x - y) / 0.5).powi(2)).exp(),
            // A cavity of uneven albedo.
            _ => (0.2 + x) * (0.2 + y) * (1.0 + 0.5 * (7.0 * (x - y)).cos()),
        }
    };
    let degree: Vec<f64> = (0..n).map(|i| (0..n).map(|j| weight(i, j)).sum()).collect();
    let matrix = Dense::new(n, |i, j| weight(i, j) / (degree[i] * degree[j]).sqrt());
    (matrix, degree.iter().map(|degree| degree.sqrt()).collect())
}

/// How far the span of `found` is from each region's own eigenvector `D^½ 1_region`.
fn worst_miss(found: &[Vec<f64>], known: &[f64], sizes: &[usize]) -> f64 {
    let length = dot(known, known).sqrt();
    let mut first = 0;
    let mut worst = 0.0_f64;
    for size in sizes {
        let mut own = vec![0.0; known.len()];
        own[first..first + size].copy_from_slice(&known[first..first + size]);
        first += size;
        let norm = dot(&own, &own).sqrt();
        let mut inside = (dot(known, &own) / length / norm).powi(2);
        inside += found.iter().map(|vector| (dot(vector, &own) / norm).powi(2)).sum::<f64>();
        worst = worst.max((1.0 - inside).max(0.0).sqrt());
    }
    worst
}

#[test]
fn two_three_and_nine_regions_take_at_most_12_15_and_50_photos() {
    for (sizes, photos) in
        [(vec![250, 400], 12), (vec![150, 300, 200], 15), (vec![60, 90, 70, 80, 100, 65, 75, 110, 85], 50)]
    {
        let (mut matrix, known) = regions(&sizes);
        let copies = sizes.len() - 1;
        // One photo more is of white, for the degree.
        let options = EigsOptions {
            count: copies,
            products: photos - 1,
            tolerance: 1e-3,
            method: EigsMethod::BlockLanczos { block: copies },
            deflate: vec![known.clone()],
            ..EigsOptions::default()
        };
        let found = eigs(&mut matrix, &options).unwrap();
        println!(
            "{} regions: {} photos, residuals up to {:.1e}, vectors off by {:.1e}",
            sizes.len(),
            found.stats.products + 1,
            found.residuals.iter().copied().fold(0.0, f64::max),
            worst_miss(&found.vectors, &known, &sizes)
        );
        assert_eq!(
            found.stats.status,
            Status::ReachedTolerance,
            "{} regions: {:?}",
            sizes.len(),
            found.residuals
        );
        // The error is bounded by the square of the residual over the gap to the next eigenvalue, which is more than 0.3.
        assert!(found.values.iter().all(|value| (value - 1.0).abs() < 1e-5), "{:?}", found.values);
        let miss = worst_miss(&found.vectors, &known, &sizes);
        // Residual over gap (Davis–Kahan), a residual of 1e-3 for each copy.
        assert!(miss < 1e-3 * (copies as f64).sqrt() / 0.3, "{} regions: {miss:e}", sizes.len());

        if copies > 1 {
            // A single vector at the same price sees one copy of the eigenvalue, or what rounding errors grew into.
            let single = EigsOptions { method: EigsMethod::Lanczos, ..options };
            let found = eigs(&mut matrix, &single).unwrap();
            assert!(worst_miss(&found.vectors, &known, &sizes) > 0.1);
            let seen = found.values.iter().filter(|value| **value > 0.95).count();
            assert!(seen < copies, "{seen} copies: {:?}", found.values);
        }
    }
}

#[test]
fn block_of_one_is_lanczos_to_the_bit() {
    let mut matrix = Dense::turned(&spread(100));
    let start = Start::default();
    let mut single = Factorization::lanczos(&start.vector(100), &[]).unwrap();
    let mut block = Factorization::block_lanczos(&start.block(100, 1), &[]).unwrap();
    for _ in 0..20 {
        assert_eq!(single.expand(&mut matrix).unwrap(), block.expand(&mut matrix).unwrap());
    }
    assert_eq!(single.basis(), block.basis());
    assert_eq!(
        single.ritz(Which::LargestAlgebraic, 5).unwrap(),
        block.ritz(Which::LargestAlgebraic, 5).unwrap()
    );
}

#[test]
fn relation_between_basis_products_and_coefficients_holds_after_any_single_product() {
    let matrix = Dense::turned(&spread(80));
    let known = vec![Start::Gaussian { seed: 3 }.vector(80)];
    let mut block = Factorization::block_lanczos(&Start::default().block(80, 4), &known).unwrap();
    for step in 1..=30 {
        block.expand(&mut matrix.clone()).unwrap();
        let state = &block;
        assert_eq!((state.steps(), state.pending(), state.products()), (step, 4, step));
        let all: Vec<&Vec<f64>> = state.basis().iter().chain(state.waiting()).collect();
        for (j, v) in state.basis().iter().enumerate() {
            let product: Vec<f64> = matrix.entries.chunks(80).map(|row| dot(row, v)).collect();
            for (i, u) in all.iter().enumerate() {
                assert!((dot(u, &product) - state.entry(i, j)).abs() < 1e-14, "entry {i}, {j}");
            }
            // The basis and the known vector leave only rounding of A v.
            let mut square = dot(&product, &product) - dot(&state.known()[0], &product).powi(2);
            square -= all.iter().map(|u| dot(u, &product).powi(2)).sum::<f64>();
            assert!(square.abs() < 1e-14, "{square:e}");
        }
        // b diagonals on each side, and nothing beyond.
        for j in 0..step {
            assert!((0..step).filter(|i| i.abs_diff(j) > 4).all(|i| state.entry(i, j).abs() < 1e-13));
        }
    }
}

#[test]
fn repeated_eigenvalues_come_with_as_many_copies_as_the_block_is_wide() {
    let values: Vec<f64> = (0..200).map(|k| if k < 5 { 1.0 } else { 0.6 * 0.97_f64.powi(k) }).collect();
    let mut matrix = Dense::turned(&values);
    for block in [1, 3, 5] {
        let options = EigsOptions {
            count: 6,
            // Later, rounding errors would have grown into further copies.
            products: 6 * block.max(3),
            tolerance: 0.0,
            method: EigsMethod::BlockLanczos { block },
            ..EigsOptions::default()
        };
        let found = eigs(&mut matrix, &options).unwrap();
        let copies = found.values.iter().filter(|value| **value > 0.99).count();
        assert_eq!(copies, block, "{:?}", found.values);
    }
}

#[test]
fn dependent_start_vectors_are_left_out() {
    let mut matrix = Dense::turned(&spread(40));
    let one = Start::Gaussian { seed: 1 }.vector(40);
    let two = Start::Gaussian { seed: 2 }.vector(40);
    let sum: Vec<f64> = one.iter().zip(&two).map(|(a, b)| a - 3.0 * b).collect();
    let starts = [one.clone(), two.clone(), sum, vec![0.0; 40]];
    let mut block = Factorization::block_lanczos(&starts, &[]).unwrap();
    assert_eq!((block.block(), block.pending()), (4, 2));
    let mut clean = Factorization::block_lanczos(&[one, two], &[]).unwrap();
    for _ in 0..10 {
        assert_eq!(block.expand(&mut matrix).unwrap(), Step::Extended);
        clean.expand(&mut matrix).unwrap();
    }
    // Only how far the first pass of Gram–Schmidt looks back differs.
    for (a, b) in block.basis().iter().zip(clean.basis()) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-10));
    }
}

#[test]
fn block_gets_narrower_as_directions_run_out_and_starts_afresh_from_an_invariant_subspace() {
    let mut matrix = Dense::diagonal(&[3.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 0.5]);
    // Within the span of e1 and e2, and of e4: A keeps both spaces.
    let starts = [vec![1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]];
    let mut block = Factorization::block_lanczos(&starts, &[]).unwrap();
    let mut steps = Vec::new();
    while !block.is_exhausted() {
        steps.push(block.expand(&mut matrix).unwrap());
    }
    assert_eq!(steps[..3], [Step::Extended, Step::Deflated, Step::Invariant]);
    assert_eq!(steps.last(), Some(&Step::Exhausted));
    assert_eq!((block.steps(), matrix.products), (8, 8));
    let found = block.ritz(Which::LargestAlgebraic, 8).unwrap();
    for (pair, wanted) in found.iter().zip([3.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 0.5]) {
        assert!((pair.value - wanted).abs() < 1e-13, "{}", pair.value);
        assert!(pair.residual < 1e-13);
    }
}

#[test]
fn more_start_vectors_than_dimensions_are_one_product_each_for_the_whole_space() {
    let mut matrix = Dense::turned(&[3.0, 1.0, -2.0]);
    let options =
        EigsOptions { count: 3, method: EigsMethod::BlockLanczos { block: 7 }, ..EigsOptions::default() };
    let found = eigs(&mut matrix, &options).unwrap();
    assert_eq!((found.stats.products, found.stats.status), (3, Status::SpaceExhausted));
    for (value, wanted) in found.values.iter().zip([3.0, 1.0, -2.0]) {
        assert!((value - wanted).abs() < 1e-14);
    }
}

#[test]
fn failed_product_within_a_block_resumes_to_the_same_bits() {
    let matrix = Dense::turned(&spread(120));
    let run = |faults: &[usize]| {
        let mut matrix = matrix.clone();
        let mut block = Factorization::block_lanczos(&Start::default().block(120, 3), &[]).unwrap();
        let mut failed = 0;
        while block.products() < 25 {
            matrix.fail_at = faults.get(failed).copied();
            match block.expand(&mut matrix) {
                Ok(_) => {}
                Err(Error::Interrupted) => failed += 1,
                Err(other) => panic!("{other}"),
            }
        }
        assert_eq!(failed, faults.len());
        (block.basis().to_vec(), block.ritz(Which::BothEnds, 4).unwrap())
    };
    assert_eq!(run(&[]), run(&[1, 5, 6, 20]));
}

#[test]
fn vectors_added_later_find_further_copies_of_an_eigenvalue() {
    let copies = 4;
    let mut values = spread(120);
    values[..copies].fill(3.0);
    let mut matrix = Dense::turned(&values);
    let starts = Start::Random { seed: 5 }.block(120, copies);
    let mut lanczos = Factorization::block_lanczos(&starts[..1], &[]).unwrap();
    let found = |lanczos: &Factorization| {
        let pairs = lanczos.ritz(Which::LargestAlgebraic, copies).unwrap();
        pairs.iter().filter(|pair| (pair.value - 3.0).abs() < 1e-8).count()
    };
    for _ in 0..15 {
        lanczos.expand(&mut matrix).unwrap();
    }
    assert!(found(&lanczos) <= 1, "one start sees one copy");
    lanczos.widen(&starts[1..]).unwrap();
    assert_eq!((lanczos.block(), lanczos.products()), (copies, 15), "no product is lost");
    while lanczos.products() < 110 {
        lanczos.expand(&mut matrix).unwrap();
    }
    assert_eq!(found(&lanczos), copies);
    assert!(matches!(lanczos.widen(&[vec![1.0; 7]]), Err(Error::Dimension { .. })));
}
