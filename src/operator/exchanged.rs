//! Two arrangements of the same devices as one operator: as they stand, and exchanged.

use super::{Adjoint, Operator, Symmetry};
use crate::error::{Error, Result};
use crate::observer::Observer;

/// An operator `A` whose transpose is that of another source: the same scene, with camera and projector exchanged. By Helmholtz reciprocity the
/// light that goes from a projector's pixel to a camera's goes as well the other way, so that the second arrangement photographs `Aᵀ`.
///
/// The two arrangements measure light in units of their own. `unit` is the factor that converts light of the second into the unit of the first.
pub struct Exchanged<F, B> {
    forth: F,
    back: B,
    unit: f64,
    /// The standard errors of the last products, in the first arrangement's unit.
    errors: Vec<f64>,
}

impl<F: Operator, B: Operator> Exchanged<F, B> {
    /// `forth` photographs `A`, `back` its transpose.
    ///
    /// # Errors
    /// [`Error::Dimension`] where the second has not as many rows as the first has columns, or the reverse.
    pub fn new(forth: F, back: B, unit: f64) -> Result<Self> {
        if (forth.rows(), forth.cols()) != (back.cols(), back.rows()) {
            return Err(Error::Dimension {
                what: "the operator of the exchanged devices",
                expected: format!("{}x{}", forth.cols(), forth.rows()),
                found: format!("{}x{}", back.rows(), back.cols()),
            });
        }
        Ok(Self { forth, back, unit, errors: Vec::new() })
    }

    /// As [`Exchanged::new`], with the unit from one photo under white by each: `1ᵀA 1` and `1ᵀAᵀ1` are the same light. Takes two products.
    ///
    /// # Errors
    /// As [`Exchanged::new`]; [`Error::Numerical`] where the second sees no light; any error of the products.
    pub fn in_one_unit(mut forth: F, mut back: B) -> Result<Self> {
        let light = |operator: &mut dyn Operator| -> Result<f64> {
            let mut photo = vec![0.0; operator.rows()];
            operator.apply(&vec![1.0; operator.cols()], &mut photo)?;
            Ok(photo.iter().sum())
        };
        let unit = light(&mut forth)? / light(&mut back)?;
        if !unit.is_finite() || unit <= 0.0 {
            return Err(Error::Numerical(
                "one of the two arrangements of the devices sees no light under white\n  help: look at both white photos".into(),
            ));
        }
        Self::new(forth, back, unit)
    }

    /// The factor that converts light of the second arrangement into the unit of the first.
    pub fn unit(&self) -> f64 {
        self.unit
    }
}

impl<F: Operator, B: Operator> Operator for Exchanged<F, B> {
    fn rows(&self) -> usize {
        self.forth.rows()
    }

    fn cols(&self) -> usize {
        self.forth.cols()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.apply_block(&[x], &mut [y])
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.forth.apply_block(xs, ys)?;
        self.errors = self.forth.standard_errors();
        Ok(())
    }

    fn block_size(&self) -> usize {
        self.forth.block_size().min(self.back.block_size())
    }

    fn observer(&self) -> &dyn Observer {
        self.forth.observer()
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }

    /// The frames of both arrangements.
    fn frames(&self) -> Option<u64> {
        Some(self.forth.frames()? + self.back.frames()?)
    }
}

impl<F: Operator, B: Operator> Adjoint for Exchanged<F, B> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.apply_adjoint_block(&[y], &mut [x])
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.back.apply_block(ys, xs)?;
        xs.iter_mut().flat_map(|x| x.iter_mut()).for_each(|value| *value *= self.unit);
        self.errors = self.back.standard_errors().into_iter().map(|error| self.unit * error).collect();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::Closure;

    #[test]
    fn one_unit_makes_the_second_arrangement_the_transpose_of_the_first() -> Result<()> {
        let scaled = |by: f64| {
            Closure::new(2, 2, Symmetry::General, move |x: &[f64], y: &mut [f64]| {
                y.copy_from_slice(&[by * x[0], 3.0 * by * x[1]]);
                Ok(())
            })
        };
        let mut both = Exchanged::in_one_unit(scaled(1.0), scaled(5.0))?;
        let (mut forth, mut back) = ([0.0; 2], [0.0; 2]);
        both.apply(&[1.0, 2.0], &mut forth)?;
        both.apply_adjoint(&[1.0, 2.0], &mut back)?;
        assert!((both.unit() - 0.2).abs() < 1e-15, "rounding");
        for (forth, back) in forth.iter().zip(back) {
            assert!((forth - back).abs() < 1e-15 * forth, "rounding: {forth} {back}");
        }
        Ok(())
    }

    #[test]
    fn arrangements_of_other_sizes_and_in_the_dark_are_refused() {
        let of = |rows, cols, by: f64| {
            Closure::new(rows, cols, Symmetry::General, move |_: &[f64], y: &mut [f64]| {
                y.fill(by);
                Ok(())
            })
        };
        assert!(matches!(Exchanged::new(of(2, 3, 1.0), of(2, 3, 1.0), 1.0), Err(Error::Dimension { .. })));
        assert!(Exchanged::in_one_unit(of(2, 3, 1.0), of(3, 2, 0.0)).is_err());
    }
}
