//! The part of a run's record that concerns its rig.

use serde::{Deserialize, Serialize};

use super::{Effort, MeasureOptions};
use crate::finding::Finding;

/// How the photos of a run on a rig were made, and what they cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigRecord {
    /// The folder of the calibration. `None` when the devices were assumed to be ideal.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub calibration: Option<String>,
    /// The options of the stages between counts and light.
    pub measurement: MeasureOptions,
    /// The number of different patterns that were shown.
    pub patterns: u64,
    /// The frames and the time that the run took.
    pub effort: Effort,
    /// The standard error of the white photo, relative to it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub noise: Option<f64>,
    /// The largest relative change of white during the run, as the sentinels measured it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub drift: Option<f64>,
    /// What the photos say of the rig: whether it sees the projector, whether its light is steady, and whether light takes every way in both
    /// directions alike.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub findings: Vec<Finding>,
}

/// The record of a run, `run.json`. A run on a scene has one without a [`RigRecord`].
pub type RunManifest = crate::io::manifest::Manifest<RigRecord>;
