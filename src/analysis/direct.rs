//! The operator of an analysis: the transport of all light, or of all light except direct light, with or without blur.
//!
//! On a coaxial rig, direct light is on the diagonal of `A`, and contributes most of the diagonal. Simulators omit direct light; rigs
//! measure and subtract it.

use crate::error::{Error, Result};
use crate::image::Blur;
use crate::operator::{Operator, between, check_square, delegate};

/// The operator `A − diag(d)`, with the symmetry of `A`. A product is one photo.
pub struct WithoutDirect<'a> {
    operator: &'a mut dyn Operator,
    direct: &'a [f64],
}

impl<'a> WithoutDirect<'a> {
    /// Makes the operator for `A` (`n × n`) and `d` (`n`). Fails with [`Error::Dimension`] if the sizes differ.
    pub fn new(operator: &'a mut dyn Operator, direct: &'a [f64]) -> Result<Self> {
        for side in [operator.rows(), operator.cols()] {
            Error::check_size("pixels of the direct image", side, direct.len())?;
        }
        Ok(Self { operator, direct })
    }
}

impl Operator for WithoutDirect<'_> {
    delegate!(operator: rows, cols, symmetry, block_size, observer, standard_errors, common_error, frames);
    delegate!(operator: confirming);

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.operator.apply_block(xs, ys)?;
        for (x, y) in xs.iter().zip(ys) {
            for ((y, x), direct) in y.iter_mut().zip(*x).zip(self.direct) {
                *y -= direct * x;
            }
        }
        Ok(())
    }
}

/// The operator `K A K`, with a Gaussian blur `K = Kᵀ` of both pattern and photo. It has the symmetry of `A`, which a blur of the photo
/// alone would break. The blur averages the noise of neighbouring pixels. Indirect light does not count as direct, even if its path is
/// shorter than the width of the blur. A product is one photo.
pub struct Blurred<'a> {
    operator: &'a mut dyn Operator,
    blur: Blur,
}

impl<'a> Blurred<'a> {
    /// Makes the operator for `A` (`n × n`). Fails with [`Error::Dimension`] if the blur has another number of pixels.
    pub fn new(operator: &'a mut dyn Operator, blur: Blur) -> Result<Self> {
        check_square("rows and columns of an operator to be blurred", blur.resolution().pixels(), operator)?;
        Ok(Self { operator, blur })
    }
}

impl Operator for Blurred<'_> {
    delegate!(operator: rows, cols, symmetry, block_size, observer, frames, confirming);

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let blur = &self.blur;
        let after = |_: &[f64], photo: &[f64], y: &mut [f64]| y.copy_from_slice(&blur.apply(photo));
        between(self.operator, (xs, ys), |x| blur.apply(x), after)
    }

    /// The standard errors of the photos, reduced by the blur. The reduction assumes that all pixels have the same noise.
    fn standard_errors(&self) -> Vec<f64> {
        let errors = self.operator.standard_errors();
        if errors.is_empty() {
            return errors;
        }
        let ones = vec![1.0; self.operator.cols()];
        let left = self.blur.variance(&ones).iter().sum::<f64>() / ones.len() as f64;
        errors.into_iter().map(|error| left.sqrt() * error).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::operator::{Closure, Symmetry};

    /// `A_ij = i j + δ_ij`. A variant that is not symmetric adds `more` for `i < j`.
    fn dense(more: f64) -> impl Operator {
        let symmetry = if more == 0.0 { Symmetry::Symmetric } else { Symmetry::General };
        Closure::new(12, 12, symmetry, move |x: &[f64], y: &mut [f64]| {
            for (i, y) in y.iter_mut().enumerate() {
                let entry =
                    |j: usize| (i * j) as f64 + f64::from(u8::from(i == j)) + if i < j { more } else { 0.0 };
                *y = (0..12).map(|j| entry(j) * x[j]).sum();
            }
            Ok(())
        })
    }

    fn column(operator: &mut dyn Operator, j: usize) -> Result<Vec<f64>> {
        let unit: Vec<f64> = (0..12).map(|i| f64::from(u8::from(i == j))).collect();
        let mut photo = vec![0.0; 12];
        operator.apply(&unit, &mut photo)?;
        Ok(photo)
    }

    #[test]
    fn without_its_diagonal_and_blurred_on_both_sides_a_matrix_stays_symmetric() -> Result<()> {
        let direct: Vec<f64> = (0..12).map(|i| (i * i) as f64 + 1.0).collect();
        let mut dense = dense(0.0);
        let mut global = WithoutDirect::new(&mut dense, &direct)?;
        for j in 0..12 {
            let column = column(&mut global, j)?;
            assert!((0..12).all(|i| column[i] == if i == j { 0.0 } else { (i * j) as f64 }));
        }
        let Some(blur) = Blur::new(Resolution::new(4, 3), 0.8) else { return Ok(()) };
        let mut blurred = Blurred::new(&mut global, blur)?;
        let columns = (0..12).map(|j| column(&mut blurred, j)).collect::<Result<Vec<_>>>()?;
        for (i, column) in columns.iter().enumerate() {
            for (j, row) in columns.iter().enumerate() {
                // Entries are below 121, and the error is about a hundred roundings.
                assert!((column[j] - row[i]).abs() < 1e-12);
            }
        }
        assert!(columns[0][0] > 0.0, "the diagonal is lit by the neighbours");
        Ok(())
    }

    #[test]
    fn what_does_not_fit_is_refused_and_a_general_operator_stays_general() -> Result<()> {
        let mut dense = dense(1.0);
        assert!(WithoutDirect::new(&mut dense, &[1.0]).is_err());
        assert_eq!(WithoutDirect::new(&mut dense, &[0.0; 12])?.symmetry(), Symmetry::General);
        let Some(blur) = Blur::new(Resolution::new(2, 2), 1.0) else { return Ok(()) };
        assert!(Blurred::new(&mut dense, blur).is_err());
        Ok(())
    }
}
