//! A captured model and what it answered.

use super::Answer;
use crate::analysis::low_rank::{Dual, RankRow, Reduced, Relit, SavedModel};
use crate::error::Result;
use crate::lab::{Lab, RunFolder};
use crate::report::relighting::RelightingRun;

/// A captured model and what it answered.
#[derive(Clone, Debug)]
pub struct Relighting {
    /// The model.
    pub model: SavedModel,
    /// Photos that this run took.
    pub photos: usize,
    /// Relit patterns.
    pub relit: Vec<Relit>,
    /// Dual photographs.
    pub duals: Vec<Dual>,
    /// Photos without interreflections.
    pub reduced: Vec<Reduced>,
    /// The model's error for each number of photos, where the matrix is known.
    pub curve: Vec<RankRow>,
    /// The largest error of a relit photo that is good enough, where there is one.
    pub max_error: Option<f64>,
    /// Files of the model that are in the folder of the run already; `None` where the model is still to be written there.
    pub files: Option<Vec<String>>,
}

impl Relighting {
    /// A model of which nothing was asked.
    pub fn new(model: SavedModel, photos: usize) -> Self {
        Self {
            model,
            photos,
            relit: Vec::new(),
            duals: Vec::new(),
            reduced: Vec::new(),
            curve: Vec::new(),
            max_error: None,
            files: None,
        }
    }

    /// The largest error of a relit photo, where it is known.
    pub fn worst(&self) -> Option<f64> {
        self.relit.iter().filter_map(|relit| relit.errors.last().copied()).reduce(f64::max)
    }

    /// Whether it is as good as was asked for.
    pub fn is_good(&self) -> bool {
        match (self.max_error, self.worst()) {
            (Some(most), Some(worst)) => worst <= most,
            _ => true,
        }
    }

    fn with_page<T>(&self, lab: &Lab, show: impl FnOnce(&RelightingRun<'_>) -> T) -> T {
        let sheet = lab.contact_sheet();
        show(&RelightingRun {
            title: format!("{} · low-rank light transport", self.model.source),
            photos: self.photos,
            rank: self.model.rank(),
            unit: &self.model.unit,
            relit: &self.relit,
            duals: &self.duals,
            reduced: &self.reduced,
            curve: &self.curve,
            good: self.is_good(),
            strip: (self.photos > 0).then_some(&sheet),
        })
    }
}

impl Answer for Relighting {
    fn verb(&self) -> &'static str {
        "relight"
    }

    fn photos(&self) -> usize {
        self.photos
    }

    fn sentence(&self, lab: &Lab) -> String {
        self.with_page(lab, |page| page.sentence())
    }

    fn write(&self, lab: &mut Lab, run: &mut RunFolder, seconds: f64) -> Result<Vec<String>> {
        let mut files = match &self.files {
            Some(files) => files.clone(),
            None => self.model.write(&run.path)?,
        };
        files.extend(self.with_page(lab, |page| page.write(&run.path, &run.manifest, seconds))?);
        Ok(files)
    }
}
