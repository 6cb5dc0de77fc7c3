//! Tells whether a rig sees its projector, and whether its light is steady, from photos of black and white that a run takes anyway.
//!
//! | finding | from | additional frames |
//! |---|---|---|
//! | `light` | white, and repeated black photos, before the first pattern | two of black for each exposure, where fewer were taken |
//! | `drift` | white, repeated during the run and once more at its end | one |

use std::borrow::Cow;

use super::calibration::Registration;
use super::hdr::RateFrame;
use super::measurement::Measurement;
use crate::error::{Error, Result};
use crate::finding::{Finding, Grade};
use crate::image::Resolution;

/// A pixel sees the projector when white is brighter than black by this many standard errors. The standard errors are computed for a pixel
/// without any light of the projector.
const SEEN: f64 = 10.0;

/// The smallest fraction of the pixel map's pixels that must see the projector.
const LEAST: f64 = 0.5;

/// The largest accepted relative change of white's light from one photo of white to the next. The lamp's brightness is interpolated between
/// photos of white, and extrapolated after the last of them. An error of this size may therefore remain.
const STEP: f64 = 0.05;

impl Measurement {
    /// Whether the camera sees the projector where the pixel map expects it. The repeated photos of black give the noise, because the noise
    /// of a rig that was not calibrated is unknown. A replayed run that lacks these photos is not examined.
    pub fn sight(&mut self) -> Result<Finding> {
        let light = match self.above_black() {
            Err(Error::NotTaken { .. }) => {
                return Ok(Finding::unmeasured("light", "the run took no repeated photos of black"));
            }
            light => light?,
        };
        Ok(judged(&self.registration, self.camera_channels(), &light))
    }

    /// White minus black in each sample of the camera, per second, and the variance of this difference without any light of the projector.
    fn above_black(&mut self) -> Result<Vec<[f64; 2]>> {
        let references = self.pipeline.references()?;
        let is_repeated = self.options.ambient && self.options.black_takes > 1;
        // The difference of two photos of black gives the noise without light.
        let blacks = match is_repeated {
            true => Cow::Borrowed(&references.blacks.exposed),
            false => Cow::Owned(self.pipeline.blacks(&references.exposures, 2)?.exposed),
        };
        let options = &self.options;
        let white: &RateFrame = &references.white;
        let sample = |sample: usize| {
            let (mut light, mut variance) = (white.values[sample], 0.0);
            for (exposure, black) in blacks.iter().enumerate() {
                let share =
                    white.shares.as_ref().map_or(1.0, |shares| shares[exposure][sample]) / black.exposure;
                if !options.ambient {
                    light -= share * black.mean[sample];
                }
                let takes = f64::from(black.takes).recip() + f64::from(options.takes).recip();
                variance += share * share * takes * black.scatter[sample].max(black.rounding[sample]);
            }
            [light, variance]
        };
        Ok((0..white.values.len()).map(sample).collect())
    }

    /// Photographs white once more, and examines whether the lamp was steady since the run's first white. It takes no photo when no pattern
    /// was shown since the last white. A replayed run that lacks this photo is judged by the photos that it has.
    pub fn steadiness(&mut self) -> Result<Finding> {
        match self.pipeline.look_again() {
            Ok(()) | Err(Error::NotTaken { .. }) => {}
            Err(error) => return Err(error),
        }
        let drift = self.drift()?;
        if drift.sentinels.len() < 2 {
            return Ok(Finding::unmeasured("drift", "white was photographed only once"));
        }
        let [step, error] = drift.step;
        let found = format!(
            "white changed by {:.1} % from one photo of it to the next, and by {:.1} % in all",
            100.0 * step,
            100.0 * drift.largest
        );
        let help = "let the lamp warm up, shut out other light, and photograph white more often (sentinel_every in [measurement])";
        let expected = format!("at most {:.0} %", 100.0 * STEP);
        Ok(Finding::at_most("drift", [step, error, STEP], Grade::Fails, found, expected, help))
    }
}

/// Whether enough pixels of a map see the projector. `light` holds white minus black for each sample of a camera with `channels` channels,
/// and the variance of this difference without any light of the projector.
pub(crate) fn judged(map: &Registration, channels: usize, light: &[[f64; 2]]) -> Finding {
    let is_lit = |pixel: usize| {
        (0..channels).any(|channel| {
            let [mut value, mut variance] = [0.0; 2];
            for (camera_pixel, weight) in map.row(pixel) {
                let [sample, noise] = light[camera_pixel * channels + channel];
                value += weight * sample;
                variance += weight * weight * noise;
            }
            value > SEEN * variance.sqrt()
        })
    };
    let seen = map.seen();
    let covered = seen.iter().filter(|&&seen| seen).count();
    let lit = (0..seen.len()).filter(|&pixel| seen[pixel] && is_lit(pixel)).count();
    let share = lit as f64 / covered.max(1) as f64;
    let found = format!(
        "white is brighter than black by {SEEN} standard errors at {lit} of {covered} pixels of the pixel map, {:.1} %",
        100.0 * share
    );
    let help = "take off the lens cap, expose longer, and let the projector light what the camera sees; where the camera sees more than the \
                projector lights, or much of the scene is black, calibrate with `krylux rig calibrate`: the pixel map then has only what is lit";
    let expected = format!("at least {:.0} %", 100.0 * LEAST);
    Finding::at_least("light", [share, 0.0, LEAST], Grade::Fails, found, expected, help)
}

