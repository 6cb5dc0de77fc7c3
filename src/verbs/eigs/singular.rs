//! Singular values with their vectors: arrays, facts and the report page.

use super::{Eigs, converged, headline, history, in_words, missing, sentence, shape};
use crate::error::Result;
use crate::finding::{Finding, decimal};
use crate::image::Resolution;
use crate::krylov::Singular;
use crate::lab::text::{percent, rounded, with_error};
use crate::lab::{Answer, Lab, Verb};
use crate::report::content::{Content, Values};
use crate::report::html::{Block, Figure};
use crate::report::run::AnswerPage;
use crate::report::spectrum;

/// Singular triplets, with the requested number of triplets.
#[derive(Clone, Debug)]
pub struct SingularTriplets {
    /// The triplets.
    pub found: Singular,
    /// The requested number of triplets.
    pub wanted: usize,
    /// The resolutions of photos and of patterns, if vectors are shown as pictures.
    pub sizes: Option<[Resolution; 2]>,
    /// Whether a tolerance was requested. If so, residuals within the noise do not suffice.
    is_strict: bool,
}

impl SingularTriplets {
    pub(super) fn new(found: Singular, asked: &Eigs, sizes: Option<[Resolution; 2]>) -> Self {
        Self { found, wanted: asked.count, sizes, is_strict: asked.tolerance.is_some() }
    }

    fn lines(&self, content: &mut Content<'_>) {
        let found = &self.found;
        content.line(format_args!("photos    {}: {}", found.stats.products, found.stats.status));
        content.line(missing(found.completeness, (found.values.len(), self.wanted), found.confirming));
        if found.disagreement > 1e-12 {
            content.line(format_args!(
                "transpose the photos of the transpose differ from the other photos transposed by {} %",
                percent(found.disagreement)
            ));
        }
        content.line("           singular value        residual");
        for (index, status) in in_words(&found.statuses).iter().enumerate() {
            let value = with_error(found.values[index], found.standard_errors[index]);
            let residual = found.residuals[index];
            content.line(format_args!("  {:>6}   {value:<20}  {residual:.1e}   {status}", index + 1));
        }
    }

    /// The patterns and their photos.
    fn figures(
        &self,
        [of_photos, of_patterns]: [Resolution; 2],
        page: &mut AnswerPage<'_>,
    ) -> Result<Vec<Figure>> {
        let found = &self.found;
        let sides =
            [(of_patterns, "pattern", "right", &found.right), (of_photos, "photo", "left", &found.left)];
        let mut figures = Vec::new();
        for (size, what, file, vectors) in sides {
            let pictures = spectrum::pictures(size, vectors, &found.values, None, None)?;
            for (index, (_, figure)) in pictures.into_iter().enumerate() {
                let name = format!("{what} {}", index + 1);
                let caption = format!("{name}: σ = {}", decimal(found.values[index], 5));
                let figure = figure.named(name, format!("{file}-vectors.npy[{index}]")).in_series(what);
                let file = format!("{file}-{:02}", index + 1);
                figures.push(page.picture(&file, Figure { caption, ..figure }));
            }
        }
        Ok(figures)
    }
}

impl Answer for SingularTriplets {
    fn names(&self) -> [&'static str; 2] {
        [Eigs::NAME, "singular values"]
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn headline(&self) -> String {
        headline("singular values", &self.found.statuses, self.wanted, self.photos(), None)
    }

    fn content(&self) -> Content<'_> {
        let (mut content, found) = (Content::default(), &self.found);
        let count = found.values.len();
        let [of_photos, of_patterns] = [0, 1].map(|side| self.sizes.map(|sizes| sizes[side]));
        content.array("singular-values", &[count], &found.values);
        content.array("residuals", &[count], &found.residuals);
        content.array("standard-errors", &[count], &found.standard_errors);
        content.array("left-vectors", &shape(of_photos, &found.left), Values::Rows(&found.left));
        content.array("right-vectors", &shape(of_patterns, &found.right), Values::Rows(&found.right));
        content.fact("photos", found.stats.products);
        content.fact("status", found.stats.status.to_string());
        let values = found.values.iter().zip(&found.standard_errors);
        let values = values.map(|(&value, &error)| rounded(value, error));
        content.fact("singular_values", values.collect::<Vec<_>>());
        content.fact("residuals", &found.residuals);
        content.fact("standard_errors", &found.standard_errors);
        content.fact("statuses", in_words(&found.statuses));
        content.fact("disagreement", found.disagreement);
        content.fact("completeness", found.completeness);
        content.fact("confirming", found.confirming);
        content.detail("completeness_in_words", found.completeness.to_string());
        content.detail("history", history(&found.history));
        self.lines(&mut content);
        content
    }

    fn findings(&self) -> Vec<Finding> {
        vec![converged("singular values", &self.found.statuses, self.wanted, self.is_strict)]
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let found = &self.found;
        page.sentence = sentence(&self.headline(), found.stats.status, found.completeness);
        if let Some(sizes) = self.sizes {
            let figures = self.figures(sizes, page)?;
            let text = "Signed images of norm 1. Each pattern (right singular vector), projected as far as signs can be, comes back as its photo (left singular vector), σ times as bright; the photo, projected by the exchanged devices, comes back as the pattern.";
            page.section("Patterns and their photos", text, [Block::Figures(figures)]);
        }
        let statuses = in_words(&found.statuses).into_iter().map(String::from).collect();
        let blocks = [
            spectrum::stems(&found.values, &found.residuals, "Singular values; bars are residual norms."),
            spectrum::convergence(&found.history, 1),
            spectrum::table(
                (&found.values, &found.standard_errors),
                &found.residuals,
                &[("verdict", statuses)],
            ),
        ];
        page.section("Singular values and convergence", page.sentence.clone(), blocks);
        page.contact_sheet("")
    }
}
