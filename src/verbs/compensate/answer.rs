//! The answer of a compensation.

use std::fmt::Write;
use std::path::PathBuf;

use serde_json::json;

use super::Compensate;
use crate::analysis::{Clamping, CompensateOptions, Compensation, CompensationRow, MethodRun, Similarity};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio, decimal};
use crate::krylov::Method;
use crate::lab::text::{capital, percentage};
use crate::lab::{Answer, Lab, Verb, Verified};
use crate::report::content::Content;
use crate::report::run::AnswerPage;

/// A compensation with its options.
#[derive(Clone, Debug)]
pub struct Compensated {
    /// The pattern, its photo, and the history of the method.
    pub found: Compensation,
    /// The options of the method.
    pub options: CompensateOptions,
    /// The runs of all methods with the same number of photos; empty if they were not requested.
    pub methods: Vec<MethodRun>,
    /// The photo of the compensation by independent light, and its residual; `None` before [`Answer::verify`].
    pub verified: Option<Verified>,
    /// The name and the unit of the model that answered without photos.
    pub(super) model: Option<(String, String)>,
    /// Whether the colours of projector and camera mix. If so, a photo is not the sum of the photos of single channels.
    pub(super) is_mixed: bool,
    /// The file in the open run that contains the pattern to project.
    pub(super) file: Option<PathBuf>,
}

impl Compensated {
    pub(super) fn new(
        asked: &Compensate,
        found: Compensation,
        options: CompensateOptions,
        lab: &mut Lab,
    ) -> Self {
        Self {
            found,
            options,
            methods: Vec::new(),
            verified: None,
            model: None,
            is_mixed: asked.crosstalk.is_some(),
            file: lab.run().map(|run| run.path.join("compensation.npy")),
        }
    }

    pub(super) fn method(&self) -> &'static str {
        self.options.method.facts().name
    }

    /// A warning about the cost of clamping, if this cost is large.
    fn warning(&self) -> Option<String> {
        self.found.clamping.as_ref().and_then(Clamping::warning)
    }

    fn arrays<'a>(&'a self, content: &mut Content<'a>) {
        let found = &self.found;
        content.image("compensation", &found.pattern);
        content.image("observed", &found.observed);
        content.image("uncompensated", &found.uncompensated);
        content.image("target", &found.target);
        if let Some(image) = &found.unclipped {
            content.image("unclipped", image);
        }
        if let Some([photo, errors]) = self.verified.as_ref().and_then(|found| found.photo.as_ref()) {
            content.image("observed-by-independent-light", photo);
            content.image("standard-error", errors);
        }
        for (name, rows) in [("history", &found.history), ("baseline", &found.baseline)] {
            content.attribute(name, &[rows.len()], residuals(rows));
        }
    }

    fn facts(&self, content: &mut Content<'_>) {
        let found = &self.found;
        content.fact("method", self.method());
        content.fact("photos", found.photos);
        content.fact("photos_before", found.preparation);
        content.fact("status", found.status.to_string());
        content.fact("peak", found.peak);
        content.fact("relative_residual", found.residual);
        content.fact("relative_residual_unclipped", found.unclipped_residual);
        content.fact("relative_residual_uncompensated", found.uncompensated_residual);
        content.fact("relative_residual_least", found.least_residual);
        content.fact("relative_residual_jacobi", found.baseline.last().map(|row| row.residual));
        content.fact("clipped", found.unclipped.is_some());
        content.fact("likeness", found.similarity);
        content.fact("likeness_uncompensated", found.uncompensated_similarity);
        let clamping = found.clamping.as_ref().map(|clamping| {
            json!({
                "relative_residual_displayed": residuals(&clamping.displayed),
                "relative_residual_krylov_box": residuals(&clamping.boxed),
                "warning": clamping.warning(),
            })
        });
        content.fact("clamping", clamping);
        content.fact("residuals", residuals(&found.history));
        let methods = self.methods.iter().map(|run| {
            json!({
                "method": run.name,
                "photos": run.photos,
                "frames": run.frames,
                "relative_residual": run.residual,
                "ssim": run.ssim,
                "residuals": residuals(&run.history),
                "residuals_displayed": residuals(&run.displayed),
            })
        });
        content.fact("methods", methods.collect::<Vec<_>>());
        content
            .fact("residual_by_independent_light", self.verified.as_ref().and_then(|found| found.residual));
        content.detail("photos_of_method", found.photos);
        content.detail("ended", found.status.to_string());
        content.detail("good", found.good);
    }

    fn lines(&self, content: &mut Content<'_>) {
        let found = &self.found;
        let [residual, unclipped, uncompensated] =
            [found.residual, found.unclipped_residual, found.uncompensated_residual].map(|of| decimal(of, 4));
        content.line(format_args!("residual  {residual} of the target; {uncompensated} uncompensated"));
        if let Some(least) = found.least_residual {
            content.line(format_args!(
                "least     no pattern in the range has a residual below {}",
                decimal(least, 4)
            ));
        }
        if let Some(row) = found.baseline.last() {
            content.line(format_args!(
                "baseline  {} by projected Jacobi with as many photos (not counted)",
                decimal(row.residual, 4)
            ));
        }
        if found.unclipped.is_some() {
            content.line(format_args!(
                "clipped   the answer leaves what can be projected; before clipping its residual was {unclipped}"
            ));
        }
        let [seen, plain] = [&found.similarity, &found.uncompensated_similarity];
        content.line(format_args!(
            "similar   PSNR {:.2} dB and SSIM {}; uncompensated {:.2} dB and {}",
            seen.psnr,
            ssim(seen),
            plain.psnr,
            ssim(plain)
        ));
        for run in &self.methods {
            let own = run.history.last().map_or(f64::NAN, |row| row.residual);
            let frames = run.frames.last().map_or(String::new(), |frames| format!(", {frames:>4} frames"));
            content.line(format_args!(
                "method    {:<14} {:>3} photos{frames}: seen {}, before clipping {}",
                run.name,
                run.photos,
                decimal(run.residual, 4),
                decimal(own, 4)
            ));
        }
        match self.warning() {
            Some(warning) => content.note(format_args!("warning: {warning}")),
            None if found.good && found.is_needless() => content.line(format_args!("          {NEEDLESS}")),
            None => {}
        }
        if let Some(residual) = self.verified.as_ref().and_then(|found| found.residual) {
            content
                .line(format_args!("          {} of the target by independent light", decimal(residual, 4)));
        }
        if let Some(file) = &self.file {
            content.line(format_args!("project   {}", file.display()));
        }
        content.line(format_args!(
            "photos    {}, {} of them before the solution: {}",
            found.photos + found.preparation,
            found.preparation,
            found.status
        ));
    }
}

