//! Claims of `eigs` about matrices on which a search from one vector misses eigenvalues: no wrong value with status 0.

use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{inside, krylux};
use krylux::io::npy;

/// The status and the summary of `eigs` on a matrix by its rows.
fn eigs(rows: &[Vec<f64>], more: &[&str]) -> (Option<i32>, Value) {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let (matrix, run) = (inside(&folder, "matrix.npy"), inside(&folder, "run"));
    npy::write_npy(Path::new(&matrix), &[rows.len(), rows[0].len()], &rows.concat()).expect("it is ours");
    let output = krylux(&[&["eigs", &matrix, "--json", "-o", &run], more].concat());
    let status = output.status.code();
    assert!(matches!(status, Some(0 | 1)), "{}", String::from_utf8_lossy(&output.stderr));
    (status, serde_json::from_slice(&output.stdout).expect("a summary"))
}

fn values(summary: &Value, name: &str) -> Vec<f64> {
    summary[name].as_array().expect("values").iter().map(|value| value.as_f64().expect("a number")).collect()
}

/// Asserts these values, with status 0 and a claim that none is missing.
fn assert_values(rows: &[Vec<f64>], more: &[&str], wanted: &[f64]) {
    let (status, summary) = eigs(rows, more);
    let name = if more.contains(&"--singular") { "singular_values" } else { "eigenvalues" };
    let found = values(&summary, name);
    // The tolerance of a residual is 1e-8 of the norm, which is 10 at most.
    let is_close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-7;
    assert!(found.len() == wanted.len() && found.iter().zip(wanted).all(is_close), "{found:?} of {wanted:?}");
    assert_eq!(status, Some(0), "{summary}");
    assert_ne!(summary["completeness"]["claim"], "not-excluded", "{summary}");
}

/// Cells of `size` pixels that exchange nothing: one eigenvalue 1 of each, all others 0.1.
fn cells(count: usize, size: usize) -> Vec<Vec<f64>> {
    let entry = |i: usize, j: usize| {
        let even = if i / size == j / size { 0.9 / size as f64 } else { 0.0 };
        even + if i == j { 0.1 } else { 0.0 }
    };
    (0..count * size).map(|i| (0..count * size).map(|j| entry(i, j)).collect()).collect()
}

#[test]
fn eigenvalues_that_one_start_misses_are_found() {
    assert_values(&[vec![1.0, 5.0], vec![5.0, 1.0]], &["--count", "1"], &[6.0]);
    let light = [3.0, 2.0, 1.0];
    let pair = |i: usize, j: usize| if i != j && i / 2 == j / 2 { light[i / 2] } else { 0.0 };
    let pairs: Vec<Vec<f64>> = (0..6).map(|i| (0..6).map(|j| pair(i, j)).collect()).collect();
    assert_values(&pairs, &["--count", "2"], &[3.0, 2.0]);
    assert_values(&pairs, &["--count", "2", "--which", "be", "--method", "block-lanczos"], &[3.0, -3.0]);
    assert_values(&cells(4, 25), &["--count", "6"], &[1.0, 1.0, 1.0, 1.0, 0.1, 0.1]);
}

#[test]
fn singular_values_that_one_start_misses_are_found() {
    let two = [
        [-1.0, 0.0, -1.0, -1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0, -1.0].to_vec(),
        [0.0, -1.0, -1.0, -1.0, 0.0, 1.0, 1.0, 1.0, -1.0, 1.0, 0.0].to_vec(),
    ];
    // σ² of two rows with squares 6 and 8 and the inner product 3: 7 + √10.
    let largest = (7.0 + 10.0_f64.sqrt()).sqrt();
    assert_values(&two, &["--singular", "--count", "1"], &[largest]);
    let values = [3.0, 3.0, 3.0, 2.0];
    let entry = |i: usize, j: usize| if i == j && i < 4 { values[i] } else { 0.0 };
    let repeated: Vec<Vec<f64>> = (0..40).map(|i| (0..60).map(|j| entry(i, j)).collect()).collect();
    assert_values(&repeated, &["--singular", "--count", "4"], &values);
}

#[test]
fn fewer_values_than_asked_and_values_that_are_not_resolved_are_status_1() {
    let (status, summary) = eigs(&[vec![1.0, 5.0], vec![5.0, 1.0]], &[]);
    assert_eq!(
        (status, values(&summary, "eigenvalues").len()),
        (Some(1), 2),
        "six were asked for: {summary}"
    );
    let spread: Vec<Vec<f64>> = (0..60)
        .map(|i| (0..60).map(|j| if i == j { 1.0 - 0.01 * i as f64 } else { 0.0 }).collect())
        .collect();
    let (status, summary) = eigs(&spread, &["--photos", "8"]);
    assert_eq!((status, summary["completeness"]["claim"].as_str()), (Some(1), Some("not-excluded")));
}

#[test]
fn methods_that_see_one_copy_claim_no_more() {
    for method in ["arnoldi", "power"] {
        let (_, summary) = eigs(&cells(2, 16), &["--count", "1", "--method", method]);
        assert_eq!(summary["completeness"]["claim"], "not-excluded", "{method}: {summary}");
    }
}
