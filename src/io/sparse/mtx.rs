//! The Matrix Market exchange format.

use std::io::{self, Write};
use std::path::Path;
use std::str::FromStr;

use flate2::read::MultiGzDecoder;

use super::super::atomic;
use super::archive::expand;
use super::{
    Beside, Entry, MatrixFile, Pictures, ProductNoise, from_entries, pictures, require_sides, unusable,
};
use crate::error::Result;
use crate::file;
use crate::image::Resolution;
use crate::sparse::Csr;

/// The start of a comment with which krylux adds what the format does not hold.
const COMMENT: &str = "% krylux:";

/// Writes Matrix Market's coordinate format. Indices start at 1, and numbers have enough digits to be read back exactly. A matrix that is
/// symmetric to the last bit is written as `symmetric` (its lower triangle), and any other matrix as `general`. Comments, which other
/// programs ignore, hold the sizes of the pictures, the noise and the light of one bounce.
///
/// # Errors
/// [`crate::Error::Write`], also for a NaN or infinite entry, which the format cannot represent.
pub fn write_mtx(path: &Path, matrix: &Csr, beside: &Beside<'_>) -> Result<()> {
    let Beside { direct, pictures, noise } = *beside;
    let is_symmetric = matrix.is_symmetric() && direct.is_none_or(Csr::is_symmetric);
    let stored = |matrix: &Csr| {
        matrix.entries().filter(|&(row, column, _)| !is_symmetric || column <= row).collect::<Vec<_>>()
    };
    let entries = stored(matrix);
    let finite = |&(row, column, value): &Entry| match value.is_finite() {
        true => Ok(()),
        false => {
            let fault = format!("entry ({row}, {column}) is {value}");
            Err(io::Error::new(io::ErrorKind::InvalidData, fault))
        }
    };
    atomic::write_with(path, |file| {
        let kind = if is_symmetric { "symmetric" } else { "general" };
        writeln!(file, "%%MatrixMarket matrix coordinate real {kind}")?;
        if let Some(Pictures { camera, projector }) = pictures {
            let shapes = [("camera", camera), ("projector", projector)];
            shapes.iter().try_for_each(|(name, Resolution { width, height })| {
                writeln!(file, "{COMMENT} {name}_shape {height} {width}")
            })?;
        }
        if let Some([full, direct, global]) = noise.map(ProductNoise::values) {
            writeln!(file, "{COMMENT} noise {full:e} {direct:e} {global:e}")?;
        }
        for entry in direct.into_iter().flat_map(stored) {
            finite(&entry)?;
            writeln!(file, "{COMMENT} direct {} {} {:e}", entry.0 + 1, entry.1 + 1, entry.2)?;
        }
        if direct.is_some() {
            writeln!(file, "{COMMENT} direct")?;
        }
        writeln!(file, "{} {} {}", matrix.rows(), matrix.cols(), entries.len())?;
        for entry in &entries {
            finite(entry)?;
            writeln!(file, "{} {} {:e}", entry.0 + 1, entry.1 + 1, entry.2)?;
        }
        Ok(())
    })
}

/// How the entries of a file are to be understood, by its first line.
#[derive(Clone, Copy)]
struct Kind {
    /// Whether all entries are listed by columns, without their positions.
    is_array: bool,
    /// Whether there are positions only, and each value is 1.
    is_pattern: bool,
    /// The factor of the entry at the mirrored position; `None` if all entries are listed.
    mirrored: Option<f64>,
}

impl Kind {
    fn of(header: &str) -> Option<Self> {
        let header = header.to_ascii_lowercase();
        let words: Vec<&str> = header.split_whitespace().collect();
        let &["%%matrixmarket", "matrix", form @ ("coordinate" | "array"), field, symmetry] =
            words.as_slice()
        else {
            return None;
        };
        let (is_array, is_pattern) = (form == "array", field == "pattern");
        let mirrored = match symmetry {
            "general" => None,
            "symmetric" => Some(1.0),
            "skew-symmetric" if !is_pattern => Some(-1.0),
            _ => return None,
        };
        let is_real = matches!(field, "real" | "integer" | "double");
        (is_real || is_pattern && !is_array).then_some(Self { is_array, is_pattern, mirrored })
    }
}

