//! The registration stage: the pixel map resamples photos from camera to projector pixels (O'Toole and Kutulakos, section 8.1).
//!
//! Linear combinations of photos are formed in the same step, because only then is the noise that the photos share known exactly.

use super::calibration::Registration;
use super::hdr::{BlackPhotos, RateFrame};
use super::photos::Plane;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::rig::{CameraInfo, ProjectorInfo};

/// The pixel map of a measurement: the calibration's map, or the map by area when the stage is switched off.
pub(crate) fn choose(
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
        Error::check_size(what, expected, found)?;
    }
    if calibrated.fault().is_some() {
        return Err(Error::Numerical(
            "the pixel map in the calibration does not consist of sparse rows\n  help: calibrate the rig again: krylux rig calibrate"
                .into(),
        ));
    }
    Ok(calibrated.clone())
}

impl Registration {
    /// The first array that is not valid (`starts`, `pixels` or `weights`), and its fault.
    pub(crate) fn fault(&self) -> Option<(&'static str, String)> {
        let (entries, camera) = (self.pixels.len(), self.camera.pixels());
        let ends = [self.starts.first(), self.starts.last()] == [Some(&0), Some(&entries)];
        if self.starts.len() != self.projector.pixels() + 1 || !ends || !self.starts.is_sorted() {
            let fault = format!("rows do not ascend from 0 to {entries}, the number of weights");
            return Some(("starts", fault));
        }
        if let Some(pixel) = self.pixels.iter().find(|&&pixel| pixel as usize >= camera) {
            return Some((
                "pixels",
                format!("it contains pixel {pixel}, but the camera has {camera} pixels"),
            ));
        }
        let are_finite =
            self.weights.len() == entries && self.weights.iter().all(|weight| weight.is_finite());
        if are_finite { None } else { Some(("weights", "a weight is not finite".into())) }
    }

    /// The row of a projector pixel: camera pixels and their weights.
    pub(crate) fn row(&self, pixel: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let span = self.starts[pixel]..self.starts[pixel + 1];
        self.pixels[span.clone()].iter().map(|&pixel| pixel as usize).zip(self.weights[span].iter().copied())
    }

    /// Whether each projector pixel is seen by at least one camera pixel.
    pub(crate) fn seen(&self) -> Vec<bool> {
        self.starts.windows(2).map(|pair| pair[0] < pair[1]).collect()
    }

    /// The standard deviation, in projector pixels, of the blur that patterns and photos need so that the camera can resolve all their
    /// detail. The blur is 1 when the camera has fewer than two pixels per projector pixel along a side, else 0.
    ///
    /// Detail of one pixel needs two samples (the sampling theorem). With fewer samples, some detail is aliased to another pattern, which
    /// no model of direct light explains. A Gaussian of one pixel leaves 0.7 % of the detail that alternates from pixel to pixel. No blur
    /// is needed if exactly one camera pixel sees each projector pixel, because no photo is then resampled.
    pub fn blur(&self) -> f64 {
        let is_one_to_one = self.starts.windows(2).all(|row| row[1] - row[0] <= 1);
        let mut used = vec![false; self.camera.pixels()];
        self.pixels.iter().for_each(|&pixel| used[pixel as usize] = true);
        let count = |pixels: &[bool]| pixels.iter().filter(|&&is_used| is_used).count();
        let (used, seen) = (count(&used), count(&self.seen()));
        if is_one_to_one || used >= 4 * seen { 0.0 } else { 1.0 }
    }

    /// The weight of each camera pixel's variance in the total variance of all projector pixels: `Σ weight²` over the rows, 0 if unused.
    pub(crate) fn importance(&self, camera: Resolution) -> Vec<f64> {
        let mut importance = vec![0.0; camera.pixels()];
        for (&pixel, weight) in self.pixels.iter().zip(&self.weights) {
            importance[pixel as usize] += weight * weight;
        }
        importance
    }
}

