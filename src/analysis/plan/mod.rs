//! What a question will cost on a rig, and how good its answer will be: asked of the rig's virtual twin before the bench is
//! booked.
//!
//! The twin is a [`VirtualRig`] with every imperfection that its file knows, in front of light transport that is known exactly.
//! The whole measurement is run on it, with the noise of several seeds; each answer is held against the one without any device
//! between. Patterns, frames and seconds are those that the twin took.

mod compensation;
mod eigenvalues;
mod segmentation;
mod twin;

pub use compensation::{CompensationPlan, CompensationTrial};
pub use eigenvalues::EigenvaluesTrial;
pub use segmentation::SegmentationTrial;
pub use twin::Twin;

use crate::error::Result;
use crate::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use crate::observer::Observer;
use crate::operator::Operator;
use crate::rig::VirtualRig;
use crate::transport::Part;

/// What is planned with.
#[derive(Clone, Copy)]
pub struct Planner<'a> {
    /// The devices.
    pub rig: &'a VirtualRig,
    /// What they look at.
    pub twin: &'a Twin,
    /// What is known of the devices.
    pub calibration: &'a Calibration,
    /// How they are used.
    pub measurement: &'a MeasureOptions,
    /// Watches the trials, and may stop them.
    pub observer: &'a dyn Observer,
}

/// What a trial took.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cost {
    /// Photos that the method asked for: products with the matrix.
    pub photos: u64,
    /// Different patterns shown, black and white among them.
    pub patterns: u64,
    /// Frames taken.
    pub frames: u64,
    /// Seconds on the rig's clock.
    pub seconds: f64,
}

impl Planner<'_> {
    /// The rig, opened with the noise of another seed.
    ///
    /// # Errors
    /// As [`VirtualRig::open`] and [`Measurement::new`].
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
