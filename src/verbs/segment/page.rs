//! The files and the report page of a light transport segmentation.

use rayon::prelude::*;

use super::{Segmented, features};
use crate::analysis::segment::Truth;
use crate::analysis::{Evidence, MASKED};
use crate::error::Result;
use crate::image::Image;
use crate::io::exr;
use crate::io::raster::exposure;
use crate::lab::Answer;
use crate::lab::text::with_error;
use crate::report::html::{Block, Figure, Legend, Report, Section, Swatch, Values};
use crate::report::palette::{Palette, label_color, paint_labels};
use crate::report::run::{Files, Run};
use crate::report::{figure, spectrum};

impl Segmented {
    /// Writes arrays, pictures and `report.html` into the run's folder and returns their names. `white` is the photo under a white pattern.
    pub(super) fn write_page(&self, white: &Image, run: &Run<'_>) -> Result<Vec<String>> {
        let found = &self.segmentation;
        let mut files = Files::of(run.folder, &self.content())?;
        if let Some(view) = &self.features {
            files.text("features.csv", &features::csv(view))?;
        }
        files.image("white", white)?;
        let mut layers = spectrum::layers(self.resolution, &found.eigenvectors)?;
        layers.push(("degree".into(), spectrum::narrowed(self.resolution, &found.degree)?));
        let layers: Vec<(&str, &Image)> = layers.iter().map(|(name, image)| (name.as_str(), image)).collect();
        exr::write_exr(&files.path("eigenvectors.exr"), &layers)?;
        let pictures = self.pictures(white, run)?;
        for (name, figure) in &pictures.all() {
            files.picture(name, figure)?;
        }
        files.finish(self.page(run, pictures)?)
    }

    fn pictures(&self, white: &Image, run: &Run<'_>) -> Result<Pictures> {
        let white = figure::light(white, exposure(white), run.unit, "The photo under white")?
            .named("white", "white.npy");
        let truth = self.truth.as_ref().map(|truth| {
            Ok(Figure {
                png: paint_labels(run.resolution, &truth.labels).encode_png()?,
                caption: "The true regions".into(),
                legend: Legend::Swatches(swatches(truth)),
                values: Some(Values::of_labels(run.resolution, &truth.labels)),
                ..Figure::default()
            }
            .named("true region", "labels-true.npy"))
        });
        let labels =
            self.segmentation.labels.par_iter().zip(self.palettes()).map(|((groups, labels), palette)| {
                let score = self.scores.iter().find(|(of, _)| of == groups);
                let score =
                    score.map_or(String::new(), |(_, score)| format!(", adjusted Rand index {score:.4}"));
                let figure = Figure {
                    png: palette.paint(run.resolution, labels).encode_png()?,
                    caption: format!("{groups} groups{score}{}", self.sure(*groups)),
                    legend: Legend::of_painted_labels(labels, &palette),
                    values: Some(Values::of_labels(run.resolution, labels)),
                    ..Figure::default()
                };
                let figure = figure
                    .named(format!("{groups} groups"), format!("labels-{groups}.npy"))
                    .in_series("number of groups");
                Ok((format!("labels-{groups}"), figure))
            });
        let found = &self.segmentation;
        let caption = "The light that each pixel receives from all others: its degree";
        let degree =
            figure::amounts(run.resolution, &found.degree, run.unit, caption)?.named("degree", "degree.npy");
        let eigenvectors = spectrum::pictures(
            run.resolution,
            &found.eigenvectors,
            &found.eigenvalues,
            Some(&found.mask),
            Some(&found.embedding),
        )?;
        Ok(Pictures {
            white,
            truth: truth.transpose()?,
            labels: labels.collect::<Result<_>>()?,
            eigenvectors,
            degree,
        })
    }

    /// The colours for each number of groups. They match the true regions if these are known, or else the groups of the first number.
    fn palettes(&self) -> Vec<Palette> {
        let labels = &self.segmentation.labels;
        let reference = self.truth.as_ref().map(|truth| truth.labels.as_slice());
        let reference = reference.or(labels.first().map(|(_, labels)| labels.as_slice())).unwrap_or_default();
        labels.iter().map(|(_, labels)| Palette::default().matched(reference, labels)).collect()
    }

    /// The share of certain labels, as the end of a caption.
    fn sure(&self, groups: usize) -> String {
        match self.share_of_sure(groups) {
            Some(share) => format!(", {:.1} % of the pixels are sure of theirs", 100.0 * share),
            None => String::new(),
        }
    }

