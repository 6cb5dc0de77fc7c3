//! Planning a segmentation on the twin.

use super::{Cost, Planner};
use crate::analysis::segment::segment;
use crate::analysis::{SegmentOptions, Segmentation, adjusted_rand_index};
use crate::error::Result;
use crate::operator::Observed;
use crate::transport::Part;

/// The result of a segmentation on the twin. Scores are adjusted Rand indices for each number of groups.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SegmentationTrial {
    /// Its cost.
    pub cost: Cost,
    /// The scores against the groups that the same method finds with ideal devices.
    pub agreement: Vec<(usize, f64)>,
    /// The scores against the true labels; empty if they are unknown.
    pub truth: Vec<(usize, f64)>,
}

impl Planner<'_> {
    /// The groups with ideal devices, by the same method with the same number of photos. Fails as [`segment`] does.
    pub fn ideal_segmentation(&self, part: Part, options: &SegmentOptions) -> Result<Segmentation> {
        segment(&mut self.twin.operator(part, 0)?, options)
    }

    /// Segments with the noise of `seed`. `ideal` is from [`Planner::ideal_segmentation`]; `labels` are true. Fails as
    /// [`segment`] or the rig does.
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
