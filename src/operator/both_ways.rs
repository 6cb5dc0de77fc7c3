//! An operator whose transpose is measured by a second arrangement of the same devices, and the products `AᵀA` and `A Aᵀ`.

use super::{Adjoint, Direction, Operator, Symmetry, block, block_mut, delegate, product};
use crate::error::{Error, Result};

/// An operator `A` whose transpose is measured separately, in the same scene with camera and projector exchanged. By Helmholtz reciprocity,
/// light travels equally well from a projector's pixel to a camera's pixel and back. The second arrangement therefore photographs `Aᵀ`.
///
/// The two arrangements measure light in different units. `unit` is the factor that converts the second arrangement's unit to the first's.
pub struct Exchanged<F, B> {
    forth: F,
    back: B,
    unit: f64,
    /// The standard errors of the last products, in the first arrangement's unit.
    errors: Vec<f64>,
}

impl<F: Operator, B: Operator> Exchanged<F, B> {
    /// Makes the operator from `forth`, which photographs `A`, and `back`, which photographs its transpose.
    ///
    /// # Errors
    /// [`Error::Dimension`] if `back` does not have the dimensions of the transpose of `forth`.
    pub fn new(forth: F, back: B, unit: f64) -> Result<Self> {
        let expected = format!("{}x{}", forth.cols(), forth.rows());
        let found = format!("{}x{}", back.rows(), back.cols());
        Error::check_size("the operator of the exchanged devices", expected, found)?;
        Ok(Self { forth, back, unit, errors: Vec::new() })
    }

    /// Makes the operator like [`Exchanged::new`], and finds the unit from one photo under white by each arrangement. The sums of the two
    /// photos, `1ᵀA 1` and `1ᵀAᵀ1`, measure the same light. Takes two products.
    ///
    /// # Errors
    /// The errors of [`Exchanged::new`]; [`Error::Numerical`] if one of the arrangements sees no light; any error of the products.
    pub fn in_one_unit(mut forth: F, mut back: B) -> Result<Self> {
        let light = |operator: &mut dyn Operator| -> Result<f64> {
            let ones = vec![1.0; operator.cols()];
            Ok(product(operator, &ones)?.iter().sum())
        };
        let unit = light(&mut forth)? / light(&mut back)?;
        if !unit.is_finite() || unit <= 0.0 {
            return Err(Error::Numerical(
                "one of the two arrangements of the devices sees no light under white\n  help: look at both white photos".into(),
            ));
        }
        Self::new(forth, back, unit)
    }

    /// The factor that converts light of the second arrangement into the unit of the first arrangement.
    pub fn unit(&self) -> f64 {
        self.unit
    }
}

impl<F: Operator, B: Operator> Operator for Exchanged<F, B> {
    delegate!(forth: rows, cols, observer);

    fn symmetry(&self) -> Symmetry {
        Symmetry::General
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.forth.apply_block(xs, ys)?;
        self.errors = self.forth.standard_errors();
        Ok(())
    }

    fn block_size(&self) -> usize {
        self.forth.block_size().min(self.back.block_size())
    }

    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }

    /// The number of frames of both arrangements.
    fn frames(&self) -> Option<u64> {
        Some(self.forth.frames()? + self.back.frames()?)
    }
}

impl<F: Operator, B: Operator> Adjoint for Exchanged<F, B> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.back.apply_block(ys, xs)?;
        xs.iter_mut().flat_map(|x| x.iter_mut()).for_each(|value| *value *= self.unit);
        self.errors = self.back.standard_errors().into_iter().map(|error| self.unit * error).collect();
        Ok(())
    }
}

