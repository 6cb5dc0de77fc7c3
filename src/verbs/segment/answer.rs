//! The answer of a segmentation.

use serde_json::json;

use super::{Direct, Segment};
use crate::analysis::segment::Truth;
use crate::analysis::{Cut, EigenpairEstimate, Evidence, FeatureView, Segmentation, Separation};
use crate::error::Result;
use crate::finding::{Finding, Grade, Ratio};
use crate::image::Resolution;
use crate::lab::text::{decimal, rounded, with_error};
use crate::lab::{Answer, Lab, Verb, Verified};
use crate::report::content::{Content, Values};
use crate::report::run::AnswerPage;
use crate::transport::Part;

/// A segmentation with the further results that were requested.
#[derive(Clone, Debug)]
pub struct Segmented {
    /// The segmentation into groups.
    pub segmentation: Segmentation,
    /// The resolution of labels and eigenvectors.
    pub resolution: Resolution,
    /// The direct light, if it was measured.
    pub direct: Option<Separation>,
    /// The evidence for each number of groups.
    pub evidence: Vec<Evidence>,
    /// The chosen pixels in the space of eigenvectors.
    pub features: Option<FeatureView>,
    /// The standard deviation, in pixels, of the Gaussian blur of patterns and photos; 0 for none.
    pub blur: f64,
    /// Whether the graph is that of `A Aᵀ`, as for a matrix `A` that is not symmetric. Every second photo is then one of the transpose.
    pub there_and_back: bool,
    /// The true labels, if they are known.
    pub truth: Option<Truth>,
    /// The adjusted Rand index against the true labels, for each number of groups; empty without true labels.
    pub scores: Vec<(usize, f64)>,
    /// Estimates of the scene's eigenvalues by independent light, except the first, which is known; empty before [`Answer::verify`].
    pub estimates: Vec<EigenpairEstimate>,
    /// For each number of groups, the fraction of the labels that independent light supports; empty before [`Answer::verify`].
    pub supported: Vec<(usize, f64)>,
    /// The number of eigenvectors that were counted as regions, but are refuted by independent light.
    pub refuted: usize,
    pub(super) part: Part,
    pub(super) cut: Cut,
    pub(super) is_of_photos_as_taken: bool,
    /// Whether there is one region, which was divided into two groups only because no number of groups was requested.
    pub(super) is_undivided: bool,
    pub(super) min_rand_index: Option<f64>,
}

impl Segmented {
    pub(super) fn new(asked: &Segment, segmentation: Segmentation, resolution: Resolution) -> Self {
        let blur = asked.blur.unwrap_or(0.0);
        Self {
            is_undivided: asked.groups.is_empty() && segmentation.regions.count < 2,
            is_of_photos_as_taken: !matches!(asked.direct, Direct::Patterns | Direct::Estimator)
                && blur == 0.0
                && asked.mu == 0.0,
            part: asked.part(),
            cut: asked.cut,
            min_rand_index: asked.min_rand_index,
            segmentation,
            resolution,
            blur,
            direct: None,
            evidence: Vec::new(),
            features: None,
            there_and_back: false,
            truth: None,
            scores: Vec::new(),
            estimates: Vec::new(),
            supported: Vec::new(),
            refuted: 0,
        }
    }

    /// The same answer, compared with the true labels.
    pub(super) fn against(mut self, truth: Option<Truth>) -> Result<Self> {
        self.scores =
            truth.as_ref().map(|truth| truth.scores(&self.segmentation)).transpose()?.unwrap_or_default();
        self.truth = truth;
        Ok(self)
    }

    /// The fraction of pixels whose labels are certain, times the fraction that independent light supports; `None` for a number of groups
    /// that was not requested.
    pub fn share_of_sure(&self, groups: usize) -> Option<f64> {
        let supported = self.supported.iter().find(|(of, _)| *of == groups).map_or(1.0, |(_, share)| *share);
        self.segmentation.share_of_sure(groups).map(|sure| sure * supported)
    }

    pub(super) fn masked(&self) -> usize {
        self.segmentation.mask.iter().filter(|&&masked| masked).count()
    }

    /// The estimate of the scene's eigenvalue for eigenvector `index`; `None` for the first, whose eigenvalue is known.
    fn estimate(&self, index: usize) -> Option<&EigenpairEstimate> {
        self.estimates.get(index.checked_sub(1)?)
    }

