//! Matrices for SciPy and Matrix Market: read back here from the bytes, without either.

use std::error::Error as StdError;
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use krylux::Error;
use krylux::io::npy;
use krylux::io::sparse::{self, Beside, write_mtx, write_npz};
use krylux::sparse::Csr;
use tempfile::TempDir;

type Outcome = Result<(), Box<dyn std::error::Error>>;

const POINTERS: [usize; 5] = [0, 2, 2, 4, 6];
const COLUMNS: [u32; 6] = [0, 3, 2, 3, 0, 2];
const VALUES: [f32; 6] = [1.5, 0.1, 1e-45, f32::MAX, 0.1, 1.0 / 3.0];

fn matrix() -> krylux::Result<Csr> {
    Csr::new(4, POINTERS.to_vec(), COLUMNS.to_vec(), VALUES.map(f64::from).to_vec())
}

fn entry(path: &Path, name: &str) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let mut archive = zip::ZipArchive::new(File::open(path)?)?;
    let mut bytes = Vec::new();
    archive.by_name(name)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[test]
fn an_npz_holds_what_scipy_expects_bit_for_bit() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.npz");
    let matrix = matrix()?;
    write_npz(&path, &matrix, &Beside::default())?;
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
    write_npz(&path, &matrix, &Beside::default())?;
    assert_eq!(std::fs::read(&path)?, first);
    Ok(())
}

#[test]
fn a_matrix_market_file_reads_back_exactly_by_way_of_f64() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.mtx");
    write_mtx(&path, &matrix()?, &Beside::default())?;
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
fn two_by_two(values: [f64; 3]) -> krylux::Result<Csr> {
    Csr::new(2, vec![0, 2, 3], vec![0, 1, 0], values.to_vec())
}

#[test]
fn a_symmetric_matrix_is_written_by_its_lower_triangle() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.mtx");
    write_mtx(&path, &two_by_two([2.0, 0.5, 0.5])?, &Beside::default())?;
    let text = std::fs::read_to_string(&path)?;
    assert_eq!(text, "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 2e0\n2 1 5e-1\n");
    let nan = two_by_two([2.0, f64::NAN, f64::NAN])?;
    assert!(matches!(write_mtx(&path, &nan, &Beside::default()), Err(Error::Write { .. })));
    assert_eq!(std::fs::read_to_string(&path)?, text, "a failed write left the old file alone");
    Ok(())
}

#[test]
fn matrices_read_back_as_they_were_written() -> Outcome {
    let folder = TempDir::new()?;
    let third = Csr::new(3, vec![0, 1, 3], vec![2, 0, 1], vec![1.0 / 3.0, -2.0, 1e-300])?;
    for original in [matrix()?, two_by_two([2.0, 0.5, 0.5])?, third] {
        for name in ["matrix.npz", "matrix.mtx"] {
            let path = folder.path().join(name);
            sparse::write(&path, &original)?;
            assert_eq!(sparse::read(&path)?, original, "{name}");
        }
    }
    Ok(())
}

#[test]
fn a_dense_array_is_a_matrix_too() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.npy");
    npy::write_npy(&path, &[2, 3], &[0.0, 1.0, 0.0, 2.0, 0.0, 3.0])?;
    assert_eq!(sparse::read(&path)?, Csr::new(3, vec![0, 1, 3], vec![1, 0, 2], vec![1.0, 2.0, 3.0])?);
    npy::write_npy(&path, &[6], &[0.0; 6])?;
    assert!(matches!(sparse::read(&path), Err(Error::Data { .. })));
    Ok(())
}

#[test]
fn damaged_matrices_are_errors_and_never_panics() -> Outcome {
    let folder = TempDir::new()?;
    for name in ["matrix.npz", "matrix.mtx"] {
        let path = folder.path().join(name);
        sparse::write(&path, &matrix()?)?;
        let whole = std::fs::read(&path)?;
        // A text file that loses digits of its last line is still one.
        let last_line = whole[..whole.len() - 1].iter().rposition(|&byte| byte == b'\n').unwrap_or(0);
        let telling = if name == "matrix.mtx" { last_line } else { whole.len() };
        for cut in 0..whole.len() {
            std::fs::write(&path, &whole[..cut])?;
            assert!(sparse::read(&path).is_err() || cut > telling, "{name} cut at {cut}");
            let mut damaged = whole.clone();
            damaged[cut] ^= 0x5a;
            std::fs::write(&path, &damaged)?;
            // Damage to padding or a digit may go unseen; it must not bring anything down.
            let _ = sparse::read(&path);
        }
    }
    for (text, fault) in [
        ("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 0\n", "first line"),
        ("%%MatrixMarket matrix array pattern general\n1 1\n1\n", "first line"),
        ("%%MatrixMarket matrix array real general\n2 1\n1\n", "before the value of row 1 in column 0"),
        ("%%MatrixMarket matrix array real general\n1 1\n1\n2\n", "line 4: there are more values"),
        ("%%MatrixMarket matrix coordinate real general\n2 2 1\n3 1 1.0\n", "line 3"),
        ("%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 1.0\n", "states 2"),
        ("%%MatrixMarket matrix coordinate real general\n2 2 1\n1 1 nan\n", "(0, 0)"),
        ("%%MatrixMarket matrix coordinate real symmetric\n2 3 1\n1 3 1.0\n", "line 2: a symmetric matrix"),
        ("%%MatrixMarket matrix coordinate real general\n4294967295 1 1\n1 1 1.0\n", "4294967295 rows"),
        ("%%MatrixMarket matrix coordinate real general\n1 4294967295 1\n1 1 1.0\n", "4294967295 columns"),
    ] {
        let path = folder.path().join("wrong.mtx");
        std::fs::write(&path, text)?;
        let message = sparse::read(&path).map_or_else(|error| error.to_string(), |_| String::new());
        assert!(message.contains(fault) && message.contains("wrong.mtx"), "{message}");
    }
    Ok(())
}

