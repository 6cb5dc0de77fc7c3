//! Eigenpairs as pictures, plots and a table.

use rayon::prelude::*;

use super::colormap::{paint_signed, robust_range, signed_color};
use super::figure::figure;
use super::html::{Block, Figure, Kind, Legend, Swatch, Values};
use super::plot::{self, StemPlot};
use super::run::AnswerPage;
use super::text::{decimal, with_error};
use crate::analysis::segment::Embedding;
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::exr;
use crate::krylov::HistoryRow;

/// Maximum number of lines in the plot of residuals.
const LINES: usize = 5;

/// A signed picture of each eigenvector, with its file name. `mask` marks pixels to leave out. `embedding` converts entries to coordinates.
pub(crate) fn pictures(
    resolution: Resolution,
    vectors: &[Vec<f64>],
    values: &[f64],
    mask: Option<&[bool]>,
    embedding: Option<&Embedding>,
) -> Result<Vec<(String, Figure)>> {
    let picture = |(index, (vector, value)): (usize, (&Vec<f64>, &f64))| {
        let range = robust_range(vector, mask);
        let coordinate = embedding.and_then(|of| Some((*of.weights.get(index)?, *of.ranges.get(index)?)));
        let kind = Kind::Eigenvector {
            // For the average cut, whose first eigenvalue is 0, eigenvectors do not determine rows of the matrix.
            eigenvalue: (embedding.is_some() && values[0] > 0.5).then_some(*value),
            weight: coordinate.map(|(weight, _)| weight),
            // Plain coordinates have no range.
            range: coordinate.map(|(_, range)| range).filter(|(low, _)| low.is_finite()).unwrap_or_default(),
        };
        let mut painted = (paint_signed(resolution, vector, mask, range)?, Legend::signed(range));
        let mut caption = format!("{}: λ = {}", index + 1, decimal(*value, 5));
        if is_constant(vector, mask) {
            // One colour would say only the sign of the vector, which is arbitrary.
            let swatch = Swatch { color: signed_color(0.0), text: "the same at every pixel".into() };
            let neutral = paint_signed(resolution, &vec![0.0; vector.len()], mask, range)?;
            painted = (neutral, Legend::Swatches(vec![swatch]));
            caption += ", constant";
        }
        let figure = figure(painted, Values::of_numbers(resolution, kind, vector, ""), caption)
            .named(format!("eigenvector {}", index + 1), format!("eigenvectors.npy[{index}]"))
            .in_series("eigenvector");
        Ok((format!("eigenvector-{:02}", index + 1), figure))
    };
    vectors.par_iter().zip(values).enumerate().map(picture).collect()
}

/// Whether the values that `mask` does not leave out agree to nine digits, that is, within the rounding of the computation.
fn is_constant(values: &[f64], mask: Option<&[bool]>) -> bool {
    let kept = values.iter().enumerate().filter(|(index, _)| !mask.is_some_and(|mask| mask[*index]));
    let [low, high] = kept.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (_, value)| {
        [low.min(*value), high.max(*value)]
    });
    high - low <= 1e-9 * high.abs()
}

/// Each eigenvector as a layer of an `.exr` file, named `eigenvector01` and so on.
pub(crate) fn layers(resolution: Resolution, vectors: &[Vec<f64>]) -> Result<Vec<(String, Image)>> {
    let layer = |(index, vector): (usize, &Vec<f64>)| {
        Ok((format!("eigenvector{:02}", index + 1), narrowed(resolution, vector)?))
    };
    vectors.iter().enumerate().map(layer).collect()
}

/// Adds the layers as the file `eigenvectors.exr`.
pub(crate) fn write_layers(page: &mut AnswerPage<'_>, layers: Vec<(String, Image)>) {
    page.files.later("eigenvectors.exr", move |path| {
        let layers: Vec<(&str, &Image)> = layers.iter().map(|(name, image)| (name.as_str(), image)).collect();
        exr::write_exr(path, &layers)
    });
}

/// A plane of `f64` values as a gray `f32` image.
pub(crate) fn narrowed(resolution: Resolution, values: &[f64]) -> Result<Image> {
    Image::new(resolution, 1, values.iter().map(|&value| value as f32).collect())
}

/// A stem plot of the eigenvalues, with residual norms as error bars.
pub(crate) fn stems(values: &[f64], residuals: &[f64], caption: &str) -> Block {
    let plot = StemPlot {
        x_label: "eigenvector".into(),
        y_label: "eigenvalue λ".into(),
        values: values.to_vec(),
        errors: residuals.to_vec(),
    };
    Block::Plot { svg: plot.render(), caption: caption.into() }
}

/// A plot of the residual norms of the leading pairs over the photos. `first` is the number of the first pair that has a history.
pub(crate) fn convergence(history: &[HistoryRow], first: usize) -> Block {
    let pairs = history.last().map_or(0, |row| row.residuals.len()).min(LINES);
    let line = |pair: usize| {
        let at = |row: &HistoryRow| Some((row.products as f64, *row.residuals.get(pair)?));
        plot::line(format!("λ{}", pair + first), history.iter().filter_map(at))
    };
    let caption = "Residual norms of the leading eigenpairs as photos are taken; they cost no photo.";
    plot::lines(["photos", "residual norm"], (0..pairs).map(line).collect(), caption)
}

/// A table with a row for each pair: the eigenvalue, with its standard error if known, the residual norm, and the columns `more`.
pub(crate) fn table(
    (values, errors): (&[f64], &[f64]),
    residuals: &[f64],
    more: &[(&str, Vec<String>)],
) -> Block {
    let row = |(index, (value, residual)): (usize, (&f64, &f64))| {
        let shown = match errors.get(index) {
            Some(&error) if error > 0.0 => with_error(*value, error),
            _ => decimal(*value, 6),
        };
        let mut cells = vec![(index + 1).to_string(), shown, format!("{residual:.1e}")];
        cells.extend(more.iter().map(|(_, column)| column.get(index).cloned().unwrap_or_default()));
        cells
    };
    let headers = ["", "eigenvalue", "residual norm"].into_iter().chain(more.iter().map(|(name, _)| *name));
    let rows = values.iter().zip(residuals).enumerate().map(row).collect();
    Block::table(headers, rows, "Eigenvalues with their residual norms")
}
