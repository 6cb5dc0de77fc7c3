//! A photo of which only some light paths are let through.

use super::Answer;
use crate::analysis::planes::{Planes, relative_error};
use crate::analysis::{Probed, Probing};
use crate::error::Result;
use crate::lab::{Lab, RunFolder};
use crate::report::probing::ProbingRun;

/// A probed photo of every channel.
#[derive(Clone, Debug)]
pub struct ProbedLight {
    /// Which paths were let through.
    pub probing: Probing,
    /// Photos of each channel.
    pub photos: usize,
    /// The photo.
    pub values: Planes,
    /// Its standard errors.
    pub standard_errors: Planes,
    /// The exact photo, where the matrix is known.
    pub truth: Option<Planes>,
}

impl ProbedLight {
    /// The probed channels, with the exact photo where it is known.
    pub fn new(probing: Probing, found: Vec<Probed>, truth: Option<Planes>) -> Self {
        let photos = found.first().map_or(0, |found| found.photos);
        let values = found.iter().map(|found| found.values.clone()).collect();
        let standard_errors = found.into_iter().map(|found| found.standard_errors).collect();
        Self { probing, photos, values, standard_errors, truth }
    }

    /// The relative error, where the exact photo is known.
    pub fn error(&self) -> Option<f64> {
        self.truth.as_ref().map(|truth| relative_error(&self.values, truth))
    }

    /// The relative standard error.
    pub fn noise(&self, lab: &Lab) -> f64 {
        self.with_page(lab, |page| page.noise())
    }

    fn with_page<T>(&self, lab: &Lab, show: impl FnOnce(&ProbingRun<'_>) -> T) -> T {
        show(&ProbingRun {
            title: format!("{} · probing of light transport", lab.name()),
            probing: self.probing,
            photos: self.photos,
            resolution: lab.resolution(),
            unit: lab.unit(),
            values: &self.values,
            standard_errors: &self.standard_errors,
            truth: self.truth.as_ref(),
            strip: &lab.contact_sheet(),
        })
    }
}

impl Answer for ProbedLight {
    fn verb(&self) -> &'static str {
        "probe"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self, lab: &Lab) -> String {
        self.with_page(lab, |page| page.sentence())
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        self.with_page(lab, |page| page.write(&run.path, &run.manifest, seconds))
    }
}
