//! A compensation on the twin.

use super::twin::{TwinOperator, range_of, shown};
use super::{Cost, Planner};
use crate::analysis::compensate::compensate;
use crate::analysis::{CompensateOptions, Target};
use crate::error::Result;
use crate::image::Image;
use crate::krylov::Method;
use crate::observer::Observer;
use crate::operator::{Adjoint, Observed, Operator, Symmetry};
use crate::transport::Part;

/// Photos that the optimum may take. They cost nothing.
const OPTIMUM_PHOTOS: usize = 500;

/// What is the best that could be projected, and what the trials are held against. Residuals are relative to the light wished, as
/// seen without noise when the pattern is on screen.
pub struct CompensationPlan {
    target: Image,
    ambient: Image,
    /// The radiance that 1 in the target stands for, in the twin's units.
    peak: f64,
    /// Of the best pattern in the box, of any level.
    pub optimum: f64,
    /// Of the target itself.
    pub uncompensated: f64,
}

/// A compensation on the twin, and how good it is.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct CompensationTrial {
    /// What it took.
    pub cost: Cost,
    /// The residual of its pattern.
    pub residual: f64,
    /// By which share that is more than the optimum's.
    pub excess: f64,
}

impl Planner<'_> {
    /// The best pattern without any device between. The peak is half the median of the white photo, as by default.
    ///
    /// # Errors
    /// As [`compensate`].
    pub fn ideal_compensation(
        &self,
        target: &Image,
        options: &CompensateOptions,
    ) -> Result<CompensationPlan> {
        let resolution = self.rig.scene.size();
        let ambient: Vec<f32> = self.twin.ambient(self.rig, 0)?.iter().map(|&value| value as f32).collect();
        let ambient = Image::new(resolution, 1, ambient)?;
        let wish = Target::new(target, &ambient)?;
        let optimum = CompensateOptions {
            method: Method::KrylovBox,
            photos: OPTIMUM_PHOTOS,
            rtol: 1e-9,
            peak: None,
            precondition: None,
            baseline: false,
            ..*options
        };
        let found = compensate(&mut [self.in_range()?], &wish, &optimum)?;
        Ok(CompensationPlan {
            target: target.clone(),
            ambient,
            peak: found.peak,
            optimum: found.residual,
            uncompensated: found.uncompensated_residual,
        })
    }

    /// Compensates on the twin with the noise of this seed. `ideal` is [`Planner::ideal_compensation`].
    ///
    /// # Errors
    /// As [`compensate`], and whatever the rig fails with.
    pub fn compensation(
        &self,
        ideal: &CompensationPlan,
        options: &CompensateOptions,
        seed: u64,
    ) -> Result<CompensationTrial> {
        let mut measurement = self.measure(seed)?.in_luma();
        let ambient = measurement.ambient()?.to_image()?;
        let wish = Target::new(&ideal.target, &ambient)?;
        let options = CompensateOptions { peak: None, baseline: false, ..*options };
        let mut operator = measurement.operator(Part::Full, 0);
        let found = compensate(&mut [Observed::new(&mut operator, self.observer)], &wish, &options)?;
        let residual = self.residual(ideal, &found.pattern)?;
        Ok(CompensationTrial {
            cost: Cost::of(&measurement, found.photos),
            residual,
            excess: residual / ideal.optimum - 1.0,
        })
    }

    /// `‖b − A x‖ / ‖b‖` on the twin, `x` being what the projector makes of `pattern`.
    fn residual(&self, ideal: &CompensationPlan, pattern: &Image) -> Result<f64> {
        let mut operator = self.in_range()?;
        let mut light = vec![0.0; operator.rows()];
        operator.apply(&shown(&self.rig.projector, pattern), &mut light)?;
        let wished: Vec<f64> = (ideal.target.plane(0).iter().zip(ideal.ambient.plane(0)))
            .map(|(target, ambient)| target * ideal.peak - ambient)
            .collect();
        let error: f64 = wished.iter().zip(&light).map(|(b, y)| (b - y) * (b - y)).sum();
        Ok((error / wished.iter().map(|b| b * b).sum::<f64>()).sqrt())
    }

    fn in_range(&self) -> Result<InRange<'_>> {
        Ok(InRange { inner: self.twin.operator(Part::Full, 0)?, range: range_of(self.rig) })
    }
}

/// The twin in units of what a pattern of 1 adds to one of 0.
struct InRange<'a> {
    inner: TwinOperator<'a>,
    range: f64,
}

impl Operator for InRange<'_> {
    fn rows(&self) -> usize {
        self.inner.rows()
    }

    fn cols(&self) -> usize {
        self.inner.cols()
    }

    fn symmetry(&self) -> Symmetry {
        self.inner.symmetry()
    }

    fn apply(&mut self, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.inner.apply(x, y)?;
        y.iter_mut().for_each(|value| *value *= self.range);
        Ok(())
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.inner.apply_block(xs, ys)?;
        ys.iter_mut().flat_map(|y| y.iter_mut()).for_each(|value| *value *= self.range);
        Ok(())
    }

    fn block_size(&self) -> usize {
        self.inner.block_size()
    }

    fn observer(&self) -> &dyn Observer {
        self.inner.observer()
    }
}

impl Adjoint for InRange<'_> {
    fn apply_adjoint(&mut self, y: &[f64], x: &mut [f64]) -> Result<()> {
        self.inner.apply_adjoint(y, x)?;
        x.iter_mut().for_each(|value| *value *= self.range);
        Ok(())
    }

    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.inner.apply_adjoint_block(ys, xs)?;
        xs.iter_mut().flat_map(|x| x.iter_mut()).for_each(|value| *value *= self.range);
        Ok(())
    }
}