/// Reads Matrix Market's formats of real numbers, coordinates or arrays, packed by gzip or not.
pub(super) fn read(path: &Path) -> Result<MatrixFile> {
    let text = read_text(path)?;
    let mut lines = text.lines().enumerate();
    let kind = lines.next().and_then(|(_, line)| Kind::of(line)).ok_or_else(|| {
        let fault = "its first line is not `%%MatrixMarket matrix`, then `coordinate` or `array`, then `real`, `integer` or `pattern`, then `general`, `symmetric` or `skew-symmetric`";
        unusable(path, fault.into())
    })?;
    let fault = |number: usize, what: &str| unusable(path, format!("line {}: {what}", number + 1));
    let mut notes = Vec::new();
    let mut rest = lines.filter(|&(number, line)| {
        notes.extend(line.strip_prefix(COMMENT).map(|note| (number, note)));
        !line.starts_with('%') && !line.trim().is_empty()
    });
    let (number, sizes) = rest.next().ok_or_else(|| unusable(path, "it ends before its sizes".into()))?;
    let (shape, count) = match (numbers(sizes).as_deref(), kind.is_array) {
        (Some(&[rows, cols, count]), false) => ([rows, cols], Some(count)),
        (Some(&[rows, cols]), true) => ([rows, cols], None),
        (_, true) => return Err(fault(number, "expected rows and columns")),
        (_, false) => return Err(fault(number, "expected rows, columns and number of entries")),
    };
    require_sides(path, shape[0], shape[1])?;
    if kind.mirrored.is_some() && shape[0] != shape[1] {
        return Err(fault(number, "a symmetric matrix has as many rows as columns"));
    }
    let stored = match kind.is_array {
        true => array(path, kind, shape, &mut rest)?,
        false => coordinates(path, kind, shape, &mut rest)?,
    };
    drop(rest);
    if let Some(count) = count.filter(|&count| count != stored.len()) {
        return Err(unusable(path, format!("it states {count} entries, but has {}", stored.len())));
    }
    let mut file = MatrixFile::from(from_entries(path, shape, mirrored(kind, stored))?);
    add_notes(path, &mut file, kind, &notes)?;
    Ok(file)
}

fn read_text(path: &Path) -> Result<String> {
    if super::extension(path) != "mtx.gz" {
        return file::read_text(path);
    }
    let packed = file::read(path)?;
    let text = expand(&packed, MultiGzDecoder::new(packed.as_slice()));
    text.and_then(|bytes| String::from_utf8(bytes).map_err(|_| "is no text".into()))
        .map_err(|what| unusable(path, format!("its content {what}")))
}

/// The entries as listed, and those at mirrored positions.
fn mirrored(kind: Kind, mut entries: Vec<Entry>) -> Vec<Entry> {
    let Some(factor) = kind.mirrored else { return entries };
    for at in 0..entries.len() {
        let (row, column, value) = entries[at];
        if row != column {
            entries.push((column, row, factor * value));
        }
    }
    entries
}

fn numbers<T: FromStr>(words: &str) -> Option<Vec<T>> {
    words.split_whitespace().map(|word| word.parse().ok()).collect()
}

/// The value on a line; 1 for a pattern. `None` if there is none, or more than that.
fn value<'a>(kind: Kind, words: &mut impl Iterator<Item = &'a str>) -> Option<f64> {
    let value = if kind.is_pattern { 1.0 } else { words.next()?.parse().ok()? };
    words.next().is_none().then_some(value)
}

fn entry(kind: Kind, [rows, cols]: [usize; 2], line: &str) -> Option<Entry> {
    let mut words = line.split_whitespace();
    let mut index = |limit| words.next()?.parse().ok().filter(|index| (1..=limit).contains(index));
    let (row, column): (usize, usize) = (index(rows)?, index(cols)?);
    Some((row - 1, column - 1, value(kind, &mut words)?))
}

