//! Spectra of the transport matrices against an independent renderer's.

use crate::common::{csr, load, reference, settings, trace, tracer};
use faer::{Mat, Side};
use krylux::transport::{Channels, Part, TransportMatrix};

const SIDE: usize = 32;
/// Eigenvalues compared.
const COUNT: usize = 20;

/// One part as a dense matrix.
fn dense(matrix: &TransportMatrix, part: Part) -> Mat<f64> {
    let mut dense = Mat::zeros(SIDE * SIDE, SIDE * SIDE);
    csr(matrix, part, 0).entries().for_each(|(row, column, weight)| dense[(row, column)] = weight);
    dense
}

/// The largest eigenvalues, falling.
fn largest(matrix: &Mat<f64>) -> Vec<f64> {
    let mut eigenvalues =
        matrix.self_adjoint_eigenvalues(Side::Lower).expect("a finite matrix has eigenvalues");
    eigenvalues.sort_by(|a, b| b.total_cmp(a));
    eigenvalues.truncate(COUNT);
    eigenvalues
}

/// `D^-½ G D^-½` with `D = diag(G 1)`.
fn normalized(global: &Mat<f64>) -> Mat<f64> {
    let degree: Vec<f64> =
        (0..global.nrows()).map(|row| global.row(row).iter().sum::<f64>().sqrt()).collect();
    Mat::from_fn(global.nrows(), global.ncols(), |i, j| global[(i, j)] / (degree[i] * degree[j]))
}

/// The largest deviation of corresponding values, each by `deviation`, and where it is.
fn worst(ours: &[f64], theirs: &[f64], deviation: impl Fn(f64, f64) -> f64) -> (usize, f64) {
    let deviations = ours.iter().zip(theirs).map(|(a, b)| deviation(*a, *b)).enumerate();
    deviations.max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are eigenvalues")
}

fn compare(scene: &str, file: &str, samples: u32) {
    // The limit of surface hits is the reference's.
    let matrix = trace(&mut tracer(&load(scene)), settings(SIDE, samples, 15, 1), Channels::Luma).matrix;
    let ours = largest(&dense(&matrix, Part::Full));
    let theirs = reference(&format!("{file}_32_eig_A.npy"));
    assert_eq!(theirs.len(), COUNT);
    let (index, relative) = worst(&ours, &theirs, |a, b| (a / b - 1.0).abs());
    println!("{scene}: eigenvalues of A within {:.3} % (the {}th)", 100.0 * relative, index + 1);
    // The noise of both matrices together is about 1 % of their Frobenius norm, and no eigenvalue moves by more than
    // the norm of the difference (Weyl); in fact noise spreads over all directions, and moves them far less.
    assert!(relative < 0.01, "eigenvalue {}: {} instead of {}", index + 1, ours[index], theirs[index]);

    let ours = largest(&normalized(&dense(&matrix, Part::Global)));
    let theirs = reference(&format!("{file}_32_eig_ncut.npy"));
    assert_eq!(theirs.len(), COUNT);
    let (index, absolute) = worst(&ours, &theirs, |a, b| (a - b).abs());
    println!("{scene}: eigenvalues of D^-½ G D^-½ within {absolute:.4} (the {}th)", index + 1);
    // The first is 1 by construction; the others separate the regions.
    assert!((ours[0] - 1.0).abs() < 1e-9, "{}", ours[0]);
    assert!(absolute < 0.01, "eigenvalue {}: {} instead of {}", index + 1, ours[index], theirs[index]);
}

#[test]
fn the_corners_spectrum_agrees_with_the_reference() {
    compare("corner", "corner90", 2048);
}

#[test]
fn the_zigzags_spectrum_agrees_with_the_reference() {
    compare("zigzag", "zigzag", 2048);
}
