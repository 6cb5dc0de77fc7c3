//! The true regions of a scene, and the agreement of groups with them.

use super::{MASKED, Segmentation};
use crate::analysis::adjusted_rand_index;
use crate::error::Result;

/// The labels given by a scene's author.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Truth {
    /// The region of each pixel (`n`), or [`MASKED`].
    pub labels: Vec<u8>,
    /// The regions' names.
    pub regions: Vec<String>,
}

impl Truth {
    /// The number of regions that are visible in some pixel.
    pub fn seen(&self) -> usize {
        (0..MASKED).filter(|region| self.labels.contains(region)).count()
    }

    /// The adjusted Rand index of a segmentation for each of its numbers of groups.
    /// Fails with [`crate::Error::Dimension`] if the segmentation has another number of pixels.
    pub fn scores(&self, segmentation: &Segmentation) -> Result<Vec<(usize, f64)>> {
        let score =
            |(groups, labels): &(usize, Vec<u8>)| Ok((*groups, adjusted_rand_index(labels, &self.labels)?));
        segmentation.labels.iter().map(score).collect()
    }
}
