//! The report of a calibration: every measured value with its standard error.

use serde::{Deserialize, Serialize};

use super::measured_value::MeasuredValue;
use crate::measure::Effort;
use crate::measure::lens_map::LensMap;

/// The report of a calibration. It is saved as `report.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationReport {
    /// The camera.
    pub camera: CameraFigures,
    /// The channels of the projector.
    pub projector: Vec<ProjectorFigures>,
    /// The pixel map.
    pub map: MapFigures,
    /// The brightness of the projector relative to the camera's: the least over the largest. `None` where the rig is not coaxial.
    #[serde(default)]
    pub evenness: Option<MeasuredValue>,
    /// The stability over time.
    pub stability: StabilityFigures,
    /// The costs of the calibration.
    pub effort: Effort,
}

/// The measured values of a camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraFigures {
    /// The count without light, in DN.
    pub black: MeasuredValue,
    /// The read noise in DN, without the noise of rounding to counts.
    pub read_noise: MeasuredValue,
    /// Electrons per linear DN.
    pub gain: MeasuredValue,
    /// The count of overexposed pixels, in DN.
    pub plateau: f64,
    /// Whether overexposed pixels were seen. Otherwise the plateau is the largest possible count.
    pub plateau_reached: bool,
    /// The plateau in electrons, from its linear DN.
    pub full_well: MeasuredValue,
    /// The largest departure of the response from a line beyond noise, as a share of the range.
    pub departure: f64,
    /// Whether the response was approximated by a line.
    pub linear: bool,
    /// Linear DN per second without a pattern: ambient light, the projector's black level, and dark current.
    pub dark_rate: MeasuredValue,
    /// The exposure at which white fills the range, in seconds.
    pub exposure: f64,
}

/// The measured values of one channel of a projector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProjectorFigures {
    /// The exponent that fits the response best.
    pub gamma: MeasuredValue,
    /// The residual of this fit, root mean square over the levels, as a share of white.
    pub gamma_residual: f64,
    /// The largest standard error of the light of a level, as a share of white.
    pub curve_error: f64,
    /// The light at level 0, ambient light included, as a share of white.
    pub black: MeasuredValue,
}

/// The measured values of the pixel map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapFigures {
    /// What it was made from: `gray-code` or `checkerboard`.
    pub by: MapBy,
    /// The map of homography and lens. `None` when none fits; each camera pixel was then decoded by itself.
    pub lens: Option<LensMap>,
    /// The number of points that the map was fitted to.
    pub points: usize,
    /// The root mean square distance of these points from the map, in projector pixels. Gray codes give whole
    /// pixels, so it is at least 0.41 with them.
    pub rms: f64,
    /// The standard error of the map, root mean square over the field, in projector pixels.
    pub error: f64,
    /// The share of lit camera pixels that could not be decoded, or do not agree with the map.
    pub unreliable: f64,
    /// The share of projector pixels that no camera pixel sees.
    pub masked: f64,
}

/// What a pixel map is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapBy {
    /// Gray codes, pixel by pixel.
    GrayCode,
    /// The corners of a checkerboard, which coarse Gray codes locate first.
    Checkerboard,
}

/// The measured stability of a rig over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StabilityFigures {
    /// Seconds from the confirmation of a frame until all of its light is there.
    pub settle: MeasuredValue,
    /// The relative change of the mean of the white photo, per hour.
    pub drift_per_hour: MeasuredValue,
    /// The seconds over which the drift was measured.
    pub watched: f64,
    /// The noise of one white photo at an average camera pixel, relative to its light.
    pub white_noise: f64,
    /// The photos of white: seconds on the rig's clock, and light relative to the first.
    pub whites: Vec<(f64, f64)>,
    /// The latency sweep: seconds waited, and the share of the light that was there.
    pub sweep: Vec<(f64, f64)>,
}
