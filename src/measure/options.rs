//! The options of the stages between counts and light, and the part of a run's record that describes its rig.

use serde::{Deserialize, Serialize};

use super::Effort;
use crate::error::{Error, Result};
use crate::finding::Finding;

/// The options of a measurement: the `[measurement]` table of a rig file. Each stage can be switched off to show the error that it removes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeasureOptions {
    /// How signed vectors are shown.
    pub signed: SignedBy,
    /// Frames per pattern. Each frame shows the rounding error of the frames before it. With 1, each pixel shows one level.
    pub bit_planes: u32,
    /// How the error of rounding to levels is spread over the pixels.
    pub dither: DitherBy,
    /// The seed of random dither.
    pub dither_seed: u64,
    /// Add to each product the direct light that is missing because of rounding. Only the global light of the rounding error is then
    /// missing. This needs the direct image, which costs a few patterns once.
    pub compensate_rounding: bool,
    /// Exposures in seconds, the shortest first. They are merged by inverse variance. When empty, they are chosen from photos of white.
    pub exposures: Vec<f64>,
    /// The largest number of exposures to choose. Each exposure is four times the exposure before. Another exposure is added while a pixel
    /// of white is dark.
    pub brackets: u32,
    /// Frames averaged for each photo.
    pub takes: u32,
    /// Frames averaged for the black photo.
    pub black_takes: u32,
    /// Subtract the black photo.
    pub ambient: bool,
    /// Correct the measured responses of the devices. When off, levels and counts are used as linear light.
    pub response: bool,
    /// Resample photos to the projector's pixels by the measured pixel map. When off, both rasters are assumed to cover the same field.
    pub registration: bool,
    /// Divide patterns and photos by the measured uneven brightness of projector and camera.
    pub flat_field: bool,
    /// The number of patterns between two photos of white that measure drift. 0 means that drift is not measured.
    pub sentinel_every: u32,
    /// Standard deviation in pixels of the Gaussian blur of both pattern and photo. 0 means no blur.
    pub blur: f64,
    /// How the direct light is measured.
    pub direct: DirectBy,
    /// The side in pixels of the squares that separate the direct light. Smaller squares keep more of the global light apart, and need a
    /// camera that resolves them. `None` means codes that change from pixel to pixel when the calibration found at least four camera pixels
    /// per projector pixel, and otherwise squares of 4.
    pub direct_square: Option<u32>,
    /// Seconds to wait after a frame is confirmed. `None` means the time that the calibration measured.
    pub settle: Option<f64>,
    /// Tries for each frame before the rig is given up.
    pub tries: u32,
}

/// How signed vectors are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SignedBy {
    /// The affine or the split form, whichever is predicted to be less noisy.
    Auto,
    /// One photo of `(x − a)/(b − a)` and the white photo that was already taken, where `x` has values from `a` to `b` (O'Toole and
    /// Kutulakos, section 7.1).
    Affine,
    /// Two photos: one photo of the positive part and one photo of the negative part.
    Split,
}

/// How the error of rounding a pattern to the projector's levels is spread over the pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DitherBy {
    /// Error diffusion for the global part, because global light is insensitive to high spatial frequencies, and nearest levels otherwise.
    Auto,
    /// Each pixel shows the nearest level. The error at each pixel is the least possible, but the errors of neighbours are correlated.
    None,
    /// Each pixel shows the level below or above at random. The error has twice the variance that nearest levels give, and the errors of
    /// neighbours are not correlated.
    Random,
    /// The error of each pixel is passed on to its neighbours, so that it has only high spatial frequencies (Floyd and Steinberg 1976).
    Diffusion,
}

/// How the direct light is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DirectBy {
    /// Patterns of high spatial frequency measure the direct light (Nayar et al. 2006).
    Patterns,
    /// The direct light is not measured and cannot be removed.
    None,
}

impl Default for MeasureOptions {
    fn default() -> Self {
        Self {
            signed: SignedBy::Auto,
            bit_planes: 1,
            dither: DitherBy::Auto,
            compensate_rounding: false,
            dither_seed: 0,
            exposures: Vec::new(),
            brackets: 1,
            takes: 1,
            black_takes: 4,
            ambient: true,
            response: true,
            registration: true,
            flat_field: true,
            sentinel_every: 16,
            blur: 0.0,
            direct: DirectBy::Patterns,
            direct_square: None,
            settle: None,
            tries: 5,
        }
    }
}

