//! Files and report page of a light transport segmentation.

mod evidence;
mod features;

use std::path::Path;

use super::contact_sheet::ContactSheet;
use super::html::{Block, Figure, Legend, Outcome, Report, Section, Swatch, Verdict};
use super::palette::{label_color, paint_labels};
use super::run::{self, Files};
use super::{figure, spectrum};
use crate::analysis::segment::Truth;
use crate::analysis::{Evidence, FeatureView, MASKED, Segmentation, Separation};
use crate::error::Result;
use crate::image::{Image, Resolution};
use crate::io::tone::exposure;
use crate::io::{exr, npy, picture};
use crate::measure::RunManifest;

/// A finished segmentation and the context that its report needs.
#[derive(Clone, Debug)]
pub struct SegmentationRun<'a> {
    /// The page's title.
    pub title: String,
    /// The result.
    pub segmentation: &'a Segmentation,
    /// Resolution of the segmentation.
    pub resolution: Resolution,
    /// The photo under a white pattern.
    pub white: &'a Image,
    /// True labels, if the scene has them.
    pub truth: Option<&'a Truth>,
    /// Adjusted Rand index for each number of groups; empty without true labels.
    pub scores: &'a [(usize, f64)],
    /// Optional results.
    pub extras: SegmentationExtras<'a>,
    /// Unit of the photos' values.
    pub unit: &'a str,
    /// Contact sheet of all photos.
    pub strip: &'a ContactSheet,
}

/// Optional results; empty by default.
#[derive(Clone, Copy, Debug, Default)]
pub struct SegmentationExtras<'a> {
    /// Direct light that was measured by photos and excluded from the graph.
    pub direct: Option<&'a Separation>,
    /// Chosen pixels in the space of eigenvectors.
    pub features: Option<&'a FeatureView>,
    /// Photos of each group lit alone, for some of the numbers of groups.
    pub evidence: &'a [Evidence],
}

impl SegmentationExtras<'_> {
    /// Number of photos taken for the optional results.
    pub fn photos(&self) -> usize {
        let evidence: usize = self.evidence.iter().map(|of| of.photos.len()).sum();
        evidence + self.direct.map_or(0, |direct| direct.photos)
    }
}

