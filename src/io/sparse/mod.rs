//! Reads and writes files of matrices: SciPy's `.npz`, NumPy's `.npy`, Matrix Market's `.mtx`, and MATLAB's `.mat`.

mod archive;
mod dense;
mod mat;
mod mtx;
mod npz;

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::atomic;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::sparse::Csr;
pub(crate) use archive::{FirstError, add_format_to_npz, add_to_npz, npz_options};
pub use dense::from_array;
pub use mtx::write_mtx;
pub use npz::write_npz;

/// A light transport matrix as a file holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixFile {
    /// One matrix (gray) or three (red, green and blue), all of one shape. A row is a camera pixel, and a column is a projector pixel.
    pub channels: Vec<Csr>,
    /// The light of one bounce in each channel, if the file holds it separately; otherwise empty.
    pub direct: Vec<Csr>,
    /// The pictures that rows and columns are, if they are known.
    pub pictures: Option<Pictures>,
    /// The noise of the matrix, if it is known.
    pub noise: Option<ProductNoise>,
}

/// The facts that a file of one channel holds beside the matrix, as far as they are known. Other programs ignore them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beside<'a> {
    /// The light of one bounce.
    pub direct: Option<&'a Csr>,
    /// The pictures that rows and columns are.
    pub pictures: Option<Pictures>,
    /// The noise of the matrix.
    pub noise: Option<ProductNoise>,
}

/// The expected norm `‖E‖_F / √n` of the error of a product with a vector of norm 1, for each part of the light. The error is due to the
/// noise of a traced matrix.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProductNoise {
    /// The noise of all light.
    pub full: f64,
    /// The noise of the light of one bounce.
    pub direct: f64,
    /// The noise of the light of two and more bounces.
    pub global: f64,
}

impl ProductNoise {
    fn values(self) -> [f64; 3] {
        [self.full, self.direct, self.global]
    }

    fn of(values: &[f64]) -> Option<Self> {
        let &[full, direct, global] = values else { return None };
        values.iter().all(|value| value.is_finite() && *value >= 0.0).then_some(Self { full, direct, global })
    }
}

/// The pictures of a light transport matrix. Pixels are counted row by row from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pictures {
    /// The size of photos. Each pixel is a row of the matrix.
    pub camera: Resolution,
    /// The size of patterns. Each pixel is a column of the matrix.
    pub projector: Resolution,
}

impl From<Csr> for MatrixFile {
    fn from(matrix: Csr) -> Self {
        Self { channels: vec![matrix], direct: Vec::new(), pictures: None, noise: None }
    }
}

impl MatrixFile {
    /// The numbers of rows and columns.
    pub fn shape(&self) -> [usize; 2] {
        self.channels.first().map_or([0; 2], |matrix| [matrix.rows(), matrix.cols()])
    }

    /// The matrix with pictures of these sizes, as the options `--size` and `--projector-size` give them. If one is missing, both pictures
    /// have the same size. A gray matrix that has three rows for each camera pixel becomes three matrices: its rows are the red, green and
    /// blue samples of one pixel after the other. `name` is used in messages.
    ///
    /// # Errors
    /// [`Error::Option`] if the sizes do not fit the numbers of rows and columns, or differ from the sizes that the matrix already has.
    pub fn sized(
        mut self,
        name: &Path,
        camera: Option<Resolution>,
        projector: Option<Resolution>,
    ) -> Result<Self> {
        let [rows, cols] = self.shape();
        let (Some(photos), Some(patterns)) = (camera.or(projector), projector.or(camera)) else {
            return Ok(self);
        };
        let differs = |option, size: Resolution, found: String| {
            let given = format!("{size} has {} pixels, but {} {found}", size.pixels(), name.display());
            Err(Error::option(option, given).help(
                "give the size of photos (--size) and of patterns (--projector-size) as WIDTHxHEIGHT; leave out what the file states itself",
            ))
        };
        let options = [
            ("--size", camera, photos, rows, "rows"),
            ("--projector-size", projector, patterns, cols, "columns"),
        ];
        for (at, (option, given, size, count, what)) in options.into_iter().enumerate() {
            let known = self.pictures.map(|known| [known.camera, known.projector][at]);
            match (known, given) {
                (Some(known), Some(given)) if known != given => {
                    return differs(option, given, format!("states {known}"));
                }
                (Some(_), _) => {}
                (None, _) => {
                    let is_color = at == 0 && self.channels.len() == 1 && count == 3 * size.pixels();
                    if size.pixels() != count && !is_color {
                        return differs(option, size, format!("has {count} {what}"));
                    }
                }
            }
        }
        if self.pictures.is_none() {
            if rows != photos.pixels() {
                let split = |matrices: &[Csr]| matrices.first().map(colors_apart).transpose();
                self.channels = split(&self.channels)?.unwrap_or_default();
                self.direct = split(&self.direct)?.unwrap_or_default();
            }
            self.pictures = Some(Pictures { camera: photos, projector: patterns });
        }
        Ok(self)
    }
}

