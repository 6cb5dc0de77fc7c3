//! SciPy's sparse matrices, and NumPy's dense arrays, in `.npz` archives.

use std::path::Path;

use zip::ZipWriter;

use super::super::atomic;
use super::archive::{Archive, FirstError, add_format_to_npz, add_to_npz};
use super::{Beside, Entry, MatrixFile, ProductNoise, dense, from_entries, pictures};
use crate::error::Result;
use crate::sparse::Csr;

/// The shapes of the pictures, `[height, width]`, in a file of krylux.
const SHAPES: [&str; 2] = ["camera_shape", "projector_shape"];

/// Writes a file that `scipy.sparse.load_npz` reads as a `csr_matrix`. Its type is `float32` if every value is exactly representable in it,
/// and `float64` otherwise. Further arrays, which SciPy ignores, are `camera_shape` and `projector_shape`, and the light of one bounce as
/// `direct_indices`, `direct_indptr` and `direct_data`, and `noise` ([`ProductNoise`]).
///
/// Index arrays are `int32` if all indices fit, and `int64` otherwise, as in SciPy. The members of the archive are not compressed and have
/// a fixed date, so equal matrices give equal bytes.
///
/// # Errors
/// [`crate::Error::Write`].
pub fn write_npz(path: &Path, matrix: &Csr, beside: &Beside<'_>) -> Result<()> {
    let Beside { direct, pictures, noise } = *beside;
    atomic::write_with(path, |file| {
        let mut archive = ZipWriter::new(FirstError::new(file));
        add_format_to_npz(&mut archive)?;
        add_to_npz(&mut archive, "shape", 2, [matrix.rows() as i64, matrix.cols() as i64].into_iter())?;
        let sizes = pictures.map(|known| [known.camera, known.projector]);
        for (name, size) in SHAPES.into_iter().zip(sizes.into_iter().flatten()) {
            add_to_npz(&mut archive, name, 2, [size.height as i64, size.width as i64].into_iter())?;
        }
        if let Some(noise) = noise {
            add_to_npz(&mut archive, "noise", 3, noise.values().into_iter())?;
        }
        for (prefix, matrix) in [("", Some(matrix)), ("direct_", direct)] {
            let Some(matrix) = matrix else { continue };
            let name = |array: &str| format!("{prefix}{array}");
            let (columns, starts, weights) = (matrix.columns(), matrix.row_start(), matrix.weights());
            let largest = [matrix.rows(), matrix.cols(), weights.len()].into_iter().max().unwrap_or(0);
            if i32::try_from(largest).is_ok() {
                let columns = (columns.len(), columns.iter().map(|&v| v as i32));
                add_to_npz(&mut archive, &name("indices"), columns.0, columns.1)?;
                add_to_npz(&mut archive, &name("indptr"), starts.len(), starts.iter().map(|&v| v as i32))?;
            } else {
                let columns = (columns.len(), columns.iter().map(|&v| i64::from(v)));
                add_to_npz(&mut archive, &name("indices"), columns.0, columns.1)?;
                add_to_npz(&mut archive, &name("indptr"), starts.len(), starts.iter().map(|&v| v as i64))?;
            }
            // Bits are compared instead of values, because NaN is not equal to itself.
            if weights.iter().all(|&v| f64::from(v as f32).to_bits() == v.to_bits()) {
                add_to_npz(&mut archive, &name("data"), weights.len(), weights.iter().map(|&v| v as f32))?;
            } else {
                add_to_npz(&mut archive, &name("data"), weights.len(), weights.iter().copied())?;
            }
        }
        archive.finish()?;
        Ok(())
    })
}

/// Refuses a file of krylux's cache. It has a matrix for each number of bounces, and only one of them under SciPy's names.
pub(super) fn require_whole(path: &Path) -> Result<()> {
    let archive = Archive::open(path)?;
    if !archive.has_member("krylux.json") {
        return Ok(());
    }
    Err(archive
        .fault("it is a file of krylux's cache, which keeps each number of bounces apart")
        .help("write the scene's matrix with krylux matrix SCENE -o FILE"))
}

/// Reads what SciPy's `save_npz` has written for a matrix of real numbers, compressed or not, or an archive with one dense array.
pub(super) fn read(path: &Path) -> Result<MatrixFile> {
    let mut archive = Archive::open(path)?;
    if !archive.has("format") {
        return dense::read_npz(path, archive);
    }
    // SciPy stores the name as bytes, or as text of four bytes a letter.
    let bytes = archive.bytes("format")?;
    let letters: Vec<u8> = bytes.into_iter().filter(|&byte| byte != 0).collect();
    let shape = archive.indices("shape")?;
    let &[rows, cols] = shape.as_slice() else {
        let what = format!("its shape has {} numbers, but a matrix has two", shape.len());
        return Err(archive.fault(what));
    };
    super::require_sides(path, rows, cols)?;
    let shape = [rows, cols];
    let entries = match letters.get(letters.len().saturating_sub(3)..) {
        Some(b"csr") => compressed(&mut archive, "", shape, false)?,
        Some(b"csc") => compressed(&mut archive, "", shape, true)?,
        Some(b"coo") => coordinates(&mut archive)?,
        Some(b"bsr") => blocks(&mut archive, shape)?,
        Some(b"dia") => diagonals(&mut archive, shape)?,
        _ => {
            return Err(archive
                .fault("it is not in a sparse format of SciPy that is known: csr, csc, coo, bsr or dia"));
        }
    };
    let mut file = MatrixFile::from(from_entries(path, shape, entries)?);
    if archive.has("direct_data") {
        let entries = compressed(&mut archive, "direct_", shape, false)?;
        file.direct = vec![from_entries(path, shape, entries)?];
    }
    if SHAPES.iter().any(|name| archive.has(name)) {
        let [camera, projector] = [archive.indices(SHAPES[0])?, archive.indices(SHAPES[1])?];
        file.pictures = Some(pictures(path, shape, &camera, &projector)?);
    }
    if archive.has("noise") {
        let noise = ProductNoise::of(&archive.array("noise")?.values);
        file.noise = Some(noise.ok_or_else(|| archive.fault("its noise is no array of three numbers"))?);
    }
    Ok(file)
}

