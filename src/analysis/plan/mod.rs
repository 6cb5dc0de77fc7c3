//! Planning uses the virtual twin of a rig to predict the cost and the accuracy of an analysis on the rig.
//!
//! The twin is a [`VirtualRig`] with all imperfections in its file, in front of exactly known light transport. The entire measurement runs
//! on the twin with the noise of several seeds. Each result is compared with the result of ideal devices. The twin also gives the numbers
//! of patterns, frames and seconds.

mod compensation;
mod twin;

use crate::analysis::segment::segment;
use crate::analysis::{SegmentOptions, Segmentation, adjusted_rand_index};
use crate::error::Result;
use crate::krylov::{Eigs, EigsOptions, eigs, norm};
use crate::measure::{Calibration, LiveFrames, MeasureOptions, Measurement};
use crate::observer::Observer;
use crate::operator::{Observed, Operator, product};
use crate::rig::VirtualRig;
use crate::transport::Part;

pub use compensation::{CompensationPlan, CompensationTrial, MethodTrial, MethodsTrial};
pub use twin::Twin;

/// The inputs of planning.
#[derive(Clone, Copy)]
pub struct Planner<'a> {
    /// The virtual devices.
    pub rig: &'a VirtualRig,
    /// The light transport in front of the devices.
    pub twin: &'a Twin,
    /// The calibration of the devices.
    pub calibration: &'a Calibration,
    /// The options of the measurement.
    pub measurement: &'a MeasureOptions,
    /// The observer of the trials. It may stop them.
    pub observer: &'a dyn Observer,
}

/// The cost of a trial.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cost {
    /// The number of photos taken by the method, which are products with the matrix.
    pub photos: u64,
    /// The number of distinct patterns shown, including black and white.
    pub patterns: u64,
    /// The number of frames taken.
    pub frames: u64,
    /// The duration in seconds on the rig's clock.
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

/// The errors of the eigenvalues on the twin.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct EigenvaluesTrial {
    /// The cost of the eigenvalues.
    pub cost: Cost,
    /// The difference of each eigenvalue from the eigenvalue with ideal devices, relative to the largest eigenvalue. The norms of the white
    /// photos convert the units.
    pub errors: Vec<f64>,
}

impl Planner<'_> {
    /// Finds the eigenpairs with ideal devices, by the same method with the same number of photos. Fails as [`eigs`] does.
    pub fn ideal_eigenpairs(&self, part: Part, options: &EigsOptions) -> Result<Eigs> {
        eigs(&mut self.twin.operator(part, 0)?, options)
    }

    /// Finds the eigenpairs with the noise of `seed`. `ideal` is the result of [`Planner::ideal_eigenpairs`]. Fails as [`eigs`] or the rig
    /// does.
    pub fn eigenvalues(
        &self,
        part: Part,
        options: &EigsOptions,
        ideal: &Eigs,
        seed: u64,
    ) -> Result<EigenvaluesTrial> {
        let mut measurement = self.measure(seed)?.in_luma();
        let mut operator = measurement.operator(part, 0);
        let found = eigs(&mut Observed::new(&mut operator, self.observer), options)?;
        let mut full = self.twin.operator(Part::Full, 0)?;
        let ones = vec![1.0; full.cols()];
        let white = product(&mut full, &ones)?;
        let scale = match measurement.white()?.planes.first() {
            Some(plane) => norm(&white) / norm(&plane.values),
            None => f64::NAN,
        };
        let largest = ideal.values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let errors = found.values.iter().zip(&ideal.values);
        Ok(EigenvaluesTrial {
            cost: Cost::of(&measurement, found.stats.products),
            errors: errors.map(|(found, ideal)| (scale * found - ideal) / largest).collect(),
        })
    }
}

/// The result of a segmentation on the twin. Scores are adjusted Rand indices, one for each number of groups.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SegmentationTrial {
    /// The cost of the segmentation.
    pub cost: Cost,
    /// The scores relative to the groups that the same method finds with ideal devices.
    pub agreement: Vec<(usize, f64)>,
    /// The scores relative to the true labels; empty if the true labels are unknown.
    pub truth: Vec<(usize, f64)>,
}

impl Planner<'_> {
    /// Finds the groups with ideal devices, by the same method with the same number of photos. Fails as [`segment`] does.
    pub fn ideal_segmentation(&self, part: Part, options: &SegmentOptions) -> Result<Segmentation> {
        segment(&mut self.twin.operator(part, 0)?, options)
    }

    /// Segments with the noise of `seed`. `ideal` is the result of [`Planner::ideal_segmentation`], and `labels` are the true labels, if
    /// known. Fails as [`segment`] or the rig does.
    pub fn segmentation(
        &self,
        part: Part,
        options: &SegmentOptions,
        ideal: &Segmentation,
        labels: Option<&[u8]>,
        seed: u64,
    ) -> Result<SegmentationTrial> {
        let mut measurement = self.measure(seed)?.in_luma();
        let mut operator = measurement.operator(part, 0);
        let found = segment(&mut Observed::new(&mut operator, self.observer), options)?;
        let of_ideal = |groups| ideal.labels.iter().find(|(of, _)| *of == groups).map(|(_, labels)| labels);
        let mut trial = SegmentationTrial {
            cost: Cost::of(&measurement, found.photos),
            agreement: Vec::new(),
            truth: Vec::new(),
        };
        for (groups, found) in &found.labels {
            if let Some(ideal) = of_ideal(*groups) {
                trial.agreement.push((*groups, adjusted_rand_index(found, ideal)?));
            }
            if let Some(labels) = labels {
                trial.truth.push((*groups, adjusted_rand_index(found, labels)?));
            }
        }
        Ok(trial)
    }
}
