//! The page as one file, which contains the matrix and needs no server.

use std::fmt::Write as _;
use std::path::Path;

use flate2::Compression;
use half::f16;
use rand::{RngExt, SeedableRng};
use serde_json::{Value, json};

use super::canvas::{Canvas, Columns, Light};
use super::page::{WORKER, describe, page};
use super::question::{MOST, PageAnswer};
use crate::analysis::planes::{Planes, difference, norm};
use crate::error::{Error, Result};
use crate::report::content::{self as array, Content};
use crate::report::web::{bundle, deflated};
use crate::sparse::Csr;

/// Options of the file.
#[derive(Clone, Debug)]
pub struct EmbedOptions {
    /// The storage format of the matrix's values.
    pub precision: Precision,
    /// The largest size of the file in bytes, or `None` for any size. A larger matrix is thinned: some small entries are left out at
    /// random, and others are enlarged, so that every photo stays right on average.
    pub max_bytes: Option<usize>,
    /// Known answers, which the page shows without a request.
    pub kept: Kept,
}

/// Answers that the file contains. Their planes have the resolution of the camera.
#[derive(Clone, Debug, Default)]
pub struct Kept {
    /// Labels, with one plane for each number of groups.
    pub groups: Option<PageAnswer>,
    /// Eigenvectors, one plane each, with their eigenvalues.
    pub eigenvectors: Option<PageAnswer>,
}

impl Kept {
    /// The labels of a segmentation, or else the eigenvectors, if the answer has any.
    pub fn of(answer: &dyn crate::lab::Answer, content: &Content<'_>) -> Self {
        let answer = || PageAnswer { status: answer.headline(), ..PageAnswer::default() };
        let (mut groups, mut eigenvectors) = (answer(), answer());
        for array in &content.arrays {
            match (array.name, array.key, &array.values) {
                ("labels", Some(count), array::Values::U8(labels)) => {
                    groups.groups.push(count);
                    groups.planes.push(labels.iter().map(|&label| f64::from(label)).collect());
                }
                ("eigenvalues", None, array::Values::F64(values)) => {
                    groups.values = values.to_vec();
                    eigenvectors.values = values.iter().take(MOST).copied().collect();
                }
                ("eigenvectors", None, array::Values::Rows(vectors)) => {
                    eigenvectors.planes = vectors.iter().take(MOST).cloned().collect();
                }
                _ => {}
            }
        }
        match (groups.planes.is_empty(), eigenvectors.planes.is_empty()) {
            (false, _) => Self { groups: Some(groups), eigenvectors: None },
            (true, false) => Self { groups: None, eigenvectors: Some(eigenvectors) },
            (true, true) => Self::default(),
        }
    }
}

/// A finished page.
#[derive(Clone, Debug)]
pub struct Embedded {
    html: String,
    /// The largest relative error that storing the matrix causes in the photos of white, of a checkerboard and of random patterns.
    pub error: f64,
    /// The fraction of the matrix's entries that the page contains.
    pub kept: f64,
}

/// The smallest fraction of the entries that is tried for a matrix that is too large, and the number of trials.
const LEAST_SHARE: f64 = 0.02;
const TRIALS: usize = 6;

impl Embedded {
    /// Makes the page of a canvas whose matrix is in memory.
    ///
    /// # Errors
    /// [`Error::Option`] naming `-o` when there is no matrix, and `--max-size` when no thinned matrix is small enough; the errors of
    /// [`Canvas::photo`].
    pub fn new(canvas: &mut Canvas<'_>, options: &EmbedOptions) -> Result<Self> {
        if canvas.layers().is_empty() {
            let fault =
                "a page without server holds the light transport matrix, and this source has none in memory";
            return Err(Error::option("-o", fault).help("give a scene or a matrix, or serve the page"));
        }
        let most = options.max_bytes.unwrap_or(usize::MAX);
        let parts = Parts::new(canvas, options)?;
        let (mut share, mut too_much, mut best) = (1.0, f64::INFINITY, None);
        for _ in 0..TRIALS {
            let layers = thinned(canvas.layers(), share);
            let html = parts.html(&layers)?;
            let bytes = html.len();
            // The size of the page's other parts does not depend on the share. The factor 0.97 leaves a small margin.
            let fitting = share * 0.97 * most as f64 / bytes as f64;
            if bytes > most {
                if share <= LEAST_SHARE {
                    return Err(too_large(bytes, most));
                }
                too_much = share;
                share = fitting.max(LEAST_SHARE);
            } else {
                let is_near = share >= 1.0 || bytes as f64 > 0.9 * most as f64;
                best = Some((html, layers));
                if is_near {
                    break;
                }
                share = fitting.min(0.5 * (share + too_much));
            }
        }
        let Some((html, layers)) = best else { return Err(too_large(most, most)) };
        let error = error(canvas, &layers, options.precision)?;
        let count = |layers: &[(Light, Columns)]| layers.iter().map(|(_, of)| of.nonzeros()).sum::<usize>();
        let kept = count(&layers) as f64 / count(canvas.layers()).max(1) as f64;
        Ok(Self { html, error, kept })
    }