/// The product `AᵀA` or `A Aᵀ` of an operator `A` (`rows × cols`) with its transpose. It is symmetric and positive semidefinite for every
/// `A`, so the methods for symmetric operators apply to it.
///
/// On a rig whose camera and projector have different positions, `A` is not symmetric, and its transpose is photographed with the two
/// devices exchanged. Each product with `AᵀA` or `A Aᵀ` is two photos, one from each arrangement. The eigenvectors are the singular vectors
/// of `A`, and the eigenvalues are the squares of its singular values.
///
/// ```
/// use krylux::krylov::{EigsOptions, eigs};
/// use krylux::operator::{Exchanged, Gram, Closure, Symmetry};
///
/// # fn main() -> krylux::Result<()> {
/// // A = [[0, 2], [0, 0]] and its transpose, as two arrangements of devices would photograph them.
/// let forth = Closure::new(2, 2, Symmetry::General, |x: &[f64], y: &mut [f64]| {
///     y.copy_from_slice(&[2.0 * x[1], 0.0]);
///     Ok(())
/// });
/// let back = Closure::new(2, 2, Symmetry::General, |x: &[f64], y: &mut [f64]| {
///     y.copy_from_slice(&[0.0, 2.0 * x[0]]);
///     Ok(())
/// });
/// let mut both = Exchanged::new(forth, back, 1.0)?;
/// let mut gram = Gram::of_patterns(&mut both);
/// let found = eigs(&mut gram, &EigsOptions { count: 1, ..EigsOptions::default() })?;
/// // The singular values of A are 2 and 0.
/// assert!((found.values[0].sqrt() - 2.0).abs() < 1e-12);
/// # Ok(())
/// # }
/// ```
pub struct Gram<'a> {
    operator: &'a mut dyn Adjoint,
    /// True for `A Aᵀ`, which acts on photos; false for `AᵀA`, which acts on patterns.
    of_photos: bool,
    /// The factor by which a second product may enlarge the error of the first product. It is the largest ratio so far of the norm of a
    /// second product to the norm of its input.
    gain: f64,
    errors: Vec<f64>,
}

impl<'a> Gram<'a> {
    /// Makes `AᵀA` of `cols × cols`, on the pixels of the projector.
    pub fn of_patterns(operator: &'a mut dyn Adjoint) -> Self {
        Self { operator, of_photos: false, gain: 0.0, errors: Vec::new() }
    }

    /// Makes `A Aᵀ` of `rows × rows`, on the pixels of the camera.
    pub fn of_photos(operator: &'a mut dyn Adjoint) -> Self {
        Self { of_photos: true, ..Self::of_patterns(operator) }
    }

    fn size(&self) -> usize {
        if self.of_photos { self.operator.rows() } else { self.operator.cols() }
    }
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|value| value * value).sum::<f64>().sqrt()
}

impl Operator for Gram<'_> {
    fn rows(&self) -> usize {
        self.size()
    }

    fn cols(&self) -> usize {
        self.size()
    }

    fn symmetry(&self) -> Symmetry {
        Symmetry::Symmetric
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let (between, [first, second]) = match self.of_photos {
            true => (self.operator.cols(), [Direction::Adjoint, Direction::Forward]),
            false => (self.operator.rows(), [Direction::Forward, Direction::Adjoint]),
        };
        let mut middle = vec![vec![0.0; between]; xs.len()];
        self.operator.products(first, xs, &mut block_mut(&mut middle))?;
        let first_errors = self.operator.standard_errors();
        self.operator.products(second, &block(&middle), ys)?;
        for (middle, y) in middle.iter().zip(ys) {
            let length = norm(middle);
            if length > 0.0 {
                self.gain = self.gain.max(norm(y) / length);
            }
        }
        let errors = first_errors.iter().zip(self.operator.standard_errors());
        self.errors = errors.map(|(first, second)| second.hypot(self.gain * first)).collect();
        Ok(())
    }

    delegate!(operator: block_size, observer, frames, confirming);

    /// The standard errors of the products, if both `A` and `Aᵀ` state their standard errors. The errors of the first products are
    /// multiplied by the largest gain of any second product so far, which overestimates them.
    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
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

    type Product = dyn FnMut(&[f64], &mut [f64]) -> Result<()>;

    fn dense(rows: Vec<Vec<f64>>) -> Closure<Box<Product>> {
        let (height, width) = (rows.len(), rows[0].len());
        let product: Box<Product> = Box::new(move |x, y| {
            for (y, row) in y.iter_mut().zip(&rows) {
                *y = row.iter().zip(x).map(|(a, x)| a * x).sum();
            }
            Ok(())
        });
        Closure::new(height, width, Symmetry::General, product)
    }

    #[test]
    fn both_products_are_those_of_the_matrix() -> Result<()> {
        let rows = vec![vec![1.0, 2.0, 0.0], vec![0.0, 1.0, 3.0]];
        let columns = vec![vec![1.0, 0.0], vec![2.0, 1.0], vec![0.0, 3.0]];
        let mut both = Exchanged::new(dense(rows), dense(columns), 1.0)?;
        let mut of_patterns = [0.0; 3];
        Gram::of_patterns(&mut both).apply(&[1.0, 0.0, 0.0], &mut of_patterns)?;
        assert_eq!(of_patterns, [1.0, 2.0, 0.0], "the first column of AᵀA");
        let mut of_photos = [0.0; 2];
        Gram::of_photos(&mut both).apply(&[1.0, 0.0], &mut of_photos)?;
        assert_eq!(of_photos, [5.0, 2.0], "the first column of A Aᵀ");
        Ok(())
    }
}