/// With fewer camera pixels than this per projector pixel along an axis, neighbouring projector pixels are mixed in the photo.
const ENOUGH_PIXELS: f64 = 1.0;

/// With fewer camera pixels than this per projector pixel along an axis, no pixel map can be fitted, and single stripes are not resolved.
pub(crate) const LEAST_PIXELS: f64 = 0.75;

/// The finding about a camera with too few pixels. It is `None` if the camera has enough. A camera that sees more than the projector lights
/// has fewer pixels for the patterns than this function counts.
pub(crate) fn too_few(camera: Resolution, projector: Resolution) -> Option<Finding> {
    let ratios = [(camera.width, projector.width), (camera.height, projector.height)]
        .map(|(camera, projector)| camera as f64 / projector as f64);
    let least = ratios[0].min(ratios[1]);
    if least >= ENOUGH_PIXELS {
        return None;
    }
    let most = Resolution::new(camera.width.min(projector.width), camera.height.min(projector.height));
    Some(Finding::graded(
        "pixels",
        if least < LEAST_PIXELS { Grade::Fails } else { Grade::Warning },
        format!(
            "the camera has {:.2} x {:.2} pixels for each pixel of the patterns ({camera} for {projector}), too few to tell them apart",
            ratios[0], ratios[1]
        ),
        "at least one; two and more give sharper photos",
        format!(
            "give patterns of at most {most} pixels: a smaller size in the rig file, on a monitor with a larger magnify; or a camera mode with more pixels. \
             Focusing does not help"
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::measure::simulated::Simulated;
    use crate::measure::{Calibration, CaptureRequest, FrameSource, MeasureOptions};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// The finding about a simulated rig of eight by eight pixels. `noise`, `room` and `white` are counts of noise, of room light and of
    /// white. Room light changes by up to the fraction `change` from photo to photo.
    fn found(seed: u64, [noise, room, white, change]: [f64; 4], options: &MeasureOptions) -> Finding {
        let mut random = Pcg64::seed_from_u64(seed);
        let photo = move |request: &CaptureRequest, _| {
            let lit = if request.frame.levels()[0] > 0 { white } else { 0.0 };
            let room = room * (1.0 + change * (2.0 * random.random::<f64>() - 1.0));
            let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
            (0..64)
                .map(|_| (100.0 + room + lit + noise * normal()).round().clamp(0.0, 4095.0) as u16)
                .collect()
        };
        let size = Resolution::new(8, 8);
        let frames = Simulated::new(size, size, 12, photo);
        let ideal = Calibration::ideal(frames.projector(), frames.camera());
        let mut rig =
            Measurement::new(Box::new(frames), ideal, options.clone()).expect("options that make sense");
        rig.sight().expect("it never fails")
    }

    #[test]
    fn a_blind_rig_never_passes_and_one_that_sees_always_does() {
        for seed in 0..300 {
            let mut random = Pcg64::seed_from_u64(1000 + seed);
            let noise = random.random_range(0.0..30.0);
            let (room, change) = (random.random_range(0.0..2000.0), random.random_range(0.0..0.5));
            let exposures = vec![0.1];
            let options = [
                MeasureOptions { exposures: exposures.clone(), ..MeasureOptions::default() },
                MeasureOptions { exposures: exposures.clone(), black_takes: 1, ..MeasureOptions::default() },
                MeasureOptions { exposures, ambient: false, ..MeasureOptions::default() },
            ];
            // The room light of two photos of black may be equal by chance. Room light therefore changes only with the first options, which
            // take more photos of black.
            let change = if seed % 3 == 0 { change } else { 0.0 };
            let options = &options[seed as usize % 3];
            let blind = found(seed, [noise, room, 0.0, change], options);
            assert_eq!(blind.grade, Grade::Fails, "{seed}: {blind}");
            assert!(blind.require().is_err_and(|error| error.to_string().contains("lens cap")));
            let seen = found(seed, [noise, room, 40.0 * noise + 5.0, 0.0], options);
            assert_eq!(seen.grade, Grade::Ok, "{seed}: {seen}");
        }
    }

    #[test]
    fn the_axis_with_fewer_pixels_decides() {
        let grade = |camera: [usize; 2], projector: [usize; 2]| {
            let [camera, projector] =
                [camera, projector].map(|[width, height]| Resolution::new(width, height));
            too_few(camera, projector).map(|found| found.grade)
        };
        for (camera, expected) in [
            ([48, 48], None),
            ([480, 48], None),
            ([480, 47], Some(Grade::Warning)),
            ([36, 99], Some(Grade::Warning)),
            ([35, 99], Some(Grade::Fails)),
            ([99, 35], Some(Grade::Fails)),
        ] {
            assert_eq!(grade(camera, [48, 48]), expected, "{camera:?}");
        }
        let found = too_few(Resolution::new(24, 99), Resolution::new(48, 64)).expect("they are too few");
        for part in ["0.50 x 1.55 pixels", "24x99 for 48x64", "at most 24x64", "Focusing does not help"] {
            assert!(found.to_string().contains(part), "{found}");
        }
    }
}
