//! The calibration of a rig: responses, camera noise, pixel map, uneven brightness and stability. O'Toole and Kutulakos, section 8.1, have
//! linear responses and a pixel map; the rest is ours.

use super::footprint::by_overlap;
use super::lens_map::LensMap;
use super::photos::Plane;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::rig::{CameraInfo, ProjectorInfo};

/// The calibration of a rig: the data for the conversion of counts to light and of patterns to levels.
///
/// `krylux rig calibrate` and the module `calibrate` measure a calibration. [`Calibration::ideal`] describes devices without imperfections.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The projector that was calibrated.
    pub projector_info: ProjectorInfo,
    /// The camera that was calibrated.
    pub camera_info: CameraInfo,
    /// The projector's response: the light of each level as a fraction of the brightest level's light, both without the light of level 0.
    /// Each channel has one ascending curve of `2^bits` values from 0 to 1.
    pub projector: Vec<Vec<f64>>,
    /// The camera's response and noise.
    pub camera: CameraResponse,
    /// The pixel map, which gives the camera pixels that see each projector pixel.
    pub registration: Registration,
    /// The uneven brightness of projector and camera. It is `None` when it was not measured.
    pub flat_field: Option<FlatField>,
    /// The stability of the rig over time.
    pub stability: Stability,
}

/// The response and the noise of a camera. Counts are in digital numbers (DN), as the camera delivers them.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraResponse {
    /// The count without light.
    pub black: f64,
    /// Counts of at least this value are saturated. Saturated counts never enter a result.
    pub saturation: f64,
    /// Electrons per linear DN. The variance of the shot noise is `linear DN / gain`.
    pub gain: f64,
    /// The read noise, in DN (standard deviation).
    pub read_noise: f64,
    /// The linear light of each count, in DN above black: `2^bits` ascending values. `None` stands for a linear camera, `count − black`.
    pub curve: Option<Vec<f64>>,
}

/// The pixel map: the camera pixels that see each projector pixel, in compressed sparse rows. There is one row per projector pixel. With
/// these weights, the photo of an evenly lit raster is even. Away from the raster's border, the weights of a row add up to 1. Unseen
/// projector pixels have empty rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// The camera's pixels.
    pub camera: Resolution,
    /// The projector's pixels.
    pub projector: Resolution,
    /// The index at which each row begins in `pixels` and `weights`, followed by the length of these arrays.
    pub starts: Vec<usize>,
    /// The camera pixels of all rows.
    pub pixels: Vec<u32>,
    /// The weights of these camera pixels.
    pub weights: Vec<f64>,
    /// The lens map from which the weights were computed, and which gives the spread of direct light. `None`: no map is known.
    pub lens: Option<LensMap>,
}

/// The stability of a rig over time.
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stability {
    /// Seconds from the confirmation of a frame until the projector emits all of this frame's light and no light of the previous frame.
    pub settle: f64,
    /// The relative change of the mean of the white photo, per hour.
    pub drift_per_hour: f64,
}

impl Calibration {
    /// The calibration of ideal devices. Light is proportional to the projector's level and to the camera's count, there is no read noise,
    /// and both rasters cover the same field ([`Registration::by_area`]).
    pub fn ideal(projector: &ProjectorInfo, camera: &CameraInfo) -> Self {
        let levels = 1_usize << projector.bits;
        let curve: Vec<f64> = (0..levels).map(|level| level as f64 / (levels - 1) as f64).collect();
        Self {
            projector_info: projector.clone(),
            camera_info: camera.clone(),
            projector: vec![curve; projector.channels],
            camera: CameraResponse {
                black: 0.0,
                saturation: ((1_u32 << camera.bits) - 1).into(),
                gain: 1.0,
                read_noise: 0.0,
                curve: None,
            },
            registration: Registration::by_area(projector.resolution, camera.resolution),
            flat_field: None,
            stability: Stability { settle: 0.0, drift_per_hour: 0.0 },
        }
    }
}