/// Rows `3 p + c` of a matrix as row `p` of matrix `c`.
fn colors_apart(matrix: &Csr) -> Result<Vec<Csr>> {
    let channel = |channel: usize| {
        let (mut starts, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
        for row in (channel..matrix.rows()).step_by(3) {
            let (of_row, values) = matrix.row(row);
            columns.extend_from_slice(of_row);
            weights.extend_from_slice(values);
            starts.push(columns.len());
        }
        Csr::new(matrix.cols(), starts, columns, weights)
    };
    (0..3).map(channel).collect()
}

/// Writes a matrix in the format that the extension selects, `.npz` ([`write_npz`]) or `.mtx` ([`write_mtx`]), without pictures.
///
/// # Errors
/// [`Error::Data`] for another extension; [`Error::Write`].
pub fn write(path: &Path, matrix: &Csr) -> Result<()> {
    write_channel(path, matrix, &Beside::default())
}

/// Works like [`write()`], with what is known beside the matrix.
pub fn write_channel(path: &Path, matrix: &Csr, beside: &Beside<'_>) -> Result<()> {
    match extension(path).as_str() {
        "npz" => write_npz(path, matrix, beside),
        "mtx" => write_mtx(path, matrix, beside),
        _ => Err(unwritable(path)),
    }
}

/// Checks that [`write()`] can write to `path`: the extension is known, and the folder exists and is writable.
pub fn check_writable(path: &Path) -> Result<()> {
    match extension(path).as_str() {
        "npz" | "mtx" => atomic::check_writable(path),
        _ => Err(unwritable(path)),
    }
}

/// The suffixes of the names of three files that together hold a matrix in colour.
pub const COLORS: [&str; 3] = [".r", ".g", ".b"];

/// The name of a matrix's file with a suffix: `a/matrix.npz` becomes `a/matrix_direct.r.npz`.
pub fn with_suffix(file: &Path, suffix: &str) -> PathBuf {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let stem = stem(file);
    file.with_file_name(format!("{stem}{suffix}{}", &name[stem.len()..]))
}

/// The name of a matrix's file without folder and extension.
pub fn stem(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let stem = name.strip_suffix(".gz").filter(|stem| stem.ends_with(".mtx")).unwrap_or(&name);
    stem.rsplit_once('.').map_or(stem, |(stem, _)| stem).to_owned()
}

/// Whether the name is that of a matrix file that [`read_file`] reads.
pub fn is_matrix(path: &Path) -> bool {
    matches!(extension(path).as_str(), "npy" | "npz" | "mtx" | "mtx.gz" | "mat")
}

/// Reads a gray matrix as [`read_file`] does, without its pictures, and the last layer of a file of the cache. Fails for a matrix in colour.
pub fn read(path: &Path) -> Result<Csr> {
    let mut channels = read_any(path)?.channels;
    match channels.pop() {
        Some(matrix) if channels.is_empty() => Ok(matrix),
        _ => Err(unusable(path, "it holds colours, but a single matrix is wanted".into())),
    }
}

/// Reads a matrix in the format that the extension selects:
///
/// * `.npz`: what `scipy.sparse.save_npz` writes (csr, csc, coo, bsr, dia), or `numpy.savez` with one dense array;
/// * `.npy`, `.mat` (version 5 to 7): a dense array, or a sparse matrix in `.mat`. An array of two axes is the matrix. An array of four axes
///   is `[H, W, h, w]`, with the camera's axes first. An array of five axes has colours as well: `[3, H, W, h, w]`, `[H, W, 3, h, w]` or
///   `[H, W, h, w, 3]`;
/// * `.mtx`, `.mtx.gz`: Matrix Market, coordinate or array.
///
/// Entries at the same position are added, as in SciPy. If there is no such file, but files of the three colours ([`COLORS`]) as
/// `krylux matrix --channels rgb` writes them, they are read as one matrix.
///
/// # Errors
/// [`Error::Read`]; [`Error::Data`] for another extension or a malformed file.
pub fn read_file(path: &Path) -> Result<MatrixFile> {
    let files = files_of(path);
    if files.len() > 1 {
        return read_colors(path, &files);
    }
    if extension(path) == "npz" {
        npz::require_whole(path)?;
    }
    read_any(path)
}

fn read_any(path: &Path) -> Result<MatrixFile> {
    match extension(path).as_str() {
        "npy" => dense::read_npy(path),
        "npz" => npz::read(path),
        "mtx" | "mtx.gz" => mtx::read(path),
        "mat" => mat::read(path),
        _ => Err(Error::data(path, "its extension is not that of a matrix file")
            .help("name it .npz (SciPy), .npy (NumPy), .mtx or .mtx.gz (Matrix Market), or .mat (MATLAB)")),
    }
}

/// The files that [`read_file`] reads for this path: one, or those of three colours.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let colors = COLORS.map(|color| with_suffix(path, color));
    if !path.exists() && colors.iter().all(|file| file.is_file()) {
        return colors.to_vec();
    }
    vec![path.to_path_buf()]
}

