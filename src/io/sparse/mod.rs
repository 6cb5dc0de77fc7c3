//! Files of sparse matrices: SciPy's `.npz` and Matrix Market's `.mtx`.

mod mtx;
mod npz;

use std::path::Path;

pub use mtx::{read_mtx, write_mtx};
pub(crate) use npz::{add as add_to_npz, add_format as add_format_to_npz, options as npz_options};
pub use npz::{read_npz, write_npz};

use super::{atomic, npy};
use crate::error::{Error, Result};
use crate::sparse::Csr;

/// Writes a matrix in the format that the extension selects: `.npz` ([`write_npz`]) or `.mtx`
/// ([`write_mtx`]).
///
/// # Errors
/// [`Error::Data`] for another extension; [`Error::Write`].
pub fn write(path: &Path, matrix: &Csr) -> Result<()> {
    match kind(path)? {
        Kind::Npz => write_npz(path, matrix),
        Kind::Mtx => write_mtx(path, matrix),
    }
}

/// Checks that [`write()`] could write `path`: its extension is known, and its folder exists and is writable.
///
/// # Errors
/// As [`write()`].
pub fn check_writable(path: &Path) -> Result<()> {
    kind(path).and_then(|_| atomic::check_writable(path))
}

/// Reads a matrix in the format that the extension selects: `.npz` ([`read_npz`]), `.mtx` ([`read_mtx`]), or
/// `.npy` with a dense `m×n` array.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] for another extension or a malformed file.
pub fn read(path: &Path) -> Result<Csr> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy")) {
        return from_dense(path);
    }
    match kind(path)? {
        Kind::Npz => read_npz(path),
        Kind::Mtx => read_mtx(path),
    }
}

/// Reads a dense matrix from an `.npy` file.
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

/// The largest number of rows or columns: the pixels of a photo of 8192×8192. Empty rows take memory, too, and a few bytes of text
/// can state any number of them.
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
    Error::Data {
        path: path.to_path_buf(),
        fault,
        help: "write it with scipy.sparse.save_npz(FILE, A.tocsr()), scipy.io.mmwrite or numpy.save".into(),
    }
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
            fault: "its extension is not that of a sparse matrix format".into(),
            help: "name it .npz (SciPy) or .mtx (Matrix Market)".into(),
        }),
    }
}
