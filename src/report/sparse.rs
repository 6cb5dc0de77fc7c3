//! Sparse matrices for others: SciPy's `.npz` and Matrix Market's `.mtx`.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use npyz::{DType, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::atomic;
use crate::error::{Error, Result};

/// A matrix in compressed sparse rows, borrowed: row `j` holds `data[indptr[j]..indptr[j + 1]]` at the columns
/// `indices[indptr[j]..indptr[j + 1]]`, which ascend strictly.
#[derive(Clone, Copy, Debug)]
pub struct Csr<'a> {
    rows: usize,
    cols: usize,
    indptr: &'a [u64],
    indices: &'a [u32],
    data: &'a [f32],
}

impl<'a> Csr<'a> {
    /// Wraps the three arrays of a `rows` × `cols` matrix.
    ///
    /// # Errors
    /// [`Error::Dimension`] when they do not describe such a matrix.
    pub fn new(
        rows: usize,
        cols: usize,
        indptr: &'a [u64],
        indices: &'a [u32],
        data: &'a [f32],
    ) -> Result<Self> {
        let mismatch =
            |what, expected: String, found: String| Err(Error::Dimension { what, expected, found });
        if indptr.len() != rows + 1 {
            return mismatch(
                "row pointers of a sparse matrix",
                (rows + 1).to_string(),
                indptr.len().to_string(),
            );
        }
        if indices.len() != data.len() {
            return mismatch("columns of a sparse matrix", data.len().to_string(), indices.len().to_string());
        }
        let ends = (indptr[0], indptr[rows]);
        if ends != (0, data.len() as u64) || !indptr.is_sorted() {
            return mismatch(
                "row pointers of a sparse matrix",
                format!("ascending from 0 to {}", data.len()),
                format!("{} to {}", ends.0, ends.1),
            );
        }
        let matrix = Self { rows, cols, indptr, indices, data };
        for row in 0..rows {
            let columns = matrix.row(row).0;
            let ascends = columns.is_sorted_by(|a, b| a < b);
            if !ascends || columns.last().is_some_and(|&last| last as usize >= cols) {
                return mismatch(
                    "columns of a sparse matrix",
                    format!("strictly ascending below {cols}"),
                    format!("others in row {row}"),
                );
            }
        }
        Ok(matrix)
    }

    /// Columns and values of one row.
    fn row(&self, row: usize) -> (&'a [u32], &'a [f32]) {
        let range = self.indptr[row] as usize..self.indptr[row + 1] as usize;
        (&self.indices[range.clone()], &self.data[range])
    }

    /// Entries as (row, column, value), row by row.
    fn entries(self) -> impl Iterator<Item = (usize, usize, f32)> + use<'a> {
        (0..self.rows).flat_map(move |row| {
            let (columns, values) = self.row(row);
            columns.iter().zip(values).map(move |(&column, &value)| (row, column as usize, value))
        })
    }

    /// Whether each entry has its mirror image, equal to the last bit.
    pub fn is_symmetric(&self) -> bool {
        self.rows == self.cols
            && self.entries().all(|(row, column, value)| {
                let (columns, values) = self.row(column);
                columns.binary_search(&(row as u32)).is_ok_and(|at| values[at].to_bits() == value.to_bits())
            })
    }
}

/// Writes what `scipy.sparse.load_npz` reads as a `csr_matrix` of `float32`.
///
/// Index arrays are `int32` where that holds all numbers, else `int64`, as SciPy has them. The entries are stored,
/// not compressed, with a fixed date: equal matrices give equal bytes.
///
/// # Errors
/// [`Error::Write`].
pub fn write_npz(path: &Path, matrix: Csr<'_>) -> Result<()> {
    atomic::write_with(path, |file| {
        let mut archive = ZipWriter::new(file);
        let largest = [matrix.rows, matrix.cols, matrix.data.len()].into_iter().max().unwrap_or(0);
        if i32::try_from(largest).is_ok() {
            add(&mut archive, "indices", matrix.indices.len(), matrix.indices.iter().map(|&v| v as i32))?;
            add(&mut archive, "indptr", matrix.indptr.len(), matrix.indptr.iter().map(|&v| v as i32))?;
        } else {
            add(&mut archive, "indices", matrix.indices.len(), matrix.indices.iter().map(|&v| i64::from(v)))?;
            add(&mut archive, "indptr", matrix.indptr.len(), matrix.indptr.iter().map(|&v| v as i64))?;
        }
        add_format(&mut archive)?;
        add(&mut archive, "shape", 2, [matrix.rows as i64, matrix.cols as i64].into_iter())?;
        add(&mut archive, "data", matrix.data.len(), matrix.data.iter().copied())?;
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
pub fn write_mtx(path: &Path, matrix: Csr<'_>) -> Result<()> {
    let symmetric = matrix.is_symmetric();
    let kept = || matrix.entries().filter(move |&(row, column, _)| !symmetric || column <= row);
    let count = kept().count();
    atomic::write_with(path, |file| {
        let kind = if symmetric { "symmetric" } else { "general" };
        writeln!(file, "%%MatrixMarket matrix coordinate real {kind}")?;
        writeln!(file, "{} {} {count}", matrix.rows, matrix.cols)?;
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
