//! `AᵀA` and `A Aᵀ`: light that goes there and back, the devices exchanged for the way back.

use super::{Adjoint, Operator, Symmetry};
use crate::error::Result;
use crate::observer::Observer;

/// The product `AᵀA` or `A Aᵀ` of an operator `A` (`rows × cols`) with its transpose. It is symmetric and positive semidefinite whatever `A`
/// is, so that the methods for symmetric operators apply to it.
///
/// On a rig whose camera and projector stand apart `A` is not symmetric, and its transpose is photographed with the two devices exchanged:
/// each product here is two photos, one from either arrangement. The eigenvectors are the singular vectors of `A`, and the eigenvalues the
/// squares of its singular values.
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
    /// Whether it is `A Aᵀ`, on photos, and not `AᵀA`, on patterns.
    of_photos: bool,
    /// The largest `‖second product‖ / ‖its pattern‖` so far: how much the second way may enlarge the errors of the first.
    gain: f64,
    errors: Vec<f64>,
}

impl<'a> Gram<'a> {
    /// `AᵀA` of `cols × cols`: on the pixels of the projector.
    pub fn of_patterns(operator: &'a mut dyn Adjoint) -> Self {
        Self { operator, of_photos: false, gain: 0.0, errors: Vec::new() }
    }

    /// `A Aᵀ` of `rows × rows`: on the pixels of the camera.
    pub fn of_photos(operator: &'a mut dyn Adjoint) -> Self {
        Self { of_photos: true, ..Self::of_patterns(operator) }
    }

    fn size(&self) -> usize {
        if self.of_photos { self.operator.rows() } else { self.operator.cols() }
    }

    /// The errors of the second products, and those of the first as far as the second may have enlarged them.
    fn note_errors(&mut self, first: &[f64], middle: &[Vec<f64>], ys: &[&mut [f64]]) {
        for (middle, y) in middle.iter().zip(ys) {
            let length = norm(middle);
            if length > 0.0 {
                self.gain = self.gain.max(norm(y) / length);
            }
        }
        let second = self.operator.standard_errors();
        self.errors =
            first.iter().zip(&second).map(|(first, second)| second.hypot(self.gain * first)).collect();
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

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.apply_block(&[x], &mut [y])
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        let between = if self.of_photos { self.operator.cols() } else { self.operator.rows() };
        let mut middle = vec![vec![0.0; between]; xs.len()];
        let first;
        if self.of_photos {
            self.operator.apply_adjoint_block(xs, &mut super::block_mut(&mut middle))?;
            first = self.operator.standard_errors();
            self.operator.apply_block(&super::block(&middle), ys)?;
        } else {
            self.operator.apply_block(xs, &mut super::block_mut(&mut middle))?;
            first = self.operator.standard_errors();
            self.operator.apply_adjoint_block(&super::block(&middle), ys)?;
        }
        self.note_errors(&first, &middle, ys);
        Ok(())
    }

    fn block_size(&self) -> usize {
        self.operator.block_size()
    }

    fn observer(&self) -> &dyn Observer {
        self.operator.observer()
    }

    /// Standard errors of products where both of `A` and `Aᵀ` are stated: those of the first are taken as enlarged by the second as much as any
    /// product so far, which is rather too much.
    fn standard_errors(&self) -> Vec<f64> {
        self.errors.clone()
    }

    fn frames(&self) -> Option<u64> {
        self.operator.frames()
    }

    fn confirming(&mut self, on: bool) -> bool {
        self.operator.confirming(on)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operator::{Closure, Exchanged};

    type Product = dyn FnMut(&[f64], &mut [f64]) -> Result<()>;

    /// A matrix that is given by its rows.
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
