//! The map from camera to projector coordinates: radial distortion followed by a homography.
//!
//! The devices of a coaxial rig have the same centre of projection, so a homography relates their images without distortion. Lenses add a
//! distortion that is mostly radial: `(x, y) → (x, y)(1 + k₁ r² + k₂ r⁴)` about the centre of the camera's raster, with `r = 1` at its
//! corner. Coordinates are in pixels from the top left corner of the raster, so the centre of pixel `(i, j)` is at `(i + ½, j + ½)`.

use crate::image::Resolution;

/// The number of parameters: eight of the homography, and two of the distortion.
pub(crate) const PARAMETERS: usize = 10;

/// A correspondence: a camera point, and the projector point that it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// The camera point, in the camera's pixels from its top left corner.
    pub camera: [f64; 2],
    /// The projector point, in the projector's pixels from its top left corner.
    pub projector: [f64; 2],
}

/// The map from camera to projector coordinates.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LensMap {
    /// The camera's pixels.
    pub camera: Resolution,
    /// The projector's pixels.
    pub projector: Resolution,
    /// The first eight entries of the homography, row by row. The ninth entry is 1. The homography maps undistorted normalized camera
    /// coordinates (0 at the centre, 1 at the corner) to normalized projector coordinates.
    pub homography: [f64; 8],
    /// The coefficients `k₁` and `k₂` of the radial distortion.
    pub distortion: [f64; 2],
}

impl LensMap {
    /// The map of two rasters that cover the same field.
    pub(crate) fn of_same_field(camera: Resolution, projector: Resolution) -> Self {
        let unit = half_diagonal(camera) / half_diagonal(projector);
        let [across, down] = [
            unit * projector.width as f64 / camera.width as f64,
            unit * projector.height as f64 / camera.height as f64,
        ];
        let homography = [across, 0.0, 0.0, 0.0, down, 0.0, 0.0, 0.0];
        Self { camera, projector, homography, distortion: [0.0; 2] }
    }

    /// The projector point that a camera point sees.
    pub fn to_projector(&self, camera: [f64; 2]) -> [f64; 2] {
        let (at, _) = evaluate(&self.parameters(), normalized(camera, self.camera));
        denormalized(at, self.projector)
    }

    /// The camera point that sees a projector point, by Newton's method. It is `None` when the method does not converge.
    pub fn to_camera(&self, projector: [f64; 2]) -> Option<[f64; 2]> {
        let mut camera = [self.camera.width as f64 / 2.0, self.camera.height as f64 / 2.0];
        for _ in 0..50 {
            let at = self.to_projector(camera);
            let miss = [projector[0] - at[0], projector[1] - at[1]];
            if miss[0].hypot(miss[1]) < 1e-9 {
                return Some(camera);
            }
            let shifted = |dx: f64, dy: f64| self.to_projector([camera[0] + dx, camera[1] + dy]);
            let [right, left, down, up] =
                [shifted(1e-4, 0.0), shifted(-1e-4, 0.0), shifted(0.0, 1e-4), shifted(0.0, -1e-4)];
            let slope = |a: [f64; 2], b: [f64; 2], axis: usize| (a[axis] - b[axis]) / 2e-4;
            let [a, b, c, d] =
                [slope(right, left, 0), slope(down, up, 0), slope(right, left, 1), slope(down, up, 1)];
            let determinant = a * d - b * c;
            camera[0] += (d * miss[0] - b * miss[1]) / determinant;
            camera[1] += (a * miss[1] - c * miss[0]) / determinant;
        }
        None
    }

    /// The parameters as [`evaluate`] expects them: the homography, then the distortion.
    pub(crate) fn parameters(&self) -> [f64; PARAMETERS] {
        let mut parameters = [0.0; PARAMETERS];
        parameters[..8].copy_from_slice(&self.homography);
        parameters[8..].copy_from_slice(&self.distortion);
        parameters
    }

    /// Adds `step` to the parameters of the map.
    pub(crate) fn moved(&self, step: &[f64]) -> Self {
        let mut moved = self.clone();
        let parameters = moved.homography.iter_mut().chain(&mut moved.distortion);
        parameters.zip(step).for_each(|(parameter, step)| *parameter += step);
        moved
    }
}

pub(crate) fn centre(pixel: usize, camera: Resolution) -> [f64; 2] {
    [(pixel % camera.width) as f64 + 0.5, (pixel / camera.width) as f64 + 0.5]
}

/// Half of the diagonal of a raster, in pixels: the unit of normalized coordinates.
pub(crate) fn half_diagonal(raster: Resolution) -> f64 {
    0.5 * (raster.width as f64).hypot(raster.height as f64)
}

/// The normalized coordinates of a point in pixels. They are 0 at the centre.
pub(crate) fn normalized([x, y]: [f64; 2], raster: Resolution) -> [f64; 2] {
    let unit = half_diagonal(raster);
    [(x - 0.5 * raster.width as f64) / unit, (y - 0.5 * raster.height as f64) / unit]
}

