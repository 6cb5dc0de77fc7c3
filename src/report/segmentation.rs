//! The files and the page of a light transport segmentation.

use std::path::Path;

use super::colormap::{paint_signed, robust_range};
use super::html::{Block, Figure, Legend, Outcome, Report, Section, Swatch, Verdict};
use super::manifest::Manifest;
use super::palette::{label_color, paint_labels};
use super::plot::{LinePlot, Series, StemPlot};
use super::tone::{develop, exposure};
use super::{exr, npy, picture};
use crate::analysis::{MASKED, Segmentation};
use crate::error::Result;
use crate::image::{Image, Resolution};

/// The author's labels of a scene.
#[derive(Clone, Debug)]
pub struct Truth {
    /// Region of each pixel (`n`); [`MASKED`] where there is none.
    pub labels: Vec<u8>,
    /// The regions' names.
    pub regions: Vec<String>,
}

impl Truth {
    /// How many regions are to be seen.
    pub fn seen(&self) -> usize {
        (0..MASKED).filter(|region| self.labels.contains(region)).count()
    }
}

/// A finished segmentation with what belongs beside it.
#[derive(Clone, Debug)]
pub struct SegmentationRun<'a> {
    /// The page's title.
    pub title: String,
    /// The result.
    pub segmentation: &'a Segmentation,
    /// Its pixels.
    pub resolution: Resolution,
    /// The photo under a white pattern.
    pub white: &'a Image,
    /// True labels, where the scene has them.
    pub truth: Option<&'a Truth>,
    /// Adjusted Rand index for each number of groups; empty without truth.
    pub scores: &'a [(usize, f64)],
}

impl SegmentationRun<'_> {
    /// Writes arrays, pictures and `report.html` into `folder`; `seconds` is what the run took so far. Returns the files' names.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &Manifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files { folder, names: Vec::new() };
        self.write_arrays(&mut files)?;
        let pictures = self.pictures()?;
        for (name, figure) in &pictures.all() {
            super::atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
        }
        self.page(pictures, manifest, seconds).write(&files.path("report.html"))?;
        Ok(files.names)
    }

    fn write_arrays(&self, files: &mut Files<'_>) -> Result<()> {
        let Resolution { width, height } = self.resolution;
        let found = self.segmentation;
        let count = found.eigenvectors.len();
        npy::write_npy(&files.path("eigenvalues.npy"), &[count], &found.eigenvalues)?;
        npy::write_npy(&files.path("residuals.npy"), &[count], &found.residuals)?;
        npy::write_npy(
            &files.path("eigenvectors.npy"),
            &[count, height, width],
            &found.eigenvectors.concat(),
        )?;
        npy::write_npy(&files.path("degree.npy"), &[height, width], &found.degree)?;
        for (groups, labels) in &found.labels {
            npy::write_npy(&files.path(&format!("labels-{groups}.npy")), &[height, width], labels)?;
        }
        if let Some(truth) = self.truth {
            npy::write_npy(&files.path("labels-true.npy"), &[height, width], &truth.labels)?;
        }
        for name in ["white.npy", "white.exr"] {
            picture::write(&files.path(name), self.white)?;
        }
        let narrow =
            |values: &[f64]| Image::new(self.resolution, 1, values.iter().map(|&v| v as f32).collect());
        let layers: Vec<(String, Image)> = found
            .eigenvectors
            .iter()
            .enumerate()
            .map(|(index, vector)| Ok((format!("eigenvector{:02}", index + 1), narrow(vector)?)))
            .chain([Ok(("degree".into(), narrow(&found.degree)?))])
            .collect::<Result<_>>()?;
        let layers: Vec<(&str, &Image)> = layers.iter().map(|(name, image)| (name.as_str(), image)).collect();
        exr::write_exr(&files.path("eigenvectors.exr"), &layers)
    }

    fn pictures(&self) -> Result<Pictures> {
        let white = Figure {
            png: develop(self.white, exposure(self.white)).encode_png()?,
            caption: "The photo under white".into(),
            legend: Legend::None,
        };
        let truth = self.truth.map(|truth| {
            Ok(Figure {
                png: paint_labels(self.resolution, &truth.labels).encode_png()?,
                caption: "The true regions".into(),
                legend: Legend::Swatches(truth.swatches()),
            })
        });
        let labels = self.segmentation.labels.iter().map(|(groups, labels)| {
            let score = self.scores.iter().find(|(of, _)| of == groups);
            let score = score.map_or(String::new(), |(_, score)| format!(", adjusted Rand index {score:.4}"));
            let figure = Figure {
                png: paint_labels(self.resolution, labels).encode_png()?,
                caption: format!("{groups} groups{score}"),
                legend: Legend::of_labels(labels),
            };
            Ok((format!("labels-{groups}"), figure))
        });
        let found = self.segmentation;
        let eigenvectors = found.eigenvectors.iter().enumerate().map(|(index, vector)| {
            let range = robust_range(vector, Some(&found.mask));
            let figure = Figure {
                png: paint_signed(self.resolution, vector, Some(&found.mask), range)?.encode_png()?,
                caption: format!("{}: λ = {:.5}", index + 1, found.eigenvalues[index]),
                legend: Legend::signed(range),
            };
            Ok((format!("eigenvector-{:02}", index + 1), figure))
        });
        Ok(Pictures {
            white,
            truth: truth.transpose()?,
            labels: labels.collect::<Result<_>>()?,
            eigenvectors: eigenvectors.collect::<Result<_>>()?,
        })
    }

    fn page(&self, pictures: Pictures, manifest: &Manifest, seconds: f64) -> Report {
        let found = self.segmentation;
        let figures =
            |of: Vec<(String, Figure)>| Block::Figures(of.into_iter().map(|(_, figure)| figure).collect());
        let beside = [Some(pictures.white), pictures.truth].into_iter().flatten();
        let groups =
            Block::Figures(beside.chain(pictures.labels.into_iter().map(|(_, figure)| figure)).collect());
        let mut sections = vec![Section {
            title: "Groups".into(),
            text: "Pixels of one colour exchange light with one another, and little with the rest. All numbers of groups come from the same photos.".into(),
            blocks: vec![groups],
        }];
        sections.push(Section {
            title: "Eigenvectors".into(),
            text: "The generalized eigenvectors of the cut: regions that exchange no light stand apart as areas of one colour. The first is the same everywhere and was known before any photo was taken.".into(),
            blocks: vec![figures(pictures.eigenvectors)],
        });
        sections.push(Section {
            title: "Spectrum and convergence".into(),
            text: format!("{}.", found.status),
            blocks: vec![self.spectrum(), self.convergence(), self.table()],
        });
        Report {
            title: self.title.clone(),
            verdict: Verdict { outcome: Outcome::Good, sentence: self.sentence() },
            facts: facts(manifest, found, seconds),
            sections,
            footer: manifest.command.join(" "),
        }
    }

    fn sentence(&self) -> String {
        let best = self.scores.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let photos = self.segmentation.photos;
        match best {
            Some((groups, score)) => {
                format!(
                    "{photos} photos; at {groups} groups the adjusted Rand index against the true regions is {score:.4}."
                )
            }
            None => format!("{}.", self.segmentation.status),
        }
    }

    fn spectrum(&self) -> Block {
        let plot = StemPlot {
            x_label: "eigenvector".into(),
            y_label: "eigenvalue λ".into(),
            values: self.segmentation.eigenvalues.clone(),
            errors: self.segmentation.residuals.clone(),
        };
        Block::Plot { svg: plot.render(), caption: "Eigenvalues; bars are residual norms. As many at one as there are regions that exchange no light.".into() }
    }

    fn convergence(&self) -> Block {
        let history = &self.segmentation.history;
        let pairs = history.last().map_or(0, |row| row.residuals.len()).min(5);
        let series = (0..pairs).map(|pair| Series {
            // The known first pair has no history.
            name: format!("λ{}", pair + 2),
            points: history
                .iter()
                .filter_map(|row| Some((row.products as f64, *row.residuals.get(pair)?)))
                .collect(),
        });
        let plot = LinePlot {
            x_label: "photos".into(),
            y_label: "residual norm".into(),
            logarithmic: true,
            series: series.collect(),
            marks: Vec::new(),
        };
        Block::Plot {
            svg: plot.render(),
            caption: "Residual norms of the leading eigenpairs as photos are taken; they cost no photo."
                .into(),
        }
    }

    fn table(&self) -> Block {
        let found = self.segmentation;
        let rows = found.eigenvalues.iter().zip(&found.residuals).enumerate();
        Block::Table {
            headers: ["", "eigenvalue", "residual norm"].map(String::from).to_vec(),
            rows: rows
                .map(|(index, (value, residual))| {
                    vec![(index + 1).to_string(), format!("{value:.6}"), format!("{residual:.1e}")]
                })
                .collect(),
            caption: "Eigenvalues with their residual norms".into(),
        }
    }
}

