//! Reads and writes files of sparse matrices: SciPy's `.npz` and Matrix Market's `.mtx`.
//!
//! This module assembles `.npz` archives itself, because the crate `npyz` requires another version of the crate `zip`.

use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::Path;

use npyz::{DType, WriterBuilder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::{atomic, npy};
use crate::error::{Error, Result};
use crate::file;
use crate::sparse::Csr;

/// Writes a matrix in the format that the extension selects: `.npz` ([`write_npz`]) or `.mtx` ([`write_mtx`]).
///
/// # Errors
/// [`Error::Data`] for another extension; [`Error::Write`].
pub fn write(path: &Path, matrix: &Csr) -> Result<()> {
    match extension(path).as_str() {
        "npz" => write_npz(path, matrix),
        "mtx" => write_mtx(path, matrix),
        _ => Err(unknown(path)),
    }
}

/// Checks that [`write()`] can write to `path`: the extension is known, and the folder exists and is writable.
pub fn check_writable(path: &Path) -> Result<()> {
    match extension(path).as_str() {
        "npz" | "mtx" => atomic::check_writable(path),
        _ => Err(unknown(path)),
    }
}

/// Reads a matrix in the format that the extension selects: `.npz` ([`read_npz`]), `.mtx` ([`read_mtx`]), or `.npy` (a dense array).
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] for another extension or a malformed file.
pub fn read(path: &Path) -> Result<Csr> {
    match extension(path).as_str() {
        "npy" => from_dense(path),
        "npz" => read_npz(path),
        "mtx" => read_mtx(path),
        _ => Err(unknown(path)),
    }
}

/// The extension of a file, in lower case.
fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

fn unknown(path: &Path) -> Error {
    Error::data(path, "its extension is not that of a sparse matrix format")
        .help("name it .npz (SciPy) or .mtx (Matrix Market)")
}

fn from_dense(path: &Path) -> Result<Csr> {
    let npy::Array { shape, values } = npy::read_npy(path)?;
    let &[rows, cols] = shape.as_slice() else {
        let fault = format!("it has {} dimensions, but a matrix has two", shape.len());
        return Err(unusable(path, fault));
    };
    require_sides(path, rows, cols)?;
    let entries = (0..rows).flat_map(|row| (0..cols).map(move |column| (row, column)));
    from_entries(
        path,
        rows,
        cols,
        entries.zip(values).map(|((row, column), value)| (row, column, value)).collect(),
    )
}

/// The maximum number of rows or columns: the pixels of a photo of 8192×8192. A limit is necessary because empty rows also take memory, and
/// a file of a few bytes can state any number of rows.
const MAX_SIDE: usize = 1 << 26;

/// Checks the number of rows and columns that a file states, before memory is allocated for them.
fn require_sides(path: &Path, rows: usize, cols: usize) -> Result<()> {
    if rows.max(cols) > MAX_SIDE {
        return Err(unusable(
            path,
            format!("it states {rows} rows and {cols} columns; at most {MAX_SIDE} are read"),
        ));
    }
    Ok(())
}

/// The matrix with these entries (row, column, value), which may be in any order. Zeros are dropped.
fn from_entries(path: &Path, rows: usize, cols: usize, mut entries: Vec<(usize, usize, f64)>) -> Result<Csr> {
    require_sides(path, rows, cols)?;
    entries.retain(|entry| entry.2 != 0.0);
    entries.sort_by_key(|&(row, column, _)| (row, column));
    if let Some(&(row, column, value)) = entries.iter().find(|entry| !entry.2.is_finite()) {
        return Err(unusable(path, format!("entry ({row}, {column}) is {value}")));
    }
    let mut row_start = Vec::new();
    row_start
        .try_reserve_exact(rows + 1)
        .map_err(|error| unusable(path, format!("its {rows} rows do not fit the memory: {error}")))?;
    row_start.resize(rows + 1, 0);
    for &(row, ..) in &entries {
        row_start[row + 1] += 1;
    }
    for row in 0..rows {
        row_start[row + 1] += row_start[row];
    }
    let columns = entries.iter().map(|entry| entry.1 as u32).collect();
    let weights = entries.iter().map(|entry| entry.2).collect();
    Csr::new(cols, row_start, columns, weights).map_err(|error| unusable(path, error.to_string()))
}

