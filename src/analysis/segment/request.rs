//! A segmentation with its optional parts: measured direct light, blur, features and evidence.

use super::{Capture, Evidence, FeatureView, SegmentOptions, Segmentation, evidence, feature_view};
use crate::analysis::{Blurred, DirectMethod, Separation, WithoutDirect, measure_direct};
use crate::error::{Error, Result};
use crate::image::{Blur, Resolution};
use crate::operator::{Adjoint, Gram, Operator, Symmetry};
use crate::transport::Part;

/// The request for a segmentation and its optional parts.
#[derive(Clone, Debug, Default)]
pub struct SegmentRequest {
    /// The method, its groups and its photos; [`SegmentRequest::run`] fills in the pixels.
    pub options: SegmentOptions,
    /// How direct light, which contains no information on groups, is removed.
    pub direct: DirectLight,
    /// The standard deviation in pixels of the Gaussian that blurs patterns and photos; 0 for none. Default: what the source needs
    /// ([`Registration::blur`](crate::measure::Registration::blur) of a rig; none where an operator is handed over).
    pub blur: Option<f64>,
    /// Pixels, by column and row, whose coordinates in the space of eigenvectors are wanted.
    pub features: Vec<(usize, usize)>,
    /// Whether each group is then lit alone, with one more photo each, to measure how much of its light stays within it.
    pub evidence: bool,
}

/// How direct light is removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DirectLight {
    /// The source removes it: a simulator exactly, a rig as its file says.
    #[default]
    Source,
    /// It is not removed, as on a rig that cannot separate it.
    Keep,
    /// It is measured from photos and subtracted.
    Measured(DirectMethod),
}

/// A segmentation with the requested optional parts.
#[derive(Clone, Debug)]
pub struct Segmented {
    /// The groups.
    pub segmentation: Segmentation,
    /// The direct light, if it was measured.
    pub direct: Option<Separation>,
    /// The evidence for each number of groups.
    pub evidence: Vec<Evidence>,
    /// The chosen pixels in the space of eigenvectors.
    pub features: Option<FeatureView>,
    /// The standard deviation in pixels of the Gaussian that blurred patterns and photos; 0 for none.
    pub blur: f64,
    /// Whether the graph is that of `A Aᵀ`, of a matrix that is not symmetric: every second photo is one of the transpose.
    pub there_and_back: bool,
}

impl Segmented {
    /// All photos: of direct light, of the graph and of the evidence.
    pub fn photos(&self) -> usize {
        let direct = self.direct.as_ref().map_or(0, |direct| direct.photos);
        let evidence: usize = self.evidence.iter().map(|evidence| evidence.photos.len()).sum();
        self.segmentation.photos + direct + evidence
    }
}

impl From<Segmentation> for Segmented {
    fn from(segmentation: Segmentation) -> Self {
        let (direct, evidence, features) = (None, Vec::new(), None);
        Self { segmentation, direct, evidence, features, there_and_back: false, blur: 0.0 }
    }
}

impl SegmentRequest {
    /// Checks the request for photos of `resolution`, before any is taken.
    ///
    /// # Errors
    /// As [`Capture::new`]; [`Error::Option`] naming `--blur`, `--features` or `--direct-photos`.
    pub fn check(&self, resolution: Resolution) -> Result<()> {
        Capture::new(self.options.clone())?;
        let refuse = |option: &str, fault: String, help: String| {
            Err(Error::Option { option: option.into(), fault, help })
        };
        let blur = self.blur.unwrap_or(0.0);
        if !(0.0..1000.0).contains(&blur) {
            let help = "give a standard deviation from 0 on";
            return refuse("--blur", format!("{blur} pixels"), help.into());
        }
        let outside = |&&(x, y): &&(usize, usize)| x >= resolution.width || y >= resolution.height;
        if let Some((x, y)) = self.features.iter().find(outside) {
            let help = format!("it has {resolution} pixels; columns and rows are counted from 0");
            return refuse("--features", format!("pixel {x},{y} is outside of the picture"), help);
        }
        if let DirectLight::Measured(DirectMethod::Checkerboards { shifts: 0 | 1, .. }) = self.direct {
            let help = "give a square number from 4 on: 4, 9, 16, 25";
            return refuse("--direct-photos", "too few photos of shifted squares".into(), help.into());
        }
        Ok(())
    }

    /// The part of the light that the operator must contain.
    pub fn part(&self) -> Part {
        if self.direct == DirectLight::Source { Part::Global } else { Part::Full }
    }

    /// Whether the eigenvectors found are those of the photos as they were taken: nothing was subtracted from these, they were
    /// not blurred, and there are none with the devices exchanged.
    pub fn is_of_photos_as_taken(&self, found: &Segmented) -> bool {
        !matches!(self.direct, DirectLight::Measured(_))
            && found.blur == 0.0
            && !found.there_and_back
            && self.options.mu == 0.0
    }

