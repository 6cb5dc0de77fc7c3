//! Linear systems.

use crate::error::{Error, Result};
use crate::krylov::{Method, Solution, SolveOptions, solve_adjoint};
use crate::lab::Lab;
use crate::transport::Part;

impl Lab {
    /// Solves `A x = b` with the first channel's matrix; `b` has one entry per row. Fails as [`solve_adjoint`] and [`Lab::operator`].
    pub fn solve(&mut self, method: Method, rhs: &[f64], options: &SolveOptions) -> Result<Solution> {
        Error::check_size("entries of the right-hand side", self.resolution().pixels(), rhs.len())?;
        let mut operator = self.operator(Part::Full)?;
        self.expect(options.products);
        self.photos(|_| solve_adjoint(method, &mut operator, rhs, options))
    }
}
