//! The twin: exactly known light transport in front of a virtual rig.

use std::sync::Arc;

use crate::error::Result;
use crate::image::Image;
use crate::operator::{Adjoint, Operator, Symmetry, delegate, product};
use crate::rig::{VirtualProjector, VirtualRig};
use crate::sparse::SparseOperator;
use crate::transport::{Assembled, ExplicitMatrix, Part, Transport};

/// Light transport for virtual rigs. Any number of rigs can use it, one after the other.
#[derive(Clone, Debug)]
pub enum Twin {
    /// A traced scene.
    Traced(Arc<Assembled>),
    /// An explicit matrix.
    Explicit(ExplicitMatrix),
}

impl Twin {
    /// The light transport that a virtual rig measures.
    pub fn transport(&self) -> Box<dyn Transport + Send> {
        match self {
            Self::Traced(traced) => Box::new(Arc::clone(traced)),
            Self::Explicit(given) => Box::new(given.clone()),
        }
    }

    /// One channel as an operator for the Krylov methods, in the matrix's own units. A well-formed matrix gives no error.
    pub fn operator(&self, part: Part, channel: usize) -> Result<TwinOperator<'_>> {
        let (inner, symmetry): (Box<dyn Adjoint + '_>, _) = match self {
            Self::Traced(traced) => {
                let operator = traced.operator(part, channel);
                let symmetry = operator.symmetry();
                (Box::new(operator), symmetry)
            }
            Self::Explicit(given) => {
                let matrix = ExplicitMatrix::part_of(given.matrix(), part)?;
                // Rigs are coaxial, so the matrix is symmetric. An explicit matrix may be symmetric only up to its own precision.
                (Box::new(SparseOperator::new(matrix)), Symmetry::Symmetric)
            }
        };
        Ok(TwinOperator { inner, symmetry, range: 1.0 })
    }

    /// The light without a pattern: the scene's own light, the rig's ambient light, and the light of the projector's black level. Its unit
    /// is the unit of [`Twin::operator`] times [`range_of`]. A well-formed matrix gives no error.
    pub(super) fn ambient(&self, rig: &VirtualRig, channel: usize) -> Result<Vec<f64>> {
        let mut operator = self.operator(Part::Full, channel)?;
        let ones = vec![1.0; operator.cols()];
        let white = product(&mut operator, &ones)?;
        let mean = white.iter().sum::<f64>() / white.len() as f64;
        let own = match self {
            Self::Traced(traced) => traced.ambient.plane(channel),
            Self::Explicit(_) => vec![0.0; white.len()],
        };
        let black = rig.projector.black_level;
        Ok(white.iter().zip(own).map(|(white, own)| own + rig.ambient.level * mean + black * white).collect())
    }
}

/// The light of a pattern of 1, in units of the projector's white. It is the white level minus the black level.
pub(super) fn range_of(rig: &VirtualRig) -> f64 {
    1.0 - rig.projector.black_level
}

/// A pattern in `[0, 1]` as the projector shows it: each pixel has the projector level whose light is nearest to the pattern.
pub(super) fn shown(projector: &VirtualProjector, pattern: &Image) -> Vec<f64> {
    let response = projector.response();
    let top = (1_u32 << projector.bits) - 1;
    let levels: Vec<f64> = (0..=top).map(|level| response.at(f64::from(level) / f64::from(top))).collect();
    let nearest = |&value: &f32| {
        let value = f64::from(value);
        let above = levels.partition_point(|&level| level < value).min(levels.len() - 1);
        let below = above.saturating_sub(1);
        if value - levels[below] < levels[above] - value { levels[below] } else { levels[above] }
    };
    pattern.samples().iter().map(nearest).collect()
}

/// One channel of a [`Twin`].
pub struct TwinOperator<'a> {
    inner: Box<dyn Adjoint + 'a>,
    symmetry: Symmetry,
    /// The factor that multiplies all products.
    pub(super) range: f64,
}

impl TwinOperator<'_> {
    fn scale(&self, products: &mut [&mut [f64]]) {
        products.iter_mut().flat_map(|product| product.iter_mut()).for_each(|value| *value *= self.range);
    }
}

impl Operator for TwinOperator<'_> {
    delegate!(inner: rows, cols, block_size);

    fn symmetry(&self) -> Symmetry {
        self.symmetry
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.inner.apply_block(xs, ys)?;
        self.scale(ys);
        Ok(())
    }
}

impl Adjoint for TwinOperator<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.inner.apply_adjoint_block(ys, xs)?;
        self.scale(xs);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn a_pattern_is_shown_at_the_levels_nearest_in_light() {
        let projector = VirtualProjector { bits: 2, gamma: Some(2.0), ..VirtualProjector::default() };
        let pattern = Image::new(Resolution::new(4, 1), 1, vec![0.0, 0.06, 0.2, 0.9]);
        let found = shown(&projector, &pattern.expect("four samples"));
        for (found, expected) in found.iter().zip([0.0, 1.0 / 9.0, 1.0 / 9.0, 1.0]) {
            assert!((found - expected).abs() < 1e-12, "{found} for {expected}");
        }
    }
}
