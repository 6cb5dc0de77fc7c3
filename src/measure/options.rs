//! Which stages stand between counts and light, and how each is set.

use serde::{Deserialize, Serialize};

/// How a measurement is made: the `[measurement]` table of a rig file. Each stage can be switched off, to see the error
/// that it removes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeasureOptions {
    /// How signed vectors are shown.
    pub signed: SignedBy,
    /// Photos per pattern, each of what the one before could not show; 1: the nearest levels, once.
    pub bit_planes: u32,
    /// Exposures in seconds, merged by inverse variance; empty: one, chosen from the white frame.
    pub exposures: Vec<f64>,
    /// Frames averaged for each photo.
    pub takes: u32,
    /// Frames averaged for the black photo.
    pub black_takes: u32,
    /// Subtract the black photo.
    pub ambient: bool,
    /// Undo the devices' measured responses; off: levels and counts are taken for light.
    pub response: bool,
    /// Resample photos to the projector's pixels by the measured map; off: by area.
    pub registration: bool,
    /// Photos between two of the drift sentinel's whites; 0: none.
    pub sentinel_every: u32,
    /// Standard deviation in pixels of the Gaussian that pattern and photo are both blurred with; 0: none.
    pub blur: f64,
    /// Where the direct light is known from.
    pub direct: DirectBy,
    /// Seconds to wait after a frame is confirmed; none: what calibration found.
    pub settle: Option<f64>,
    /// Tries for each frame before the rig is given up.
    pub tries: u32,
}

/// How signed vectors are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SignedBy {
    /// Whichever of the two is predicted to be less noisy.
    Auto,
    /// `(x − a)/(b − a)`, and the white photo that is there already (section 7.1).
    Affine,
    /// The positive and the negative part, a photo each.
    Split,
}

/// Where the direct light is known from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DirectBy {
    /// Shifted patterns of high frequency (Nayar et al. 2006).
    Patterns,
    /// It is not: it stays in.
    None,
}

impl Default for MeasureOptions {
    fn default() -> Self {
        Self {
            signed: SignedBy::Auto,
            bit_planes: 1,
            exposures: Vec::new(),
            takes: 1,
            black_takes: 4,
            ambient: true,
            response: true,
            registration: true,
            sentinel_every: 16,
            blur: 0.0,
            direct: DirectBy::Patterns,
            settle: None,
            tries: 5,
        }
    }
}
