//! The labels of the regions that a scene's pixels see.

use super::{Lab, Truth};
use crate::error::Result;

impl Lab {
    /// The region that the centre of each pixel of a scene sees, row by row; 255 marks a pixel that sees none.
    ///
    /// # Errors
    /// [`crate::Error::Data`] if there is no scene; [`crate::Error::Scene`] for more than 255 regions.
    pub fn labels(&self) -> Result<Vec<u8>> {
        self.scene_source()?.labels(self.resolution())
    }

    /// The true labels by the scene's author, if there are any. Fails as [`Lab::labels`].
    pub fn truth(&self) -> Result<Option<Truth>> {
        self.source.truth()
    }

    /// The true labels that a segmentation supplied, or else [`Lab::truth`]. Fails as [`Lab::labels`].
    pub fn known_truth(&self) -> Result<Option<Truth>> {
        match &self.kept_truth {
            Some(truth) => Ok(Some(truth.clone())),
            None => self.truth(),
        }
    }

    /// Makes the journal of the run keep the true labels, so that a replay of the run knows them. Call it before the first photo.
    pub(crate) fn keep_truth(&mut self, truth: Option<&Truth>) {
        self.kept_truth = truth.cloned();
    }
}