fn read_colors(path: &Path, files: &[PathBuf]) -> Result<MatrixFile> {
    let mut whole = MatrixFile { channels: Vec::new(), direct: Vec::new(), pictures: None, noise: None };
    for file in files {
        let color = read_file(file)?;
        let is_like =
            whole.channels.is_empty() || (whole.shape(), whole.pictures) == (color.shape(), color.pictures);
        if color.channels.len() != 1 || !is_like {
            return Err(unusable(file, format!("it does not fit the other colours of {}", path.display())));
        }
        whole.channels.extend(color.channels);
        whole.direct.extend(color.direct);
        whole.pictures = color.pictures;
        // The noise is that of the first channel, as for a traced matrix.
        whole.noise = whole.noise.or(color.noise);
    }
    if whole.direct.len() != whole.channels.len() {
        whole.direct.clear();
    }
    Ok(whole)
}

/// The extension of a file, in lower case. It is `mtx.gz` for a packed Matrix Market file.
fn extension(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match name.rsplit_once('.') {
        Some((stem, "gz")) if stem.ends_with(".mtx") => "mtx.gz".into(),
        Some((_, extension)) => extension.into(),
        None => String::new(),
    }
}

fn unwritable(path: &Path) -> Error {
    Error::data(path, "its extension is not that of a sparse matrix that can be written")
        .help("name it .npz (SciPy) or .mtx (Matrix Market)")
}

/// The maximum number of rows or columns: the pixels of a photo of 8192×8192. A limit is necessary because empty rows also take memory, and
/// a file of a few bytes can state any number of rows.
const MAX_SIDE: usize = 1 << 26;

/// Checks the number of rows and columns that a file states, before memory is allocated for them.
fn require_sides(path: &Path, rows: usize, cols: usize) -> Result<()> {
    if rows.max(cols) > MAX_SIDE {
        let what = format!("it states {rows} rows and {cols} columns; at most {MAX_SIDE} are read");
        return Err(unusable(path, what));
    }
    Ok(())
}

/// An entry of a file: row, column and value.
type Entry = (usize, usize, f64);

/// The matrix with these entries, which may be in any order. Entries at the same position are added in the order of the file, and zeros are
/// dropped.
fn from_entries(path: &Path, [rows, cols]: [usize; 2], mut entries: Vec<Entry>) -> Result<Csr> {
    require_sides(path, rows, cols)?;
    if let Some(&(row, column, _)) = entries.iter().find(|&&(row, column, _)| row >= rows || column >= cols) {
        let what = format!("entry ({row}, {column}) lies outside of its {rows} rows and {cols} columns");
        return Err(unusable(path, what));
    }
    entries.sort_by_key(|&(row, column, _)| (row, column));
    entries.dedup_by(|next, kept| {
        let repeats = (next.0, next.1) == (kept.0, kept.1);
        if repeats {
            kept.2 += next.2;
        }
        repeats
    });
    if let Some(&(row, column, value)) = entries.iter().find(|entry| !entry.2.is_finite()) {
        return Err(unusable(path, format!("entry ({row}, {column}) is {value}")));
    }
    entries.retain(|entry| entry.2 != 0.0);
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

/// The pictures of a matrix by the shapes that the file states, `[height, width]` each. Fails if they do not fit the numbers of rows and
/// columns.
fn pictures(path: &Path, shape: [usize; 2], camera: &[usize], projector: &[usize]) -> Result<Pictures> {
    match (camera, projector) {
        (&[height, width], &[rows, columns])
            if [height.checked_mul(width), rows.checked_mul(columns)] == shape.map(Some) =>
        {
            let [camera, projector] = [(width, height), (columns, rows)].map(|(w, h)| Resolution::new(w, h));
            Ok(Pictures { camera, projector })
        }
        _ => Err(unusable(
            path,
            format!(
                "its pictures of {camera:?} and {projector:?} (heights and widths) do not fit {} rows and {} columns",
                shape[0], shape[1]
            ),
        )),
    }
}

fn unusable(path: &Path, fault: String) -> Error {
    Error::data(path, fault).help(
        "write it with scipy.sparse.save_npz(FILE, A), scipy.io.mmwrite, numpy.save or MATLAB's save -v7",
    )
}
