//! Sparse matrices for others: SciPy's `.npz` and Matrix Market's `.mtx`.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use npyz::{DType, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::atomic;
use crate::error::{Error, Result};
use crate::sparse::Csr;

/// Writes a matrix in the format that the extension says: `.npz` ([`write_npz`]) or `.mtx` ([`write_mtx`]).
///
/// # Errors
/// [`Error::Data`] for another extension; [`Error::Write`].
pub fn write(path: &Path, matrix: &Csr) -> Result<()> {
    match kind(path)? {
        Kind::Npz => write_npz(path, matrix),
        Kind::Mtx => write_mtx(path, matrix),
    }
}

/// Whether [`write`] could write `path`: it has a known extension, and its folder is there and writable.
///
/// # Errors
/// As [`write`].
pub fn check_writable(path: &Path) -> Result<()> {
    kind(path).and_then(|_| atomic::check_writable(path))
}

enum Kind {
    Npz,
    Mtx,
}

fn kind(path: &Path) -> Result<Kind> {
    match path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase()).as_deref() {
        Some("npz") => Ok(Kind::Npz),
        Some("mtx") => Ok(Kind::Mtx),
        _ => Err(Error::Data {
            path: path.to_path_buf(),
            fault: "its extension tells no sparse matrix format".into(),
            help: "name it .npz (for scipy.sparse.load_npz) or .mtx (Matrix Market)".into(),
        }),
    }
}

/// Writes what `scipy.sparse.load_npz` reads as a `csr_matrix` of `float32`.
///
/// Index arrays are `int32` where that holds all numbers, else `int64`, as SciPy has them. The entries are stored,
/// not compressed, with a fixed date: equal matrices give equal bytes.
///
/// # Errors
/// [`Error::Write`].
pub fn write_npz(path: &Path, matrix: &Csr) -> Result<()> {
    atomic::write_with(path, |file| {
        let mut archive = ZipWriter::new(file);
        let largest = [matrix.rows(), matrix.cols(), matrix.weights().len()].into_iter().max().unwrap_or(0);
        if i32::try_from(largest).is_ok() {
            add(&mut archive, "indices", matrix.columns().len(), matrix.columns().iter().map(|&v| v as i32))?;
            add(
                &mut archive,
                "indptr",
                matrix.row_start().len(),
                matrix.row_start().iter().map(|&v| v as i32),
            )?;
        } else {
            add(
                &mut archive,
                "indices",
                matrix.columns().len(),
                matrix.columns().iter().map(|&v| i64::from(v)),
            )?;
            add(
                &mut archive,
                "indptr",
                matrix.row_start().len(),
                matrix.row_start().iter().map(|&v| v as i64),
            )?;
        }
        add_format(&mut archive)?;
        add(&mut archive, "shape", 2, [matrix.rows() as i64, matrix.cols() as i64].into_iter())?;
        add(&mut archive, "data", matrix.weights().len(), matrix.weights().iter().copied())?;
        archive.finish()?;
        Ok(())
    })
}

/// Appends a one-dimensional array of `count` values as `NAME.npy`.
fn add<T: npyz::AutoSerialize>(
    archive: &mut ZipWriter<impl Write + io::Seek>,
    name: &str,
    count: usize,
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    let bytes = count as u64 * size_of::<T>() as u64;
    archive.start_file(format!("{name}.npy"), options(bytes))?;
    let mut buffer = BufWriter::with_capacity(1 << 16, archive);
    let mut array = npyz::WriteOptions::<T>::new()
        .default_dtype()
        .shape(&[count as u64])
        .writer(&mut buffer)
        .begin_nd()?;
    array.extend(values)?;
    array.finish()?;
    buffer.flush()
}

/// The matrix's kind, as SciPy stores it: a scalar byte string.
fn add_format(archive: &mut ZipWriter<impl Write + io::Seek>) -> io::Result<()> {
    archive.start_file("format.npy", options(0))?;
    let bytes: DType = DType::Plain("|S3".parse().map_err(io::Error::other)?);
    let mut array =
        npyz::WriteOptions::<[u8]>::new().dtype(bytes).shape(&[]).writer(&mut *archive).begin_nd()?;
    array.push(b"csr")?;
    array.finish()
}

fn options(bytes: u64) -> SimpleFileOptions {
    SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::DEFAULT)
        .unix_permissions(0o644)
        // The header of an .npy takes some hundred bytes more; without the flag an entry ends at 4 GiB.
        .large_file(bytes + 4096 > u64::from(u32::MAX))
}

/// Writes Matrix Market's coordinate format, 1-based: `symmetric` (the lower triangle) when the matrix is so to the
/// last bit, else `general`.
///
/// Values have nine significant digits: these lie so near the number that also a reader that goes by way of `f64`
/// finds the same `f32`.
///
/// # Errors
/// [`Error::Write`]; a NaN or infinite entry, which the format cannot hold, is one.
pub fn write_mtx(path: &Path, matrix: &Csr) -> Result<()> {
    let symmetric = matrix.is_symmetric();
    let kept = || matrix.entries().filter(move |&(row, column, _)| !symmetric || column <= row);
    let count = kept().count();
    atomic::write_with(path, |file| {
        let kind = if symmetric { "symmetric" } else { "general" };
        writeln!(file, "%%MatrixMarket matrix coordinate real {kind}")?;
        writeln!(file, "{} {} {count}", matrix.rows(), matrix.cols())?;
        for (row, column, value) in kept() {
            if !value.is_finite() {
                let fault = format!("entry ({row}, {column}) is {value}");
                return Err(io::Error::new(io::ErrorKind::InvalidData, fault));
            }
            writeln!(file, "{} {} {value:.8e}", row + 1, column + 1)?;
        }
        Ok(())
    })
}
