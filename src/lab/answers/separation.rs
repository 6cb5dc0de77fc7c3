//! Direct and global light.

use super::Answer;
use crate::analysis::planes::{Planes, relative_error};
use crate::analysis::separate::{ComparisonRow, NearFar};
use crate::error::Result;
use crate::lab::{Lab, RunFolder};
use crate::report::separation::SeparationRun;

/// Direct and global light under an all-ones pattern, with what was asked beside it.
#[derive(Clone, Debug)]
pub struct Separated {
    /// The method with its setting, in words.
    pub method: String,
    /// The method's name.
    pub name: &'static str,
    /// Photos that the method took; those of `near_far` are beside them.
    pub photos: usize,
    /// One bounce.
    pub direct: Planes,
    /// Two bounces and more.
    pub global: Planes,
    /// Standard errors of `direct`, where the method knows them.
    pub standard_error: Option<Planes>,
    /// The exact first bounce, where a simulator knows it and the method is another.
    pub truth: Option<Planes>,
    /// The second bounce, and three and more.
    pub bounces: Option<[Planes; 2]>,
    /// Global light by how far it went.
    pub near_far: Option<NearFar>,
    /// Every method at several photo counts; may be empty.
    pub comparison: Vec<ComparisonRow>,
    /// The largest error of `direct` that is good enough, where there is one.
    pub max_error: Option<f64>,
}

impl Separated {
    /// The relative error of the direct light, where the truth is known.
    pub fn error(&self) -> Option<f64> {
        self.truth.as_ref().map(|truth| relative_error(&self.direct, truth))
    }

    /// Whether it is as good as was asked for.
    pub fn is_good(&self) -> bool {
        match (self.max_error, self.error()) {
            (Some(most), Some(error)) => error <= most,
            _ => true,
        }
    }

    fn with_page<T>(&self, lab: &Lab, show: impl FnOnce(&SeparationRun<'_>) -> T) -> T {
        show(&SeparationRun {
            title: format!("{} · direct and global light", lab.name()),
            method: self.method.clone(),
            photos: self.photos,
            resolution: lab.resolution(),
            unit: lab.unit(),
            direct: &self.direct,
            global: &self.global,
            standard_error: self.standard_error.as_ref(),
            truth: self.truth.as_ref(),
            bounces: self.bounces.as_ref(),
            reach: self.near_far.as_ref(),
            comparison: &self.comparison,
            good: self.is_good(),
            strip: &lab.contact_sheet(),
        })
    }
}

impl Answer for Separated {
    fn verb(&self) -> &'static str {
        "separate"
    }

    fn photos(&self) -> usize {
        self.photos + self.near_far.as_ref().map_or(0, |near_far| near_far.photos)
    }

    fn sentence(&self, lab: &Lab) -> String {
        self.with_page(lab, |page| page.sentence())
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        self.with_page(lab, |page| page.write(&run.path, &run.manifest, seconds))
    }
}
