//! The conditions of a virtual rig: ambient light, drift and faults. By default there are none.

use serde::Deserialize;

/// Light that does not come from the projector. It is the same at each camera pixel, except for the camera's vignetting.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ambient {
    /// Its level relative to the mean of the white photo.
    pub level: f64,
    /// The relative amplitude of its variation, a sine of time. A photo has the mean over its exposure.
    pub variation: f64,
    /// The period of the sine in seconds.
    pub period: f64,
}

/// The change of the projector's brightness with time `t`: `(1 + per_hour · t / 3600)(1 + swing · sin(2π t / period))`. A photo
/// has the mean over its exposure.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Drift {
    /// The relative change per hour.
    pub per_hour: f64,
    /// The relative amplitude of the sine.
    pub swing: f64,
    /// The period of the sine in seconds.
    pub period: f64,
}

/// The frames that fail. Each fault is given by its probability (the seed and the frame's number select the frames), or by the
/// numbers of the frames, which count from 1.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// The probability that a frame does not arrive.
    pub dropped: f64,
    /// The probability that the previous frame arrives again instead.
    pub repeated: f64,
    /// The probability that a frame arrives which was exposed before the last pattern was shown.
    pub late: f64,
    /// The probability that a frame's exposure began when the last pattern was confirmed, before the pattern settled.
    pub early: f64,
    /// The frames that do not arrive.
    pub dropped_frames: Vec<u64>,
    /// The frames that are replaced by the previous frame.
    pub repeated_frames: Vec<u64>,
    /// The frames that were exposed before the last pattern was shown.
    pub late_frames: Vec<u64>,
    /// The frames whose exposure did not wait for the pattern to settle.
    pub early_frames: Vec<u64>,
    /// The frames after which the camera hangs until it is restarted.
    pub freeze_after: Vec<u64>,
    /// Whether a restart does not help a camera that hangs.
    pub freeze_for_good: bool,
}
