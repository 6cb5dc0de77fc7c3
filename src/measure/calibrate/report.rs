//! What a calibration found, figure by figure.

use serde::{Deserialize, Serialize};

use super::lens_map::LensMap;
use super::measured_value::MeasuredValue;
use crate::measure::Effort;

/// Everything that was measured, with standard errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationReport {
    /// The camera's.
    pub camera: CameraFigures,
    /// The projector's, one for each of its channels.
    pub projector: Vec<ProjectorFigures>,
    /// Where camera pixels look.
    pub map: MapFigures,
    /// How steady the rig is.
    pub stability: StabilityFigures,
    /// What it has cost.
    pub effort: Effort,
}

/// Figures of a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraFigures {
    /// The count without light, in DN.
    pub black: MeasuredValue,
    /// In DN, without what rounding to whole counts adds.
    pub read_noise: MeasuredValue,
    /// Electrons per linear DN.
    pub gain: MeasuredValue,
    /// The count where overexposed pixels lie, in DN.
    pub plateau: f64,
    /// Whether overexposed pixels were seen; else the plateau is the largest count there can be.
    pub plateau_reached: bool,
    /// Linear DN of the plateau in electrons.
    pub full_well: MeasuredValue,
    /// Largest departure of the response from a line beyond noise, as a share of the range.
    pub departure: f64,
    /// Whether the response was taken for a line.
    pub linear: bool,
    /// Linear DN per second without the projector's picture: ambient light, the projector's black, and dark
    /// current.
    pub dark_rate: MeasuredValue,
    /// The exposure at which the white frame fills the range, in seconds.
    pub exposure: f64,
}

/// Figures of one channel of a projector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProjectorFigures {
    /// The exponent that fits the response best.
    pub gamma: MeasuredValue,
    /// What it leaves, root mean square over the levels, as a share of white.
    pub gamma_residual: f64,
    /// Largest standard error of a level's light, as a share of white.
    pub curve_error: f64,
    /// The light that is there at level 0, ambient light included, as a share of white's.
    pub black: MeasuredValue,
}

/// Figures of the pixel map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapFigures {
    /// What it was made from: `gray-code` or `checkerboard`.
    pub by: MapBy,
    /// The map, where one fits; none: each camera pixel was decoded by itself.
    pub lens: Option<LensMap>,
    /// Points that it was fitted to.
    pub points: usize,
    /// Root mean square distance of these from the map, in projector pixels. Gray codes tell whole pixels
    /// only, which makes it at least 0.41.
    pub rms: f64,
    /// Standard error of the map, root mean square over the field, in projector pixels.
    pub error: f64,
    /// Share of lit camera pixels that could not be decoded, or do not agree with the map.
    pub unreliable: f64,
    /// Share of projector pixels that nothing sees.
    pub masked: f64,
}

/// What a pixel map is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapBy {
    /// Gray codes, pixel by pixel.
    GrayCode,
    /// Corners of a checkerboard, near where coarse Gray codes have them.
    Checkerboard,
}

/// Figures of steadiness.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StabilityFigures {
    /// Seconds from a frame's confirmation until its light is all there.
    pub settle: MeasuredValue,
    /// Relative change of the white photo's mean per hour.
    pub drift_per_hour: MeasuredValue,
    /// Seconds over which the drift was watched.
    pub watched: f64,
    /// Noise of one white photo at an average camera pixel, relative to its light.
    pub white_noise: f64,
    /// The whites: seconds on the rig's clock, light relative to the first.
    pub whites: Vec<(f64, f64)>,
    /// The latency sweep: seconds waited, share of the light that was there.
    pub sweep: Vec<(f64, f64)>,
}