/// The point in pixels with these normalized coordinates.
fn denormalized([x, y]: [f64; 2], raster: Resolution) -> [f64; 2] {
    let unit = half_diagonal(raster);
    [x * unit + 0.5 * raster.width as f64, y * unit + 0.5 * raster.height as f64]
}

/// Maps a normalized camera point. Returns the projector point and its derivatives with respect to the parameters, one row per coordinate.
pub(crate) fn evaluate(p: &[f64; PARAMETERS], [x, y]: [f64; 2]) -> ([f64; 2], [[f64; PARAMETERS]; 2]) {
    let square = x * x + y * y;
    let factor = 1.0 + square * (p[8] + square * p[9]);
    let [u, v] = [x * factor, y * factor];
    let depth = p[6] * u + p[7] * v + 1.0;
    let at = [(p[0] * u + p[1] * v + p[2]) / depth, (p[3] * u + p[4] * v + p[5]) / depth];
    let mut slopes = [[0.0; PARAMETERS]; 2];
    for (axis, row) in slopes.iter_mut().enumerate() {
        row[3 * axis] = u / depth;
        row[3 * axis + 1] = v / depth;
        row[3 * axis + 2] = 1.0 / depth;
        row[6] = -at[axis] * u / depth;
        row[7] = -at[axis] * v / depth;
        let along = |index: usize| (p[3 * axis + index] - at[axis] * p[6 + index]) / depth;
        let radial = along(0) * x + along(1) * y;
        row[8] = radial * square;
        row[9] = radial * square * square;
    }
    (at, slopes)
}

#[cfg(test)]
mod tests {
    use super::*;

    const P: [f64; PARAMETERS] = [1.1, 0.2, 0.05, -0.15, 0.9, -0.1, 0.3, -0.25, -0.2, 0.1];

    /// The factor of the distortion is 0.9 at (0.6, −0.8), where r = 1. The distorted point is (0.54, −0.72), with a homogeneous coordinate
    /// of 1.342.
    #[test]
    fn a_point_is_distorted_then_mapped_and_both_as_written_above() {
        let (at, _) = evaluate(&P, [0.6, -0.8]);
        let expected = [(0.594 - 0.144 + 0.05) / 1.342, (-0.081 - 0.648 - 0.1) / 1.342];
        assert!((at[0] - expected[0]).abs() < 1e-15 && (at[1] - expected[1]).abs() < 1e-15, "{at:?}");
        // The factor of the distortion at r² = ¼ is 1 − 0.05 + 0.1 / 16.
        let (at, _) = evaluate(&P, [0.5, 0.0]);
        let u = 0.5 * (1.0 - 0.05 + 0.006_25);
        assert!((at[0] - (1.1 * u + 0.05) / (0.3 * u + 1.0)).abs() < 1e-15);
    }

    #[test]
    fn slopes_are_those_of_small_changes_of_each_parameter() {
        for point in [[0.6, -0.8], [-0.3, 0.4], [0.2, 0.7]] {
            let (_, slopes) = evaluate(&P, point);
            for parameter in 0..PARAMETERS {
                let moved = |by: f64| {
                    let mut moved = P;
                    moved[parameter] += by;
                    evaluate(&moved, point).0
                };
                let (more, less) = (moved(1e-5), moved(-1e-5));
                for axis in 0..2 {
                    let slope = (more[axis] - less[axis]) / 2e-5;
                    // The error of a central difference is of the order of the squared step, plus the rounding error divided by the step.
                    assert!((slopes[axis][parameter] - slope).abs() < 1e-8, "{parameter} {axis}");
                }
            }
        }
    }

    #[test]
    fn the_unit_of_normalized_coordinates_is_half_of_the_diagonal() {
        let raster = Resolution::new(8, 6);
        assert_eq!((half_diagonal(raster), centre(11, raster)), (5.0, [3.5, 1.5]));
        assert_eq!(normalized([8.0, 0.0], raster), [0.8, -0.6]);
        assert_eq!(denormalized([0.8, -0.6], raster), [8.0, 0.0]);
        let (camera, homography) = (raster, [1.0, 0.0, 0.1, 0.0, 1.0, -0.2, 0.0, 0.0]);
        let map = LensMap { camera, projector: Resolution::new(16, 12), homography, distortion: [0.0; 2] };
        // The map doubles coordinates, then shifts points by one pixel to the right (0.1 of the half diagonal of ten pixels) and by two
        // pixels up.
        assert_eq!(map.to_projector([4.0, 3.0]), [9.0, 4.0]);
    }

    #[test]
    fn the_inverse_undoes_the_map() {
        let map = LensMap {
            camera: Resolution::new(120, 90),
            projector: Resolution::new(64, 48),
            homography: [1.02, 0.03, 0.01, -0.02, 0.99, -0.015, 0.02, -0.01],
            distortion: [-0.04, 0.005],
        };
        for camera in [[3.0, 5.0], [119.0, 2.0], [60.5, 44.5]] {
            let back = map.to_camera(map.to_projector(camera)).expect("a gentle distortion has an inverse");
            assert!((back[0] - camera[0]).hypot(back[1] - camera[1]) < 1e-6);
        }
    }
}
