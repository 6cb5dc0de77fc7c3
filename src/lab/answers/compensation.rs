//! What to project so that the scene looks like a target.

use super::Answer;
use crate::analysis::{CompensateOptions, Compensation, MethodRun};
use crate::error::Result;
use crate::lab::{Lab, RunFolder};
use crate::report::compensation::{CompensationExtras, CompensationRun};

/// A compensation with the options that it was found by.
#[derive(Clone, Copy, Debug)]
pub struct Compensated<'a> {
    /// The compensation.
    pub found: &'a Compensation,
    /// Its options.
    pub options: &'a CompensateOptions,
    /// Other methods with as many photos.
    pub methods: &'a [MethodRun],
    /// The name and the unit of the source, where it is a model rather than the laboratory's own.
    pub model: Option<(&'a str, &'a str)>,
    /// Whether photos were taken for it.
    pub has_photos: bool,
}

impl<'a> Compensated<'a> {
    /// A compensation from photos of the laboratory's source.
    pub fn new(found: &'a Compensation, options: &'a CompensateOptions) -> Self {
        Self { found, options, methods: &[], model: None, has_photos: true }
    }

    /// Lets `show` use the page's data.
    fn with_page<T>(&self, lab: &Lab, show: impl FnOnce(&CompensationRun<'_>) -> T) -> T {
        let (name, unit) = (lab.name(), lab.unit());
        let (name, unit) = self.model.unwrap_or((&name, unit));
        let sheet = lab.contact_sheet();
        show(&CompensationRun {
            title: format!("{name} · light transport compensation"),
            found: self.found,
            method: self.options.method.facts().name,
            floor: self.options.floor,
            extras: CompensationExtras { methods: self.methods, lift: self.options.lift },
            unit,
            strip: self.has_photos.then_some(&sheet),
        })
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

    fn sentence(&self, lab: &Lab) -> String {
        self.with_page(lab, |page| page.sentence())
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        self.with_page(lab, |page| page.write(&run.path, &run.manifest, seconds))
    }
}
