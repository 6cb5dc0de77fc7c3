//! The files and the report page of a light transport segmentation.

use rayon::prelude::*;

use super::{Segmented, features};
use crate::analysis::segment::Truth;
use crate::analysis::{Evidence, MASKED};
use crate::error::Result;
use crate::image::Image;
use crate::io::raster::exposure;
use crate::lab::text::{capital, with_error};
use crate::report::html::{Block, Figure, Legend, Swatch, Values};
use crate::report::palette::{Palette, label_color, paint_labels};
use crate::report::run::AnswerPage;
use crate::report::{figure, spectrum};

impl Segmented {
    /// Writes pictures and features. `white` is the photo under a white pattern.
    pub(super) fn show_on(&self, white: &Image, page: &mut AnswerPage<'_>) -> Result<()> {
        let found = &self.segmentation;
        page.sentence = format!("{} {}.", page.sentence, capital(&found.regions.sentence()));
        page.photos = found.photos;
        let figures = self.groups(white, page)?;
        let text = "Pixels of one colour exchange light with one another, and little with the rest. Groups are numbered from 0, as in the arrays. All numbers of groups come from the same photos. A pixel is sure of its group if the probability of this group, by its coordinates, is 0.95 or more; that the number of groups is right is another question.";
        page.section("Groups", text, [Block::Figures(figures)]);
        self.evidence.iter().try_for_each(|of| evidence(of, page))?;
        let figures = self.eigenvectors(page)?;
        let text = "The generalized eigenvectors of the cut: regions that exchange no light stand apart as areas of one colour. The first is the same everywhere and was known before any photo was taken.";
        page.section("Eigenvectors", text, [Block::Figures(figures)]);
        if let Some(view) = &self.features {
            page.files.text("features.csv", features::csv(view));
            let palette = self.palettes().into_iter().next().unwrap_or_default();
            features::show(found, view, &palette, page);
        }
        let text = format!("{}. From these eigenvalues, {}.", found.status, found.regions.sentence());
        let caption = "Eigenvalues; bars are residual norms. As many at one as there are regions that exchange no light.";
        let blocks = [
            spectrum::stems(&found.eigenvalues, &found.residuals, caption),
            // The first pair is known in advance, so it has no history.
            spectrum::convergence(&found.history, 2),
            spectrum::table((&found.eigenvalues, &[]), &found.residuals, &self.columns()),
        ];
        page.section("Spectrum and convergence", text, blocks);
        page.contact_sheet("Those of direct light come first, where it was measured; then white, which is what each pixel gets from all others; then those of the Krylov process, and of groups lit alone.")?;
        page.fact("Masked pixels", self.masked());
        page.fact("Independent regions", found.regions.count);
        if let Some(direct) = &self.direct {
            page.fact("Photos of direct light", direct.photos);
        }
        if self.blur > 0.0 {
            page.fact("Blur", format_args!("{} px, of patterns and photos", self.blur));
        }
        if !self.evidence.is_empty() {
            let lit: usize = self.evidence.iter().map(|of| of.photos.len()).sum();
            page.fact("Photos of groups lit alone", lit);
        }
        Ok(())
    }

    /// The figures of the white photo, the degree, the true regions, and the groups.
    fn groups(&self, white: &Image, page: &mut AnswerPage<'_>) -> Result<Vec<Figure>> {
        let (found, size) = (&self.segmentation, self.resolution);
        let caption = "The light that each pixel receives from all others: its degree";
        let degree = figure::amounts(size, &found.degree, &page.unit, caption)?;
        let mut figures = vec![
            page.light("white", white, exposure(white), "The photo under white"),
            degree.named("degree", "degree.npy"),
        ];
        if let Some(truth) = &self.truth {
            let painted = (paint_labels(size, &truth.labels), Legend::Swatches(swatches(truth)));
            let values = Values::of_labels(size, &truth.labels);
            let figure = figure::figure(painted, values, "The true regions");
            figures.push(page.picture("labels-true", figure.named("true region", "labels-true.npy")));
        }
        let figure = |((groups, labels), palette): (&(usize, Vec<u8>), Palette)| {
            let score = self.scores.iter().find(|(of, _)| of == groups);
            let score = score.map_or(String::new(), |(_, score)| format!(", adjusted Rand index {score:.4}"));
            let painted = (palette.paint(size, labels), Legend::of_painted_labels(labels, &palette));
            let caption = format!("{groups} groups{score}{}", self.sure(*groups));
            figure::figure(painted, Values::of_labels(size, labels), caption)
                .named(format!("{groups} groups"), format!("labels-{groups}.npy"))
                .in_series("number of groups")
        };
        let painted: Vec<Figure> = found.labels.par_iter().zip(self.palettes()).map(figure).collect();
        for (figure, (groups, _)) in painted.into_iter().zip(&found.labels) {
            figures.push(page.picture(&format!("labels-{groups}"), figure));
        }
        Ok(figures)
    }

