//! Planning a compensation on the twin of a rig.

use super::twin::{TwinOperator, range_of, shown};
use super::{Cost, Planner};
use crate::analysis::compensate::{MethodRun, Prior, compare_methods, compensate};
use crate::analysis::{CompensateOptions, Target};
use crate::error::Result;
use crate::image::Image;
use crate::krylov::Method;
use crate::operator::{Observed, product};
use crate::transport::Part;

/// The number of photos for the optimum. On the twin, they cost nothing.
const OPTIMUM_PHOTOS: usize = 500;

/// The optimum with which trials are compared. Residuals are computed from noise-free photos of the displayed pattern, relative to the
/// target light.
pub struct CompensationPlan {
    target: Image,
    ambient: Image,
    /// The radiance of a target value of 1, in the twin's units.
    peak: f64,
    /// The residual of the best pattern inside the box, without quantization.
    pub optimum: f64,
    /// The residual if the target itself is the pattern.
    pub uncompensated: f64,
}

/// The result of a compensation on the twin.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct CompensationTrial {
    /// The cost of the compensation.
    pub cost: Cost,
    /// The residual of the computed pattern.
    pub residual: f64,
    /// The residual divided by the residual of the optimum, minus 1.
    pub excess: f64,
}

/// The results of all methods on the twin, with the noise of one seed.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct MethodsTrial {
    /// The total cost of all methods.
    pub cost: Cost,
    /// The number of frames at which all methods are compared: the frames of the method that took the fewest frames.
    pub frames: u64,
    /// The result of each method.
    pub methods: Vec<MethodTrial>,
}

/// The result of one method of a [`MethodsTrial`]. Residuals are computed from the rig's photos of the method's patterns, clipped to the
/// projector's range.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct MethodTrial {
    /// The method's name on the command line.
    pub name: &'static str,
    /// The number of photos that the method took.
    pub photos: usize,
    /// The frames of these photos: of the positive and negative parts of patterns, bit planes, exposures and repetitions, and of photos
    /// that measure the drift of the lamp. The frames of black and white are not included, because all methods share them.
    pub frames: u64,
    /// The residual after all photos.
    pub residual: f64,
    /// The smallest residual among the photos within the common number of frames; infinite if there is no such photo.
    pub at_equal_frames: f64,
}

impl MethodTrial {
    fn of(run: &MethodRun, budget: u64) -> Self {
        let within = run.displayed.iter().zip(&run.frames).filter(|(_, frames)| **frames <= budget);
        Self {
            name: run.name,
            photos: run.photos,
            frames: run.frames.last().copied().unwrap_or(0),
            residual: run.residual,
            at_equal_frames: within.map(|(row, _)| row.residual).fold(f64::INFINITY, f64::min),
        }
    }
}

impl Planner<'_> {
    /// Finds the best pattern with ideal devices, at the default peak (half the median of the white photo). Fails as [`compensate`] does.
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

    /// Compensates on the twin with the noise of `seed`. `ideal` is the result of [`Planner::ideal_compensation`]. Fails as [`compensate`]
    /// or the rig does.
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

    /// Compensates on the twin by every method, with the number of photos of `options` and the noise of `seed`. Fails as
    /// [`compare_methods`] or the rig does.
    pub fn methods(
        &self,
        ideal: &CompensationPlan,
        options: &CompensateOptions,
        seed: u64,
    ) -> Result<MethodsTrial> {
        let mut measurement = self.measure(seed)?.in_luma();
        let ambient = measurement.ambient()?.to_image()?;
        let target = Target::new(&ideal.target, &ambient)?;
        let options = CompensateOptions { peak: None, ..*options };
        let mut operator = measurement.operator(Part::Full, 0);
        let mut channels = [Observed::new(&mut operator, self.observer)];
        let runs = compare_methods(&mut channels, &target, &options, &Prior::default())?;
        let frames = runs.iter().filter_map(|run| run.frames.last().copied()).min().unwrap_or(0);
        let photos = runs.iter().map(|run| run.photos).sum();
        Ok(MethodsTrial {
            cost: Cost::of(&measurement, photos),
            frames,
            methods: runs.iter().map(|run| MethodTrial::of(run, frames)).collect(),
        })
    }

    /// `‖b − A x‖ / ‖b‖` on the twin, where `x` is `pattern` as the projector shows it.
    fn residual(&self, ideal: &CompensationPlan, pattern: &Image) -> Result<f64> {
        let light = product(&mut self.in_range()?, &shown(&self.rig.projector, pattern))?;
        let wanted: Vec<f64> = (ideal.target.plane(0).iter().zip(ideal.ambient.plane(0)))
            .map(|(target, ambient)| target * ideal.peak - ambient)
            .collect();
        let error: f64 = wanted.iter().zip(&light).map(|(b, y)| (b - y) * (b - y)).sum();
        Ok((error / wanted.iter().map(|b| b * b).sum::<f64>()).sqrt())
    }

    /// The operator of the twin, in units of the light that a pattern of 1 adds to a pattern of 0.
    fn in_range(&self) -> Result<TwinOperator<'_>> {
        let mut operator = self.twin.operator(Part::Full, 0)?;
        operator.range = range_of(self.rig);
        Ok(operator)
    }
}
