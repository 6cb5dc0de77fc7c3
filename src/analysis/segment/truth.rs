//! The true regions of a scene, and how well groups agree with them.

use super::{MASKED, Segmentation};
use crate::analysis::adjusted_rand_index;
use crate::error::Result;

/// The labels of a scene's author.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Truth {
    /// The region of each pixel (`n`); [`MASKED`] where there is none.
    pub labels: Vec<u8>,
    /// The regions' names.
    pub regions: Vec<String>,
}

impl Truth {
    /// The number of regions that some pixel sees.
    pub fn seen(&self) -> usize {
        (0..MASKED).filter(|region| self.labels.contains(region)).count()
    }

    /// The adjusted Rand index of each number of groups of a segmentation.
    ///
    /// # Errors
    /// [`crate::Error::Dimension`] when the segmentation has another number of pixels.
    pub fn scores(&self, segmentation: &Segmentation) -> Result<Vec<(usize, f64)>> {
        let score =
            |(groups, labels): &(usize, Vec<u8>)| Ok((*groups, adjusted_rand_index(labels, &self.labels)?));
        segmentation.labels.iter().map(score).collect()
    }
}
