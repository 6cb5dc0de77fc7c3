//! Requests to a laboratory, and their answers.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{ChannelChoice, Lab, RunFolder};
use crate::analysis::EigenpairEstimate;
use crate::analysis::segment::KEPT;
use crate::error::{Error, Result};
use crate::finding::Finding;
use crate::image::{Image, Resolution};
use crate::io::manifest::Verification;
use crate::report::content::Content;
use crate::report::run::{AnswerPage, Files, PAINT};
use crate::report::text;

/// An array that a program passes for a field of a request, in place of a file.
#[derive(Clone, Debug)]
pub struct GivenArray {
    /// The name of the field.
    pub field: String,
    /// The name of the array, for a field that takes several arrays.
    pub name: String,
    /// The shape.
    pub shape: Vec<usize>,
    /// The elements in C order.
    pub values: Vec<f64>,
}

impl GivenArray {
    /// The array as an image of `H×W` or `H×W×3`. Fails with [`Error::Option`] for another shape.
    pub fn image(&self) -> Result<Image> {
        let (height, width, channels) = match *self.shape {
            [height, width] => (height, width, 1),
            [height, width, channels] => (height, width, channels),
            _ => return Err(self.refused("it is no picture", "give an array of H×W or H×W×3")),
        };
        let samples = self.values.iter().map(|&value| value as f32).collect();
        Image::new(Resolution::new(width, height), channels, samples)
    }

    /// The error for a field that takes no array.
    pub(crate) fn not_taken(&self) -> Error {
        self.refused("it takes no array", "give a value")
    }

    fn refused(&self, fault: &str, help: &str) -> Error {
        Error::option(format!("--{}", self.field.replace('_', "-")), fault).help(help)
    }
}

/// A request to a laboratory: a struct whose documented fields are command line options, Python keywords, and the record in `run.json`.
pub trait Verb: Serialize {
    /// The name of the verb, which is part of the default name of the run's folder.
    const NAME: &'static str;

    /// Whether the answer can be verified with light that is independent of it.
    const IS_CHECKED: bool = true;

    /// The reason why a run of this verb cannot be resumed, if its photos are not kept.
    const NOT_RESUMED: Option<&'static str> = None;

    /// Whether the verb needs to know which pixels are neighbours, so that a matrix must know its pictures.
    const NEEDS_PICTURES: bool = false;

    /// The type of the answer.
    type Answer: Answer;

    /// Whether the light of a scene must be split by the number of bounces.
    fn splits_bounces(&self) -> bool {
        false
    }

    /// Checks the request itself, before a source is opened.
    ///
    /// # Errors
    /// [`crate::Error::Option`] with the name of the option on the command line.
    fn check(&self) -> Result<()> {
        Ok(())
    }

    /// Checks that the request fits the source, before a photo is taken. Fails as [`Verb::check`].
    fn check_on(&self, _lab: &Lab) -> Result<()> {
        Ok(())
    }

    /// Takes the arrays that a program gives in place of files, possibly none. Fails with [`Error::Option`] if an array is for a field that
    /// does not exist or takes no array.
    fn give(&mut self, given: Vec<GivenArray>) -> Result<()> {
        given.first().map_or(Ok(()), |given| Err(given.not_taken()))
    }

    /// The channels with which a source is opened for this request. Fails if the channels depend on a model that cannot be read.
    fn channels(&self, _source: &Path) -> Result<ChannelChoice> {
        Ok(ChannelChoice::Luma)
    }

    /// Takes the photos and computes the answer. The request must have been checked. Fails if a photo or the method fails.
    fn answer(&self, lab: &mut Lab) -> Result<Self::Answer>;
}

/// An answer to a request. Its named arrays and facts become files, a summary, Python attributes, and a page.
pub trait Answer {
    /// The name of the verb, which is part of the default name of the run's folder; and the title of the page without the source's name.
    fn names(&self) -> [&'static str; 2];

    /// The number of photos behind the answer, for the run's record.
    fn photos(&self) -> usize;

    /// The result and its quality, in fewer than twenty words without a full stop. It is the first line on the terminal.
    fn headline(&self) -> String;

    /// The sentences at the top of the page. The default is the headline.
    fn sentence(&self) -> String {
        format!("{}.", text::capital(&self.headline()))
    }

    /// The named arrays and facts.
    fn content(&self) -> Content<'_> {
        Content::default()
    }

    /// Findings about the answer. They state whether the answer is good enough, and which quantities could not be measured.
    fn findings(&self) -> Vec<Finding> {
        Vec::new()
    }