/// The sum `Σ_m c_m(i) photo_m(i)` at the projector's pixels `i`, for one channel, with its variance.
///
/// The photos are independent, except for the black photo `B` that was subtracted from each. The black photo counts once, with the sum of
/// its shares:
///
/// ```text
/// var_i = Σ_j r_ij² ( Σ_m c_m² var_mj  +  Σ_e (Σ_m c_m share_mej)² var B_ej )
/// ```
///
/// The sums run over camera pixels `j` with weights `r_ij`, photos `m` and exposures `e`. Photo `m` subtracts the share `share_mej` of the
/// black photo `B_ej`. In the difference of two photos, for example, the black photo cancels. `coefficient(i, m)` is `c_m(i)`. The last
/// argument is the channel's index and the number of channels.
pub(crate) fn combine(
    registration: &Registration,
    rate_frames: &[&RateFrame],
    coefficient: &dyn Fn(usize, usize) -> f64,
    blacks: &BlackPhotos,
    (channel, channels): (usize, usize),
) -> Plane {
    let pixels = registration.projector.pixels();
    let mut plane = Plane::zero(pixels);
    let mut factors = vec![0.0; rate_frames.len()];
    for pixel in 0..pixels {
        for (term, factor) in factors.iter_mut().enumerate() {
            *factor = coefficient(pixel, term);
        }
        for (camera_pixel, weight) in registration.row(pixel) {
            let sample = camera_pixel * channels + channel;
            let (mut value, mut variance) = (0.0, 0.0);
            for (factor, rate_frame) in factors.iter().zip(rate_frames) {
                if *factor != 0.0 {
                    value += factor * rate_frame.values[sample];
                    variance += factor * factor * rate_frame.variance[sample];
                }
            }
            for (exposure, black) in blacks.variance.iter().enumerate() {
                let share = |(factor, rate_frame): (&f64, &&RateFrame)| {
                    factor
                        * rate_frame.scale
                        * rate_frame.shares.as_ref().map_or(1.0, |shares| shares[exposure][sample])
                };
                let share: f64 = factors.iter().zip(rate_frames).map(share).sum();
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

#[cfg(test)]
mod tests {
    use super::*;

    fn photo(value: f64, variance: f64, shares: Option<[f64; 2]>) -> RateFrame {
        RateFrame {
            started: 0.0,
            values: vec![value],
            variance: vec![variance],
            shares: shares.map(|shares| shares.map(|share| vec![share]).to_vec()),
            scale: 1.0,
        }
    }

    fn sum(photos: &[&RateFrame], coefficients: &[f64], black: &[f64]) -> [f64; 2] {
        let one = Resolution::new(1, 1);
        let blacks = BlackPhotos {
            exposed: Vec::new(),
            variance: black.iter().map(|&variance| vec![variance]).collect(),
        };
        let registration = Registration::by_area(one, one);
        let plane = combine(&registration, photos, &|_, term| coefficients[term], &blacks, (0, 1));
        [plane.values[0], plane.variance[0]]
    }

    /// The drift correction divides a photo together with its black photo by the lamp's brightness.
    #[test]
    fn the_black_photos_noise_is_scaled_as_the_drift_correction_scales_the_photo() {
        let mut halved = photo(8.0, 4.0, None);
        halved.scale(0.5);
        assert_eq!(sum(&[&halved], &[1.0], &[16.0]), [4.0, 1.0 + 4.0]);
        // In the difference of two photos, the black photo cancels without drift. With drift, a part of the black photo is left.
        let other = photo(3.0, 1.0, None);
        assert_eq!(sum(&[&other, &other], &[1.0, -1.0], &[16.0]), [0.0, 2.0]);
        assert_eq!(sum(&[&other, &halved], &[1.0, -1.0], &[16.0]), [-1.0, 1.0 + 1.0 + 0.25 * 16.0]);
    }

    #[test]
    fn the_black_photo_of_each_exposure_counts_by_its_share() {
        let mut merged = photo(8.0, 4.0, Some([0.25, 0.75]));
        merged.scale(2.0);
        assert_eq!(sum(&[&merged], &[1.0], &[16.0, 4.0]), [16.0, 16.0 + 0.25 * 16.0 + 2.25 * 4.0]);
    }

    #[test]
    fn a_camera_of_few_pixels_needs_a_blur_and_one_that_sees_pixel_by_pixel_needs_none() {
        let four = Resolution::new(4, 4);
        let of_area = |side: usize| Registration::by_area(four, Resolution::new(side, side)).blur();
        // The camera pixels per 16 projector pixels are 16 (one by one), 36 and 64.
        assert_eq!([of_area(4), of_area(6), of_area(8)], [0.0, 1.0, 0.0]);
        // Each projector pixel lies between two camera pixels.
        let between = Registration {
            camera: Resolution::new(3, 1),
            projector: Resolution::new(2, 1),
            starts: vec![0, 2, 4],
            pixels: vec![0, 1, 1, 2],
            weights: vec![0.5; 4],
            lens: None,
        };
        assert_eq!(between.blur(), 1.0);
    }
}
