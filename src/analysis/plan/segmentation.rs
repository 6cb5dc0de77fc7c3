//! A segmentation on the twin.

use super::{Cost, Planner};
use crate::analysis::segment::segment;
use crate::analysis::{SegmentOptions, Segmentation, adjusted_rand_index};
use crate::error::Result;
use crate::operator::Observed;
use crate::transport::Part;

/// A segmentation on the twin, and how good it is: adjusted Rand indices for each number of groups.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SegmentationTrial {
    /// What it took.
    pub cost: Cost,
    /// Against the groups that the same method finds without any device between.
    pub agreement: Vec<(usize, f64)>,
    /// Against the true labels; empty without.
    pub truth: Vec<(usize, f64)>,
}

impl Planner<'_> {
    /// The groups without any device between, by the same method and photos.
    ///
    /// # Errors
    /// As [`segment`].
    pub fn ideal_segmentation(&self, part: Part, options: &SegmentOptions) -> Result<Segmentation> {
        segment(&mut self.twin.operator(part, 0)?, options)
    }

    /// Segments the twin with the noise of this seed. `ideal` is [`Planner::ideal_segmentation`], `labels` are the true ones.
    ///
    /// # Errors
    /// As [`segment`], and whatever the rig fails with.
    pub fn segmentation(
        &self,
        part: Part,
        options: &SegmentOptions,
        ideal: &Segmentation,
        labels: Option<&[u8]>,
        seed: u64,
    ) -> Result<SegmentationTrial> {
        let mut measurement = self.measure(seed)?.in_luma();
        let mut operator = measurement.operator(part, 0);
        let found = segment(&mut Observed::new(&mut operator, self.observer), options)?;
        let of_ideal = |groups| ideal.labels.iter().find(|(of, _)| *of == groups).map(|(_, labels)| labels);
        let mut trial = SegmentationTrial {
            cost: Cost::of(&measurement, found.photos),
            agreement: Vec::new(),
            truth: Vec::new(),
        };
        for (groups, found) in &found.labels {
            if let Some(ideal) = of_ideal(*groups) {
                trial.agreement.push((*groups, adjusted_rand_index(found, ideal)?));
            }
            if let Some(labels) = labels {
                trial.truth.push((*groups, adjusted_rand_index(found, labels)?));
            }
        }
        Ok(trial)
    }
}
