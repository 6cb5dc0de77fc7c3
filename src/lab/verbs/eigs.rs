//! Eigenvalues and eigenvectors.

use crate::error::Result;
use crate::krylov::{Confirm, Eigs, EigsOptions, Singular, SingularOptions, eigs, singular};
use crate::lab::lock::lock;
use crate::lab::{Lab, LabOperator};
use crate::operator::Operator;
use crate::transport::Part;

impl Lab {
    /// Eigenpairs of one part of the light transport matrix. Where a model of a run's photos answers, their standard errors are the bounds.
    ///
    /// # Errors
    /// As [`eigs()`] and [`Lab::operator`].
    pub fn eigs(&mut self, part: Part, options: &EigsOptions) -> Result<Eigs> {
        self.allow_photos(options.products);
        let mut operator = self.operator(part)?;
        let (confirm, photos) = confirm_within(options.confirm, &operator);
        self.expect(options.products + photos);
        let options = &EigsOptions { confirm, ..options.clone() };
        let mut found = self.photos(|_| eigs(&mut operator, options))?;
        // What a model misses is no noise that averages out over the pixels: it makes all large eigenvalues smaller.
        if lock(self.transport()?).is_model() {
            found.standard_errors.clone_from(&found.bounds);
        }
        Ok(found)
    }

    /// Singular values of one part of the light transport matrix, with the patterns and their photos. Every second photo is one of the transpose.
    ///
    /// # Errors
    /// As [`singular()`] and [`Lab::operator`]; a rig that is not coaxial takes no photos of its transpose ([`crate::operator::Exchanged`]).
    pub fn singular(&mut self, part: Part, options: &SingularOptions) -> Result<Singular> {
        self.allow_photos(options.products);
        let mut operator = self.operator(part)?;
        let (confirm, photos) = confirm_within(options.confirm, &operator);
        self.expect(options.products + 2 * photos);
        let options = &SingularOptions { confirm, ..options.clone() };
        self.photos(|_| singular(&mut operator, options))
    }
}

/// How an answer is confirmed by photos, and how many more it takes at most.
fn confirm_within(asked: Option<Confirm>, operator: &LabOperator) -> (Option<Confirm>, usize) {
    let confirm =
        asked.map(|confirm| if operator.is_free() { confirm } else { confirm.on_rig(operator.cols()) });
    let photos = confirm.filter(|_| !operator.is_free()).map_or(0, |confirm| confirm.products);
    (confirm, photos)
}
