//! What can be saved: the answers of the Krylov methods and of the analyses, as a run's folder holds them.

use std::path::PathBuf;

use super::{Lab, RunFolder, SourceKind};
use crate::analysis::Segmentation;
use crate::analysis::segment::Segmented;
use crate::bench::audit::Audit;
use crate::error::Result;
use crate::finding::Finding;
use crate::krylov::{Eigs, Singular};
use crate::report;
use crate::report::compensation::Compensated;
use crate::report::eigenpairs::Eigenpairs;
use crate::report::probing::ProbedLight;
use crate::report::relighting::Relighting;
use crate::report::run::{PAINT, Run};
use crate::report::segmentation::Scored;
use crate::report::separation::Separated;
use crate::report::singular::SingularTriplets;
use crate::report::solution::Solved;

/// An answer that a laboratory can save ([`Lab::save`]).
pub trait Answer {
    /// The verb that asks for it: a part of the folder's default name.
    fn verb(&self) -> &'static str;

    /// Photos that it took, for the run's record.
    fn photos(&self) -> usize;

    /// One sentence that says what was found, for the run's record.
    fn sentence(&self) -> String;

    /// What the answer says of itself: whether it is good enough, and what could not be measured.
    fn findings(&self) -> Vec<Finding> {
        Vec::new()
    }

    /// Whether the white photo of a rig is known, so that noise and drift can be recorded without a further photo.
    fn has_white(&self) -> bool {
        true
    }

    /// Writes arrays, pictures and the page; `seconds` is what the run took so far. Returns the files' names, relative to the folder.
    ///
    /// # Errors
    /// [`crate::Error::Write`] naming the file; those of the photos that the page shows.
    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>>;
}

/// A saved answer.
#[derive(Clone, Debug)]
pub struct Saved {
    /// The folder.
    pub folder: PathBuf,
    /// `report.html` in it.
    pub report: PathBuf,
    /// The sentence of the run's record.
    pub message: String,
    /// All that was found of the answer and of the rig.
    pub findings: Vec<Finding>,
    /// Seconds that the run took.
    pub seconds: f64,
}

impl Lab {
    /// The open run as its page shows it.
    fn page<'a>(&'a self, what: &str, run: &'a RunFolder, seconds: f64) -> Run<'a> {
        Run {
            title: format!("{} · {what}", self.name()),
            folder: &run.answer,
            has_paint: run.path.join(PAINT).is_file()
                || run.manifest.command.iter().any(|word| word.to_str() == Some("--paint")),
            manifest: &run.manifest,
            seconds,
            resolution: self.resolution(),
            unit: self.unit(),
            strip: Some(self.contact_sheet()),
        }
    }
}

impl Answer for Audit {
    fn verb(&self) -> &'static str {
        "audit"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    /// An audit that failed by saturation has no white photo whose noise could be known.
    fn has_white(&self) -> bool {
        !self.white.is_empty()
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        report::audit::write(self, &lab.page("audit", run, seconds))
    }
}

impl Answer for Compensated<'_> {
    fn verb(&self) -> &'static str {
        "compensate"
    }

    fn photos(&self) -> usize {
        let compared: usize = self.methods.iter().map(|run| run.photos).sum();
        self.found.photos + self.found.preparation + compared
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        const WHAT: &str = "light transport compensation";
        let mut run = lab.page(WHAT, run, seconds);
        if let Some((name, unit)) = self.model {
            (run.title, run.unit) = (format!("{name} · {WHAT}"), unit);
        }
        run.strip = run.strip.filter(|_| self.has_photos);
        Self::write(self, &run)
    }
}

impl Answer for Eigenpairs<'_> {
    fn verb(&self) -> &'static str {
        "eigs"
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn sentence(&self) -> String {
        format!("{} photos: {}", self.found.stats.products, self.found.stats.status)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let run = lab.page("eigenpairs", run, seconds);
        let has_pictures = lab.kind() != SourceKind::Matrix;
        Self::write(self, &Run { strip: run.strip.filter(|_| has_pictures), ..run })
    }
}