    fn arrays<'a>(&'a self, content: &mut Content<'a>) {
        let Resolution { width, height } = self.resolution;
        let (found, count) = (&self.segmentation, self.segmentation.eigenvectors.len());
        content.array("eigenvalues", &[count], &found.eigenvalues);
        content.array("residuals", &[count], &found.residuals);
        content.array("eigenvectors", &[count, height, width], Values::Rows(&found.eigenvectors));
        content.array("degree", &[height, width], &found.degree);
        for (groups, labels) in &found.labels {
            content.array("labels", &[height, width], labels).key = Some(*groups);
        }
        for (groups, confidence) in &found.confidence {
            content.array("confidence", &[height, width], confidence).key = Some(*groups);
        }
        if let Some(truth) = &self.truth {
            content.array("labels-true", &[height, width], &truth.labels);
        }
        if let Some(direct) = &self.direct {
            content.array("direct", &[height, width], &direct.direct);
        }
        for of in &self.evidence {
            content.array("evidence", &[of.groups, height, width], Values::Rows(&of.photos)).key =
                Some(of.groups);
        }
        content.attribute("within", &[count], &found.embedding.within);
        content.attribute("weights", &[height, width], &found.weights);
        content.attribute("mask", &[height, width], &found.mask);
    }

    fn facts(&self, content: &mut Content<'_>) {
        let found = &self.segmentation;
        let by_groups = |values: Vec<(usize, Option<f64>)>| {
            values
                .into_iter()
                .map(|(groups, value)| (groups.to_string(), json!(value)))
                .collect::<serde_json::Map<_, _>>()
        };
        content.fact("photos", found.photos);
        content.fact("photos_direct", self.direct.as_ref().map(|direct| direct.photos));
        content.fact("status", &found.status);
        content.fact("there_and_back", self.there_and_back);
        content.fact("regions", &found.regions);
        content.fact("refuted_regions", self.refuted);
        content.fact("blur", self.blur);
        let values = found.eigenvalues.iter().enumerate();
        let values = values
            .map(|(index, &value)| rounded(value, self.estimate(index).map_or(0.0, |of| of.standard_error)));
        content.fact("eigenvalues", values.collect::<Vec<f64>>());
        content.fact("residuals", &found.residuals);
        let of_scene = self.estimates.iter().map(|of| {
            json!({ "eigenvalue": rounded(of.value, of.standard_error), "standard_error": of.standard_error })
        });
        content.fact("of_scene", of_scene.collect::<Vec<_>>());
        content.fact("within", &found.embedding.within);
        content.fact("masked", self.masked());
        let sure = found.labels.iter().map(|(groups, _)| (*groups, self.share_of_sure(*groups)));
        content.fact("share_of_sure", by_groups(sure.collect()));
        let scores = self.scores.iter().map(|(groups, score)| (*groups, Some(*score)));
        content.fact("adjusted_rand_index", by_groups(scores.collect()));
        let evidence = self.evidence.iter().map(|of| {
            json!({
                "groups": of.groups,
                "photos": of.photos.len(),
                "cut": of.cut(),
                "kept": of.kept(),
                "exchange": of.exchange,
            })
        });
        content.fact("evidence", evidence.collect::<Vec<_>>());
        let features = self.features.as_ref().map(|view| {
            json!({ "pixels": view.pixels, "coordinates": view.coordinates, "distances": view.distances })
        });
        content.fact("features", features);
        content.detail("regions_sentence", found.regions.sentence());
        let history = found.history.iter().map(|row| json!([row.products, row.values, row.residuals]));
        content.detail("history", history.collect::<Vec<_>>());
    }

    fn lines(&self, content: &mut Content<'_>) {
        let found = &self.segmentation;
        if let Some(direct) = &self.direct {
            let [own, global] = [&direct.direct, &direct.global].map(|light| light.iter().sum::<f64>());
            let share = Ratio::of(own, own + global, 0.0);
            content.line(format_args!("direct    {share} of the light, from {} photos", direct.photos));
        }
        if self.there_and_back {
            content.line(
                "matrix    not symmetric: camera and projector stand apart; every second photo is one with the two exchanged",
            );
        }
        if self.masked() > 0 {
            let share = 100.0 * self.masked() as f64 / found.mask.len() as f64;
            content
                .line(format_args!("masked    {} pixels without global light ({share:.1} %)", self.masked()));
        }
        let of_scene = if self.estimates.is_empty() { "" } else { "   of the scene" };
        content.line(format_args!("          eigenvalue   residual{of_scene}"));
        for (index, (value, residual)) in found.eigenvalues.iter().zip(&found.residuals).enumerate() {
            let note = if found.embedding.is_local(index) { "   localized eigenvector" } else { "" };
            let (value, of_scene) = match self.estimate(index) {
                Some(of) => (
                    rounded(*value, of.standard_error).to_string(),
                    format!("   {:<16}", with_error(of.value, of.standard_error)),
                ),
                None => (decimal(*value, 6), String::new()),
            };
            content.line(format_args!("  {:>6}  {value:>10}   {residual:.1e}{of_scene}{note}", index + 1));
        }
        content.line(format_args!("regions   {}", found.regions.sentence()));
        for (groups, _) in &found.labels {
            let sure = 100.0 * self.share_of_sure(*groups).unwrap_or(0.0);
            let score = self.scores.iter().find(|(of, _)| of == groups);
            let score =
                score.map(|(_, score)| format!("; adjusted Rand index {score:.4} against the true labels"));
            content.line(format_args!(
                "groups    {groups:>3}: {sure:.1} % of the pixels are sure of theirs{}",
                score.unwrap_or_default()
            ));
        }
        for of in &self.evidence {
            let least = of.kept().into_iter().fold(1.0, f64::min);
            content.line(format_args!(
                "evidence  {:>3} groups, each lit alone: the cut is {:.4}, and each keeps {:.2} % of its light or more",
                of.groups,
                of.cut(),
                100.0 * least
            ));
        }
        content.line(format_args!("photos    {}", found.status));
    }

    fn notes(&self, content: &mut Content<'_>) {
        if self.refuted > 0 {
            content.note(format_args!(
                "warning: {} of the {} eigenvectors that were counted as regions are noise: other light paths do not confirm them; give more --spp",
                self.refuted, self.segmentation.regions.at_one
            ));
        }
        if self.is_undivided {
            content.note(
                "the light shows one region, which has no groups to tell apart; the two that are shown divide it, as --groups 2 asks for",
            );
        }
    }

    /// One finding: whether the groups agree with the true labels as well as requested. If this cannot be examined, the finding fails.
    fn agreement(&self) -> Option<Finding> {
        let least = self.min_rand_index?;
        let expected = format!("at least {least}");
        let fails = |found: String, help: String| {
            Some(Finding::graded("agreement", Grade::Fails, found, expected.clone(), help))
        };
        let Some(truth) = &self.truth else {
            return fails(
                "the scene has no true labels to compare with".into(),
                "give regions by `region` in the extras of its nodes, meshes or primitives".into(),
            );
        };
        let regions = truth.seen();
        let Some(&(_, score)) = self.scores.iter().find(|(groups, _)| *groups == regions) else {
            return fails(
                format!("the scene shows {regions} labelled regions, and there are no {regions} groups"),
                format!("add --groups {regions}"),
            );
        };
        // The comparison is false for a bound that is NaN, so such a bound is not met.
        let grade = if score >= least { Grade::Ok } else { Grade::Fails };
        let found = format!("the adjusted Rand index against the true labels is {score:.4}");
        Some(Finding::graded("agreement", grade, found, expected, "give more --photos or --spp"))
    }
}

