//! The report of a calibration: every measured value with its standard error, and the report as text lines.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::finding::decimal;
use crate::measure::Effort;
use crate::measure::lens_map::LensMap;

/// The report of a calibration, saved as `report.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CalibrationReport {
    /// The camera.
    pub camera: CameraFigures,
    /// The channels of the projector.
    pub projector: Vec<ProjectorFigures>,
    /// The pixel map.
    pub map: MapFigures,
    /// The smallest ratio of the projector's to the camera's brightness, divided by the largest. It is `None` when the rig is not coaxial.
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
    /// The count at which overexposed pixels saturate, in DN.
    pub plateau: f64,
    /// Whether overexposed pixels were seen. Otherwise the plateau is the largest possible count.
    pub plateau_reached: bool,
    /// The plateau in electrons, computed from its linear DN.
    pub full_well: MeasuredValue,
    /// The largest departure of the response from a line beyond noise, as a fraction of the range.
    pub departure: f64,
    /// Whether the response was approximated by a line.
    pub linear: bool,
    /// Linear DN per second without a pattern, from ambient light, the projector's black level and dark current.
    pub dark_rate: MeasuredValue,
    /// The exposure at which white fills the range, in seconds.
    pub exposure: f64,
}

/// The measured values of one channel of a projector.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProjectorFigures {
    /// The exponent that fits the response best.
    pub gamma: MeasuredValue,
    /// The root mean square residual of this fit over the levels, as a fraction of white.
    pub gamma_residual: f64,
    /// The largest standard error of the light of a level, as a fraction of white.
    pub curve_error: f64,
    /// The light at level 0, ambient light included, as a fraction of white.
    pub black: MeasuredValue,
}

/// The measured values of the pixel map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapFigures {
    /// The source of the map: `gray-code` or `checkerboard`.
    pub by: MapBy,
    /// The lens map: a homography and the distortion of the lens. It is `None` when no map fits, so that each camera pixel is decoded
    /// separately.
    pub lens: Option<LensMap>,
    /// The number of points to which the map was fitted.
    pub points: usize,
    /// The root mean square distance of these points from the map, in projector pixels. With Gray codes, it is at least 0.41, because codes
    /// are whole pixels.
    pub rms: f64,
    /// The standard error of the map, root mean square over the field, in projector pixels.
    pub error: f64,
    /// The fraction of lit camera pixels that could not be decoded or do not agree with the map.
    pub unreliable: f64,
    /// The fraction of projector pixels that no camera pixel sees.
    pub masked: f64,
}

/// The source of a pixel map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapBy {
    /// Gray codes with their inverses.
    GrayCode,
    /// The corners of a checkerboard.
    Checkerboard,
}

/// The measured stability of a rig over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StabilityFigures {
    /// The time from the confirmation of a frame until all of its light is there, in seconds.
    pub settle: MeasuredValue,
    /// The relative change of the mean of the white photo, per hour.
    pub drift_per_hour: MeasuredValue,
    /// The time over which the drift was measured, in seconds.
    pub watched: f64,
    /// The noise of one white photo at an average camera pixel, relative to its light.
    pub white_noise: f64,
    /// The photos of white, as seconds on the rig's clock and light relative to the first photo.
    pub whites: Vec<(f64, f64)>,
    /// The latency sweep, as the wait in seconds and the light after this wait relative to the full light.
    pub sweep: Vec<(f64, f64)>,
}

/// A measured number with its standard error, in the same unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredValue {
    /// The value.
    pub value: f64,
    /// The standard error, as predicted by the noise of the frames.
    pub error: f64,
}

impl MeasuredValue {
    /// Makes `value ± error`.
    pub fn new(value: f64, error: f64) -> Self {
        Self { value, error }
    }

    /// Multiplies the value and its error by a factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self { value: self.value * factor, error: self.error * factor.abs() }
    }
}

impl fmt::Display for MeasuredValue {
    /// Writes the value, rounded to two digits of the error: `2.2013 ± 0.0012`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = if self.error > 0.0 { self.error } else { self.value.abs() * 1e-4 };
        let decimals = if size > 0.0 { (1.0 - size.log10().floor()).clamp(0.0, 9.0) as usize } else { 0 };
        write!(f, "{:.decimals$} ± {:.decimals$}", self.value, self.error)
    }
}