impl Answer for Eigs {
    fn verb(&self) -> &'static str {
        "eigs"
    }

    fn photos(&self) -> usize {
        self.stats.products
    }

    fn sentence(&self) -> String {
        Eigenpairs::new(self, self.values.len()).sentence()
    }

    fn findings(&self) -> Vec<Finding> {
        Eigenpairs::new(self, self.values.len()).findings()
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Answer::write(&Eigenpairs::new(self, self.values.len()), lab, run, seconds)
    }
}

impl Answer for SingularTriplets<'_> {
    fn verb(&self) -> &'static str {
        "eigs"
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn sentence(&self) -> String {
        format!("{} photos there and back: {}", self.found.stats.products, self.found.stats.status)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let sizes = [lab.resolution(), lab.projector_resolution()];
        let has_pictures = lab.kind() != SourceKind::Matrix;
        Self::write(self, &lab.page("singular values", run, seconds), has_pictures.then_some(sizes))
    }
}

impl Answer for Singular {
    fn verb(&self) -> &'static str {
        "eigs"
    }

    fn photos(&self) -> usize {
        self.stats.products
    }

    fn sentence(&self) -> String {
        SingularTriplets { found: self, wanted: self.values.len() }.sentence()
    }

    fn findings(&self) -> Vec<Finding> {
        SingularTriplets { found: self, wanted: self.values.len() }.findings()
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Answer::write(&SingularTriplets { found: self, wanted: self.values.len() }, lab, run, seconds)
    }
}

impl Answer for ProbedLight {
    fn verb(&self) -> &'static str {
        "probe"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Self::write(self, &lab.page("probing of light transport", run, seconds))
    }
}

impl Answer for Relighting {
    fn verb(&self) -> &'static str {
        "relight"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let mut files = match &self.files {
            Some(files) => files.clone(),
            None => self.model.write(&run.answer)?,
        };
        let run = lab.page("", run, seconds);
        let title = format!("{} · low-rank light transport", self.model.source);
        let strip = run.strip.filter(|_| self.photos > 0);
        files.extend(Self::write(self, &Run { title, unit: &self.model.unit, strip, ..run })?);
        Ok(files)
    }
}

impl Answer for Scored<'_> {
    fn verb(&self) -> &'static str {
        "segment"
    }

    fn photos(&self) -> usize {
        self.segmented.photos()
    }

    fn sentence(&self) -> String {
        self.segmented.segmentation.status.clone()
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let white = lab.white()?;
        Self::write(self, &white, &lab.page("light transport segmentation", run, seconds))
    }
}

impl Answer for Segmented {
    fn verb(&self) -> &'static str {
        "segment"
    }

    fn photos(&self) -> usize {
        Self::photos(self)
    }

    fn sentence(&self) -> String {
        self.segmentation.status.clone()
    }

    fn findings(&self) -> Vec<Finding> {
        self.segmentation.findings()
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let truth = lab.truth()?;
        let scores = truth.as_ref().map(|truth| truth.scores(&self.segmentation)).transpose()?;
        let scores = scores.unwrap_or_default();
        let scored = Scored::new(self, truth.as_ref(), &scores);
        Answer::write(&scored, lab, run, seconds)
    }
}

impl Answer for Segmentation {
    fn verb(&self) -> &'static str {
        "segment"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self) -> String {
        self.status.clone()
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Segmented::from(self.clone()).write(lab, run, seconds)
    }
}

impl Answer for Separated {
    fn verb(&self) -> &'static str {
        "separate"
    }

    fn photos(&self) -> usize {
        self.all_photos()
    }

    fn sentence(&self) -> String {
        Self::sentence(self)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Self::write(self, &lab.page("direct and global light", run, seconds))
    }
}

impl Answer for Solved<'_> {
    fn verb(&self) -> &'static str {
        "solve"
    }

    fn photos(&self) -> usize {
        self.found.stats.products
    }

    fn sentence(&self) -> String {
        format!("{} products: {}", self.found.stats.products, self.found.stats.status)
    }

    fn findings(&self) -> Vec<Finding> {
        Self::findings(self)
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Self::write(self, &lab.page("linear system", run, seconds))
    }
}
