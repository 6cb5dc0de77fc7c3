//! Factorizations on disk: resumed to the same bits, damage found; and no long vector allocated within a step.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::krylov_support::{Dense, Noisy, spread};
use krylux::Error;
use krylux::krylov::{EigsOptions, Factorization, ProcessKind, RitzPair, Start, Which, eigs_from};
use krylux::operator::Symmetry;

const N: usize = 90;

fn known() -> Vec<Vec<f64>> {
    vec![Start::Gaussian { seed: 8 }.vector(N)]
}

/// A process of this kind before its first step.
fn start(kind: ProcessKind) -> Factorization {
    let start = Start::default();
    match kind {
        ProcessKind::Lanczos => Factorization::lanczos(&start.vector(N), &known()),
        ProcessKind::BlockLanczos => Factorization::block_lanczos(&start.block(N, 3), &known()),
        ProcessKind::Arnoldi => Factorization::arnoldi(&start.vector(N), &[]),
    }
    .unwrap()
}

fn matrix() -> Dense {
    Dense::turned(&spread(N))
}

fn saved(state: &Factorization) -> Vec<u8> {
    let mut bytes = Vec::new();
    state.save(&mut bytes).unwrap();
    bytes
}

fn everything(state: &Factorization) -> (Vec<Vec<f64>>, Vec<RitzPair>, usize, f64) {
    let pairs = state.ritz(Which::LargestMagnitude, 6).unwrap();
    (state.basis().to_vec(), pairs, state.products(), state.asymmetry())
}

fn resumes_to_the_same_bits(kind: ProcessKind) {
    let mut matrix = matrix();
    let mut whole = start(kind);
    for stop in 0..20 {
        // Saved at every point, even before the first step, and gone on with from there.
        let mut resumed = Factorization::load(kind, &saved(&whole)[..]).unwrap();
        assert_eq!(everything(&resumed), everything(&whole), "stopped after {stop}");
        for _ in 0..4 {
            resumed.expand(&mut matrix).unwrap();
        }
        let mut straight = whole.clone();
        for _ in 0..4 {
            straight.expand(&mut matrix).unwrap();
        }
        assert_eq!(everything(&resumed), everything(&straight), "stopped after {stop}");
        assert_eq!(saved(&resumed), saved(&straight));
        whole.expand(&mut matrix).unwrap();
    }
}

#[test]
fn each_factorization_resumes_from_disk_to_the_same_bits() {
    resumes_to_the_same_bits(ProcessKind::Lanczos);
    resumes_to_the_same_bits(ProcessKind::BlockLanczos);
    resumes_to_the_same_bits(ProcessKind::Arnoldi);
}

#[test]
fn restarted_noisy_and_invariant_processes_resume_to_the_same_bits_too() {
    let options =
        EigsOptions { count: 3, products: 40, tolerance: 0.0, max_basis: Some(12), ..EigsOptions::default() };
    let mut dense = matrix();
    let mut lanczos = start(ProcessKind::Lanczos);
    eigs_from(&mut lanczos, &mut Noisy::new(&mut dense, |_| 1e-3), &options).unwrap();
    let mut resumed = Factorization::load(ProcessKind::Lanczos, &saved(&lanczos)[..]).unwrap();
    assert_eq!(everything(&resumed), everything(&lanczos));
    let options = EigsOptions { products: 60, ..options };
    let straight = eigs_from(&mut lanczos, &mut dense.clone(), &options).unwrap();
    let again = eigs_from(&mut resumed, &mut dense, &options).unwrap();
    assert_eq!((straight.vectors, straight.residuals), (again.vectors, again.residuals));

    // The identity: every step ends in an invariant subspace, and draws a random vector.
    let mut identity = Dense::diagonal(&[1.0; N]);
    let mut block = Factorization::block_lanczos(&Start::default().block(N, 2), &[]).unwrap();
    for _ in 0..7 {
        block.expand(&mut identity).unwrap();
    }
    let mut resumed = Factorization::load(ProcessKind::BlockLanczos, &saved(&block)[..]).unwrap();
    while !block.is_exhausted() {
        assert_eq!(block.expand(&mut identity).unwrap(), resumed.expand(&mut identity).unwrap());
    }
    assert_eq!(everything(&resumed), everything(&block));
}

