//! Camera pixels to projector pixels, by the calibration's sparse rows (section 8.1); of one photo, or of a linear
//! combination of several, whose noise is then known exactly.

use super::ambient::Blacks;
use super::calibration::Registration;
use super::hdr::Sighting;
use super::photo::Plane;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::rig::{CameraInfo, ProjectorInfo};

/// The map that a measurement uses: the calibration's, or by area where the stage is off.
pub(super) fn choose(
    calibrated: &Registration,
    projector: &ProjectorInfo,
    camera: &CameraInfo,
    on: bool,
) -> Result<Registration> {
    if !on {
        return Ok(Registration::by_area(projector.resolution, camera.resolution));
    }
    for (what, expected, found) in [
        ("camera pixels in the calibration", camera.resolution, calibrated.camera),
        ("projector pixels in the calibration", projector.resolution, calibrated.projector),
    ] {
        if expected != found {
            return Err(Error::Dimension { what, expected: expected.to_string(), found: found.to_string() });
        }
    }
    let entries = calibrated.pixels.len();
    let rows = calibrated.projector.pixels();
    let ascends = calibrated.starts.windows(2).all(|pair| pair[0] <= pair[1]);
    let ends = calibrated.starts.first() == Some(&0) && calibrated.starts.last() == Some(&entries);
    let inside = calibrated.pixels.iter().all(|&pixel| (pixel as usize) < calibrated.camera.pixels());
    if calibrated.starts.len() != rows + 1
        || !ascends
        || !ends
        || !inside
        || calibrated.weights.len() != entries
    {
        return Err(Error::Numerical(
            "the pixel map in the calibration is not a list of sparse rows\n  help: calibrate the rig again: krylux rig calibrate"
                .into(),
        ));
    }
    Ok(calibrated.clone())
}

impl Registration {
    /// The entries of a projector pixel's row: camera pixels and their weights.
    pub(crate) fn row(&self, pixel: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let span = self.starts[pixel]..self.starts[pixel + 1];
        self.pixels[span.clone()].iter().map(|&pixel| pixel as usize).zip(self.weights[span].iter().copied())
    }

    /// Which projector pixels are seen at all.
    pub(crate) fn seen(&self) -> Vec<bool> {
        self.starts.windows(2).map(|pair| pair[0] < pair[1]).collect()
    }

    /// How much the variance of each camera pixel adds to the sum of the variances of all projector pixels, `Σ weight²`;
    /// 0: it is not used.
    pub(super) fn importance(&self, camera: Resolution) -> Vec<f64> {
        let mut importance = vec![0.0; camera.pixels()];
        for (&pixel, weight) in self.pixels.iter().zip(&self.weights) {
            importance[pixel as usize] += weight * weight;
        }
        importance
    }
}

/// `Σ_m c_m(i) photo_m(i)` on the projector's pixels `i`, for one channel, with its variance.
///
/// Photos are independent but for the black photo `B` that was subtracted from each; it counts once, with the sum of its shares:
///
/// ```text
/// var_i = Σ_j r_ij² ( Σ_m c_m² var_mj  +  Σ_e (Σ_m c_m share_mej)² var B_ej )
/// ```
///
/// over camera pixels `j` of weight `r_ij` and exposures `e`. So a difference of two photos knows that the black one
/// cancels.
pub(super) fn combine(
    registration: &Registration,
    sightings: &[&Sighting],
    coefficient: &dyn Fn(usize, usize) -> f64,
    blacks: &Blacks,
    (channel, channels): (usize, usize),
) -> Plane {
    let pixels = registration.projector.pixels();
    let mut plane = Plane::zero(pixels);
    let mut factors = vec![0.0; sightings.len()];
    for pixel in 0..pixels {
        for (term, factor) in factors.iter_mut().enumerate() {
            *factor = coefficient(pixel, term);
        }
        for (camera_pixel, weight) in registration.row(pixel) {
            let sample = camera_pixel * channels + channel;
            let (mut value, mut variance) = (0.0, 0.0);
            for (factor, sighting) in factors.iter().zip(sightings) {
                if *factor != 0.0 {
                    value += factor * sighting.values[sample];
                    variance += factor * factor * sighting.variance[sample];
                }
            }
            for (exposure, black) in blacks.variance.iter().enumerate() {
                let share = |(factor, sighting): (&f64, &&Sighting)| {
                    factor
                        * sighting.scale
                        * sighting.shares.as_ref().map_or(1.0, |shares| shares[exposure][sample])
                };
                let share: f64 = factors.iter().zip(sightings).map(share).sum();
                if share != 0.0 {
                    variance += share * share * black[sample];
                }
            }
            plane.values[pixel] += weight * value;
            plane.variance[pixel] += weight * weight * variance;
        }
    }
    plane
}
