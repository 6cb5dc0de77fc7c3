//! What is written about the world around the devices of a virtual rig: at its default, dark, steady and without fault.

use serde::Deserialize;

/// Light that does not come from the projector: the same at each camera pixel, but for its vignetting.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ambient {
    /// Relative to the mean of the white photo.
    pub level: f64,
    /// By which share of itself it swings, as a sine of time; a photo has the mean over its exposure.
    pub variation: f64,
    /// The sine's period in seconds.
    pub period: f64,
}

/// The projector's brightness at time `t`: `(1 + per_hour · t / 3600)(1 + swing · sin(2π t / period))`. A photo has its mean
/// over the exposure.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Drift {
    /// Relative change per hour.
    pub per_hour: f64,
    /// By which share of itself it swings, as a sine of time.
    pub swing: f64,
    /// The sine's period in seconds.
    pub period: f64,
}

/// Frames that go wrong: each by chance (selected by the seed and its number), or by its number, from 1.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// The chance that a frame does not come.
    pub dropped: f64,
    /// The chance that the frame before comes again instead.
    pub repeated: f64,
    /// The chance that a frame comes which was exposed before the last pattern was shown.
    pub late: f64,
    /// The chance that a frame's exposure began as soon as the last pattern was confirmed, without waiting.
    pub early: f64,
    /// Frames that do not come.
    pub dropped_frames: Vec<u64>,
    /// Frames instead of which the one before comes again.
    pub repeated_frames: Vec<u64>,
    /// Frames that were exposed before the last pattern was shown.
    pub late_frames: Vec<u64>,
    /// Frames whose exposure did not wait.
    pub early_frames: Vec<u64>,
    /// Frames after which the camera hangs until it is restarted.
    pub freeze_after: Vec<u64>,
    /// A camera that hangs does not come back.
    pub freeze_for_good: bool,
}
