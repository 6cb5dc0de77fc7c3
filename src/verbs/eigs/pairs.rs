//! Eigenpairs: arrays, facts and the report page.

use serde_json::json;

use super::{Eigs, converged, headline, history, in_words, missing, sentence, shape};
use crate::analysis::EigenpairEstimate;
use crate::error::Result;
use crate::finding::Finding;
use crate::image::Resolution;
use crate::io::manifest::CheckVerdict;
use crate::krylov;
use crate::lab::text::{percent, rounded, signed, with_error};
use crate::lab::{Answer, Lab, Verb, Verified};
use crate::report::content::{Content, Values};
use crate::report::html::{Block, Figure};
use crate::report::run::AnswerPage;
use crate::report::spectrum;
use crate::transport::Part;

/// Eigenpairs, with the requested number of pairs.
#[derive(Clone, Debug)]
pub struct Eigenpairs {
    /// The eigenpairs.
    pub found: krylov::Eigs,
    /// The requested number of pairs.
    pub wanted: usize,
    /// Estimates of the scene's eigenpairs by independent light, one for each pair found; empty before [`Answer::verify`].
    pub estimates: Vec<EigenpairEstimate>,
    /// The verdict of independent light; `None` before [`Answer::verify`], or if there is no such light.
    pub check: Option<CheckVerdict>,
    /// The resolution of a vector, if vectors are shown as pictures.
    pub size: Option<Resolution>,
    part: Part,
    /// Whether a tolerance was requested. If so, residuals within the noise do not suffice.
    is_strict: bool,
}

impl Eigenpairs {
    /// The answer to the request `asked`. `size` is the resolution of vectors, if they are shown as pictures.
    pub fn new(found: krylov::Eigs, asked: &Eigs, size: Option<Resolution>) -> Self {
        let (part, is_strict) = (asked.part.into(), asked.tolerance.is_some());
        Self { found, wanted: asked.count, estimates: Vec::new(), check: None, size, part, is_strict }
    }

    fn is_complex(&self) -> bool {
        self.found.imaginary_values.iter().any(|&value| value != 0.0)
    }

    fn lines(&self, content: &mut Content<'_>) {
        let found = &self.found;
        content.line(missing(found.completeness, (found.values.len(), self.wanted), found.confirming));
        if found.asymmetry > 1e-12 {
            content.line(format_args!("symmetry  {} % off, as measured", percent(found.asymmetry)));
        }
        if !self.estimates.is_empty() {
            content.line("  of the scene, by light paths of another seed as well:");
            content.line("           eigenvalue            residual");
            for (index, of) in self.estimates.iter().enumerate() {
                let residual = of.residual.map(|residual| format!("{residual:.1e}")).unwrap_or_default();
                let value = with_error(of.value, of.standard_error);
                content.line(format_args!("  {:>6}   {value:<20}  {residual}", index + 1));
            }
            content.line("  of the matrix, whose noise is the same in all photos:");
        }
        content.line("           eigenvalue            residual   error at most");
        for (index, status) in in_words(&found.statuses).iter().enumerate() {
            let imaginary = match found.imaginary_values[index] {
                0.0 => String::new(),
                value => format!(" {} i", signed(value, 8)),
            };
            let value = match self.estimates.get(index) {
                // The estimate by independent light, which is printed before, states the error.
                Some(of) => rounded(found.values[index], of.standard_error).to_string(),
                None => with_error(found.values[index], found.standard_errors[index]) + &imaginary,
            };
            content.line(format_args!(
                "  {:>6}   {value:<20}  {:.1e}    {:.1e}   {status}",
                index + 1,
                found.residuals[index],
                found.bounds[index]
            ));
        }
        content.line(format_args!("photos    {}: {}", found.stats.products, found.stats.status));
    }

    fn figures(&self, size: Resolution, page: &mut AnswerPage<'_>) -> Result<Vec<Figure>> {
        spectrum::write_layers(page, spectrum::layers(size, &self.found.vectors)?);
        let pictures = spectrum::pictures(size, &self.found.vectors, &self.found.values, None, None)?;
        Ok(pictures.into_iter().map(|(name, figure)| page.picture(&name, figure)).collect())
    }
}

