//! The page as one file, which holds the matrix and needs no server.

use std::fmt::Write as _;
use std::path::Path;

use flate2::Compression;
use rand::{RngExt, SeedableRng};
use serde_json::{Value, json};

use super::packed::{Precision, pack, scale_of};
use super::thinned::thinned;
use super::{WORKER, describe, page};
use crate::analysis::planes::{Planes, difference, norm};
use crate::error::{Error, Result};
use crate::paint::canvas::{Canvas, Light};
use crate::paint::columns::Columns;
use crate::paint::question::Answer;
use crate::report::content::{self as array, Content};
use crate::report::web::{bundle, deflated};
use crate::sparse::Csr;

/// How the file is made.
#[derive(Clone, Debug)]
pub struct EmbedOptions {
    /// How the matrix's values are stored.
    pub precision: Precision,
    /// The most bytes of the file. A matrix that takes more is thinned: small entries are left out by chance, and others made larger, so that
    /// every photo stays right on average. `None` for any size.
    pub max_bytes: Option<usize>,
    /// What the page shows without asking: groups and eigenvectors that are known.
    pub kept: Kept,
}

/// Answers that are kept in the file. Their planes have the camera's pixels.
#[derive(Clone, Debug, Default)]
pub struct Kept {
    /// Labels, one plane for each number of groups.
    pub groups: Option<Answer>,
    /// Eigenvectors, one plane each, with their eigenvalues.
    pub eigenvectors: Option<Answer>,
}

impl Kept {
    /// What the page shows of an answer: labels, if it has any.
    pub fn of(answer: &impl crate::lab::Answer, content: &Content<'_>) -> Self {
        let mut groups = Answer { status: answer.sentence(), ..Answer::default() };
        for array in &content.arrays {
            match (array.name, array.key, &array.values) {
                ("labels", Some(count), array::Values::U8(labels)) => {
                    groups.groups.push(count);
                    groups.planes.push(labels.iter().map(|&label| f64::from(label)).collect());
                }
                ("eigenvalues", None, array::Values::F64(values)) => groups.values = values.to_vec(),
                _ => {}
            }
        }
        Self { groups: (!groups.groups.is_empty()).then_some(groups), eigenvectors: None }
    }
}

/// A finished page.
#[derive(Clone, Debug)]
pub struct Embedded {
    html: String,
    /// What storing the matrix changes: the relative difference of the photos of white, of a checkerboard and of random patterns, at most.
    pub error: f64,
    /// The share of the matrix's entries that the page has.
    pub kept: f64,
}

/// How well the bytes are packed: a better level takes several times as long, and saves a few per cent.
const LEVEL: Compression = Compression::new(6);

/// The least share of the entries that is tried where the whole matrix is too large, and how many shares are.
const LEAST_SHARE: f64 = 0.02;
const TRIALS: usize = 6;

impl Embedded {
    /// Makes the page of a canvas whose matrix is in memory.
    ///
    /// # Errors
    /// [`Error::Option`] naming `-o` where there is no matrix, and `--max-size` where no thinned one is small enough; those of
    /// [`Canvas::photo`].
    pub fn new(canvas: &mut Canvas<'_>, options: &EmbedOptions) -> Result<Self> {
        if canvas.layers().is_empty() {
            return Err(Error::Option {
                option: "-o".into(),
                fault: "a page without server holds the light transport matrix, and this source has none in memory"
                    .into(),
                help: "give a scene or a matrix, or serve the page".into(),
            });
        }
        let most = options.max_bytes.unwrap_or(usize::MAX);
        let parts = Parts::new(canvas, options)?;
        let (mut share, mut too_much, mut best) = (1.0, f64::INFINITY, None);
        for _ in 0..TRIALS {
            let layers = thinned(canvas.layers(), share);
            let html = parts.html(&layers)?;
            let bytes = html.len();
            // What is not of the matrix does not shrink; a little less than what should fit.
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

    /// Bytes of the file.
    pub fn bytes(&self) -> usize {
        self.html.len()
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn write(&self, path: &Path) -> Result<()> {
        crate::io::atomic::write_bytes(path, self.html.as_bytes())
    }
}

fn too_large(bytes: usize, most: usize) -> Error {
    let mebibytes = |bytes: usize| format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20));
    Error::Option {
        option: "--max-size".into(),
        fault: format!(
            "the page takes {} with {} % of the matrix's entries, more than {}",
            mebibytes(bytes),
            100.0 * LEAST_SHARE,
            mebibytes(most)
        ),
        help: "use a smaller --size, or allow more".into(),
    }
}

/// The relative difference that storing makes to photos, the largest of four.
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

/// What is in the page whatever layers it has.
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
        let mut keep = |ask: &str, answer: &Answer, bytes: &[u8]| {
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

    /// The page with these layers.
    fn html(&self, layers: &[(Light, Columns)]) -> Result<String> {
        let (mut info, mut sections) = (self.info.clone(), self.sections.clone());
        let layer = |(light, columns): &(Light, Columns)| {
            // Each row of these matrices is a column of the layer.
            let of_channels = columns.channels();
            let packed = pack(of_channels, self.precision);
            json!({
                "light": light,
                "rows": of_channels[0].cols(),
                "columns": of_channels[0].rows(),
                "symmetric": packed.is_symmetric,
                "precision": self.precision,
                "scales": packed.scales,
                "positions": sections.add(&packed.positions),
                "values": packed.values.iter().map(|bytes| sections.add(bytes)).collect::<Vec<_>>(),
            })
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

/// Elements that hold deflated bytes as text.
#[derive(Clone, Default)]
struct Sections {
    html: String,
    count: usize,
}

impl Sections {
    /// Adds one; returns its number.
    fn add(&mut self, bytes: &[u8]) -> usize {
        let (number, text) = (self.count, deflated(bytes, LEVEL));
        // Writing to a string cannot fail.
        let _ = writeln!(self.html, "<script type=\"text/plain\" id=\"section-{number}\">{text}</script>");
        self.count += 1;
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::Lab;

    fn options(max_bytes: Option<usize>) -> EmbedOptions {
        EmbedOptions { precision: Precision::Half, max_bytes, kept: Kept::default() }
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
        // Direct light is the largest entries: they are all there.
        assert!(thin.error > whole.error && thin.error < 0.05, "{}", thin.error);
        // The page itself takes more than this.
        let refused = Embedded::new(&mut canvas, &options(Some(10_000)));
        assert!(refused.is_err_and(|error| error.to_string().contains("--max-size")));
        Ok(())
    }
}
