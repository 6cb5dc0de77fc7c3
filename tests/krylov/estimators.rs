//! Estimators from few products, against the dense truth: photo counts, lack of bias, and honest error estimates.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::krylov_support::{Dense, general_gallery, spread};
use krylux::Error;
use krylux::krylov::{
    Estimate, ForwardOnly, LowRankOptions, diagonal, dot, hutch_plus_plus, hutchinson, norm, randomized_svd,
};

fn trace(matrix: &Dense) -> f64 {
    (0..matrix.n).map(|i| matrix.entries[i * matrix.n + i]).sum()
}

fn decaying(n: usize, by: f64) -> Dense {
    Dense::turned(&(0..n).map(|k| by.powi(k as i32)).collect::<Vec<_>>())
}

/// Over many seeds: the mean within its own standard error of the truth, and the spread as the estimates say.
fn check_statistics(truth: f64, runs: &[Estimate]) {
    let count = runs.len() as f64;
    let mean = runs.iter().map(|run| run.value).sum::<f64>() / count;
    let variance = runs.iter().map(|run| (run.value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let promised = runs.iter().map(|run| run.standard_error.powi(2)).sum::<f64>() / count;
    // Four standard errors of the mean: 6e-5 for chance; the seeds are fixed.
    assert!(
        (mean - truth).abs() <= 4.0 * (variance / count).sqrt(),
        "mean {mean}, truth {truth}, {}",
        (variance / count).sqrt()
    );
    // The ratio of two variances from 200 runs: 10 % standard error, more for heavy tails.
    assert!((0.5..2.0).contains(&(variance / promised)), "variance {variance:e}, promised {promised:e}");
}

#[test]
fn hutchinson_is_without_bias_and_knows_its_error() {
    for mut matrix in [
        decaying(60, 0.9),
        Dense::turned(&spread(60)),
        Dense::turned(&(0..60).map(|k| f64::from(k) - 20.0).collect::<Vec<_>>()),
    ] {
        let truth = trace(&matrix);
        let runs: Vec<Estimate> = (0..200).map(|seed| hutchinson(&mut matrix, 20, seed).unwrap()).collect();
        assert_eq!(matrix.products, 200 * 20);
        assert!(runs.iter().all(|run| run.products == 20));
        check_statistics(truth, &runs);
    }
}

#[test]
fn hutch_plus_plus_is_without_bias_and_better_where_the_spectrum_decays() {
    let mut matrix = decaying(100, 0.7);
    let truth = trace(&matrix);
    let plus: Vec<Estimate> = (0..200).map(|seed| hutch_plus_plus(&mut matrix, 30, seed).unwrap()).collect();
    assert_eq!(matrix.products, 200 * 30);
    check_statistics(truth, &plus);
    let plain: Vec<Estimate> = (0..200).map(|seed| hutchinson(&mut matrix, 30, seed).unwrap()).collect();
    let error =
        |runs: &[Estimate]| (runs.iter().map(|run| (run.value - truth).powi(2)).sum::<f64>() / 200.0).sqrt();
    // Ten vectors leave 0.7^10 = 0.03 of the norm, a random sketch two or three times that; and only a third of the
    // products samples it: 0.03 · 3 · √3 and some spread.
    assert!(error(&plus) < 0.4 * error(&plain), "{:e} {:e}", error(&plus), error(&plain));
    // Not symmetric, indefinite: still without bias.
    let (_, mut random) = general_gallery().remove(3);
    let truth = trace(&random);
    let runs: Vec<Estimate> = (0..200).map(|seed| hutch_plus_plus(&mut random, 15, seed).unwrap()).collect();
    check_statistics(truth, &runs);
}

#[test]
fn traces_of_diagonal_and_low_rank_matrices_are_exact() {
    let mut matrix = Dense::diagonal(&[1.0, -2.0, 5.0, 0.5, 0.0, 3.0, 1.0, 1.0]);
    let found = hutchinson(&mut matrix, 2, 7).unwrap();
    assert!((found.value - 9.5).abs() < 1e-13 && found.standard_error < 1e-13);
    let mut low =
        Dense::turned(&(0..50).map(|k| if k < 3 { 1.0 + f64::from(k) } else { 0.0 }).collect::<Vec<_>>());
    let found = hutch_plus_plus(&mut low, 15, 7).unwrap();
    assert!((found.value - 6.0).abs() < 1e-12, "{}", found.value);
    assert_eq!(low.products, 15, "the products that a sketch of rank 3 leaves over go to the rest");
}

#[test]
fn diagonal_is_without_bias_with_honest_errors_pixel_by_pixel() {
    let mut matrix =
        Dense::new(
            80,
            |i, j| if i == j { 3.0 + (i as f64).sin() } else { 0.3 / (1.0 + i.abs_diff(j) as f64) },
        );
    let found = diagonal(&mut matrix, 400, 3).unwrap();
    assert_eq!((matrix.products, found.products), (400, 400));
    let scores: Vec<f64> =
        (0..80).map(|i| (found.values[i] - matrix.entries[i * 81]) / found.standard_errors[i]).collect();
    // Eighty z-scores: none beyond 4 (chance 0.5 %), and their mean square 1 ± 4 √(2/80).
    assert!(scores.iter().all(|score| score.abs() < 4.0), "{scores:?}");
    let square = dot(&scores, &scores) / 80.0;
    assert!((0.37..1.63).contains(&square), "{square}");
    let exact = diagonal(&mut Dense::diagonal(&[1.0, -2.0, 0.0]), 2, 0).unwrap();
    assert_eq!((exact.values, exact.standard_errors), (vec![1.0, -2.0, 0.0], vec![0.0; 3]));
}

#[test]
fn randomized_svd_finds_what_decays_and_says_what_it_missed() {
    let n = 60;
    // U diag(0.6^k) Wᵀ with two different reflections.
    let left = decaying(n, 0.6);
    let axis: Vec<f64> = (0..n).map(|i| (1.0 + i as f64).cos()).collect();
    let square = dot(&axis, &axis);
    let mut matrix = Dense::general(n, |i, j| {
        let row = &left.entries[i * n..(i + 1) * n];
        row[j] - 2.0 * dot(row, &axis) * axis[j] / square
    });
    for power in [0, 1] {
        let before = matrix.products;
        let options = LowRankOptions { rank: 6, oversampling: 6, power, probes: 10, seed: 2 };
        let found = randomized_svd(&mut matrix, &options).unwrap();
        assert_eq!(found.products, 2 * (power + 1) * 12 + 10, "as promised");
        assert_eq!(matrix.products - before, found.products);
        for (k, value) in found.values.iter().enumerate() {
            let truth = 0.6_f64.powi(k as i32);
            // The sketch misses σ₁₃ = 0.6^12 = 2e-3 times a factor of a few; values are off by its square over σ_k.
            assert!((value - truth).abs() < if power == 0 { 1e-3 } else { 1e-6 }, "σ_{k}: {value} {truth}");
            assert!(
                (norm(&found.left[k]) - 1.0).abs() < 1e-12 && (norm(&found.right[k]) - 1.0).abs() < 1e-12
            );
            let mut product = vec![0.0; n];
            krylux::operator::Operator::apply(&mut matrix.clone(), &found.right[k], &mut product).unwrap();
            let projected = dot(&product, &found.left[k]);
            assert!((projected - value).abs() < 1e-12, "uᵀAw = σ");
        }
        // ‖A − QQᵀA‖_F² is at least what the best rank 12 misses.
        let best: f64 = (12..n).map(|k| 0.36_f64.powi(k as i32)).sum();
        let missed = found.missed_square;
        assert!(missed.value + 4.0 * missed.standard_error >= best, "{missed:?} {best:e}");
        assert!(missed.value <= 100.0 * best, "{missed:?} {best:e}");
    }
}

#[test]
fn low_rank_matrices_are_recovered_to_rounding() {
    let values: Vec<f64> = (0..70).map(|k| if k < 4 { 4.0 - f64::from(k) } else { 0.0 }).collect();
    let mut matrix = Dense::turned(&values);
    let options = LowRankOptions { rank: 6, oversampling: 4, probes: 3, ..LowRankOptions::default() };
    let svd = randomized_svd(&mut ForwardOnly(&mut matrix), &options).unwrap();
    for (k, value) in values.iter().enumerate().take(4) {
        assert!((svd.values[k] - value).abs() < 1e-12, "{:?}", svd.values);
    }
    assert!(svd.missed_square.value < 1e-20);
    let zero = randomized_svd(&mut Dense::diagonal(&[0.0; 20]), &options).unwrap();
    assert!(zero.values.iter().all(|value| *value == 0.0));
}

#[test]
fn failures_and_wrong_options_come_through() {
    let mut matrix = Dense::turned(&spread(20));
    matrix.fail_at = Some(5);
    assert!(matches!(hutchinson(&mut matrix, 10, 0), Err(Error::Interrupted)));
    // The seed names the vectors: taken again, the answer is that of an undisturbed run.
    let again = hutchinson(&mut matrix, 10, 0).unwrap();
    assert_eq!(again, hutchinson(&mut Dense::turned(&spread(20)), 10, 0).unwrap());
    matrix.spoil_at = Some(matrix.products + 2);
    assert!(matches!(diagonal(&mut matrix, 10, 0), Err(Error::Numerical(_))));
    let option = |result: Result<(), Error>, name: &str| match result {
        Err(Error::Option { option, .. }) => assert_eq!(option, name),
        other => panic!("{other:?}"),
    };
    option(hutchinson(&mut matrix, 1, 0).map(drop), "--photos");
    option(hutch_plus_plus(&mut matrix, 5, 0).map(drop), "--photos");
    for (options, name) in [
        (LowRankOptions { rank: 0, ..LowRankOptions::default() }, "rank"),
        (LowRankOptions { probes: 1, ..LowRankOptions::default() }, "--probes"),
    ] {
        option(randomized_svd(&mut ForwardOnly(&mut matrix), &options).map(drop), name);
    }
    let (_, mut general) = general_gallery().remove(0);
    assert!(randomized_svd(&mut ForwardOnly(&mut general), &LowRankOptions::default()).is_err());
}