fn unusable(path: &Path, fault: String) -> Error {
    Error::data(path, fault)
        .help("write it with scipy.sparse.save_npz(FILE, A.tocsr()), scipy.io.mmwrite or numpy.save")
}

/// Writes a file that `scipy.sparse.load_npz` reads as a `csr_matrix`. Its type is `float32` if every value is exactly representable in it,
/// and `float64` otherwise.
///
/// As in SciPy, index arrays are `int32` if all indices fit, and `int64` otherwise. The members of the archive are not compressed and have
/// a fixed date, so equal matrices give equal bytes.
pub fn write_npz(path: &Path, matrix: &Csr) -> Result<()> {
    atomic::write_with(path, |file| {
        let mut archive = ZipWriter::new(FirstError::new(file));
        let largest = [matrix.rows(), matrix.cols(), matrix.weights().len()].into_iter().max().unwrap_or(0);
        let (columns, starts) = (matrix.columns(), matrix.row_start());
        if i32::try_from(largest).is_ok() {
            add_to_npz(&mut archive, "indices", columns.len(), columns.iter().map(|&v| v as i32))?;
            add_to_npz(&mut archive, "indptr", starts.len(), starts.iter().map(|&v| v as i32))?;
        } else {
            add_to_npz(&mut archive, "indices", columns.len(), columns.iter().map(|&v| i64::from(v)))?;
            add_to_npz(&mut archive, "indptr", starts.len(), starts.iter().map(|&v| v as i64))?;
        }
        add_format_to_npz(&mut archive)?;
        add_to_npz(&mut archive, "shape", 2, [matrix.rows() as i64, matrix.cols() as i64].into_iter())?;
        let weights = matrix.weights();
        // Bits are compared instead of values, because NaN is not equal to itself.
        if weights.iter().all(|&v| f64::from(v as f32).to_bits() == v.to_bits()) {
            add_to_npz(&mut archive, "data", weights.len(), weights.iter().map(|&v| v as f32))?;
        } else {
            add_to_npz(&mut archive, "data", weights.len(), weights.iter().copied())?;
        }
        archive.finish()?;
        Ok(())
    })
}

/// Appends a one-dimensional array of `count` values to the archive as `NAME.npy`.
pub(crate) fn add_to_npz<T: npyz::AutoSerialize>(
    archive: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    count: usize,
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    let bytes = count as u64 * size_of::<T>() as u64;
    archive.start_file(format!("{name}.npy"), npz_options(bytes))?;
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
pub(crate) fn add_format_to_npz(archive: &mut ZipWriter<impl Write + Seek>) -> io::Result<()> {
    archive.start_file("format.npy", npz_options(0))?;
    let bytes: DType = DType::Plain("|S3".parse().map_err(io::Error::other)?);
    let mut array =
        npyz::WriteOptions::<[u8]>::new().dtype(bytes).shape(&[]).writer(&mut *archive).begin_nd()?;
    array.push(b"csr")?;
    array.finish()
}

pub(crate) fn npz_options(bytes: u64) -> SimpleFileOptions {
    SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::DEFAULT)
        .unix_permissions(0o644)
        // A member of 4 GiB or more needs this flag. The comparison includes a margin for the header of the .npy format.
        .large_file(bytes + 4096 > u64::from(u32::MAX))
}

/// The maximum size in bytes of a member that is read at any compression ratio.
const MAX_EXPANDED_BYTES: u64 = 1 << 28;

/// The maximum compression ratio of a larger member. This limit prevents a small malicious archive from filling the memory.
const MAX_EXPANSION: u64 = 64;