impl Answer for Segmented {
    fn names(&self) -> [&'static str; 2] {
        [Segment::NAME, "light transport segmentation"]
    }

    fn photos(&self) -> usize {
        let direct = self.direct.as_ref().map_or(0, |direct| direct.photos);
        let evidence: usize = self.evidence.iter().map(|evidence| evidence.photos.len()).sum();
        self.segmentation.photos + direct + evidence
    }

    fn headline(&self) -> String {
        let mut regions = self.segmentation.regions.count_in_words();
        if self.refuted > 0 {
            regions += &format!(", {} refuted", self.refuted);
        }
        let best = self.scores.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let groups = match best {
            Some((groups, score)) => format!("at {groups} groups the adjusted Rand index is {score:.4}"),
            None => {
                let shares = self.segmentation.labels.iter().filter_map(|of| self.share_of_sure(of.0));
                let least = 100.0 * shares.fold(1.0, f64::min);
                format!("at least {least:.1} % of pixels surely labelled")
            }
        };
        format!("{regions}; {groups}; {} photos", self.photos())
    }

    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        self.arrays(&mut content);
        self.facts(&mut content);
        self.lines(&mut content);
        self.notes(&mut content);
        content
    }

    fn findings(&self) -> Vec<Finding> {
        let mut findings = self.segmentation.findings();
        if self.is_undivided {
            let found = "the light shows one region, which has no groups to tell apart";
            let expected = "two regions or more, where no number of groups is asked for";
            let help = "ask for a number: --groups 2";
            findings.push(Finding::graded("groups", Grade::Fails, found, expected, help));
        }
        findings.extend(self.agreement());
        findings
    }

    fn verify(&mut self, lab: &mut Lab) -> Result<Option<Verified>> {
        // Verification needs eigenvectors of unmodified photos: nothing subtracted, no blur, no exchanged devices.
        if !self.is_of_photos_as_taken || self.there_and_back {
            return Ok(None);
        }
        let Some(verified) = lab.verify_segmentation(self.part, self.cut, &self.segmentation)? else {
            return Ok(None);
        };
        self.refuted = verified.refuted(self.segmentation.regions.at_one);
        self.estimates.clone_from(&verified.estimates);
        self.supported.clone_from(&verified.supported);
        Ok(Some(verified))
    }

    fn show(&self, lab: &mut Lab, page: &mut AnswerPage<'_>) -> Result<()> {
        self.show_on(&lab.white()?, page)
    }
}