impl Answer for Eigenpairs {
    fn names(&self) -> [&'static str; 2] {
        [Eigs::NAME, "eigenpairs"]
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn headline(&self) -> String {
        headline("eigenvalues", &self.found.statuses, self.wanted, self.photos(), self.check)
    }

    fn content(&self) -> Content<'_> {
        let (mut content, found) = (Content::default(), &self.found);
        let (count, length) = (found.values.len(), found.vectors.first().map_or(0, Vec::len));
        content.array("eigenvalues", &[count], &found.values);
        content.array("residuals", &[count], &found.residuals);
        content.array("bounds", &[count], &found.bounds);
        if !self.estimates.is_empty() {
            let pairs = self.estimates.iter().flat_map(|of| [of.value, of.standard_error]);
            content.array("eigenvalues-of-scene", &[count, 2], pairs.collect::<Vec<f64>>());
        }
        content.array("eigenvectors", &shape(self.size, &found.vectors), Values::Rows(&found.vectors));
        if self.is_complex() {
            // Real eigenpairs have empty imaginary vectors, which are filled with zeros here.
            let padded = found.imaginary_vectors.iter().map(|vector| match vector.is_empty() {
                true => vec![0.0; length],
                false => vector.clone(),
            });
            let vectors: Vec<Vec<f64>> = padded.collect();
            content.array("eigenvalues-imaginary", &[count], &found.imaginary_values);
            content.array("eigenvectors-imaginary", &shape(self.size, &vectors), vectors.concat());
        }
        content.attribute("gap_bounds", &[count], &found.gap_bounds);
        content.attribute("standard_errors", &[count], &found.standard_errors);
        content.fact("photos", found.stats.products);
        content.fact("status", found.stats.status.to_string());
        let values = found.values.iter().zip(&found.standard_errors);
        content.fact("eigenvalues", values.map(|(&value, &error)| rounded(value, error)).collect::<Vec<_>>());
        content.fact("imaginary_parts", &found.imaginary_values);
        content.fact("residuals", &found.residuals);
        content.fact("bounds", &found.bounds);
        content.fact("standard_errors", &found.standard_errors);
        content.fact("statuses", in_words(&found.statuses));
        content.fact("asymmetry", found.asymmetry);
        content.fact("completeness", found.completeness);
        content.fact("confirming", found.confirming);
        let of_scene = self.estimates.iter().map(|of| {
            json!({
                "eigenvalue": rounded(of.value, of.standard_error),
                "standard_error": of.standard_error,
                "residual": of.residual,
            })
        });
        content.fact("of_scene", of_scene.collect::<Vec<_>>());
        content.detail("completeness_in_words", found.completeness.to_string());
        content.detail("history", history(&found.history));
        self.lines(&mut content);
        content
    }

    fn findings(&self) -> Vec<Finding> {
        vec![converged("eigenpairs", &self.found.statuses, self.wanted, self.is_strict)]
    }

    fn verify(&mut self, lab: &mut Lab) -> Result<Option<Verified>> {
        let Some(verified) = lab.verify_eigenpairs(self.part, &self.found)? else { return Ok(None) };
        for (index, estimate) in verified.estimates.iter().enumerate() {
            self.found.standard_errors[index] = estimate.error_of(self.found.values[index]);
        }
        self.estimates.clone_from(&verified.estimates);
        self.check = Some(verified.verification.verdict);
        Ok(Some(verified))
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        let found = &self.found;
        page.sentence = sentence(&self.headline(), found.stats.status, found.completeness);
        match self.size {
            None => page.strip = None,
            Some(size) => {
                let figures = self.figures(size, page)?;
                let text = "Signed images of norm 1. Projected (as far as signs can be), each would come back as a photo of itself.";
                page.section("Eigenvectors", text, [Block::Figures(figures)]);
            }
        }
        let statuses = in_words(&found.statuses).into_iter().map(String::from).collect();
        let bounds = found.bounds.iter().map(|bound| format!("{bound:.1e}")).collect();
        let mut columns = vec![("error at most", bounds), ("verdict", statuses)];
        if !self.estimates.is_empty() {
            let of_scene = |of: &EigenpairEstimate| with_error(of.value, of.standard_error);
            columns.insert(0, ("of the scene", self.estimates.iter().map(of_scene).collect()));
        }
        if self.is_complex() {
            let imaginary = found.imaginary_values.iter().map(|&value| signed(value, 6) + " i").collect();
            columns.insert(0, ("imaginary part", imaginary));
        }
        let blocks = [
            spectrum::stems(&found.values, &found.residuals, "Eigenvalues; bars are residual norms."),
            spectrum::convergence(&found.history, 1),
            spectrum::table((&found.values, &found.standard_errors), &found.residuals, &columns),
        ];
        page.section("Spectrum and convergence", page.sentence.clone(), blocks);
        page.contact_sheet("")
    }
}