    /// The size of the file in bytes.
    pub fn bytes(&self) -> usize {
        self.html.len()
    }

    /// Writes the file.
    pub fn write(&self, path: &Path) -> Result<()> {
        crate::io::atomic::write_bytes(path, self.html.as_bytes())
    }
}

fn too_large(bytes: usize, most: usize) -> Error {
    let mebibytes = |bytes: usize| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
    let fault = format!(
        "the page takes {} with {} % of the matrix's entries, more than {}",
        mebibytes(bytes),
        100.0 * LEAST_SHARE,
        mebibytes(most)
    );
    Error::option("--max-size", fault).help("use a smaller --size, or allow more")
}

/// The largest relative error of four photos due to the storage of the matrix.
fn error(canvas: &mut Canvas<'_>, layers: &[(Light, Columns)], precision: Precision) -> Result<f64> {
    let (pixels, camera, width) =
        (canvas.projector().pixels(), canvas.camera().pixels(), canvas.projector().width);
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let checker = |pixel: usize| ((pixel % width / 3 + pixel / width / 3) % 2) as f64;
    let patterns: [Vec<f64>; 4] = [
        vec![1.0; pixels],
        (0..pixels).map(checker).collect(),
        (0..pixels).map(|_| random.random::<f64>()).collect(),
        (0..pixels).map(|_| f64::from(u8::from(random.random::<f64>() < 0.01))).collect(),
    ];
    let mut worst = 0.0_f64;
    for pattern in &patterns {
        let [mut exact, mut stored] = [0, 1].map(|_| vec![vec![0.0; camera]; canvas.channels()]);
        for (light, columns) in canvas.layers() {
            let of_light = layers.iter().find(|(of, _)| of == light).map(|(_, columns)| columns);
            for channel in 0..exact.len() {
                columns.multiply(channel, pattern, &mut exact[channel]);
                if let Some(of_light) = of_light {
                    multiply_rounded(&of_light.channels()[channel], precision, pattern, &mut stored[channel]);
                }
            }
        }
        worst = worst.max(norm(&difference(&exact, &stored)) / norm(&exact).max(f64::MIN_POSITIVE));
    }
    Ok(worst)
}

fn multiply_rounded(columns: &Csr, precision: Precision, pattern: &[f64], photo: &mut [f64]) {
    let scale = scale_of(columns);
    for (pixel, &value) in pattern.iter().enumerate().filter(|(_, value)| **value != 0.0) {
        let (places, values) = columns.row(pixel);
        for (&place, entry) in places.iter().zip(values) {
            photo[place as usize] += value * scale * precision.rounded(entry / scale);
        }
    }
}

/// The parts of the page that do not depend on the layers of the matrix.
struct Parts {
    info: Value,
    sections: Sections,
    precision: Precision,
}

impl Parts {
    fn new(canvas: &mut Canvas<'_>, options: &EmbedOptions) -> Result<Self> {
        let mut sections = Sections::default();
        let mut info = describe(canvas)?;
        info["isEmbedded"] = json!(true);
        info["welcome"] = json!("The light transport matrix is in this page");
        let ambient = canvas.ambient_of(Light::All).map(floats).unwrap_or_default();
        info["ambient"] = json!(sections.add(&ambient));
        info["kept"] = json!({});
        let mut keep = |ask: &str, answer: &PageAnswer, bytes: &[u8]| {
            info["kept"][ask] = json!(answer);
            info["kept"][ask]["section"] = json!(sections.add(bytes));
        };
        if let Some(groups) = &options.kept.groups {
            let labels: Vec<u8> = groups.planes.iter().flatten().map(|&label| label as u8).collect();
            keep("groups", groups, &labels);
        }
        if let Some(eigenvectors) = &options.kept.eigenvectors {
            keep("eigenvectors", eigenvectors, &floats(&eigenvectors.planes));
        }
        Ok(Self { info, sections, precision: options.precision })
    }