impl Registration {
    /// The pixel map of two rasters that cover the same field. The camera pixels whose centres lie in a projector pixel see it with equal
    /// weights. If there are no such camera pixels, the camera pixel that contains the projector pixel's centre sees it.
    ///
    /// If the camera's raster is finer than the projector's, but not by a whole factor, some camera pixels see two projector pixels. The
    /// map is then made in the same way as for a calibrated rig, to separate a pixel's light from its neighbours' light.
    pub fn by_area(projector: Resolution, camera: Resolution) -> Self {
        let sides = [(projector.width, camera.width), (projector.height, camera.height)];
        let is_finer = sides.iter().all(|(projector, camera)| camera >= projector);
        if is_finer && sides.iter().any(|(projector, camera)| !camera.is_multiple_of(*projector)) {
            return by_overlap(&LensMap::of_same_field(camera, projector), &vec![true; camera.pixels()]);
        }
        let span = |index: usize, of: usize, among: usize| -> std::ops::Range<usize> {
            // One side of the field has `of` pixels in one raster and `among` pixels in the other. The span holds the pixels of the other
            // raster whose centres lie in pixel `index` of the first.
            let edge = |index: usize| ((2 * index * among).saturating_sub(of)).div_ceil(2 * of);
            let (from, to) = (edge(index), edge(index + 1));
            if from < to {
                from..to
            } else {
                let nearest = (2 * index + 1) * among / (2 * of);
                nearest..nearest + 1
            }
        };
        let row = |pixel: usize| {
            let rows = span(pixel / projector.width, projector.height, camera.height);
            let columns = span(pixel % projector.width, projector.width, camera.width);
            let weight = 1.0 / (rows.len() * columns.len()) as f64;
            let pixels = rows.flat_map(|row| columns.clone().map(move |column| row * camera.width + column));
            pixels.map(|pixel| (pixel as u32, weight)).collect()
        };
        Self::of_rows(camera, projector, (0..projector.pixels()).map(row).collect())
    }
}

// The flat-field stage: the uneven brightness of projector and camera, above all their vignetting.
//
// A pattern `x` leaves the projector as `p ∘ x`, and light `y` is photographed as `c ∘ y`, with smooth factors `p` and `c` on the
// projector's pixels. With the light transport `A`, the rig's matrix is `diag(c) A diag(p)`, which is not symmetric. The stage divides
// patterns by `p` and photos by `c`.

/// The relative brightness of the projector and of the camera at each of the projector's pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatField {
    /// The projector's brightness. The least value is 1, so that every pattern can still be shown after the division by this brightness.
    pub projector: Vec<f64>,
    /// The camera's brightness, with a mean of 1.
    pub camera: Vec<f64>,
}

impl FlatField {
    /// The flat field of a rig from `ratio = p / c`, which follows from the symmetry of `A`. The ratio is attributed to the camera alone,
    /// so `p` is 1. An uneven brightness that both devices share remains in the photos, and leaves the matrix symmetric.
    pub fn of_ratio(ratio: &[f64]) -> Result<Self> {
        let camera = ratio.iter().map(|ratio| 1.0 / ratio).collect();
        Self { projector: vec![1.0; ratio.len()], camera }.normalized()
    }

    /// The flat field of both devices. `sheet` is the photo of an evenly coloured matte sheet that stands square to the camera, lit by
    /// white. This photo shows the product `p c`. The factor `p / c` is taken from `self`.
    ///
    /// # Errors
    /// [`Error::Dimension`] if the sizes differ, and the errors of [`Self::check`].
    pub fn with_sheet(&self, sheet: &[f64]) -> Result<Self> {
        if sheet.len() != self.camera.len() {
            return Err(Error::dimension("pixels of the sheet's photo", self.camera.len(), sheet.len()));
        }
        let both = self.projector.iter().zip(&self.camera).map(|(p, c)| p / c).zip(sheet);
        let (projector, camera) =
            both.map(|(ratio, sheet)| ((sheet * ratio).sqrt(), (sheet / ratio).sqrt())).unzip();
        Self { projector, camera }.normalized()
    }

    fn normalized(mut self) -> Result<Self> {
        self.check()?;
        let least = self.projector.iter().copied().fold(f64::INFINITY, f64::min);
        self.projector.iter_mut().for_each(|value| *value /= least);
        let mean = self.camera.iter().sum::<f64>() / self.camera.len() as f64;
        self.camera.iter_mut().for_each(|value| *value /= mean);
        Ok(self)
    }

    /// Refuses factors that are not positive numbers.
    ///
    /// # Errors
    /// [`Error::Numerical`] with the first such factor.
    pub fn check(&self) -> Result<()> {
        let all = self.projector.iter().chain(&self.camera);
        match all.copied().find(|value| !(*value > 0.0 && value.is_finite())) {
            None => Ok(()),
            Some(value) => Err(Error::Numerical(format!(
                "the brightness of projector and camera is {value} at a pixel\n  help: the sheet must fill the view, and must not be saturated"
            ))),
        }
    }

