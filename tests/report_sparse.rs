//! Matrices for SciPy and Matrix Market: read back here from the bytes, without either.

use std::io::Read;
use std::path::Path;

use krylux::Error;
use krylux::report::npy;
use krylux::report::sparse::{write_mtx, write_npz};
use krylux::sparse::Csr;
use tempfile::TempDir;

type Outcome = Result<(), Box<dyn std::error::Error>>;

const POINTERS: [usize; 5] = [0, 2, 2, 4, 6];
const COLUMNS: [u32; 6] = [0, 3, 2, 3, 0, 2];
const VALUES: [f32; 6] = [1.5, 0.1, 1e-45, f32::MAX, 0.1, 1.0 / 3.0];

fn matrix() -> krylux::Result<Csr> {
    Csr::new(4, POINTERS.to_vec(), COLUMNS.to_vec(), VALUES.to_vec())
}

fn entry(path: &Path, name: &str) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let mut archive = zip::ZipArchive::new(std::fs::File::open(path)?)?;
    let mut bytes = Vec::new();
    archive.by_name(name)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[test]
fn an_npz_holds_what_scipy_expects_bit_for_bit() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.npz");
    let matrix = matrix()?;
    write_npz(&path, &matrix)?;
    let array = |name: &str| -> Result<npy::Array, Box<dyn std::error::Error>> {
        let extracted = folder.path().join(name);
        std::fs::write(&extracted, entry(&path, name)?)?;
        Ok(npy::read_npy(&extracted)?)
    };
    assert_eq!(array("indptr.npy")?.values, POINTERS.map(|v| v as f64));
    assert_eq!(array("indices.npy")?.values, COLUMNS.map(f64::from));
    assert_eq!(array("data.npy")?.values, VALUES.map(f64::from));
    assert_eq!(array("shape.npy")?.values, [4.0, 4.0]);
    let text = |name: &str| entry(&path, name).map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(text("data.npy")?.contains("'<f4'") && text("indices.npy")?.contains("'<i4'"));
    let format = text("format.npy")?;
    assert!(
        format.contains("'|S3'") && format.contains("'shape': ()") && format.ends_with("csr"),
        "{format}"
    );

    let first = std::fs::read(&path)?;
    write_npz(&path, &matrix)?;
    assert_eq!(std::fs::read(&path)?, first);
    Ok(())
}

#[test]
fn a_matrix_market_file_reads_back_exactly_by_way_of_f64() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.mtx");
    write_mtx(&path, &matrix()?)?;
    let text = std::fs::read_to_string(&path)?;
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("%%MatrixMarket matrix coordinate real general"));
    assert_eq!(lines.next(), Some("4 4 6"));
    for ((line, column), value) in lines.zip(COLUMNS).zip(VALUES) {
        let words: Vec<&str> = line.split(' ').collect();
        assert_eq!(words[1].parse::<u32>()?, column + 1);
        assert_eq!((words[2].parse::<f64>()? as f32).to_bits(), value.to_bits());
    }
    Ok(())
}

/// Symmetric where the last two values agree.
fn two_by_two(values: [f32; 3]) -> krylux::Result<Csr> {
    Csr::new(2, vec![0, 2, 3], vec![0, 1, 0], values.to_vec())
}

#[test]
fn a_symmetric_matrix_is_written_by_its_lower_triangle() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.mtx");
    write_mtx(&path, &two_by_two([2.0, 0.5, 0.5])?)?;
    let text = std::fs::read_to_string(&path)?;
    assert_eq!(
        text,
        "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 2.00000000e0\n2 1 5.00000000e-1\n"
    );
    let nan = two_by_two([2.0, f32::NAN, f32::NAN])?;
    assert!(matches!(write_mtx(&path, &nan), Err(Error::Write { .. })));
    assert_eq!(std::fs::read_to_string(&path)?, text, "a failed write left the old file alone");
    Ok(())
}
