//! A measured rig as the Krylov methods see it.

use super::measurement::Measurement;
use super::photo::Plane;
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::transport::Part;

/// `y = P x` for one part and channel of a rig's matrix. Each product takes the photos that it needs: none for a constant `x`.
///
/// It is symmetric as [`Measurement::symmetry`] declares; whether that is so, `krylux audit` tells. Where it is not, no photo shows a
/// product with the transpose: camera and projector would have to change places.
pub struct MeasuredOperator<'a> {
    pub(super) measurement: &'a mut Measurement,
    pub(super) part: Part,
    pub(super) channel: usize,
}

impl Measurement {
    /// One channel of the rig's matrix as the Krylov methods see it.
    pub fn operator(&mut self, part: Part, channel: usize) -> MeasuredOperator<'_> {
        debug_assert!(channel < self.channels());
        MeasuredOperator { measurement: self, part, channel }
    }
}

impl MeasuredOperator<'_> {
    /// The last product, with the variance of each entry.
    pub fn last_product(&self) -> Option<&Plane> {
        self.measurement.last_product()
    }

    /// The standard error of the last product, `√Σ variance`: by so much `‖y − A x‖₂` is expected to be off because of noise.
    pub fn standard_error(&self) -> f64 {
        self.last_product().map_or(0.0, Plane::standard_error)
    }

    /// The rig behind.
    pub fn measurement(&self) -> &Measurement {
        self.measurement
    }
}

impl Operator for MeasuredOperator<'_> {
    fn rows(&self) -> usize {
        self.measurement.resolution().pixels()
    }

    fn cols(&self) -> usize {
        self.rows()
    }

    fn symmetry(&self) -> Symmetry {
        self.measurement.symmetry()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        if y.len() != self.rows() {
            return Err(Error::Dimension {
                what: "entries of the product",
                expected: self.rows().to_string(),
                found: y.len().to_string(),
            });
        }
        y.copy_from_slice(&self.measurement.product(self.part, self.channel, x)?.values);
        Ok(())
    }
}

impl Adjoint for MeasuredOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        match self.symmetry() {
            Symmetry::Symmetric => self.apply(y, x),
            Symmetry::General => Err(Error::Numerical(
                "a rig that is not coaxial takes no photos of its transpose\n  help: use a method without it, such as gmres or krylov-box"
                    .into(),
            )),
        }
    }
}