/// Reads a file that `scipy.sparse.save_npz` has written for a CSR matrix of real numbers, compressed or not.
///
/// # Errors
/// [`crate::Error::Read`]; [`crate::Error::Data`] if the file does not contain the arrays of a CSR matrix.
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
        // Both sizes are stated by the archive, so they may be wrong. A member cannot take more bytes than the whole archive.
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
    // Converting indices to f64 and back is exact, because indices are below 2⁵³.
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
    // SciPy need not sort the entries of a row.
    let row_of = (0..rows).flat_map(|row| std::iter::repeat_n(row, starts[row + 1] - starts[row]));
    let entries = row_of.zip(columns).zip(weights).map(|((row, column), value)| (row, column, value));
    from_entries(path, rows, cols, entries.collect())
}

/// Writes Matrix Market's coordinate format. Indices start at 1, and numbers have enough digits to be read back exactly. A matrix that is
/// symmetric to the last bit is written as `symmetric` (its lower triangle), and any other matrix as `general`.
///
/// # Errors
/// [`crate::Error::Write`], also for a NaN or infinite entry, which the format cannot represent.
pub fn write_mtx(path: &Path, matrix: &Csr) -> Result<()> {
    let symmetric = matrix.is_symmetric();
    let stored = || matrix.entries().filter(move |&(row, column, _)| !symmetric || column <= row);
    let count = stored().count();
    atomic::write_with(path, |file| {
        let kind = if symmetric { "symmetric" } else { "general" };
        writeln!(file, "%%MatrixMarket matrix coordinate real {kind}")?;
        writeln!(file, "{} {} {count}", matrix.rows(), matrix.cols())?;
        for (row, column, value) in stored() {
            if !value.is_finite() {
                let fault = format!("entry ({row}, {column}) is {value}");
                return Err(io::Error::new(io::ErrorKind::InvalidData, fault));
            }
            writeln!(file, "{} {} {value:e}", row + 1, column + 1)?;
        }
        Ok(())
    })
}

/// Reads Matrix Market's coordinate format with real or integer numbers, `general` or `symmetric`.
///
/// # Errors
/// [`crate::Error::Read`]; [`crate::Error::Data`], which names the invalid line.
pub fn read_mtx(path: &Path) -> Result<Csr> {
    let text = file::read_text(path)?;
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or(String::new(), |(_, line)| line.to_ascii_lowercase());
    let words: Vec<&str> = header.split_whitespace().collect();
    let symmetric = match words.as_slice() {
        ["%%matrixmarket", "matrix", "coordinate", "real" | "integer", "general"] => false,
        ["%%matrixmarket", "matrix", "coordinate", "real" | "integer", "symmetric"] => true,
        _ => {
            let fault = "its first line does not say `matrix coordinate real` (or `integer`), `general` or `symmetric`";
            return Err(unusable(path, fault.into()));
        }
    };
    let mut lines = lines.filter(|(_, line)| !line.starts_with('%') && !line.trim().is_empty());
    let fault = |number: usize, what: &str| unusable(path, format!("line {}: {what}", number + 1));
    let (number, sizes) = lines.next().ok_or_else(|| unusable(path, "it ends before its sizes".into()))?;
    let sizes: Option<Vec<usize>> = sizes.split_whitespace().map(|word| word.parse().ok()).collect();
    let Some(&[rows, cols, count]) = sizes.as_deref() else {
        return Err(fault(number, "expected rows, columns and number of entries"));
    };
    require_sides(path, rows, cols)?;
    if symmetric && rows != cols {
        return Err(fault(number, "a symmetric matrix has as many rows as columns"));
    }
    let mut entries = Vec::new();
    let mut found = 0;
    for (number, line) in lines {
        let mut words = line.split_whitespace();
        let mut index = |limit| words.next()?.parse().ok().filter(|index| (1..=limit).contains(index));
        let position = index(rows).zip(index(cols));
        let value = words.next().and_then(|word| word.parse::<f64>().ok());
        let Some(((row, column), value)) = position.zip(value).filter(|_| words.next().is_none()) else {
            return Err(fault(number, "expected row, column (from 1 on) and value, and nothing else"));
        };
        entries.push((row - 1, column - 1, value));
        if symmetric && row != column {
            entries.push((column - 1, row - 1, value));
        }
        found += 1;
    }
    if found != count {
        return Err(unusable(path, format!("it states {count} entries, but has {found}")));
    }
    from_entries(path, rows, cols, entries)
}

