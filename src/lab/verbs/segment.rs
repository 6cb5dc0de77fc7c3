//! Light transport segmentation.

use crate::analysis::segment::{SegmentRequest, Segmented};
use crate::error::Result;
use crate::lab::{Lab, Log};
use crate::operator::Operator;

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
        let confirm = request.options.confirm.filter(|_| !operator.is_free());
        self.expect(request.photos() + confirm.map_or(0, |confirm| confirm.steps(operator.cols())));
        let resolution = self.resolution();
        let request = &SegmentRequest { blur: Some(self.blur(request)), ..request.clone() };
        self.photos(|_| request.run_with_transpose(&mut operator, resolution))
    }

    /// The blur of patterns and photos: what is asked for, or what the rig needs.
    fn blur(&self, request: &SegmentRequest) -> f64 {
        if let Some(blur) = request.blur {
            return blur;
        }
        let blur = self.source.blur();
        if blur > 0.0 {
            self.observer.note(format_args!(
                "note: the camera has fewer than two pixels along a side for each of the projector's, so patterns and photos are blurred by \
                 {blur} pixel; --blur 0 leaves them as they are"
            ));
        }
        blur
    }
}