impl Truth {
    fn swatches(&self) -> Vec<Swatch> {
        let seen = |region: &u8| self.labels.contains(region);
        let name = |region: u8| self.regions.get(usize::from(region)).cloned().unwrap_or_default();
        (0..MASKED)
            .filter(seen)
            .map(|region| Swatch { color: label_color(region), text: name(region) })
            .collect()
    }
}

fn facts(manifest: &Manifest, found: &Segmentation, seconds: f64) -> Vec<(String, String)> {
    let masked = found.mask.iter().filter(|&&masked| masked).count();
    let mut facts = vec![("Photos", found.photos.to_string())];
    facts.extend(manifest.scene.as_ref().map(|scene| ("Scene", scene.path.clone())));
    facts.extend(manifest.resolution.map(|resolution| ("Pixels", resolution.to_string())));
    facts.extend(manifest.samples_per_pixel.map(|samples| ("Samples per pixel", samples.to_string())));
    facts.extend(manifest.max_bounces.map(|bounces| ("Bounces at most", bounces.to_string())));
    facts.push(("Masked pixels", masked.to_string()));
    facts.extend(manifest.seed.map(|seed| ("Seed", seed.to_string())));
    facts.extend(manifest.adapter.as_ref().map(|adapter| ("Adapter", adapter.name.clone())));
    facts.push(("Time", format!("{seconds:.1} s")));
    facts.push(("Started", manifest.started.clone()));
    facts.push(("krylux", manifest.version.clone()));
    facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Every picture of the run, by its file's name.
struct Pictures {
    white: Figure,
    truth: Option<Figure>,
    labels: Vec<(String, Figure)>,
    eigenvectors: Vec<(String, Figure)>,
}

impl Pictures {
    fn all(&self) -> Vec<(&str, &Figure)> {
        let mut all = vec![("white", &self.white)];
        all.extend(self.truth.as_ref().map(|truth| ("labels-true", truth)));
        all.extend(
            self.labels.iter().chain(&self.eigenvectors).map(|(name, figure)| (name.as_str(), figure)),
        );
        all
    }
}

/// Names of the files written, as they are asked for.
struct Files<'a> {
    folder: &'a Path,
    names: Vec<String>,
}

impl Files<'_> {
    fn path(&mut self, name: &str) -> std::path::PathBuf {
        self.names.push(name.to_owned());
        self.folder.join(name)
    }
}
