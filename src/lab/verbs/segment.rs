//! Light transport segmentation.

use crate::analysis::segment::{SegmentRequest, Segmented};
use crate::error::Result;
use crate::lab::Lab;

impl Lab {
    /// Segments the scene: groups of pixels that exchange light, or, where camera and projector stand apart, on which the same light falls
    /// ([`SegmentRequest::run_with_transpose`]). The journal of the run keeps the true labels of the scene, where it has any.
    ///
    /// # Errors
    /// As [`SegmentRequest::run`] and [`Lab::operator`].
    pub fn segment(&mut self, request: &SegmentRequest) -> Result<Segmented> {
        request.check(self.resolution())?;
        self.allow_photos(request.options.photos);
        let truth = self.timed("true labels", |lab| lab.truth())?;
        self.keep_truth(truth.as_ref());
        let mut operator = self.operator(request.part())?;
        self.expect(request.photos());
        let resolution = self.resolution();
        self.photos(|_| request.run_with_transpose(&mut operator, resolution))
    }
}