    pub(crate) fn pattern(&self, x: &[f64]) -> Vec<f64> {
        x.iter().zip(&self.projector).map(|(x, factor)| x / factor).collect()
    }

    /// The vector that a shown pattern represents: the pattern times the projector's brightness.
    pub(crate) fn shown(&self, pattern: &[f64]) -> Vec<f64> {
        pattern.iter().zip(&self.projector).map(|(x, factor)| x * factor).collect()
    }

    /// Divides a photo by the camera's brightness.
    pub(crate) fn light(&self, plane: Plane) -> Plane {
        let divided = |values: Vec<f64>, power: i32| -> Vec<f64> {
            values.into_iter().zip(&self.camera).map(|(value, factor)| value / factor.powi(power)).collect()
        };
        Plane { values: divided(plane.values, 1), variance: divided(plane.variance, 2) }
    }

    /// Whether the flat field leaves patterns unchanged.
    pub(crate) fn leaves_patterns(&self) -> bool {
        self.projector.iter().all(|&factor| factor == 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::spread::PixelSpread;

    #[test]
    fn by_area_a_projector_pixel_is_seen_by_the_camera_pixels_inside_it() {
        let registration = Registration::by_area(Resolution::new(2, 1), Resolution::new(4, 2));
        assert_eq!(registration.starts, [0, 4, 8]);
        assert_eq!(registration.pixels, [0, 1, 4, 5, 2, 3, 6, 7]);
        assert!(registration.weights.iter().all(|&weight| weight == 0.25));
        let fewer = Registration::by_area(Resolution::new(4, 1), Resolution::new(2, 1));
        assert_eq!((fewer.starts, fewer.pixels), (vec![0, 1, 2, 3, 4], vec![0, 0, 1, 1]));
        let coarser = Registration::by_area(Resolution::new(3, 1), Resolution::new(2, 1));
        assert_eq!((coarser.starts, coarser.pixels), (vec![0, 1, 2, 3], vec![0, 1, 1]));
    }

    #[test]
    fn the_camera_may_be_finer_by_any_factor() {
        let projector = Resolution::new(8, 6);
        for (width, height) in [(16, 12), (20, 15), (17, 14), (24, 13), (23, 29), (31, 12)] {
            let camera = Resolution::new(width, height);
            let map = Registration::by_area(projector, camera);
            let lens = LensMap::of_same_field(camera, projector);
            let corner = lens.to_projector([width as f64, 0.0]);
            assert!((corner[0] - 8.0).abs() < 1e-12 && corner[1].abs() < 1e-12, "{corner:?}");
            let spread = PixelSpread::new(&map, &lens);
            for pixel in 0..48 {
                let row = spread.row(pixel);
                let of = |is_own: bool| -> f64 {
                    row.iter()
                        .filter(|entry| (entry.0 as usize == pixel) == is_own)
                        .map(|entry| entry.1.abs())
                        .sum()
                };
                // Each projector pixel contains at least one camera pixel almost entirely. With a plain mean over the overlapping camera
                // pixels, 0.1 to 0.3 of the light would be the neighbours' light.
                assert!(of(true) > 0.97 && of(false) < 0.05, "{width}x{height} {pixel}: {row:?}");
            }
        }
    }

    #[test]
    fn ratio_and_sheet_tell_both_devices() -> Result<()> {
        let (p, c) = ([1.0, 0.9, 0.8], [0.7, 1.0, 0.95]);
        let of = |f: fn(f64, f64) -> f64| -> Vec<f64> { p.iter().zip(c).map(|(p, c)| f(*p, c)).collect() };
        let alone = FlatField::of_ratio(&of(|p, c| p / c))?;
        assert!(alone.leaves_patterns());
        let both = alone.with_sheet(&of(|p, c| 3.0 * p * c))?;
        for pixel in 0..3 {
            // The tolerance covers the rounding of a few operations.
            assert!((both.projector[pixel] - p[pixel] / 0.8).abs() < 1e-14);
            assert!((both.camera[pixel] - c[pixel] / (2.65 / 3.0)).abs() < 1e-14);
            assert!((both.shown(&both.pattern(&p))[pixel] - p[pixel]).abs() < 1e-15);
        }
        assert!(alone.with_sheet(&[1.0, 0.0, 1.0]).is_err() && alone.with_sheet(&[1.0]).is_err());
        Ok(())
    }
}