const BYTES: &[u8] = b"\x93NUMPY\x01\x00csr";

/// The message about an `.npz` archive whose arrays are these and, by [`fill`], `data`.
fn refused_npz(
    format: &[u8],
    indptr: &[f64],
    fill: impl Fn(&mut dyn Write) -> io::Result<()>,
) -> Result<String, Box<dyn StdError>> {
    let folder = TempDir::new()?;
    let [path, array] = ["wrong.npz", "array.npy"].map(|name| folder.path().join(name));
    let mut archive = zip::ZipWriter::new(File::create(&path)?);
    let packed = zip::write::SimpleFileOptions::default();
    archive.start_file("format.npy", packed)?;
    archive.write_all(format)?;
    for (name, values) in [("indptr", indptr), ("indices", &[0.0, 1.0]), ("shape", &[2.0, 2.0])] {
        npy::write_npy(&array, &[values.len()], values)?;
        archive.start_file(format!("{name}.npy"), packed)?;
        archive.write_all(&std::fs::read(&array)?)?;
    }
    archive.start_file("data.npy", packed)?;
    fill(&mut archive)?;
    archive.finish()?;
    Ok(sparse::read(&path).map_or_else(|error| error.to_string(), |matrix| format!("{matrix:?}")))
}

#[test]
fn row_starts_begin_at_zero() -> Outcome {
    let values = |file: &mut dyn Write| {
        let folder = TempDir::new()?;
        let path = folder.path().join("data.npy");
        npy::write_npy(&path, &[2], &[3.0, 4.0]).map_err(io::Error::other)?;
        file.write_all(&std::fs::read(&path)?)
    };
    assert!(refused_npz(BYTES, &[0.0, 1.0, 2.0], values)?.contains("weights: [3.0, 4.0]"));
    // The name of the format as text of four bytes a letter.
    let text = b"\x93NUMPY\x01\x00c\0\0\0s\0\0\0r\0\0\0";
    assert!(refused_npz(text, &[0.0, 1.0, 2.0], values)?.contains("weights: [3.0, 4.0]"));
    let other = refused_npz(b"\x93NUMPY\x01\x00lil", &[0.0, 1.0, 2.0], values)?;
    assert!(other.contains("not in a sparse format of SciPy that is known"), "{other}");
    for starts in [[1.0, 1.0, 2.0], [1.0, 2.0, 2.0]] {
        let message = refused_npz(BYTES, &starts, values)?;
        assert!(message.contains("do not fit together"), "{message}");
    }
    Ok(())
}

/// A ZIP archive has a checksum of each member, which is compared at its end.
#[test]
fn a_changed_byte_in_an_array_of_an_npz_is_noticed() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("matrix.npz");
    sparse::write(&path, &matrix()?)?;
    let mut bytes = std::fs::read(&path)?;
    // The last byte of the last array, which is followed by the list of members.
    let end = bytes.windows(4).position(|four| four == b"PK\x01\x02").ok_or("an archive has a list")?;
    bytes[end - 1] ^= 1;
    std::fs::write(&path, &bytes)?;
    let message = sparse::read(&path).map_or_else(|error| error.to_string(), |matrix| format!("{matrix:?}"));
    assert!(message.contains("array `data`: Invalid checksum"), "{message}");
    Ok(())
}

#[test]
fn an_archive_that_grows_a_thousandfold_is_refused() -> Outcome {
    let zeros = |mut file: &mut dyn Write| io::copy(&mut io::repeat(0).take(300 << 20), &mut file).map(drop);
    let message = refused_npz(BYTES, &[0.0, 1.0, 2.0], zeros)?;
    assert!(message.contains("claims to be one of 314572800"), "{message}");
    Ok(())
}

/// A few bytes of text state any number of rows: what is read ends with the pixels of a photo of 8192×8192.
#[test]
fn sides_beyond_any_photo_are_refused_before_memory_is_taken() -> Outcome {
    let folder = TempDir::new()?;
    let path = folder.path().join("wide.mtx");
    for (rows, cols, fits) in [(2, 67_108_864_u64, true), (2, 67_108_865, false), (67_108_865, 2, false)] {
        let text = format!("%%MatrixMarket matrix coordinate real general\n{rows} {cols} 1\n1 1 1.5\n");
        std::fs::write(&path, text)?;
        let read = sparse::read(&path);
        assert_eq!(read.is_ok(), fits, "{rows} rows and {cols} columns");
        if let Err(error) = read {
            assert!(error.to_string().contains("at most 67108864 are read"), "{error}");
        }
    }
    Ok(())
}
