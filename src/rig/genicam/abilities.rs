//! What a camera can do, read from its GenICam description.

use viva_genicam::Camera;
use viva_genicam::genapi::RegisterIo;

/// What a machine vision camera can do, as far as it says.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Abilities {
    /// Width and height of the sensor, in pixels.
    pub sensor: Option<[usize; 2]>,
    /// The camera's names of its pixel formats.
    pub pixel_formats: Vec<String>,
    /// The shortest and the longest exposure, in seconds.
    pub exposures: Option<[f64; 2]>,
    /// The lowest and the highest gain, in the camera's own unit.
    pub gains: Option<[f64; 2]>,
}

impl Abilities {
    /// Reads the abilities of an open camera, without setting anything.
    pub(in crate::rig) fn of<T: RegisterIo>(camera: &Camera<T>) -> Self {
        let range = |names: &[&str]| {
            let mut states = names.iter().filter_map(|name| camera.feature_state(name).ok());
            states.find_map(|state| state.range).map(|range| [range.min, range.max])
        };
        let whole = |names: &[&str]| {
            let number = names.iter().find_map(|name| camera.get_integer(name).ok());
            number.and_then(|number| usize::try_from(number).ok()).filter(|&number| number > 0)
        };
        // Width and Height may be a part of the sensor now: their maximum is the sensor's.
        let sides = [whole(&["WidthMax", "SensorWidth"]), whole(&["HeightMax", "SensorHeight"])];
        Self {
            sensor: sides[0].zip(sides[1]).map(|(width, height)| [width, height]),
            pixel_formats: camera
                .feature_state("PixelFormat")
                .ok()
                .and_then(|state| state.enum_entries)
                .unwrap_or_default(),
            // The camera's exposures are in microseconds.
            exposures: range(&["ExposureTime", "ExposureTimeAbs"]).map(|range| range.map(|time| time / 1e6)),
            gains: range(&["Gain"]),
        }
    }
}

impl std::fmt::Display for Abilities {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let between =
            |what: &str, [least, most]: [f64; 2], unit: &str| format!("{what} {least} to {most}{unit}");
        let parts = [
            self.sensor.map(|[width, height]| format!("{width}x{height} pixels")),
            Some(self.pixel_formats.join(", ")).filter(|formats| !formats.is_empty()),
            self.exposures.map(|range| between("exposures", range, " s")),
            self.gains.map(|range| between("gain", range, "")),
        ];
        f.write_str(&parts.into_iter().flatten().collect::<Vec<_>>().join("; "))
    }
}
