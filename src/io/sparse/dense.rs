//! Dense arrays as matrices. The number of axes says what an array is.

use std::path::Path;

use super::archive::Archive;
use super::{MatrixFile, Pictures, require_sides, unusable};
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::io::npy;
use crate::sparse::Csr;

pub(super) fn read_npy(path: &Path) -> Result<MatrixFile> {
    from_array(path, &npy::read_npy(path)?)
}

/// The only array of an archive that has two axes or more.
pub(super) fn read_npz(path: &Path, mut archive: Archive<'_>) -> Result<MatrixFile> {
    let mut found: Option<(String, npy::Array)> = None;
    for name in archive.names() {
        let array = archive.array(&name)?;
        match &found {
            _ if array.shape.len() < 2 => {}
            Some((other, _)) => {
                return Err(several(path, &format!("arrays `{other}` and `{name}`"), "numpy.save(FILE, A)"));
            }
            None => found = Some((name, array)),
        }
    }
    match found {
        Some((_, array)) => from_array(path, &array),
        None => {
            Err(unusable(path, "it has neither a matrix of SciPy nor an array of two axes or more".into()))
        }
    }
}

/// The error for a file that has several arrays which may be the matrix.
pub(super) fn several(path: &Path, what: &str, remedy: &str) -> Error {
    Error::data(path, format!("it has {what}, and either may be the matrix"))
        .help(format!("write one alone: {remedy}"))
}

/// The lengths of an array's axes by meaning, with their strides.
struct Axes {
    /// The channels, and the camera's and the projector's rows and columns.
    lengths: [usize; 5],
    strides: [usize; 5],
}

/// The array as a matrix, by the rules of [`super::read_file`]. `path` is used in messages.
///
/// # Errors
/// [`Error::Data`] if the axes have no meaning, if the shape is empty or too large, or if an entry is NaN or infinite.
pub fn from_array(path: &Path, array: &npy::Array) -> Result<MatrixFile> {
    let shape = array.shape.as_slice();
    let text = shape.iter().map(usize::to_string).collect::<Vec<_>>().join("×");
    let strides: Vec<usize> = (0..shape.len()).map(|axis| shape[axis + 1..].iter().product()).collect();
    let axes = |order: [Option<usize>; 5]| Axes {
        lengths: order.map(|axis| axis.map_or(1, |axis| shape[axis])),
        strides: order.map(|axis| axis.map_or(0, |axis| strides[axis])),
    };
    let axes = match shape {
        [_, _] => axes([None, None, Some(0), None, Some(1)]),
        [_, _, _, _] => axes([None, Some(0), Some(1), Some(2), Some(3)]),
        [_, _, _, _, _] => {
            let colors: Vec<usize> = [0, 2, 4].into_iter().filter(|&axis| shape[axis] == 3).collect();
            let &[color] = colors.as_slice() else {
                let fault = format!(
                    "which of its axes is colour is not certain: its shape is {text}, and {} of the first, third and last axis have a length of 3",
                    colors.len()
                );
                return Err(Error::data(path, fault)
                    .help("reshape it to a matrix of (H·W·3, h·w), and give --size and --projector-size"));
            };
            let rest: Vec<Option<usize>> = (0..5).filter(|&axis| axis != color).map(Some).collect();
            axes([Some(color), rest[0], rest[1], rest[2], rest[3]])
        }
        _ => {
            return Err(Error::data(path, format!("its shape is {text}, which is no matrix")).help(
                "give a matrix of (pixels of the camera, pixels of the projector), or an array of H×W×h×w, with colours H×W×3×h×w, 3×H×W×h×w or H×W×h×w×3",
            ));
        }
    };
    let [channels, height, width, rows, columns] = axes.lengths;
    require_sides(path, height.saturating_mul(width), rows.saturating_mul(columns))?;
    let channels =
        (0..channels).map(|channel| axes.matrix(path, channel, &array.values)).collect::<Result<_>>()?;
    let pictures = (shape.len() > 2).then(|| Pictures {
        camera: Resolution::new(width, height),
        projector: Resolution::new(columns, rows),
    });
    Ok(MatrixFile { channels, direct: Vec::new(), pictures, noise: None })
}

impl Axes {
    /// The matrix of one channel, without its zeros.
    fn matrix(&self, path: &Path, channel: usize, values: &[f64]) -> Result<Csr> {
        let [_, height, width, rows, columns] = self.lengths;
        let [by_channel, by_y, by_x, by_row, by_column] = self.strides;
        let (mut starts, mut indices, mut weights) = (vec![0], Vec::new(), Vec::new());
        for pixel in 0..height * width {
            let first = channel * by_channel + pixel / width * by_y + pixel % width * by_x;
            for column in 0..rows * columns {
                let value = values[first + column / columns * by_row + column % columns * by_column];
                if !value.is_finite() {
                    return Err(unusable(path, format!("entry ({pixel}, {column}) is {value}")));
                }
                if value != 0.0 {
                    indices.push(column as u32);
                    weights.push(value);
                }
            }
            starts.push(indices.len());
        }
        Csr::new(rows * columns, starts, indices, weights).map_err(|error| unusable(path, error.to_string()))
    }
}
