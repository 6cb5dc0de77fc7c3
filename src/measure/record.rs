//! What a run on a rig cost, for the run's record.

use serde::{Deserialize, Serialize};

use super::{Effort, MeasureOptions};

/// What a run on a rig cost, and how its photos were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigRecord {
    /// The calibration's folder; none: the devices were taken as ideal.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub calibration: Option<String>,
    /// The stages between counts and light, and how each was set.
    pub measurement: MeasureOptions,
    /// Different patterns shown.
    pub patterns: u64,
    /// Frames and time.
    pub effort: Effort,
    /// The standard error of the white photo, relative to it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub noise: Option<f64>,
    /// By which share white has changed during the run, as the drift sentinel saw it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub drift: Option<f64>,
}

/// The record of a run, on a rig or not: `run.json`.
pub type RunManifest = crate::io::manifest::Manifest<RigRecord>;