impl SegmentationRun<'_> {
    /// Writes arrays, pictures and `report.html` into `folder` and returns their names. `seconds` is the run's duration so far.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file.
    pub fn write(&self, folder: &Path, manifest: &RunManifest, seconds: f64) -> Result<Vec<String>> {
        let mut files = Files::new(folder);
        self.write_arrays(&mut files)?;
        self.write_extras(&mut files)?;
        let pictures = self.pictures()?;
        for (name, figure) in &pictures.all() {
            crate::io::atomic::write_bytes(&files.path(&format!("{name}.png")), &figure.png)?;
        }
        self.page(pictures, manifest, seconds)?.write(&files.path("report.html"))?;
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
        let mut layers = spectrum::layers(self.resolution, &found.eigenvectors)?;
        layers.push(("degree".into(), spectrum::narrowed(self.resolution, &found.degree)?));
        let layers: Vec<(&str, &Image)> = layers.iter().map(|(name, image)| (name.as_str(), image)).collect();
        exr::write_exr(&files.path("eigenvectors.exr"), &layers)
    }

    fn write_extras(&self, files: &mut Files<'_>) -> Result<()> {
        let Resolution { width, height } = self.resolution;
        if let Some(direct) = self.extras.direct {
            npy::write_npy(&files.path("direct.npy"), &[height, width], &direct.direct)?;
        }
        if let Some(view) = self.extras.features {
            crate::io::atomic::write_bytes(&files.path("features.csv"), features::csv(view).as_bytes())?;
        }
        for evidence in self.extras.evidence {
            let name = format!("evidence-{}.npy", evidence.groups);
            npy::write_npy(&files.path(&name), &[evidence.groups, height, width], &evidence.photos.concat())?;
        }
        Ok(())
    }

    fn pictures(&self) -> Result<Pictures> {
        let white = figure::light(self.white, exposure(self.white), self.unit, "The photo under white")?;
        let truth = self.truth.map(|truth| {
            Ok(Figure {
                png: paint_labels(self.resolution, &truth.labels).encode_png()?,
                caption: "The true regions".into(),
                legend: Legend::Swatches(swatches(truth)),
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
        let eigenvectors =
            spectrum::pictures(self.resolution, &found.eigenvectors, &found.eigenvalues, Some(&found.mask))?;
        Ok(Pictures {
            white,
            truth: truth.transpose()?,
            labels: labels.collect::<Result<_>>()?,
            eigenvectors,
        })
    }

    fn page(&self, pictures: Pictures, manifest: &RunManifest, seconds: f64) -> Result<Report> {
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
        for of in self.extras.evidence {
            sections.push(evidence::section(self, of)?);
        }
        sections.push(Section {
            title: "Eigenvectors".into(),
            text: "The generalized eigenvectors of the cut: regions that exchange no light stand apart as areas of one colour. The first is the same everywhere and was known before any photo was taken.".into(),
            blocks: vec![figures(pictures.eigenvectors)],
        });
        if let Some(view) = self.extras.features {
            sections.push(features::section(self, view));
        }
        sections.push(Section {
            title: "Spectrum and convergence".into(),
            text: format!("{}. From these eigenvalues {}.", found.status, found.regions.sentence()),
            blocks: vec![
                spectrum::stems(&found.eigenvalues, &found.residuals, "Eigenvalues; bars are residual norms. As many at one as there are regions that exchange no light."),
                // The first pair is known in advance and has no history.
                spectrum::convergence(&found.history, 2),
                spectrum::table(&found.eigenvalues, &found.residuals, &self.local()),
            ],
        });
        sections.extend(self.strip.section(self.unit, ORDER)?);
        let masked = found.mask.iter().filter(|&&masked| masked).count();
        let mut more = vec![
            ("Masked pixels", masked.to_string()),
            ("Independent regions", found.regions.count.to_string()),
        ];
        more.extend(self.extras.direct.map(|direct| ("Photos of direct light", direct.photos.to_string())));
        let lit: usize = self.extras.evidence.iter().map(|of| of.photos.len()).sum();
        more.extend((lit > 0).then(|| ("Photos of groups lit alone", lit.to_string())));
        Ok(Report {
            title: self.title.clone(),
            verdict: Verdict { outcome: Outcome::Good, sentence: self.sentence() },
            facts: run::facts(manifest, found.photos, more, seconds),
            sections,
            footer: manifest.command.join(" "),
        })
    }

    /// A table column that marks localized eigenvectors; empty if there are none.
    fn local(&self) -> Vec<(&'static str, Vec<String>)> {
        let embedding = &self.segmentation.embedding;
        let mark = |index| if embedding.is_local(index) { "a few pixels alone" } else { "regions" };
        let marks = (0..embedding.within.len()).map(|index| mark(index).to_owned()).collect();
        if embedding.local() == 0 { Vec::new() } else { vec![("tells of", marks)] }
    }

    fn sentence(&self) -> String {
        let regions = self.segmentation.regions.sentence();
        let best = self.scores.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let photos = self.segmentation.photos;
        match best {
            Some((groups, score)) => {
                format!(
                    "{photos} photos; at {groups} groups the adjusted Rand index against the true regions is {score:.4}; {regions}."
                )
            }
            None => format!("{}; {regions}.", self.segmentation.status),
        }
    }
}

/// Colour and name of each region that some pixel sees.
fn swatches(truth: &Truth) -> Vec<Swatch> {
    let seen = |region: &u8| truth.labels.contains(region);
    let name = |region: u8| truth.regions.get(usize::from(region)).cloned().unwrap_or_default();
    (0..MASKED).filter(seen).map(|region| Swatch { color: label_color(region), text: name(region) }).collect()
}

/// Explains the order of the photos.
const ORDER: &str = "Those of direct light come first, where it was measured; then white, which is what each pixel gets from all others; then those of the Krylov process, and of groups lit alone.";

/// All pictures of the run with their file names.
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
