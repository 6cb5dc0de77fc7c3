//! Planning predicts the cost and the accuracy of an analysis on a rig with the rig's virtual twin.
//!
//! The twin is a [`VirtualRig`] with all imperfections in its file, in front of exactly known light transport. The whole measurement runs
//! on it with the noise of several seeds. Each result is compared with that of ideal devices. Patterns, frames and seconds are the twin's.

mod compensation;
mod eigenvalues;
mod segmentation;
mod twin;

pub use compensation::{CompensationPlan, CompensationTrial, MethodTrial, MethodsTrial};
pub use eigenvalues::EigenvaluesTrial;
pub use segmentation::SegmentationTrial;
pub use twin::Twin;

use crate::error::Result;
use crate::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use crate::observer::Observer;
use crate::operator::Operator;
use crate::rig::VirtualRig;
use crate::transport::Part;

/// The inputs of planning.
#[derive(Clone, Copy)]
pub struct Planner<'a> {
    /// The virtual devices.
    pub rig: &'a VirtualRig,
    /// The light transport in front of them.
    pub twin: &'a Twin,
    /// The calibration of the devices.
    pub calibration: &'a Calibration,
    /// The options of the measurement.
    pub measurement: &'a MeasureOptions,
    /// An observer of the trials, which may stop them.
    pub observer: &'a dyn Observer,
}

/// The cost of a trial.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cost {
    /// Photos taken by the method: products with the matrix.
    pub photos: u64,
    /// Distinct patterns shown, including black and white.
    pub patterns: u64,
    /// Frames taken.
    pub frames: u64,
    /// Seconds on the rig's clock.
    pub seconds: f64,
}

impl Planner<'_> {
    /// Opens the rig with the noise of `seed`. Fails as [`VirtualRig::open`] and [`Measurement::new`] do.
    pub fn measure(&self, seed: u64) -> Result<Measurement> {
        let rig = VirtualRig { seed, ..self.rig.clone() };
        let bench = rig.open(self.twin.transport(), None)?;
        let settle = self.measurement.settle.unwrap_or(self.calibration.stability.settle);
        let shots = LiveFrames::new(bench, settle, self.measurement.tries);
        let measurement =
            Measurement::new(Box::new(shots), self.calibration.clone(), self.measurement.clone())?;
        Ok(measurement.declared(self.twin.operator(Part::Full, 0)?.symmetry()))
    }
}

impl Cost {
    fn of(measurement: &Measurement, photos: usize) -> Self {
        let effort = measurement.effort();
        Self {
            photos: photos as u64,
            patterns: measurement.patterns() as u64,
            frames: effort.taken,
            seconds: effort.seconds,
        }
    }
}