    fn html(&self, layers: &[(Light, Columns)]) -> Result<String> {
        let (mut info, mut sections) = (self.info.clone(), self.sections.clone());
        let layer = |(light, columns): &(Light, Columns)| {
            // Each row of `columns` is a column of the layer.
            let mut packed = packed(columns.channels(), self.precision, &mut sections);
            packed["light"] = json!(light);
            packed
        };
        info["layers"] = layers.iter().map(layer).collect();
        let data = format!(
            "{}<script type=\"text/plain\" id=\"worker\">\n{}</script>\n",
            sections.html,
            bundle(&WORKER)
        );
        let about =
            "This file holds the light transport matrix and needs no server: it sends nothing anywhere.";
        page(&info, about, None, &data)
    }
}

fn floats(planes: &Planes) -> Vec<u8> {
    planes.iter().flatten().flat_map(|&value| (value as f32).to_le_bytes()).collect()
}

/// Script elements that contain deflated bytes as text.
#[derive(Clone, Default)]
struct Sections {
    html: String,
    count: usize,
}

impl Sections {
    fn add(&mut self, bytes: &[u8]) -> usize {
        let (number, text) = (self.count, deflated(bytes, Compression::default()));
        // Writing to a string cannot fail.
        let _ = writeln!(self.html, "<script type=\"text/plain\" id=\"section-{number}\">{text}</script>");
        self.count += 1;
        number
    }
}

/// The storage format of values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 16-bit floats with 11 significant bits.
    #[default]
    Half,
    /// 32-bit floats.
    Single,
}

impl Precision {
    /// The value that is read back after storage. Both values are relative to the largest value.
    pub(super) fn rounded(self, value: f64) -> f64 {
        match self {
            Self::Half => f16::from_f64(value).to_f64(),
            Self::Single => f64::from(value as f32),
        }
    }

    fn put(self, value: f64, bytes: &mut Vec<u8>) {
        match self {
            Self::Half => bytes.extend(f16::from_f64(value).to_le_bytes()),
            Self::Single => bytes.extend((value as f32).to_le_bytes()),
        }
    }
}

/// The largest absolute value of a channel's entries. Stored values are relative to this value.
fn scale_of(columns: &Csr) -> f64 {
    let largest = columns.weights().iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    if largest > 0.0 { f64::from(largest as f32) } else { 1.0 }
}

/// Packs the columns of all channels of a layer, which have their entries at the same positions. Positions are stored as numbers with seven
/// bits per byte: first the number of entries of each column, then the distance of each entry from the previous entry. The values are
/// stored separately, as half or single floats relative to the largest. For a symmetric matrix, only the entries on and below the diagonal
/// are packed. The result describes the layer and names its sections.
fn packed(columns: &[Csr], precision: Precision, sections: &mut Sections) -> Value {
    let is_symmetric = columns.iter().all(Csr::is_symmetric);
    let first = &columns[0];
    let kept = |column: usize| {
        let (places, _) = first.row(column);
        let from = if is_symmetric { places.partition_point(|&place| (place as usize) < column) } else { 0 };
        from..places.len()
    };
    let mut positions = Vec::new();
    (0..first.rows()).for_each(|column| put_number(kept(column).len() as u32, &mut positions));
    for column in 0..first.rows() {
        let mut last = 0;
        for &place in &first.row(column).0[kept(column)] {
            put_number(place - last, &mut positions);
            last = place;
        }
    }
    let positions = sections.add(&positions);
    let scales: Vec<f64> = columns.iter().map(scale_of).collect();
    let values = columns.iter().zip(&scales).map(|(columns, scale)| {
        let mut bytes = Vec::new();
        for column in 0..columns.rows() {
            let values = &columns.row(column).1[kept(column)];
            values.iter().for_each(|value| precision.put(value / scale, &mut bytes));
        }
        sections.add(&bytes)
    });
    json!({
        "rows": first.cols(),
        "columns": first.rows(),
        "symmetric": is_symmetric,
        "precision": precision,
        "scales": scales.iter().map(|&scale| scale as f32).collect::<Vec<_>>(),
        "positions": positions,
        "values": values.collect::<Vec<_>>(),
    })
}

