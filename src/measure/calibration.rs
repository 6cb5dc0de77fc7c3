//! What is known of a rig's devices, measured by `krylux rig calibrate` or given.

use crate::image::Resolution;
use crate::rig::{CameraInfo, ProjectorInfo};

/// What is known of a rig's devices: all that turns counts into light and levels into a pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The projector that it belongs to.
    pub projector_info: ProjectorInfo,
    /// The camera that it belongs to.
    pub camera_info: CameraInfo,
    /// The light of each level relative to the brightest, with level 0's light subtracted: one ascending curve of `2^bits`
    /// values from 0 to 1 for each channel of the projector.
    pub projector: Vec<Vec<f64>>,
    /// The camera's response and noise.
    pub camera: CameraResponse,
    /// Which camera pixels see which projector pixel.
    pub registration: Registration,
    /// How steady the rig is.
    pub stability: Stability,
}

/// How a camera counts. All in digital numbers (DN) as it hands them out.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraResponse {
    /// The count without light.
    pub black: f64,
    /// Counts from here on are saturated: they never enter a result.
    pub saturation: f64,
    /// Electrons per linear DN: the shot noise's variance is `linear DN / gain`.
    pub gain: f64,
    /// Read noise, in DN (standard deviation).
    pub read_noise: f64,
    /// Linear light for each count, in DN above black: `curve[count]`, of `2^bits` ascending values; `None`: `count − black`.
    pub curve: Option<Vec<f64>>,
}

/// Which camera pixels see each projector pixel: a row for each of these, its weights adding up to 1, or an empty row
/// where nothing sees it (compressed sparse rows).
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// The camera's pixels.
    pub camera: Resolution,
    /// The projector's pixels.
    pub projector: Resolution,
    /// Where each row begins in the other two, with their length at the end.
    pub starts: Vec<usize>,
    /// Camera pixels.
    pub pixels: Vec<u32>,
    /// Their weights.
    pub weights: Vec<f64>,
}

/// How steady a rig is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stability {
    /// Seconds from a frame's confirmation until its light is all there and the old one's gone.
    pub settle: f64,
    /// Relative change of the white photo's mean per hour.
    pub drift_per_hour: f64,
}

impl Calibration {
    /// That of devices without fault: levels are light, counts are light from 0 on, and pixel sees pixel (of equal numbers of
    /// pixels; otherwise by area).
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
            stability: Stability { settle: 0.0, drift_per_hour: 0.0 },
        }
    }
}

impl Registration {
    /// Both rasters cover the same field: each projector pixel is seen by the camera pixels whose centre lies in it, or, where
    /// there is none, by the one that its own centre lies in.
    pub fn by_area(projector: Resolution, camera: Resolution) -> Self {
        let span = |index: usize, of: usize, among: usize| -> std::ops::Range<usize> {
            // Centres at k + ½ of `among` that lie in [index, index + 1) of `of`.
            let edge = |index: usize| ((2 * index * among).saturating_sub(of)).div_ceil(2 * of);
            let (from, to) = (edge(index), edge(index + 1));
            if from < to {
                from..to
            } else {
                let nearest = (2 * index + 1) * among / (2 * of);
                nearest..nearest + 1
            }
        };
        let (mut starts, mut pixels, mut weights) = (vec![0], Vec::new(), Vec::new());
        for y in 0..projector.height {
            for x in 0..projector.width {
                let [rows, columns] =
                    [span(y, projector.height, camera.height), span(x, projector.width, camera.width)];
                let weight = 1.0 / (rows.len() * columns.len()) as f64;
                for row in rows {
                    for column in columns.clone() {
                        pixels.push((row * camera.width + column) as u32);
                        weights.push(weight);
                    }
                }
                starts.push(pixels.len());
            }
        }
        Self { camera, projector, starts, pixels, weights }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_area_a_projector_pixel_is_seen_by_the_camera_pixels_in_it() {
        let registration = Registration::by_area(Resolution::new(2, 1), Resolution::new(4, 2));
        assert_eq!(registration.starts, [0, 4, 8]);
        assert_eq!(registration.pixels, [0, 1, 4, 5, 2, 3, 6, 7]);
        assert!(registration.weights.iter().all(|&weight| weight == 0.25));
        let fewer = Registration::by_area(Resolution::new(4, 1), Resolution::new(2, 1));
        assert_eq!((fewer.starts, fewer.pixels), (vec![0, 1, 2, 3, 4], vec![0, 0, 1, 1]));
        let uneven = Registration::by_area(Resolution::new(2, 1), Resolution::new(3, 1));
        assert_eq!((uneven.starts, uneven.pixels), (vec![0, 1, 3], vec![0, 1, 2]));
    }
}