fn coordinates<'a>(
    path: &Path,
    kind: Kind,
    shape: [usize; 2],
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
) -> Result<Vec<Entry>> {
    let expected = match kind.is_pattern {
        true => "expected row and column (from 1 on), and nothing else",
        false => "expected row, column (from 1 on) and value, and nothing else",
    };
    let of_line = |(number, line)| {
        let found = entry(kind, shape, line);
        found.ok_or_else(|| unusable(path, format!("line {}: {expected}", number + 1)))
    };
    lines.map(of_line).collect()
}

/// The entries of an array, listed column by column: all of them, those on and below the diagonal, or those below it.
fn array<'a>(
    path: &Path,
    kind: Kind,
    [rows, cols]: [usize; 2],
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
) -> Result<Vec<Entry>> {
    let first = move |column: usize| match kind.mirrored {
        None => 0,
        Some(1.0) => column,
        Some(_) => column + 1,
    };
    let positions = (0..cols).flat_map(|column| (first(column)..rows).map(move |row| (row, column)));
    let mut entries = Vec::new();
    for (row, column) in positions {
        let Some((number, line)) = lines.next() else {
            return Err(unusable(path, format!("it ends before the value of row {row} in column {column}")));
        };
        let value = value(kind, &mut line.split_whitespace());
        let expected = || unusable(path, format!("line {}: expected one number", number + 1));
        entries.push((row, column, value.ok_or_else(expected)?));
    }
    match lines.next() {
        Some((number, _)) => {
            Err(unusable(path, format!("line {}: there are more values than entries", number + 1)))
        }
        None => Ok(entries),
    }
}

/// Adds what the comments of krylux hold.
fn add_notes(path: &Path, file: &mut MatrixFile, kind: Kind, notes: &[(usize, &str)]) -> Result<()> {
    let (mut direct, mut shapes) = (None, [Vec::new(), Vec::new()]);
    for &(number, note) in notes {
        let (name, rest) = note.trim().split_once(' ').unwrap_or((note.trim(), ""));
        let fault = || unusable(path, format!("line {}: a comment of krylux is damaged", number + 1));
        match name {
            "direct" => {
                let entries = direct.get_or_insert_with(Vec::new);
                if !rest.is_empty() {
                    entries.push(
                        entry(Kind { is_pattern: false, ..kind }, file.shape(), rest).ok_or_else(fault)?,
                    );
                }
            }
            "camera_shape" | "projector_shape" => {
                shapes[usize::from(name == "projector_shape")] = numbers(rest).ok_or_else(fault)?;
            }
            "noise" => {
                let noise = numbers(rest).and_then(|values| ProductNoise::of(&values));
                file.noise = Some(noise.ok_or_else(fault)?);
            }
            _ => return Err(fault()),
        }
    }
    if let Some(direct) = direct {
        file.direct = vec![from_entries(path, file.shape(), mirrored(kind, direct))?];
    }
    if shapes.iter().any(|shape| !shape.is_empty()) {
        file.pictures = Some(pictures(path, file.shape(), &shapes[0], &shapes[1])?);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_again(text: &str) -> Result<MatrixFile> {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        let path = folder.path().join("a.mtx");
        std::fs::write(&path, text).expect("the folder can be written");
        read(&path)
    }

    #[test]
    fn comments_and_empty_lines_are_no_entries() {
        let text = "%%MatrixMarket matrix coordinate real general\n% by hand\n\n2 3 2\n% one\n1 3 2.5\n\n2 1 -1\n%\n";
        let expected = Csr::new(3, vec![0, 1, 2], vec![2, 0], vec![2.5, -1.0]).expect("a matrix");
        assert_eq!(read_again(text).expect("it is whole"), MatrixFile::from(expected));
    }

    #[test]
    fn lines_with_more_words_than_they_have_numbers_are_refused_by_their_number() {
        for (sizes, entry, line) in [
            ("2 2 1", "1 1 2.5 7", 3),
            ("2 2 1", "1 1 2.5 x", 3),
            ("2 2 1 7", "1 1 2", 2),
            ("2 2 1 x", "1 1 2", 2),
        ] {
            let text = format!("%%MatrixMarket matrix coordinate real general\n{sizes}\n{entry}\n");
            let why = read_again(&text).expect_err("a word too many").to_string();
            assert!(why.contains(&format!("a.mtx: line {line}: expected ")), "{why}");
        }
    }
}