    fn page(&self, run: &Run<'_>, pictures: Pictures) -> Result<Report> {
        let found = &self.segmentation;
        let figures =
            |of: Vec<(String, Figure)>| Block::Figures(of.into_iter().map(|(_, figure)| figure).collect());
        let beside = [Some(pictures.white), Some(pictures.degree), pictures.truth].into_iter().flatten();
        let groups =
            Block::Figures(beside.chain(pictures.labels.into_iter().map(|(_, figure)| figure)).collect());
        let mut sections = vec![Section {
            title: "Groups".into(),
            text: "Pixels of one colour exchange light with one another, and little with the rest. Groups are numbered from 0, as in the arrays. All numbers of groups come from the same photos. A pixel is sure of its group if the probability of this group, by its coordinates, is 0.95 or more; that the number of groups is right is another question.".into(),
            blocks: vec![groups],
        }];
        for of in &self.evidence {
            sections.push(evidence(run, of)?);
        }
        sections.push(Section {
            title: "Eigenvectors".into(),
            text: "The generalized eigenvectors of the cut: regions that exchange no light stand apart as areas of one colour. The first is the same everywhere and was known before any photo was taken.".into(),
            blocks: vec![figures(pictures.eigenvectors)],
        });
        if let Some(view) = &self.features {
            let palette = self.palettes().into_iter().next().unwrap_or_default();
            sections.push(features::section(found, view, &palette));
        }
        sections.push(Section {
            title: "Spectrum and convergence".into(),
            text: format!("{}. From these eigenvalues {}.", found.status, found.regions.sentence()),
            blocks: vec![
                spectrum::stems(&found.eigenvalues, &found.residuals, "Eigenvalues; bars are residual norms. As many at one as there are regions that exchange no light."),
                // The first pair is known in advance and has no history.
                spectrum::convergence(&found.history, 2),
                spectrum::table((&found.eigenvalues, &[]), &found.residuals, &self.columns()),
            ],
        });
        sections.extend(run.photos(ORDER)?);
        let mut more = vec![
            ("Masked pixels", self.masked().to_string()),
            ("Independent regions", found.regions.count.to_string()),
        ];
        more.extend(self.direct.as_ref().map(|direct| ("Photos of direct light", direct.photos.to_string())));
        if self.blur > 0.0 {
            more.push(("Blur", format!("{} px, of patterns and photos", self.blur)));
        }
        let lit: usize = self.evidence.iter().map(|of| of.photos.len()).sum();
        more.extend((lit > 0).then(|| ("Photos of groups lit alone", lit.to_string())));
        Ok(run.page((self.findings(), self.headline()), found.photos, more, sections))
    }

    /// Further table columns: the eigenvalues of the scene and the localization of eigenvectors, if there are any.
    fn columns(&self) -> Vec<(&'static str, Vec<String>)> {
        let mut columns = Vec::new();
        if !self.estimates.is_empty() {
            let of_scene = self.estimates.iter().map(|of| with_error(of.value, of.standard_error));
            columns.push(("of the scene", std::iter::once("1, known".into()).chain(of_scene).collect()));
        }
        let embedding = &self.segmentation.embedding;
        let mark = |index| if embedding.is_local(index) { "a few pixels alone" } else { "regions" };
        let marks = (0..embedding.within.len()).map(|index| mark(index).to_owned()).collect();
        if embedding.local() > 0 {
            columns.push(("tells of", marks));
        }
        columns
    }

    fn headline(&self) -> String {
        let found = &self.segmentation;
        let regions = found.regions.sentence();
        let best = self.scores.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let photos = found.photos;
        match best {
            Some((groups, score)) => {
                format!(
                    "{photos} photos; at {groups} groups the adjusted Rand index against the true regions is {score:.4}; {regions}."
                )
            }
            None => format!("{}; {regions}.", found.status),
        }
    }
}

fn swatches(truth: &Truth) -> Vec<Swatch> {
    let seen = |region: &u8| truth.labels.contains(region);
    let name = |region: u8| truth.regions.get(usize::from(region)).cloned().unwrap_or_default();
    (0..MASKED).filter(seen).map(|region| Swatch { color: label_color(region), text: name(region) }).collect()
}

const ORDER: &str = "Those of direct light come first, where it was measured; then white, which is what each pixel gets from all others; then those of the Krylov process, and of groups lit alone.";

struct Pictures {
    white: Figure,
    truth: Option<Figure>,
    labels: Vec<(String, Figure)>,
    eigenvectors: Vec<(String, Figure)>,
    degree: Figure,
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

/// Photos of single groups that are lit alone, and the light that the groups exchange.
fn evidence(run: &Run<'_>, evidence: &Evidence) -> Result<Section> {
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let kept = evidence.kept();
    let figures = evidence.photos.iter().zip(&kept).enumerate().map(|(group, (photo, kept))| {
        let photo = spectrum::narrowed(run.resolution, photo)?;
        let caption = format!("Group {group} lit alone: it keeps {} of its light", percent(*kept));
        let file = format!("evidence-{}.npy[{group}]", evidence.groups);
        let figure = figure::light(&photo, exposure(&photo), run.unit, caption)?;
        Ok(figure.named(format!("light of group {group}"), file).in_series("group lit alone"))
    });
    let row = |(group, shares): (usize, &Vec<f64>)| {
        std::iter::once(format!("group {group}")).chain(shares.iter().map(|share| percent(*share))).collect()
    };
    let table = Block::Table {
        headers: std::iter::once("arrives in".to_owned())
            .chain((0..evidence.groups).map(|group| format!("from {group}")))
            .collect(),
        rows: evidence.exchange.iter().enumerate().map(row).collect(),
        caption: "Where the light of each group goes; columns add up to 100 %".into(),
    };
    Ok(Section {
        title: format!("Evidence for {} groups", evidence.groups),
        text: format!(
            "Each group was lit alone, in its own photo; each picture is developed by itself, and direct light is left out where it was for the groups. What is dark receives nothing from the group. The cut's value, light that leaves its group in shares of each group's light, added up, is {:.4}.",
            evidence.cut()
        ),
        blocks: vec![Block::Figures(figures.collect::<Result<_>>()?), table],
    })
}
