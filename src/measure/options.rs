//! Which stages stand between counts and light, and how each is set.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// How a measurement is made: the `[measurement]` table of a rig file. Each stage can be switched off, to see the error
/// that it removes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeasureOptions {
    /// How signed vectors are shown.
    pub signed: SignedBy,
    /// Frames per pattern, each of what those before could not show; 1: the nearest levels, once.
    pub bit_planes: u32,
    /// How the error of rounding to levels is spread over the pixels.
    pub dither: DitherBy,
    /// Seed of random dither.
    pub dither_seed: u64,
    /// Add the direct light of what rounding to levels left out: direct light is known pixel by pixel, so only the indirect light of
    /// the difference is then missing. It needs the direct image, a few patterns once.
    pub compensate_rounding: bool,
    /// Exposures in seconds, merged by inverse variance; empty: chosen from the white frame.
    pub exposures: Vec<f64>,
    /// How many exposures may be chosen: each four times the one before, while a pixel of the white photo is still dark.
    pub brackets: u32,
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
    /// Patterns between two of the drift sentinel's whites; 0: none.
    pub sentinel_every: u32,
    /// Standard deviation in pixels of the Gaussian that pattern and photo are both blurred with; 0: none.
    pub blur: f64,
    /// Where the direct light is known from.
    pub direct: DirectBy,
    /// The side in pixels of the squares that the direct light is found with: wider than the blur of projector and
    /// camera, smaller than anything that indirect light shows.
    pub direct_square: u32,
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

/// How the error of rounding a pattern to the projector's levels is spread.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DitherBy {
    /// As is best for the product: diffusion where the direct light is removed, since indirect light hardly sees high
    /// frequencies; nearest levels otherwise.
    Auto,
    /// Each pixel shows the nearest level: the least error at each pixel, in patterns of its own.
    None,
    /// The level below or above by chance: twice the variance, but without pattern.
    Random,
    /// The error goes to neighbours, so that only high frequencies have one (Floyd and Steinberg 1976).
    Diffusion,
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
            sentinel_every: 16,
            blur: 0.0,
            direct: DirectBy::Patterns,
            direct_square: 4,
            settle: None,
            tries: 5,
        }
    }
}

impl MeasureOptions {
    /// That every value can be used.
    ///
    /// # Errors
    /// [`Error::Option`], with the key as it stands in a rig file.
    pub fn check(&self) -> Result<()> {
        let counts = [
            ("bit_planes", self.bit_planes, 1, 16),
            ("brackets", self.brackets, 1, 12),
            ("takes", self.takes, 1, MOST_TAKES),
            ("black_takes", self.black_takes, 1, MOST_TAKES),
            ("direct_square", self.direct_square, 1, 1024),
            ("tries", self.tries, 1, 1000),
        ];
        for (key, value, least, most) in counts {
            if !(least..=most).contains(&value) {
                return Err(refused(
                    key,
                    value.to_string(),
                    format!("a whole number from {least} to {most}"),
                ));
            }
        }
        for &exposure in &self.exposures {
            if !(exposure > 0.0 && exposure.is_finite()) {
                return Err(refused("exposures", exposure.to_string(), "seconds, more than 0".into()));
            }
        }
        if self.exposures.windows(2).any(|pair| pair[0] >= pair[1]) {
            let found = format!("{:?}", self.exposures);
            return Err(refused("exposures", found, "each longer than the one before".into()));
        }
        if !(0.0..=100.0).contains(&self.blur) {
            return Err(refused("blur", self.blur.to_string(), "pixels, from 0 to 100".into()));
        }
        match self.settle {
            Some(seconds) if !(0.0..=3600.0).contains(&seconds) => {
                Err(refused("settle", seconds.to_string(), "seconds, from 0 to 3600".into()))
            }
            _ => Ok(()),
        }
    }
}

/// Takes of one frame at most: those above number the drift sentinel's.
pub(super) const MOST_TAKES: u32 = 65_536;

fn refused(key: &str, found: String, expected: String) -> Error {
    Error::Option {
        option: format!("[measurement] {key}"),
        fault: format!("{found} is no possible value"),
        help: format!("give {expected}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_their_key() {
        let standard = MeasureOptions::default();
        assert!(standard.check().is_ok());
        let wrong: [(&str, MeasureOptions); 7] = [
            ("takes", MeasureOptions { takes: 0, ..standard.clone() }),
            ("bit_planes", MeasureOptions { bit_planes: 17, ..standard.clone() }),
            ("exposures", MeasureOptions { exposures: vec![0.1, -1.0], ..standard.clone() }),
            ("exposures", MeasureOptions { exposures: vec![0.2, 0.1], ..standard.clone() }),
            ("blur", MeasureOptions { blur: f64::NAN, ..standard.clone() }),
            ("settle", MeasureOptions { settle: Some(-1.0), ..standard.clone() }),
            ("direct_square", MeasureOptions { direct_square: 0, ..standard.clone() }),
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