/// The entries of compressed rows, or of compressed columns. SciPy need not sort the entries of a row, and may repeat a position.
fn compressed(
    archive: &mut Archive<'_>,
    prefix: &str,
    [rows, cols]: [usize; 2],
    by_columns: bool,
) -> Result<Vec<Entry>> {
    let starts = archive.indices(&format!("{prefix}indptr"))?;
    let minor = archive.indices(&format!("{prefix}indices"))?;
    let weights = archive.array(&format!("{prefix}data"))?.values;
    let (lines, limit, what) = if by_columns { (cols, rows, "row") } else { (rows, cols, "column") };
    if !are_starts(&starts, lines, minor.len()) || minor.len() != weights.len() {
        return Err(archive.unfit());
    }
    if minor.iter().any(|&index| index >= limit) {
        return Err(archive.fault(format!("a {what} index is not below {limit}")));
    }
    let entries = line_of(&starts).zip(minor).zip(weights).map(|((major, minor), value)| match by_columns {
        true => (minor, major, value),
        false => (major, minor, value),
    });
    Ok(entries.collect())
}

/// Whether these are the starts of so many compressed lines, and the end of their `count` entries.
pub(super) fn are_starts(starts: &[usize], lines: usize, count: usize) -> bool {
    let ends = [starts.first(), starts.last()] == [Some(&0), Some(&count)];
    ends && starts.len().checked_sub(1) == Some(lines) && starts.is_sorted()
}

/// The line of each entry.
pub(super) fn line_of(starts: &[usize]) -> impl Iterator<Item = usize> {
    starts.windows(2).enumerate().flat_map(|(line, ends)| std::iter::repeat_n(line, ends[1] - ends[0]))
}

fn coordinates(archive: &mut Archive<'_>) -> Result<Vec<Entry>> {
    let (rows, columns) = (archive.indices("row")?, archive.indices("col")?);
    let weights = archive.array("data")?.values;
    if rows.len() != weights.len() || columns.len() != weights.len() {
        return Err(archive.unfit());
    }
    let entries = rows.into_iter().zip(columns).zip(weights);
    Ok(entries.map(|((row, column), value)| (row, column, value)).collect())
}

/// Compressed rows of dense blocks.
fn blocks(archive: &mut Archive<'_>, [rows, cols]: [usize; 2]) -> Result<Vec<Entry>> {
    let (starts, columns) = (archive.indices("indptr")?, archive.indices("indices")?);
    let data = archive.array("data")?;
    let &[count, height, width] = data.shape.as_slice() else {
        return Err(archive.fault("its blocks are no array of three axes"));
    };
    if height * width == 0 {
        return Err(archive.fault("its blocks are empty"));
    }
    if !are_starts(&starts, rows / height, count) {
        return Err(archive.unfit());
    }
    let fits = rows.is_multiple_of(height) && cols.is_multiple_of(width) && count == columns.len();
    if !fits || columns.iter().any(|&column| column >= cols / width) {
        return Err(archive.fault("its blocks do not fit its shape"));
    }
    let corners = line_of(&starts).zip(columns).map(|(row, column)| (row * height, column * width));
    let entries = corners.zip(data.values.chunks_exact(height * width)).flat_map(|((top, left), block)| {
        let entry = move |(at, &value): (usize, &f64)| (top + at / width, left + at % width, value);
        block.iter().enumerate().map(entry)
    });
    Ok(entries.collect())
}

/// Diagonals. Element `k` of a diagonal is in column `k`, and elements outside of the matrix are ignored, as in SciPy.
fn diagonals(archive: &mut Archive<'_>, [rows, cols]: [usize; 2]) -> Result<Vec<Entry>> {
    let (offsets, data) = (archive.integers("offsets")?, archive.array("data")?);
    let &[count, length] = data.shape.as_slice() else {
        return Err(archive.fault("its diagonals are no array of two axes"));
    };
    if count != offsets.len() {
        return Err(archive.unfit());
    }
    let entries =
        offsets.into_iter().zip(data.values.chunks(length.max(1))).flat_map(|(offset, diagonal)| {
            diagonal.iter().take(cols).enumerate().filter_map(move |(column, &value)| {
                let row = usize::try_from(column as i64 - offset).ok().filter(|&row| row < rows)?;
                Some((row, column, value))
            })
        });
    Ok(entries.collect())
}