/// A writer that passes everything to `inner` until an operation fails. Afterwards, all operations succeed and do nothing. Without this,
/// the crate `zip`, which finishes an archive when it is dropped, would print a second error on stderr.
pub(crate) struct FirstError<W> {
    inner: W,
    has_failed: bool,
}

impl<W> FirstError<W> {
    pub(crate) fn new(inner: W) -> Self {
        Self { inner, has_failed: false }
    }

    fn unless_failed<T>(&mut self, rest: T, work: impl FnOnce(&mut W) -> io::Result<T>) -> io::Result<T> {
        if self.has_failed {
            return Ok(rest);
        }
        let done = work(&mut self.inner);
        self.has_failed = done.as_ref().is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        done
    }
}

impl<W: Write> Write for FirstError<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.unless_failed(bytes.len(), |inner| inner.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.unless_failed((), Write::flush)
    }
}

impl<W: Seek> Seek for FirstError<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.unless_failed(0, |inner| inner.seek(to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_empty_lines_are_no_entries() {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let path = folder.path().join("a.mtx");
        let text = "%%MatrixMarket matrix coordinate real general\n% by hand\n\n2 3 2\n% one\n1 3 2.5\n\n2 1 -1\n%\n";
        std::fs::write(&path, text).expect("the folder can be written");
        let expected = Csr::new(3, vec![0, 1, 2], vec![2, 0], vec![2.5, -1.0]).expect("a matrix");
        assert_eq!(read_mtx(&path).expect("it is whole"), expected);
    }

    #[test]
    fn lines_with_more_words_than_they_have_numbers_are_refused_by_their_number() {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let path = folder.path().join("a.mtx");
        for (sizes, entry, line) in [
            ("2 2 1", "1 1 2.5 7", 3),
            ("2 2 1", "1 1 2.5 x", 3),
            ("2 2 1 7", "1 1 2", 2),
            ("2 2 1 x", "1 1 2", 2),
        ] {
            let text = format!("%%MatrixMarket matrix coordinate real general\n{sizes}\n{entry}\n");
            std::fs::write(&path, text).expect("the folder can be written");
            let why = read_mtx(&path).expect_err("a word too many").to_string();
            assert!(why.contains(&format!("a.mtx: line {line}: expected ")), "{why}");
        }
    }

    #[test]
    fn after_an_error_nothing_is_written_and_nothing_fails() {
        let mut writer = FirstError::new(io::Cursor::new(Vec::new()));
        assert!(writer.write_all(b"abc").is_ok() && writer.seek(SeekFrom::Start(1)).is_ok());
        assert_eq!(writer.inner.get_ref(), b"abc");
        let mut writer = FirstError::new(Refusing);
        assert!(
            FirstError::new(Refusing).flush().is_err()
                && FirstError::new(Refusing).seek(SeekFrom::End(0)).is_err()
        );
        assert!(writer.write(b"a").is_err());
        assert!(writer.write_all(b"b").is_ok() && writer.flush().is_ok());
        assert_eq!(writer.seek(SeekFrom::Start(7)).ok(), Some(0));
    }

    struct Refusing;

    impl Write for Refusing {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Err(io::ErrorKind::StorageFull.into())
        }
    }

    impl Seek for Refusing {
        fn seek(&mut self, _: SeekFrom) -> io::Result<u64> {
            Err(io::ErrorKind::StorageFull.into())
        }
    }
}
