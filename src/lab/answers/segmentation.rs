//! Groups of pixels that exchange light.

use super::Answer;
use crate::analysis::Segmentation;
use crate::analysis::segment::{Segmented, Truth};
use crate::error::Result;
use crate::lab::{Lab, RunFolder};
use crate::report::segmentation::{SegmentationExtras, SegmentationRun};

/// A segmentation with what was asked beside it, compared with the true labels.
#[derive(Clone, Copy, Debug)]
pub struct Scored<'a> {
    /// The groups.
    pub segmented: &'a Segmented,
    /// The true labels, where they are known.
    pub truth: Option<&'a Truth>,
    /// The adjusted Rand index of each number of groups; empty without true labels.
    pub scores: &'a [(usize, f64)],
}

impl Answer for Scored<'_> {
    fn verb(&self) -> &'static str {
        "segment"
    }

    fn photos(&self) -> usize {
        self.segmented.photos()
    }

    fn sentence(&self, _: &Lab) -> String {
        self.segmented.segmentation.status.clone()
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let Segmented { segmentation, direct, evidence, features } = self.segmented;
        let page = SegmentationRun {
            title: format!("{} · light transport segmentation", lab.name()),
            segmentation,
            resolution: lab.resolution(),
            white: &lab.white()?,
            truth: self.truth,
            scores: self.scores,
            extras: SegmentationExtras { direct: direct.as_ref(), features: features.as_ref(), evidence },
            unit: lab.unit(),
            strip: &lab.contact_sheet(),
        };
        page.write(&run.path, &run.manifest, seconds)
    }
}

impl Answer for Segmented {
    fn verb(&self) -> &'static str {
        "segment"
    }

    fn photos(&self) -> usize {
        Self::photos(self)
    }

    fn sentence(&self, _: &Lab) -> String {
        self.segmentation.status.clone()
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let truth = lab.truth()?;
        let scores = truth.as_ref().map(|truth| truth.scores(&self.segmentation)).transpose()?;
        let scores = scores.unwrap_or_default();
        Scored { segmented: self, truth: truth.as_ref(), scores: &scores }.write(lab, run, seconds)
    }
}

impl Answer for Segmentation {
    fn verb(&self) -> &'static str {
        "segment"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self, _: &Lab) -> String {
        self.status.clone()
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        Segmented::from(self.clone()).write(lab, run, seconds)
    }
}