    /// The most photos in total.
    pub fn photos(&self) -> usize {
        // Where the number of groups is not known yet, it is at most one more than the starting patterns.
        let groups = match self.options.groups.as_slice() {
            [] => self.options.starts.unwrap_or(SegmentOptions::automatic_starts(self.options.photos)) + 1,
            groups => groups.iter().sum(),
        };
        let evidence = if self.evidence { groups } else { 0 };
        let direct = match self.direct {
            DirectLight::Source | DirectLight::Keep => 0,
            DirectLight::Measured(DirectMethod::Checkerboards { shifts, .. }) => shifts * shifts,
            DirectLight::Measured(DirectMethod::Estimator { photos }) => photos,
        };
        self.options.photos + evidence + direct
    }

    /// Takes all photos with `operator` (`n × n`), which contains the light of [`SegmentRequest::part`].
    ///
    /// # Errors
    /// As [`SegmentRequest::check`], [`measure_direct`], [`Capture::run`] and [`evidence()`].
    pub fn run(&self, operator: &mut dyn Operator, resolution: Resolution) -> Result<Segmented> {
        self.check(resolution)?;
        let direct = match self.direct {
            DirectLight::Source | DirectLight::Keep => None,
            DirectLight::Measured(by) => Some(measure_direct(operator, resolution, by, self.options.seed)?),
        };
        let (segmentation, evidence) = match &direct {
            Some(direct) => self.blurred(&mut WithoutDirect::new(operator, &direct.direct)?, resolution)?,
            None => self.blurred(operator, resolution)?,
        };
        let features = match self.features.as_slice() {
            [] => None,
            chosen => Some(feature_view(&segmentation, resolution, chosen)?),
        };
        let blur = self.blur.unwrap_or(0.0);
        Ok(Segmented { segmentation, direct, evidence, features, there_and_back: false, blur })
    }

    /// As [`SegmentRequest::run`], of any matrix whose transpose is at hand. One that is not symmetric is that of a camera and a projector that
    /// stand apart: the graph is then that of `A Aᵀ`, where two pixels of the camera are neighbours if the same light reaches both, and each of
    /// its products is a photo with the devices exchanged and one as they stand. All photos count.
    ///
    /// # Errors
    /// As [`SegmentRequest::run`]; [`Error::Option`] naming what such a matrix does not tell.
    pub fn run_with_transpose(
        &self,
        operator: &mut dyn Adjoint,
        resolution: Resolution,
    ) -> Result<Segmented> {
        let mut operator = operator;
        if operator.symmetry() == Symmetry::Symmetric {
            return self.run(&mut operator, resolution);
        }
        self.check_apart()?;
        let photos = self.options.photos / 2;
        let starts = self.options.starts.or(Some(SegmentOptions::automatic_starts(photos)));
        let half =
            Self { options: SegmentOptions { photos, starts, ..self.options.clone() }, ..self.clone() };
        let mut found = half.run(&mut Gram::of_photos(operator), resolution)?;
        found.there_and_back = true;
        found.segmentation.photos *= 2;
        found.segmentation.history.iter_mut().for_each(|row| row.products *= 2);
        found.segmentation.status = format!(
            "{} photos there and back, of A Aᵀ: {}",
            found.segmentation.photos, found.segmentation.status
        );
        Ok(found)
    }

    /// Refuses what relies on a symmetric matrix.
    fn check_apart(&self) -> Result<()> {
        let refuse = |option: &str, fault: &str, help: &str| {
            Err(Error::Option { option: option.into(), fault: fault.into(), help: help.into() })
        };
        if let DirectLight::Measured(_) = self.direct {
            let fault = "direct light is no diagonal where camera and projector stand apart";
            return refuse("--direct", fault, "give --direct keep: direct light connects no groups");
        }
        if self.evidence {
            let fault = "a group of the camera's pixels cannot be lit alone by a projector that stands apart";
            return refuse("--evidence", fault, "leave it out");
        }
        Ok(())
    }

    fn blurred(
        &self,
        operator: &mut dyn Operator,
        resolution: Resolution,
    ) -> Result<(Segmentation, Vec<Evidence>)> {
        match Blur::new(resolution, self.blur.unwrap_or(0.0)) {
            Some(blur) => self.groups(&mut Blurred::new(operator, blur)?, resolution),
            None => self.groups(operator, resolution),
        }
    }

    fn groups(
        &self,
        operator: &mut dyn Operator,
        resolution: Resolution,
    ) -> Result<(Segmentation, Vec<Evidence>)> {
        let leak = leak(self.blur.unwrap_or(0.0), resolution);
        let options = SegmentOptions { resolution: Some(resolution), leak, ..self.options.clone() };
        let mut capture = Capture::new(options)?;
        capture.run(operator)?;
        let segmentation = capture.segmentation()?;
        let counts = segmentation.labels.iter().filter(|_| self.evidence);
        let evidence = counts.map(|(_, labels)| evidence(operator, labels)).collect::<Result<_>>()?;
        Ok((segmentation, evidence))
    }
}

/// The share of its light that a blur of patterns and photos by `blur` pixels carries out of half a picture, across a straight border. Both
/// together blur by `√2 blur`, and `1/√2π` of that is the mean way across.
fn leak(blur: f64, resolution: Resolution) -> f64 {
    let half = resolution.width.min(resolution.height) as f64 / 2.0;
    blur / std::f64::consts::PI.sqrt() / half
}
