//! Eigenvalues and eigenvectors.

use crate::error::Result;
use crate::krylov::{Eigs, EigsOptions, eigs};
use crate::lab::Lab;
use crate::transport::Part;

impl Lab {
    /// Eigenpairs of one part of the light transport matrix.
    ///
    /// # Errors
    /// As [`eigs()`] and [`Lab::operator`].
    pub fn eigs(&mut self, part: Part, options: &EigsOptions) -> Result<Eigs> {
        self.allow_photos(options.products);
        let mut operator = self.operator(part)?;
        self.expect(options.products);
        self.photos(|_| eigs(&mut operator, options))
    }
}