    fn eigenvectors(&self, page: &mut AnswerPage<'_>) -> Result<Vec<Figure>> {
        let (found, size) = (&self.segmentation, self.resolution);
        let mut layers = spectrum::layers(size, &found.eigenvectors)?;
        layers.push(("degree".into(), spectrum::narrowed(size, &found.degree)?));
        spectrum::write_layers(page, layers);
        let (mask, embedding) = (Some(found.mask.as_slice()), Some(&found.embedding));
        let pictures = spectrum::pictures(size, &found.eigenvectors, &found.eigenvalues, mask, embedding)?;
        Ok(pictures.into_iter().map(|(name, figure)| page.picture(&name, figure)).collect())
    }

    /// The colours for each number of groups. They match the true regions if these are known, and otherwise the groups for the first number
    /// of groups.
    fn palettes(&self) -> Vec<Palette> {
        let labels = &self.segmentation.labels;
        let reference = self.truth.as_ref().map(|truth| truth.labels.as_slice());
        let reference = reference.or(labels.first().map(|(_, labels)| labels.as_slice())).unwrap_or_default();
        labels.iter().map(|(_, labels)| Palette::default().matched(reference, labels)).collect()
    }

    /// The fraction of pixels whose labels are certain, as the end of a caption.
    fn sure(&self, groups: usize) -> String {
        let text = |share| format!(", {:.1} % of the pixels are sure of theirs", 100.0 * share);
        self.share_of_sure(groups).map(text).unwrap_or_default()
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
}

fn swatches(truth: &Truth) -> Vec<Swatch> {
    let seen = |region: &u8| truth.labels.contains(region);
    let name = |region: u8| truth.regions.get(usize::from(region)).cloned().unwrap_or_default();
    (0..MASKED).filter(seen).map(|region| Swatch { color: label_color(region), text: name(region) }).collect()
}

/// Photos of the scene with one group lit at a time, and the light that the groups exchange.
fn evidence(evidence: &Evidence, page: &mut AnswerPage<'_>) -> Result<()> {
    let percent = |share: f64| format!("{:.2} %", 100.0 * share);
    let kept = evidence.kept();
    let figures = evidence.photos.iter().zip(&kept).enumerate().map(|(group, (photo, kept))| {
        let photo = spectrum::narrowed(page.resolution, photo)?;
        let caption = format!("Group {group} lit alone: it keeps {} of its light", percent(*kept));
        let file = format!("evidence-{}.npy[{group}]", evidence.groups);
        let figure = figure::light(&photo, exposure(&photo), &page.unit, caption);
        Ok(figure.named(format!("light of group {group}"), file).in_series("group lit alone"))
    });
    let row = |(group, shares): (usize, &Vec<f64>)| {
        std::iter::once(format!("group {group}")).chain(shares.iter().map(|share| percent(*share))).collect()
    };
    let figures = Block::Figures(figures.collect::<Result<_>>()?);
    let headers = (0..evidence.groups).map(|group| format!("from {group}"));
    let table = Block::table(
        std::iter::once("arrives in".to_owned()).chain(headers),
        evidence.exchange.iter().enumerate().map(row).collect(),
        "Where the light of each group goes; columns add up to 100 %",
    );
    let text = format!(
        "Each group was lit alone, in its own photo; each picture is developed by itself, and direct light is left out where it was for the groups. What is dark receives nothing from the group. The cut's value, light that leaves its group in shares of each group's light, added up, is {:.4}.",
        evidence.cut()
    );
    page.section(format!("Evidence for {} groups", evidence.groups), text, [figures, table]);
    Ok(())
}
