//! SciPy's `.npz`: a ZIP archive of the three arrays, the shape and the format's name.
//!
//! The archive is assembled here and not by the crate `npyz`, which writes its arrays: `npyz` depends on
//! version 0.6 of the crate `zip`, and krylux uses version 9.

use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

use npyz::{DType, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::super::first_error::FirstError;
use super::super::{atomic, npy};
use super::unusable;
use crate::error::{Error, Result};
use crate::file;
use crate::sparse::Csr;

/// Writes a file that `scipy.sparse.load_npz` reads as a `csr_matrix`. Its type is `float32` if that
/// represents every value exactly, and `float64` otherwise.
///
/// Index arrays are `int32` if that can represent all indices, and `int64` otherwise, as in SciPy. The
/// members of the archive are not compressed and have a fixed date, so that equal matrices give equal bytes.
///
/// # Errors
/// [`crate::Error::Write`].
pub fn write_npz(path: &Path, matrix: &Csr) -> Result<()> {
    atomic::write_with(path, |file| {
        let mut archive = ZipWriter::new(FirstError::new(file));
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
        // Bits are compared instead of values, because NaN differs from itself.
        if weights.iter().all(|&v| f64::from(v as f32).to_bits() == v.to_bits()) {
            add(&mut archive, "data", weights.len(), weights.iter().map(|&v| v as f32))?;
        } else {
            add(&mut archive, "data", weights.len(), weights.iter().copied())?;
        }
        archive.finish()?;
        Ok(())
    })
}

/// Appends a one-dimensional array of `count` values to the archive as `NAME.npy`.
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

/// Appends the name of the matrix format, `csr`, as SciPy stores it: a scalar byte string.
pub(crate) fn add_format(archive: &mut ZipWriter<impl Write + io::Seek>) -> io::Result<()> {
    archive.start_file("format.npy", options(0))?;
    let bytes: DType = DType::Plain("|S3".parse().map_err(io::Error::other)?);
    let mut array =
        npyz::WriteOptions::<[u8]>::new().dtype(bytes).shape(&[]).writer(&mut *archive).begin_nd()?;
    array.push(b"csr")?;
    array.finish()
}

/// The options of a member of `bytes` bytes.
pub(crate) fn options(bytes: u64) -> SimpleFileOptions {
    SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::DEFAULT)
        .unix_permissions(0o644)
        // A member of 4 GiB or more needs this flag. The sum allows for the header of the .npy format.
        .large_file(bytes + 4096 > u64::from(u32::MAX))
}

/// Members up to this size in bytes are read however small they are in the archive.
const MAX_EXPANDED_BYTES: u64 = 1 << 28;

/// How many times larger than in the archive a larger member may be. It keeps a small malicious archive from filling the memory.
const MAX_EXPANSION: u64 = 64;

/// Reads a file that `scipy.sparse.save_npz` wrote for a CSR matrix of real numbers, compressed or not.
///
/// # Errors
/// [`crate::Error::Read`]; [`crate::Error::Data`] when the file is not such an archive, or when its arrays do not form a
/// CSR matrix.
pub fn read_npz(path: &Path) -> Result<Csr> {
    let archive = file::open(path)?;
    let length = archive.metadata().map_err(Error::reading(path))?.len();
    let fault = |what: String| unusable(path, what);
    let mut archive = ZipArchive::new(BufReader::new(archive))
        .map_err(|error| fault(format!("it is not a ZIP archive: {error}")))?;
    let mut bytes = |name: &str| -> Result<Vec<u8>> {
        let entry = archive.by_name(&format!("{name}.npy"));
        let entry = entry.map_err(|error| fault(format!("it has no array `{name}`: {error}")))?;
        let size = entry.size();
        // The archive states both sizes, and may be wrong; but nothing in it takes more bytes than all of it.
        let packed = entry.compressed_size().min(length);
        if size > MAX_EXPANDED_BYTES.max(MAX_EXPANSION * packed) {
            return Err(fault(format!(
                "array `{name}` takes {packed} bytes, but claims to be one of {size}"
            )));
        }
        let mut bytes = Vec::new();
        let failed = |error: io::Error| fault(format!("array `{name}`: {error}"));
        bytes.try_reserve_exact(size as usize).map_err(|error| failed(io::Error::other(error)))?;
        if entry.take(size + 1).read_to_end(&mut bytes).map_err(failed)? as u64 != size {
            return Err(fault(format!("array `{name}` is not as long as the archive states")));
        }
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
    // The conversion of indices to f64 and back is exact, because they are below 2⁵³.
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
        || starts.first() != Some(&0)
        || starts.last() != Some(&columns.len())
        || !starts.is_sorted()
        || columns.len() != weights.len()
    {
        return Err(fault("its arrays do not fit together".into()));
    }
    if u32::try_from(cols).is_err() || columns.iter().any(|&column| column >= cols) {
        return Err(fault(format!("a column index is not below {cols}")));
    }
    // SciPy does not sort the entries of a row.
    let row_of = (0..rows).flat_map(|row| std::iter::repeat_n(row, starts[row + 1] - starts[row]));
    let entries = row_of.zip(columns).zip(weights).map(|((row, column), value)| (row, column, value));
    super::from_entries(path, rows, cols, entries.collect())
}
