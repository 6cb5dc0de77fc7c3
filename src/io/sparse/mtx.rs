//! Matrix Market's coordinate format: a text file with one entry per line.

use std::io::{self, Write};
use std::path::Path;

use super::super::atomic;
use super::unusable;
use crate::error::Result;
use crate::file;
use crate::sparse::Csr;

/// Writes Matrix Market's coordinate format, with indices from 1 on. A matrix that is symmetric to the last
/// bit is written as `symmetric` (its lower triangle), any other one as `general`.
///
/// Values are written with enough digits that a reader gets the same numbers.
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

/// Reads Matrix Market's coordinate format of real or integer numbers, `general` or `symmetric`.
///
/// # Errors
/// [`crate::Error::Read`]; [`crate::Error::Data`] naming the line at fault.
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
    super::require_sides(path, rows, cols)?;
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
    super::from_entries(path, rows, cols, entries)
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
}
