//! Planning a compensation on the twin.

use super::twin::{TwinOperator, range_of, shown};
use super::{Cost, Planner};
use crate::analysis::compensate::compensate;
use crate::analysis::{CompensateOptions, Target};
use crate::error::Result;
use crate::image::Image;
use crate::krylov::Method;
use crate::operator::{Adjoint, Observed, Operator, delegate};
use crate::transport::Part;

/// Photos for the optimum, which cost nothing on the twin.
const OPTIMUM_PHOTOS: usize = 500;

/// The optimum that trials are compared with. Residuals are of noise-free photos of what is shown, relative to the target light.
pub struct CompensationPlan {
    target: Image,
    ambient: Image,
    /// The radiance that 1 in the target stands for, in the twin's units.
    peak: f64,
    /// The residual of the best pattern inside the box, without quantization.
    pub optimum: f64,
    /// The residual of the target itself as a pattern.
    pub uncompensated: f64,
}

/// The result of a compensation on the twin.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct CompensationTrial {
    /// Its cost.
    pub cost: Cost,
    /// The residual of its pattern.
    pub residual: f64,
    /// The residual over the optimum's, minus 1.
    pub excess: f64,
}

impl Planner<'_> {
    /// The best pattern with ideal devices. The peak is half the median of the white photo, the default.
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
        let above_ambient = Target::new(target, &ambient)?;
        let optimum = CompensateOptions {
            method: Method::KrylovBox,
            photos: OPTIMUM_PHOTOS,
            rtol: 1e-9,
            peak: None,
            precondition: None,
            baseline: false,
            ..*options
        };
        let found = compensate(&mut [self.in_range()?], &above_ambient, &optimum)?;
        Ok(CompensationPlan {
            target: target.clone(),
            ambient,
            peak: found.peak,
            optimum: found.residual,
            uncompensated: found.uncompensated_residual,
        })
    }

    /// Compensates on the twin with the noise of `seed`; `ideal` is the result of [`Planner::ideal_compensation`].
    ///
    /// # Errors
    /// As [`compensate`], and any error of the rig.
    pub fn compensation(
        &self,
        ideal: &CompensationPlan,
        options: &CompensateOptions,
        seed: u64,
    ) -> Result<CompensationTrial> {
        let mut measurement = self.measure(seed)?.in_luma();
        let ambient = measurement.ambient()?.to_image()?;
        let target = Target::new(&ideal.target, &ambient)?;
        let options = CompensateOptions { peak: None, baseline: false, ..*options };
        let mut operator = measurement.operator(Part::Full, 0);
        let found = compensate(&mut [Observed::new(&mut operator, self.observer)], &target, &options)?;
        let residual = self.residual(ideal, &found.pattern)?;
        Ok(CompensationTrial {
            cost: Cost::of(&measurement, found.photos),
            residual,
            excess: residual / ideal.optimum - 1.0,
        })
    }

    /// `‖b − A x‖ / ‖b‖` on the twin, where `x` is `pattern` as the projector shows it.
    fn residual(&self, ideal: &CompensationPlan, pattern: &Image) -> Result<f64> {
        let mut operator = self.in_range()?;
        let mut light = vec![0.0; operator.rows()];
        operator.apply(&shown(&self.rig.projector, pattern), &mut light)?;
        let wanted: Vec<f64> = (ideal.target.plane(0).iter().zip(ideal.ambient.plane(0)))
            .map(|(target, ambient)| target * ideal.peak - ambient)
            .collect();
        let error: f64 = wanted.iter().zip(&light).map(|(b, y)| (b - y) * (b - y)).sum();
        Ok((error / wanted.iter().map(|b| b * b).sum::<f64>()).sqrt())
    }

    fn in_range(&self) -> Result<InRange<'_>> {
        Ok(InRange { inner: self.twin.operator(Part::Full, 0)?, range: range_of(self.rig) })
    }
}

/// The twin in units of the light that a pattern of 1 adds to a pattern of 0.
struct InRange<'a> {
    inner: TwinOperator<'a>,
    range: f64,
}

impl Operator for InRange<'_> {
    delegate!(inner: rows, cols, symmetry, block_size, observer);

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