fn put_number(mut value: u32, bytes: &mut Vec<u8>) {
    while value > 127 {
        bytes.push((value & 127) as u8 | 128);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Keeps about the fraction `share` of the entries of all layers together. Entries above a threshold `τ` are unchanged. A smaller entry `a`
/// becomes `±τ` with the probability `|a| / τ`, and is otherwise dropped. The expectation of every entry is unchanged. Both halves of a
/// symmetric matrix are thinned in the same way.
pub(super) fn thinned(layers: &[(Light, Columns)], share: f64) -> Vec<(Light, Columns)> {
    if share >= 1.0 {
        return layers.to_vec();
    }
    // All channels have entries at the same positions. The size of an entry is the largest over the channels, each scaled by its largest
    // entry.
    let channels = layers.first().map_or(0, |(_, columns)| columns.channels().len());
    let largest = |channel: usize| {
        layers.iter().map(|(_, columns)| scale_of(&columns.channels()[channel])).fold(0.0, f64::max)
    };
    let scales: Vec<f64> = (0..channels).map(largest).collect();
    let sizes = layers.iter().flat_map(|(_, columns)| sizes(columns, &scales)).collect();
    let threshold = threshold(sizes, share);
    layers.iter().map(|(light, columns)| (*light, without_small(columns, &scales, threshold))).collect()
}

fn sizes(columns: &Columns, scales: &[f64]) -> Vec<f64> {
    let mut sizes = vec![0.0_f64; columns.nonzeros()];
    for (of, scale) in columns.channels().iter().zip(scales) {
        sizes.iter_mut().zip(of.weights()).for_each(|(size, value)| *size = size.max(value.abs() / scale));
    }
    sizes
}

/// The layer after the entries below the threshold are dropped or enlarged at random.
fn without_small(columns: &Columns, scales: &[f64], threshold: f64) -> Columns {
    let sizes = sizes(columns, scales);
    let first = &columns.channels()[0];
    let mut row_start = vec![0];
    let mut places_kept = Vec::new();
    let mut values_kept: Vec<Vec<f64>> = vec![Vec::new(); scales.len()];
    for column in 0..first.rows() {
        let of_column = first.row_start()[column]..first.row_start()[column + 1];
        for (at, size) in of_column.clone().zip(&sizes[of_column]) {
            let place = first.columns()[at];
            let probability = (size / threshold).min(1.0);
            if probability < 1.0 && chance(column, place as usize) >= probability {
                continue;
            }
            places_kept.push(place);
            for (values, of) in values_kept.iter_mut().zip(columns.channels()) {
                values.push(of.weights()[at] / probability);
            }
        }
        row_start.push(places_kept.len());
    }
    let thin = |values: Vec<f64>| Csr::new(first.cols(), row_start.clone(), places_kept.clone(), values).ok();
    // The matrix is valid, since its positions are a subset of a valid matrix's positions.
    Columns::new(values_kept.into_iter().filter_map(thin).collect())
}

/// The threshold `τ` for which `Σ min(1, size / τ)` is the fraction `share` of the number of entries.
fn threshold(mut sizes: Vec<f64>, share: f64) -> f64 {
    sizes.sort_by(f64::total_cmp);
    let wanted = share * sizes.len() as f64;
    let mut below = sizes.iter().sum::<f64>();
    // The search starts at the largest entry. If the `whole` largest entries count as 1, the sum is as required at `threshold`.
    for (whole, &size) in sizes.iter().rev().enumerate() {
        let threshold = below / (wanted - whole as f64).max(f64::MIN_POSITIVE);
        if size <= threshold {
            return threshold.max(f64::MIN_POSITIVE);
        }
        below -= size;
    }
    f64::MIN_POSITIVE
}

/// A random number from 0 to 1 for an entry. It is the same for both halves of a symmetric matrix.
fn chance(column: usize, place: usize) -> f64 {
    let (low, high) = (column.min(place) as u64, column.max(place) as u64);
    rand_pcg::Pcg64Mcg::seed_from_u64(high << 32 | low).random()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Result;
    use crate::lab::{Answer as _, Lab};
    use crate::verbs::eigs::Spectrum;
    use crate::verbs::{Eigs, Segment};

    fn options(max_bytes: Option<usize>) -> EmbedOptions {
        EmbedOptions { precision: Precision::Half, max_bytes, kept: Kept::default() }
    }

    #[test]
    fn a_page_beside_an_answer_shows_its_eigenvectors_or_its_groups() -> Result<()> {
        let mut lab = Lab::builder("assets/scenes/zigzag/scene.glb").size(16, 16).samples(16).open()?;
        let pairs = lab.ask(&Eigs { count: 2, photos: Some(10), ..Eigs::default() })?;
        let Spectrum::Pairs(found) = &pairs else { unreachable!("no singular values were asked for") };
        let kept = Kept::of(&pairs, &pairs.content());
        let shown = kept.eigenvectors.map(|shown| (shown.values, shown.planes));
        assert_eq!(shown, Some((found.found.values.clone(), found.found.vectors.clone())));
        assert_eq!(kept.groups, None);
        let groups = lab.ask(&Segment { groups: vec![2, 3], photos: Some(10), ..Segment::default() })?;
        let kept = Kept::of(&groups, &groups.content());
        assert_eq!(kept.groups, Some(PageAnswer::from(&groups)));
        assert_eq!(kept.eigenvectors, None);
        Ok(())
    }

    #[test]
    fn a_matrix_that_is_too_large_is_thinned_and_says_how_far_its_photos_are_off() -> Result<()> {
        let mut lab = Lab::builder("assets/scenes/cornell/scene.glb").size(32, 32).samples(64).open()?;
        let mut canvas = Canvas::new(&mut lab)?;
        let whole = Embedded::new(&mut canvas, &options(None))?;
        assert!(whole.kept == 1.0 && whole.error < 5e-4, "{}", whole.error);
        let page = whole.bytes() - 100_000;
        let thin = Embedded::new(&mut canvas, &options(Some(page)))?;
        assert!(thin.bytes() <= page && thin.kept < 1.0);
        // The largest entries are those of direct light, so all of them are kept.
        assert!(thin.error > whole.error && thin.error < 0.05, "{}", thin.error);
        let refused = Embedded::new(&mut canvas, &options(Some(10_000)));
        assert!(refused.is_err_and(|error| error.to_string().contains("--max-size")));
        Ok(())
    }

    #[test]
    fn thinning_keeps_the_mean_of_every_photo_and_symmetry() -> Result<()> {
        let entries = |row: usize| (0..60).map(move |column| 1.0 + ((row * column) % 7) as f64);
        let weights: Vec<f64> = (0..60).flat_map(entries).collect();
        let columns: Vec<u32> = (0..60).flat_map(|_| 0..60).collect();
        let matrix = Csr::new(60, (0..=60).map(|row| 60 * row).collect(), columns, weights)?;
        let sum = |of: &Csr| of.weights().iter().sum::<f64>();
        let thin = thinned(&[(Light::All, Columns::new(vec![matrix.clone()]))], 0.3);
        let thin = &thin[0].1.channels()[0];
        assert!(thin.is_symmetric());
        let share = thin.weights().len() as f64 / matrix.weights().len() as f64;
        // The 1,830 choices are independent. Three standard deviations are 3.5 % of the share and about 5 % of the sum.
        assert!((share / 0.3 - 1.0).abs() < 0.15, "{share}");
        assert!((sum(thin) / sum(&matrix) - 1.0).abs() < 0.1);
        Ok(())
    }

    #[test]
    fn the_threshold_keeps_the_share_that_is_wanted() {
        let sizes: Vec<f64> = (1..=1000).map(|size| f64::from(size).powi(2)).collect();
        for share in [0.9, 0.5, 0.1] {
            let threshold = threshold(sizes.clone(), share);
            let kept: f64 = sizes.iter().map(|size| (size / threshold).min(1.0)).sum();
            assert!((kept / 1000.0 - share).abs() < 1e-9, "{share}: {kept}");
        }
    }
}