impl CalibrationReport {
    /// The report as lines of text, each with a subject and its figures. An empty subject means that the previous line continues.
    pub fn lines(&self) -> Vec<[String; 2]> {
        let Self { projector, map, evenness, stability, effort, .. } = self;
        let mut lines = Vec::from(self.camera.lines());
        lines.extend(projector.iter().enumerate().map(|(channel, found)| {
            let (residual, black) = (100.0 * found.gamma_residual, found.black.scaled(100.0));
            let text = format!(
                "channel {channel}: gamma {}, with a residual of {residual:.3} % of white; black and ambient {black} % of white",
                found.gamma
            );
            ("projector", text)
        }));
        let by = match map.by {
            MapBy::GrayCode => "Gray codes",
            MapBy::Checkerboard => "a checkerboard",
        };
        let kind =
            if map.lens.is_some() { "homography and lens" } else { "pixel by pixel: no common map fits" };
        lines.push(("pixels", format!("by {by}, {} points, {kind}", map.points)));
        lines.push((
            "",
            format!(
                "within {:.3} pixels of the projector (points scatter by {:.2}); {:.1} % unreliable, {:.1} % unseen",
                map.error,
                map.rms,
                100.0 * map.unreliable,
                100.0 * map.masked
            ),
        ));
        lines.extend(evenness.map(|share| {
            let text = format!(
                "projector over camera: the least is {share} of the largest, by the symmetry of the light transport"
            );
            ("evenness", text)
        }));
        lines.push((
            "stability",
            format!(
                "light settles in {} s; drifts {} % per hour (watched for {:.0} s)",
                stability.settle,
                stability.drift_per_hour.scaled(100.0),
                stability.watched
            ),
        ));
        lines.push(("", format!("noise of one white photo {:.3} % a pixel", 100.0 * stability.white_noise)));
        lines.push(("frames", effort_text(effort)));
        lines.into_iter().map(|(subject, text)| [subject.to_owned(), text]).collect()
    }
}

fn effort_text(effort: &Effort) -> String {
    let refused = effort.dropped + effort.repeated + effort.late;
    format!("{} taken, {refused} refused, in {:.0} s of the rig's time", effort.taken, effort.seconds)
}

impl CameraFigures {
    fn lines(&self) -> [(&'static str, String); 4] {
        let well = if self.plateau_reached { "" } else { " at least: it was never full" };
        let response = if self.linear { "linear" } else { "not linear, and corrected" };
        let (departure, exposure) = (100.0 * self.departure, decimal(self.exposure, 4));
        [
            ("camera", format!("black level {} DN, read noise {} DN", self.black, self.read_noise)),
            (
                "",
                format!("gain {} electrons per DN, full well {} electrons{well}", self.gain, self.full_well),
            ),
            (
                "",
                format!(
                    "response {response} (it departs from a line by {departure:.2} % of the range beyond noise)"
                ),
            ),
            ("", format!("{} DN/s without a pattern; white fills the range in {exposure} s", self.dark_rate)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_written_with_two_digits_of_its_error() {
        assert_eq!(MeasuredValue::new(2.201_34, 0.001_21).to_string(), "2.2013 ± 0.0012");
        assert_eq!(MeasuredValue::new(64.03, 1.5).to_string(), "64.0 ± 1.5");
        assert_eq!(MeasuredValue::new(0.0, 0.0).to_string(), "0 ± 0");
        // If the error is 0, a ten-thousandth of the value determines the number of digits.
        assert_eq!(MeasuredValue::new(-2.5, 0.0).to_string(), "-2.50000 ± 0.00000");
        assert_eq!(MeasuredValue::new(2.0, 0.5).scaled(-3.0), MeasuredValue::new(-6.0, 1.5));
    }

    #[test]
    fn frames_of_all_three_kinds_are_refused() {
        let effort =
            Effort { taken: 70, dropped: 4, repeated: 2, late: 1, seconds: 12.4, ..Effort::default() };
        assert_eq!(effort_text(&effort), "70 taken, 7 refused, in 12 s of the rig's time");
    }
}