const NEEDLESS: &str = "the target itself, projected, is seen as well: there is nothing to compensate";

fn residuals(rows: &[CompensationRow]) -> Vec<f64> {
    rows.iter().map(|row| row.residual).collect()
}

/// The structural similarity as text; `–` for an image with too few pixels.
pub(super) fn ssim(of: &Similarity) -> String {
    of.ssim.map_or("–".into(), |ssim| format!("{ssim:.4}"))
}

impl Answer for Compensated {
    fn names(&self) -> [&'static str; 2] {
        [Compensate::NAME, "light transport compensation"]
    }

    fn photos(&self) -> usize {
        let compared: usize = self.methods.iter().map(|run| run.photos).sum();
        self.found.photos + self.found.preparation + compared
    }

    fn headline(&self) -> String {
        let [seen, plain] =
            [self.found.residual, self.found.uncompensated_residual].map(|of| percentage(Ratio::from(of)));
        format!("the photo is {seen} off the target, uncompensated {plain}; {} photos", self.photos())
    }

    fn sentence(&self) -> String {
        let found = &self.found;
        let mut text = format!("{}. By {}: {}.", capital(&self.headline()), self.method(), found.status);
        if found.unclipped.is_some() {
            let _ = write!(
                text,
                " The answer had to be clipped to [{}, 1]; before that its residual was {}.",
                self.options.floor,
                decimal(found.unclipped_residual, 4)
            );
        }
        if let Some(ssim) = found.similarity.ssim {
            let _ = write!(text, " PSNR {:.2} dB, SSIM {ssim:.4}.", found.similarity.psnr);
        }
        if let Some(warning) = self.warning() {
            let _ = write!(text, " Warning: {warning}.");
        }
        text
    }

    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        self.arrays(&mut content);
        self.facts(&mut content);
        self.lines(&mut content);
        content
    }

    fn findings(&self) -> Vec<Finding> {
        let found = &self.found;
        let grade = if found.good { Grade::Ok } else { Grade::Fails };
        let text = match found.good && found.is_needless() {
            true => NEEDLESS.to_owned(),
            false => format!(
                "a residual of {}, uncompensated {}",
                decimal(found.residual, 4),
                decimal(found.uncompensated_residual, 4)
            ),
        };
        let help = match self.options.method {
            Method::KrylovBox => "give more --photos, or a target that can be reached (--peak)",
            _ => "use --method krylov-box, or give more --photos",
        };
        let expected = "within the tolerance, or better than no compensation";
        vec![Finding::graded("compensation", grade, text, expected, help)]
    }

    fn verify(&mut self, lab: &mut Lab) -> Result<Option<Verified>> {
        if !self.is_mixed {
            self.verified = lab.verify_compensation(&self.found)?;
        }
        Ok(self.verified.clone())
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        if let Some((name, unit)) = &self.model {
            page.title = format!("{name} · {}", self.names()[1]);
            page.unit.clone_from(unit);
            page.strip = None;
        }
        self.show_on(page)
    }
}
