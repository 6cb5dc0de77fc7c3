//! Factorizations on disk: resumed to the same bits, damage found; and no long vector allocated within a step.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::krylov_support::{Dense, Noisy, spread};
use krylux::krylov::{
    Arnoldi, BlockLanczos, EigsOptions, Factorization, Lanczos, RitzPair, Start, Which, eigs_from,
};
use krylux::operator::Symmetry;
use krylux::{Error, Result};

const N: usize = 90;

/// One of the three, and how to save and load it.
trait Kind: Factorization + Sized + Clone {
    fn start() -> Self;
    fn save(&self, writer: &mut Vec<u8>);
    fn load(bytes: &[u8]) -> Result<Self>;
}

macro_rules! kind {
    ($name:ident, $start:expr) => {
        impl Kind for $name {
            fn start() -> Self {
                $start.unwrap()
            }
            fn save(&self, writer: &mut Vec<u8>) {
                $name::save(self, writer).unwrap();
            }
            fn load(bytes: &[u8]) -> Result<Self> {
                $name::load(bytes)
            }
        }
    };
}

fn known() -> Vec<Vec<f64>> {
    vec![Start::Gaussian { seed: 8 }.vector(N)]
}

kind!(Lanczos, Lanczos::new(&Start::default().vector(N), &known()));
kind!(BlockLanczos, BlockLanczos::new(&Start::default().block(N, 3), &known()));
kind!(Arnoldi, Arnoldi::new(&Start::default().vector(N), &[]));

fn matrix() -> Dense {
    Dense::turned(&spread(N))
}

fn saved<F: Kind>(state: &F) -> Vec<u8> {
    let mut bytes = Vec::new();
    state.save(&mut bytes);
    bytes
}

fn everything<F: Kind>(state: &F) -> (Vec<Vec<f64>>, Vec<RitzPair>, usize, f64) {
    let pairs = state.ritz(Which::LargestMagnitude, 6).unwrap();
    (state.basis().to_vec(), pairs, state.products(), state.asymmetry())
}

fn resumes_to_the_same_bits<F: Kind>() {
    let mut matrix = matrix();
    let mut whole = F::start();
    for stop in 0..20 {
        // Saved at every point, even before the first step, and gone on with from there.
        let mut resumed = F::load(&saved(&whole)).unwrap();
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
    resumes_to_the_same_bits::<Lanczos>();
    resumes_to_the_same_bits::<BlockLanczos>();
    resumes_to_the_same_bits::<Arnoldi>();
}

#[test]
fn restarted_noisy_and_invariant_processes_resume_to_the_same_bits_too() {
    let options =
        EigsOptions { count: 3, products: 40, tolerance: 0.0, max_basis: Some(12), ..EigsOptions::default() };
    let mut dense = matrix();
    let mut lanczos = <Lanczos as Kind>::start();
    eigs_from(&mut lanczos, &mut Noisy::new(&mut dense, |_| 1e-3), &options).unwrap();
    let mut resumed = <Lanczos as Kind>::load(&saved(&lanczos)).unwrap();
    assert_eq!(everything(&resumed), everything(&lanczos));
    let options = EigsOptions { products: 60, ..options };
    let straight = eigs_from(&mut lanczos, &mut dense.clone(), &options).unwrap();
    let again = eigs_from(&mut resumed, &mut dense, &options).unwrap();
    assert_eq!((straight.vectors, straight.residuals), (again.vectors, again.residuals));

    // The identity: every step ends in an invariant subspace, and draws a random vector.
    let mut identity = Dense::diagonal(&[1.0; N]);
    let mut block = BlockLanczos::new(&Start::default().block(N, 2), &[]).unwrap();
    for _ in 0..7 {
        block.expand(&mut identity).unwrap();
    }
    let mut resumed = <BlockLanczos as Kind>::load(&saved(&block)).unwrap();
    while !block.is_exhausted() {
        assert_eq!(block.expand(&mut identity).unwrap(), resumed.expand(&mut identity).unwrap());
    }
    assert_eq!(everything(&resumed), everything(&block));
}

#[test]
fn every_flipped_byte_and_every_missing_end_is_found() {
    let mut dense = matrix();
    let mut lanczos = <Lanczos as Kind>::start();
    for _ in 0..3 {
        lanczos.expand(&mut dense).unwrap();
    }
    let bytes = saved(&lanczos);
    let refused = |bytes: &[u8], what: String| match <Lanczos as Kind>::load(bytes) {
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
    let mut lanczos = <Lanczos as Kind>::start();
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
    let read = <Lanczos as Kind>::load(&bytes).unwrap();
    assert_eq!(everything(&read), everything(&lanczos));
    assert_eq!(saved(&read), saved(&lanczos), "it is written as the version of today");
}

#[test]
fn other_versions_kinds_and_absurd_lengths_are_named() {
    let bytes = saved(&<Lanczos as Kind>::start());
    let fault = |bytes: &[u8]| match <Lanczos as Kind>::load(bytes).unwrap_err() {
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
    assert!(fault(&saved(&<Arnoldi as Kind>::start())).contains("kind 3"));
    // A length of 2^60 must not be allocated.
    let huge = (1_u64 << 60).to_le_bytes();
    assert!(fault(&with(16, &huge)).contains("too early"));
    assert!(fault(&with(40, &huge)).contains("contradict"));
    let error = <Lanczos as Kind>::load(&bytes[..100]).unwrap_err().to_string();
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
    assert!(matches!(Lanczos::save(&<Lanczos as Kind>::start(), Broken), Err(Error::Write { .. })));
    assert!(matches!(Lanczos::load(Broken), Err(Error::Read { .. })));
}

#[test]
fn arnoldi_of_a_symmetric_operator_is_not_taken_for_lanczos() {
    assert_eq!(matrix().symmetry, Symmetry::Symmetric);
    let mut arnoldi = <Arnoldi as Kind>::start();
    arnoldi.expand(&mut matrix()).unwrap();
    assert!(<Lanczos as Kind>::load(&saved(&arnoldi)).is_err());
}