#[test]
fn every_flipped_byte_and_every_missing_end_is_found() {
    let mut dense = matrix();
    let mut lanczos = start(ProcessKind::Lanczos);
    for _ in 0..3 {
        lanczos.expand(&mut dense).unwrap();
    }
    let bytes = saved(&lanczos);
    let refused = |bytes: &[u8], what: String| match Factorization::load(ProcessKind::Lanczos, bytes) {
        Err(Error::Data { path, .. }) => assert_eq!(path.to_str(), Some("saved factorization")),
        Err(other) => panic!("{what}: {other}"),
        Ok(_) => panic!("{what}: believed"),
    };
    for position in 0..bytes.len() {
        for flip in [0x01, 0x80] {
            let mut damaged = bytes.clone();
            damaged[position] ^= flip;
            refused(&damaged, format!("byte {position} flipped by {flip:#x}"));
        }
    }
    for length in (0..bytes.len()).step_by(7) {
        refused(&bytes[..length], format!("only {length} bytes"));
    }
}

#[test]
fn files_of_the_version_before_are_read() {
    let mut dense = matrix();
    let mut lanczos = start(ProcessKind::Lanczos);
    lanczos.expand(&mut dense).unwrap();
    // A restart that keeps all but one vector leaves no late parts, which that version cannot say.
    lanczos.expand(&mut dense).unwrap();
    lanczos.shrink(Which::LargestAlgebraic, 1).unwrap();
    let mut bytes = saved(&lanczos);
    bytes.truncate(bytes.len() - 32);
    // Magic, version, kind, seven counts, two floats; one column of two coefficients and its error.
    let at = 8 + 4 + 4 + 7 * 8 + 2 * 8 + (8 + 2 * 8 + 8);
    assert_eq!(bytes.drain(at..at + 8).collect::<Vec<u8>>(), [0; 8], "no late parts");
    bytes[8..12].copy_from_slice(&2_u32.to_le_bytes());
    let checksum = *blake3::hash(&bytes).as_bytes();
    bytes.extend_from_slice(&checksum);
    let read = Factorization::load(ProcessKind::Lanczos, &bytes[..]).unwrap();
    assert_eq!(everything(&read), everything(&lanczos));
    assert_eq!(saved(&read), saved(&lanczos), "it is written as the version of today");
}

#[test]
fn other_versions_kinds_and_absurd_lengths_are_named() {
    let bytes = saved(&start(ProcessKind::Lanczos));
    let fault = |bytes: &[u8]| match Factorization::load(ProcessKind::Lanczos, bytes).unwrap_err() {
        Error::Data { fault, .. } => fault,
        other => panic!("{other}"),
    };
    let with = |at: usize, value: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        bytes
    };
    assert!(fault(b"not a factorization at all").contains("begin like a saved factorization"));
    assert!(fault(&with(8, &[1])).contains("version 1"));
    assert!(fault(&saved(&start(ProcessKind::Arnoldi))).contains("kind 3"));
    // A length of 2^60 must not be allocated.
    let huge = (1_u64 << 60).to_le_bytes();
    assert!(fault(&with(16, &huge)).contains("too early"));
    assert!(fault(&with(40, &huge)).contains("contradict"));
    let error = Factorization::load(ProcessKind::Lanczos, &bytes[..100]).unwrap_err().to_string();
    assert!(error.contains("help:"), "{error}");
}

#[test]
fn failing_writers_and_readers_are_reported_as_such() {
    struct Broken;
    impl std::io::Write for Broken {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("disk full"))
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    impl std::io::Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("cable pulled"))
        }
    }
    assert!(matches!(start(ProcessKind::Lanczos).save(Broken), Err(Error::Write { .. })));
    assert!(matches!(Factorization::load(ProcessKind::Lanczos, Broken), Err(Error::Read { .. })));
}

#[test]
fn arnoldi_of_a_symmetric_operator_is_not_taken_for_lanczos() {
    assert_eq!(matrix().symmetry, Symmetry::Symmetric);
    let mut arnoldi = start(ProcessKind::Arnoldi);
    arnoldi.expand(&mut matrix()).unwrap();
    assert!(Factorization::load(ProcessKind::Lanczos, &saved(&arnoldi)[..]).is_err());
}
