//! Eigenvalues and eigenvectors.

use crate::error::Result;
use crate::krylov::{Eigs, EigsOptions, Singular, SingularOptions, eigs, singular};
use crate::lab::Lab;
use crate::lab::lock::lock;
use crate::transport::Part;

impl Lab {
    /// Eigenpairs of one part of the light transport matrix. Where a model of a run's photos answers, their standard errors are the bounds.
    ///
    /// # Errors
    /// As [`eigs()`] and [`Lab::operator`].
    pub fn eigs(&mut self, part: Part, options: &EigsOptions) -> Result<Eigs> {
        self.allow_photos(options.products);
        let mut operator = self.operator(part)?;
        self.expect(options.products);
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
        self.expect(options.products);
        self.photos(|_| singular(&mut operator, options))
    }
}
