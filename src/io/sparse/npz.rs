//! SciPy's `.npz`: a ZIP archive of the three arrays, the shape and the format's name.
//!
//! The archive is put together here because `npyz`, which writes its arrays, brings version 0.6 of `zip` for archives of its own; this one
//! is made by version 9.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

use npyz::{DType, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::super::{atomic, npy};
use super::unusable;
use crate::error::{Error, Result};
use crate::sparse::Csr;

/// Writes what `scipy.sparse.load_npz` reads as a `csr_matrix`, of `float32` where that holds every value exactly, else of `float64`.
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
        let (columns, starts) = (matrix.columns(), matrix.row_start());
        if i32::try_from(largest).is_ok() {
            add(&mut archive, "indices", columns.len(), columns.iter().map(|&v| v as i32))?;
            add(&mut archive, "indptr", starts.len(), starts.iter().map(|&v| v as i32))?;
        } else {
            add(&mut archive, "indices", columns.len(), columns.iter().map(|&v| i64::from(v)))?;
            add(&mut archive, "indptr", starts.len(), starts.iter().map(|&v| v as i64))?;
        }
        add_format(&mut archive)?;
        add(&mut archive, "shape", 2, [matrix.rows() as i64, matrix.cols() as i64].into_iter())?;
        let weights = matrix.weights();
        // Compared by bits, so that NaN stays what it is.
        if weights.iter().all(|&v| f64::from(v as f32).to_bits() == v.to_bits()) {
            add(&mut archive, "data", weights.len(), weights.iter().map(|&v| v as f32))?;
        } else {
            add(&mut archive, "data", weights.len(), weights.iter().copied())?;
        }
        archive.finish()?;
        Ok(())
    })
}

/// Appends a one-dimensional array of `count` values as `NAME.npy`.
pub(crate) fn add<T: npyz::AutoSerialize>(
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
pub(crate) fn add_format(archive: &mut ZipWriter<impl Write + io::Seek>) -> io::Result<()> {
    archive.start_file("format.npy", options(0))?;
    let bytes: DType = DType::Plain("|S3".parse().map_err(io::Error::other)?);
    let mut array =
        npyz::WriteOptions::<[u8]>::new().dtype(bytes).shape(&[]).writer(&mut *archive).begin_nd()?;
    array.push(b"csr")?;
    array.finish()
}

pub(crate) fn options(bytes: u64) -> SimpleFileOptions {
    SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::DEFAULT)
        .unix_permissions(0o644)
        // The header of an .npy takes some hundred bytes more; without the flag an entry ends at 4 GiB.
        .large_file(bytes + 4096 > u64::from(u32::MAX))
}

/// Arrays beyond this many bytes are refused, so that a small archive cannot fill the memory.
const LARGEST: u64 = 1 << 36;

/// Reads what `scipy.sparse.save_npz` wrote from a CSR matrix of real numbers, compressed or not.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] when it is no such archive, another sparse format, or not a matrix.
pub fn read_npz(path: &Path) -> Result<Csr> {
    let file = File::open(path).map_err(Error::reading(path))?;
    let fault = |what: String| unusable(path, what);
    let mut archive = ZipArchive::new(BufReader::new(file))
        .map_err(|error| fault(format!("it is no ZIP archive: {error}")))?;
    let mut bytes = |name: &str| -> Result<Vec<u8>> {
        let entry = archive.by_name(&format!("{name}.npy"));
        let entry = entry.map_err(|error| fault(format!("it holds no array `{name}`: {error}")))?;
        let mut bytes = Vec::new();
        entry
            .take(LARGEST)
            .read_to_end(&mut bytes)
            .map_err(|error| fault(format!("array `{name}`: {error}")))?;
        Ok(bytes)
    };
    let format = bytes("format")?;
    if !format.ends_with(b"csr") && !format.ends_with(b"c\0\0\0s\0\0\0r\0\0\0") {
        return Err(fault("it is not in SciPy's CSR format".into()));
    }
    let mut array = |name: &str| -> Result<Vec<f64>> {
        let array = npy::parse(&bytes(name)?).map_err(|what| fault(format!("array `{name}`: {what}")))?;
        Ok(array.values)
    };
    // Indices are far below 2⁵³, so nothing is lost on the way through f64.
    let index = |name: &str, values: Vec<f64>| -> Result<Vec<usize>> {
        let whole = |&value: &f64| (0.0..9e15).contains(&value);
        if !values.iter().all(whole) {
            return Err(fault(format!("array `{name}` holds negative or huge indices")));
        }
        Ok(values.into_iter().map(|value| value as usize).collect())
    };
    let shape = index("shape", array("shape")?)?;
    let starts = index("indptr", array("indptr")?)?;
    let columns = index("indices", array("indices")?)?;
    let weights = array("data")?;
    let &[rows, cols] = shape.as_slice() else {
        return Err(fault(format!("its shape has {} numbers, but a matrix has two", shape.len())));
    };
    if starts.len() != rows + 1
        || starts.last() != Some(&columns.len())
        || !starts.is_sorted()
        || columns.len() != weights.len()
    {
        return Err(fault("its arrays do not fit together".into()));
    }
    if u32::try_from(cols).is_err() || columns.iter().any(|&column| column >= cols) {
        return Err(fault(format!("a column index is not below {cols}")));
    }
    // Rows may come unsorted from SciPy.
    let row_of = (0..rows).flat_map(|row| std::iter::repeat_n(row, starts[row + 1] - starts[row]));
    let entries = row_of.zip(columns).zip(weights).map(|((row, column), value)| (row, column, value));
    super::from_entries(path, rows, cols, entries.collect())
}
