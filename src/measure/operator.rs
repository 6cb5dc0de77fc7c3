//! A measured rig as a linear operator for the Krylov methods.

use super::measurement::Measurement;
use super::photo::Plane;
use crate::error::{Error, Result};
use crate::operator::{Adjoint, Operator, Symmetry};
use crate::transport::Part;

/// The operator `y = P x` for one part and channel of a rig's matrix. Each product takes the photos that it
/// needs; a constant `x` needs none.
///
/// The operator is symmetric if [`Measurement::symmetry`] says so, and `krylux audit` tests that. A product
/// with the transpose of a matrix that is not symmetric cannot be photographed: camera and projector would
/// have to change places.
pub struct MeasuredOperator<'a> {
    pub(crate) measurement: &'a mut Measurement,
    pub(crate) part: Part,
    pub(crate) channel: usize,
    /// The standard errors of the products of the last call.
    errors: Vec<f64>,
}

impl Measurement {
    /// The operator of one part and one channel of the rig's matrix.
    pub fn operator(&mut self, part: Part, channel: usize) -> MeasuredOperator<'_> {
        debug_assert!(channel < self.channels());
        MeasuredOperator { measurement: self, part, channel, errors: Vec::new() }
    }
}

impl MeasuredOperator<'_> {
    /// The last product, with the variance of each entry.
    pub fn last_product(&self) -> Option<&Plane> {
        self.measurement.last_product()
    }

    /// The measured rig.
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
        self.apply_block(&[x], &mut [y])
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.errors.clear();
        for (x, y) in xs.iter().zip(ys) {
            if y.len() != self.rows() {
                return Err(Error::Dimension {
                    what: "entries of the product",
                    expected: self.rows().to_string(),
                    found: y.len().to_string(),
                });
            }
            let product = self.measurement.product(self.part, self.channel, x)?;
            y.copy_from_slice(&product.values);
            self.errors.push(product.standard_error());
        }
        Ok(())
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }

    fn common_error(&mut self, x: &[f64]) -> Result<f64> {
        match self.part {
            Part::Full => Ok(0.0),
            Part::Direct | Part::Global => self.measurement.direct_error(self.channel, x),
        }
    }

    fn frames(&self) -> Option<u64> {
        Some(self.measurement.effort().frames())
    }
}

impl Adjoint for MeasuredOperator<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        match self.symmetry() {
            Symmetry::Symmetric => self.apply(y, x),
            Symmetry::General => Err(Error::Numerical(
                "a rig that is not coaxial cannot take photos of its transpose\n  help: use a method without the transpose, such as gmres or krylov-box, or exchange the devices: krylux::operator::Exchanged takes both rigs"
                    .into(),
            )),
        }
    }
}
