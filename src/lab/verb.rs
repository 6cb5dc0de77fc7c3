//! Questions to a laboratory and their answers.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{ChannelChoice, Lab, RunFolder};
use crate::analysis::EigenpairEstimate;
use crate::error::Result;
use crate::finding::Finding;
use crate::image::Image;
use crate::io::manifest::Verification;
use crate::report::content::Content;
use crate::report::run::{PAINT, Run};

/// A question to a laboratory: a struct whose documented fields are the options of the command line, the keyword arguments in Python, and
/// the record in `run.json`.
pub trait Verb: Serialize {
    /// The name: a part of the folder's default name.
    const NAME: &'static str;

    /// What is found.
    type Answer: Answer;

    /// Whether the bounces of a scene's light must be kept apart.
    fn splits_bounces(&self) -> bool {
        false
    }

    /// Checks the request itself, before a source is opened.
    ///
    /// # Errors
    /// [`crate::Error::Option`] naming the option as the command line has it.
    fn check(&self) -> Result<()> {
        Ok(())
    }

    /// Checks that the request fits the source, before a photo is taken.
    ///
    /// # Errors
    /// As [`Verb::check`].
    fn check_on(&self, _lab: &Lab) -> Result<()> {
        Ok(())
    }

    /// Gray or coloured photos of a source that is opened for the request.
    ///
    /// # Errors
    /// Those of reading a model, where it decides.
    fn channels(&self, _source: &Path) -> Result<ChannelChoice> {
        Ok(ChannelChoice::Luma)
    }

    /// Takes the photos and answers; the request was checked.
    ///
    /// # Errors
    /// Those of the photos and of the method.
    fn answer(&self, lab: &mut Lab) -> Result<Self::Answer>;
}

/// An answer: named arrays and named facts, from which files, summary and attributes come, and a page.
pub trait Answer {
    /// The verb that asks for it: a part of the folder's default name.
    fn verb(&self) -> &'static str;

    /// Photos that it took, for the run's record.
    fn photos(&self) -> usize;

    /// One sentence that says what was found, for the run's record.
    fn sentence(&self) -> String;

    /// The named arrays and facts.
    fn content(&self) -> Content<'_> {
        Content::default()
    }

    /// What the answer says of itself: whether it is good enough, and what could not be measured.
    fn findings(&self) -> Vec<Finding> {
        Vec::new()
    }

    /// Compares the photos that the answer predicts with light that it was not computed from, and keeps what that light says. `None` where
    /// there is no such light, or where the answer predicts no photos.
    ///
    /// # Errors
    /// Those of the photos.
    fn verify(&mut self, _lab: &mut Lab) -> Result<Option<Verified>> {
        Ok(None)
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

/// An answer by light that it was not computed from.
#[derive(Clone, Debug)]
pub struct Verified {
    /// How well photos are predicted.
    pub verification: Verification,
    /// The eigenvalues of the scene, of eigenpairs and segmentations; of a segmentation without the first, which is known.
    pub estimates: Vec<EigenpairEstimate>,
    /// The distance from the target, of a compensation.
    pub residual: Option<f64>,
    /// The photo, and the standard error of each of its samples, of a compensation.
    pub photo: Option<[Image; 2]>,
}

impl From<Verification> for Verified {
    fn from(verification: Verification) -> Self {
        Self { verification, estimates: Vec::new(), residual: None, photo: None }
    }
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
    /// Asks a question. The record of the open run keeps it.
    ///
    /// # Errors
    /// As [`Verb::check`], [`Verb::check_on`] and [`Verb::answer`].
    pub fn ask<V: Verb>(&mut self, request: &V) -> Result<V::Answer> {
        request.check()?;
        request.check_on(self)?;
        if let Some(run) = &mut self.run {
            run.manifest.request = serde_json::to_value(request).ok();
        }
        request.answer(self)
    }

    /// The open run as its page shows it.
    pub(crate) fn page<'a>(&'a self, what: &str, run: &'a RunFolder, seconds: f64) -> Run<'a> {
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