    /// Compares the photos that the answer predicts with light that is independent of the answer, and keeps the results. Returns `None` if
    /// there is no such light, or if the answer predicts no photos. Fails if a photo fails.
    fn verify(&mut self, _lab: &mut Lab) -> Result<Option<Verified>> {
        Ok(None)
    }

    /// Whether the white photo of a rig is known, so that noise and drift can be recorded without a further photo.
    fn has_white(&self) -> bool {
        true
    }

    /// Adds pictures and sections to the page, and replaces its title, sentence or facts. Files, the arrays of [`Answer::content`] among them,
    /// may be written only after this call. Fails with the errors of the photos that the page shows.
    fn show(&self, lab: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()>;
}

/// A verification of an answer by light that is independent of the answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Verified {
    /// The accuracy of the predicted photos.
    pub verification: Verification,
    /// Estimates of the scene's eigenvalues, for eigenpairs and segmentations (without the first eigenvalue, which is known). There are none
    /// for a rig, since its photo shows all pairs together.
    pub estimates: Vec<EigenpairEstimate>,
    /// For each number of groups, the fraction of the pixels that independent light assigns to the same group as the segmentation. It
    /// limits the confidence of the labels, and is 0 if the verification fails.
    pub supported: Vec<(usize, f64)>,
    /// The distance of a compensation from its target.
    pub residual: Option<f64>,
    /// The photo of a compensation's pattern, and the standard error of each of its samples.
    pub photo: Option<[Image; 2]>,
}

impl From<Verification> for Verified {
    fn from(verification: Verification) -> Self {
        let (estimates, supported) = (Vec::new(), Vec::new());
        Self { verification, estimates, supported, residual: None, photo: None }
    }
}

impl Verified {
    /// The number of eigenvectors that are only noise of the matrix, in a segmentation that counts `regions` regions. Under independent
    /// light, such an eigenvector keeps a smaller fraction of its light than [`KEPT`].
    pub fn refuted(&self, regions: usize) -> usize {
        let counted = self.estimates.iter().take(regions.saturating_sub(1));
        counted.filter(|estimate| estimate.quotient[0] + 2.0 * estimate.quotient[1] < KEPT).count()
    }
}

/// A saved answer.
#[derive(Clone, Debug)]
pub struct Saved {
    /// The folder.
    pub folder: PathBuf,
    /// The file `report.html` in the folder.
    pub report: PathBuf,
    /// The sentence about the result in the run's record.
    pub message: String,
    /// All findings about the answer and the rig.
    pub findings: Vec<Finding>,
    /// Seconds that the run took.
    pub seconds: f64,
}

impl Lab {
    /// Checks that a request fits the source. Fails as [`Verb::check_on`], and as [`Lab::require_pictures`] if the verb needs pictures.
    pub fn accept<V: Verb>(&self, request: &V) -> Result<()> {
        if V::NEEDS_PICTURES {
            self.require_pictures(V::NAME)?;
        }
        request.check_on(self)
    }

    /// Answers a request, and records it in the open run. Fails as [`Verb::check`], [`Lab::accept`] and [`Verb::answer`].
    pub fn ask<V: Verb>(&mut self, request: &V) -> Result<V::Answer> {
        request.check()?;
        self.accept(request)?;
        if let Some(run) = &mut self.run {
            run.manifest.request = serde_json::to_value(request).ok();
        }
        request.answer(self)
    }

    /// Writes the arrays, the pictures and the page of an answer into the folder of a run. Returns the names of all files.
    pub(super) fn show(
        &mut self,
        answer: &(impl Answer + ?Sized),
        run: &RunFolder,
        seconds: f64,
    ) -> Result<Vec<String>> {
        let manifest = &run.manifest;
        let has_option = manifest.command.iter().any(|word| word.to_str() == Some("--paint"));
        let mut page = AnswerPage {
            title: format!("{} · {}", self.name(), answer.names()[1]),
            sentence: answer.sentence(),
            photos: answer.photos(),
            resolution: self.resolution(),
            unit: self.unit().to_owned(),
            strip: Some(self.contact_sheet()),
            has_paint: has_option || run.path.join(PAINT).is_file(),
            files: Files::of(&run.answer, answer.content()),
            facts: Vec::new(),
            sections: Vec::new(),
        };
        answer.show(self, &mut page)?;
        page.finish(answer.findings(), manifest, seconds)
    }
}