/// The largest number of takes (repeated photos) of one frame. Larger take numbers, and this number, belong to photos of white that measure
/// drift.
pub(crate) const MOST_TAKES: u32 = 65_536;

impl MeasureOptions {
    /// Checks that every value is valid.
    ///
    /// # Errors
    /// [`Error::Option`] with the key of a rig file.
    pub fn check(&self) -> Result<()> {
        self.fault().map_or(Ok(()), |[key, found, expected]| {
            let fault = format!("{found} is not a valid value");
            Err(Error::option(format!("[measurement] {key}"), fault).help(format!("give {expected}")))
        })
    }

    /// The first invalid value: its key, the value, and the expected values.
    pub(crate) fn fault(&self) -> Option<[String; 3]> {
        let whole = "a whole number";
        let ranges = [
            ("bit_planes", self.bit_planes.into(), whole, 1.0, 16.0),
            ("brackets", self.brackets.into(), whole, 1.0, 12.0),
            ("takes", self.takes.into(), whole, 1.0, MOST_TAKES.into()),
            ("black_takes", self.black_takes.into(), whole, 1.0, MOST_TAKES.into()),
            ("direct_square", self.direct_square.unwrap_or(1).into(), whole, 1.0, 1024.0),
            ("tries", self.tries.into(), whole, 1.0, 1000.0),
            ("blur", self.blur, "pixels,", 0.0, 100.0),
            ("settle", self.settle.unwrap_or(0.0), "seconds,", 0.0, 3600.0),
        ];
        let wrong = ranges.into_iter().find(|(_, value, _, least, most)| !(*least..=*most).contains(value));
        if let Some((key, value, unit, least, most)) = wrong {
            return Some([key.into(), f64::to_string(&value), format!("{unit} from {least} to {most}")]);
        }
        let of_exposures = |found, expected: &str| Some(["exposures".into(), found, expected.into()]);
        if let Some(exposure) =
            self.exposures.iter().find(|seconds| !(**seconds > 0.0 && seconds.is_finite()))
        {
            return of_exposures(exposure.to_string(), "seconds, more than 0");
        }
        let ascend = self.exposures.windows(2).all(|pair| pair[0] < pair[1]);
        if ascend {
            None
        } else {
            of_exposures(format!("{:?}", self.exposures), "each longer than the one before")
        }
    }
}

/// How the photos of a run on a rig were made, and their cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RigRecord {
    /// The folder of the calibration. It is `None` when the devices were assumed to be ideal.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub calibration: Option<String>,
    /// The options of the stages between counts and light.
    pub measurement: MeasureOptions,
    /// The number of different patterns that were shown.
    pub patterns: u64,
    /// The frames and the time that the run took.
    pub effort: Effort,
    /// The relative standard error of the white photo.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub noise: Option<f64>,
    /// The largest relative change of white during the run, measured by repeated photos of white.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub drift: Option<f64>,
    /// Findings from the photos: whether the rig sees the projector, whether its light is steady, and whether light travels alike in both
    /// directions.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub findings: Vec<Finding>,
}

/// The record of a run, `run.json`. The record of a run on a scene has no [`RigRecord`].
pub type RunManifest = crate::io::manifest::Manifest<RigRecord>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_names_the_key_whose_value_is_out_of_range() {
        let standard = MeasureOptions::default();
        assert!(standard.check().is_ok());
        let wrong: [(&str, MeasureOptions); 7] = [
            ("takes", MeasureOptions { takes: 0, ..standard.clone() }),
            ("bit_planes", MeasureOptions { bit_planes: 17, ..standard.clone() }),
            ("exposures", MeasureOptions { exposures: vec![0.1, -1.0], ..standard.clone() }),
            ("exposures", MeasureOptions { exposures: vec![0.2, 0.1], ..standard.clone() }),
            ("blur", MeasureOptions { blur: f64::NAN, ..standard.clone() }),
            ("settle", MeasureOptions { settle: Some(-1.0), ..standard.clone() }),
            ("direct_square", MeasureOptions { direct_square: Some(0), ..standard.clone() }),
        ];
        for (key, options) in wrong {
            let error = options.check().map_err(|error| error.to_string());
            assert!(
                error.as_ref().is_err_and(|text| text.contains(&format!("[measurement] {key}:"))),
                "{error:?}"
            );
        }
    }
}
