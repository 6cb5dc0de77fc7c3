//! The map from camera to projector coordinates: radial distortion, and then a homography.
//!
//! Both devices of a coaxial rig look from one point, so that pinholes would be related by a homography; what lenses add is
//! mostly radial: `(x, y) → (x, y)(1 + k₁ r² + k₂ r⁴)` about the camera's centre, `r = 1` at its corner. Coordinates are in
//! pixels from the top left corner of the raster, so that pixel `(i, j)` has its centre at `(i + ½, j + ½)`.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::least_squares::Normal;
use crate::error::{Error, Result};
use crate::image::Resolution;

/// Parameters: eight of the homography, two of the distortion.
const PARAMETERS: usize = 10;

/// Quadruples tried for a first homography.
const TRIALS: usize = 400;

/// A camera point, and the projector point that it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// In the camera's pixels from its top left corner.
    pub camera: [f64; 2],
    /// In the projector's.
    pub projector: [f64; 2],
}

/// The map.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct LensMap {
    /// The camera's pixels.
    pub camera: Resolution,
    /// The projector's pixels.
    pub projector: Resolution,
    /// The homography's first eight entries, row by row (the ninth is 1), from undistorted normalized camera coordinates
    /// (0 at the centre, 1 at the corner) to normalized projector coordinates.
    pub homography: [f64; 8],
    /// `k₁` and `k₂`.
    pub distortion: [f64; 2],
}

/// A map fitted to matches.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fit {
    pub(super) map: LensMap,
    /// Root mean square distance of the matches that belong to it, in projector pixels.
    pub(super) rms: f64,
    /// Standard error of the map itself, root mean square over the field, in projector pixels.
    pub(super) error: f64,
    /// Share of matches that do not belong to it.
    pub(super) outliers: f64,
}

impl LensMap {
    /// Where a camera point lies in the projector's raster.
    pub fn to_projector(&self, camera: [f64; 2]) -> [f64; 2] {
        let (at, _) = evaluate(&self.parameters(), normalized(camera, self.camera));
        denormalized(at, self.projector)
    }

    /// Where a projector point is seen, by Newton's method; `None` where that does not converge.
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

    fn parameters(&self) -> [f64; PARAMETERS] {
        let mut parameters = [0.0; PARAMETERS];
        parameters[..8].copy_from_slice(&self.homography);
        parameters[8..].copy_from_slice(&self.distortion);
        parameters
    }
}

/// Fits the map to matches some of which may be wrong. Matches are taken to be off by about `spread` projector pixels.
///
/// # Errors
/// [`Error::Rig`] when fewer than 24 of the matches agree on a map.
pub(super) fn fit(matches: &[Match], camera: Resolution, projector: Resolution, spread: f64) -> Result<Fit> {
    let points: Vec<([f64; 2], [f64; 2])> = matches
        .iter()
        .map(|found| (normalized(found.camera, camera), normalized(found.projector, projector)))
        .collect();
    if points.len() < 24 {
        return Err(no_map(points.len()));
    }
    let unit = half_diagonal(projector);
    let mut parameters = first(&points, 6.0 * spread / unit).ok_or_else(|| no_map(points.len()))?;
    let mut scale = 2.0 * spread / unit;
    for _ in 0..8 {
        parameters = refine(&points, parameters, 3.0 * scale)?;
        let inside = distances(&points, &parameters).into_iter().filter(|&distance| distance < 4.0 * scale);
        // The median of a two-dimensional Gaussian's distances is 1.18 σ.
        let median = super::sitting::percentile(inside, 0.5) / 1.18;
        scale = median.max(1e-9 / unit);
    }
    let limit = 4.0 * scale;
    let inside: Vec<f64> = distances(&points, &parameters).into_iter().filter(|&d| d < limit).collect();
    if inside.len() < 24 {
        return Err(no_map(inside.len()));
    }
    let rms = (inside.iter().map(|d| d * d).sum::<f64>() / inside.len() as f64).sqrt();
    let mut homography = [0.0; 8];
    homography.copy_from_slice(&parameters[..8]);
    let error = field_error(&points, &parameters, 3.0 * scale, rms)?;
    Ok(Fit {
        map: LensMap { camera, projector, homography, distortion: [parameters[8], parameters[9]] },
        rms: rms * unit,
        error: error * unit,
        outliers: 1.0 - inside.len() as f64 / points.len() as f64,
    })
}

pub(super) fn no_map(count: usize) -> Error {
    Error::Rig {
        device: "camera".into(),
        fault: format!(
            "only {count} points agree on where projector pixels are seen: no map can be fitted to them"
        ),
        help: "bring the projector's image into the camera's view and into focus, and remove what moves"
            .into(),
    }
}

fn half_diagonal(raster: Resolution) -> f64 {
    0.5 * (raster.width as f64).hypot(raster.height as f64)
}

fn normalized([x, y]: [f64; 2], raster: Resolution) -> [f64; 2] {
    let unit = half_diagonal(raster);
    [(x - 0.5 * raster.width as f64) / unit, (y - 0.5 * raster.height as f64) / unit]
}

fn denormalized([x, y]: [f64; 2], raster: Resolution) -> [f64; 2] {
    let unit = half_diagonal(raster);
    [x * unit + 0.5 * raster.width as f64, y * unit + 0.5 * raster.height as f64]
}

/// The map of a normalized camera point, and its derivatives with respect to the parameters: one row for each coordinate.
fn evaluate(p: &[f64; PARAMETERS], [x, y]: [f64; 2]) -> ([f64; 2], [[f64; PARAMETERS]; 2]) {
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

fn distances(points: &[([f64; 2], [f64; 2])], parameters: &[f64; PARAMETERS]) -> Vec<f64> {
    let distance = |&(camera, projector): &([f64; 2], [f64; 2])| {
        let (at, _) = evaluate(parameters, camera);
        (at[0] - projector[0]).hypot(at[1] - projector[1])
    };
    points.iter().map(distance).collect()
}

/// The homography of four matches that most others agree with (RANSAC).
fn first(points: &[([f64; 2], [f64; 2])], within: f64) -> Option<[f64; PARAMETERS]> {
    let mut random = Pcg64::seed_from_u64(0);
    let mut best: Option<(usize, [f64; PARAMETERS])> = None;
    for _ in 0..TRIALS {
        let mut normal = Normal::new(8);
        for _ in 0..4 {
            let ([u, v], [x, y]) = points[random.random_range(0..points.len())];
            normal.add_full(&[u, v, 1.0, 0.0, 0.0, 0.0, -x * u, -x * v], x, 1.0);
            normal.add_full(&[0.0, 0.0, 0.0, u, v, 1.0, -y * u, -y * v], y, 1.0);
        }
        // Points on a line, or one drawn twice, make no homography.
        let Ok(found) = normal.solve() else { continue };
        let mut parameters = [0.0; PARAMETERS];
        parameters[..8].copy_from_slice(&found.values);
        let agree = distances(points, &parameters).into_iter().filter(|&distance| distance < within).count();
        if best.as_ref().is_none_or(|best| agree > best.0) {
            best = Some((agree, parameters));
        }
    }
    best.filter(|best| best.0 >= 24).map(|best| best.1)
}

/// Tukey's weight.
fn weight(distance: f64, limit: f64) -> f64 {
    (1.0 - (distance / limit).powi(2)).max(0.0).powi(2)
}

fn normal_equations(points: &[([f64; 2], [f64; 2])], parameters: &[f64; PARAMETERS], limit: f64) -> Normal {
    let mut normal = Normal::new(PARAMETERS);
    for &(camera, projector) in points {
        let (at, slopes) = evaluate(parameters, camera);
        let miss = [projector[0] - at[0], projector[1] - at[1]];
        let weight = weight(miss[0].hypot(miss[1]), limit);
        if weight > 0.0 {
            (0..2).for_each(|axis| normal.add_full(&slopes[axis], miss[axis], weight));
        }
    }
    normal
}

/// A few steps of Gauss–Newton with weights that leave out what is off by more than `limit`.
fn refine(
    points: &[([f64; 2], [f64; 2])],
    mut parameters: [f64; PARAMETERS],
    limit: f64,
) -> Result<[f64; PARAMETERS]> {
    for _ in 0..6 {
        let step = normal_equations(points, &parameters, limit).damped(1e-9).solve()?.values;
        parameters.iter_mut().zip(&step).for_each(|(parameter, step)| *parameter += step);
        if step.iter().all(|step| step.abs() < 1e-13) {
            break;
        }
    }
    Ok(parameters)
}

/// `√(mean of trace(J C Jᵀ))` over the matches, for a scatter of `rms` in two dimensions.
fn field_error(
    points: &[([f64; 2], [f64; 2])],
    parameters: &[f64; PARAMETERS],
    limit: f64,
    rms: f64,
) -> Result<f64> {
    let covariance = normal_equations(points, parameters, limit).solve()?.covariance;
    let mut sum = 0.0;
    for &(camera, _) in points {
        for row in evaluate(parameters, camera).1 {
            for i in 0..PARAMETERS {
                for j in 0..PARAMETERS {
                    sum += row[i] * covariance[i * PARAMETERS + j] * row[j];
                }
            }
        }
    }
    Ok((0.5 * rms * rms * sum / points.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth() -> LensMap {
        LensMap {
            camera: Resolution::new(120, 90),
            projector: Resolution::new(64, 48),
            homography: [1.02, 0.03, 0.01, -0.02, 0.99, -0.015, 0.02, -0.01],
            distortion: [-0.04, 0.005],
        }
    }

    fn matches(map: &LensMap, of: impl Fn([f64; 2], usize) -> [f64; 2]) -> Vec<Match> {
        (0..map.camera.pixels())
            .map(|pixel| {
                let camera =
                    [(pixel % map.camera.width) as f64 + 0.5, (pixel / map.camera.width) as f64 + 0.5];
                Match { camera, projector: of(map.to_projector(camera), pixel) }
            })
            .collect()
    }

    fn off(found: &LensMap, truth: &LensMap) -> f64 {
        let squares = matches(truth, |at, _| at).into_iter().map(|truth| {
            let at = found.to_projector(truth.camera);
            (at[0] - truth.projector[0]).powi(2) + (at[1] - truth.projector[1]).powi(2)
        });
        (squares.sum::<f64>() / truth.camera.pixels() as f64).sqrt()
    }

    #[test]
    fn pixel_numbers_alone_give_the_map_to_a_twentieth_of_a_pixel_and_a_quarter_of_nonsense_does_not_harm() {
        let truth = truth();
        let wrong = |at: [f64; 2], pixel: usize| match pixel % 4 {
            0 => [(pixel * 7919 % 6400) as f64 / 100.0, (pixel * 104_729 % 4800) as f64 / 100.0],
            _ => at.map(|coordinate| coordinate.floor() + 0.5),
        };
        let found =
            fit(&matches(&truth, wrong), truth.camera, truth.projector, 0.41).expect("enough matches");
        let off = off(&found.map, &truth);
        // 8000 independent matches of √(1/6) pixel each and ten parameters would leave 0.41 √(10/16000) = 0.010. Rounding to pixels is
        // not independent: its error repeats along rows and columns, and the fit leaves about four times as much as it says.
        assert!(off < 0.05, "{off}");
        assert!(off < 5.0 * found.error && found.error < 0.03, "{off} against {}", found.error);
        assert!((found.rms - (1.0_f64 / 6.0).sqrt()).abs() < 0.05, "{}", found.rms);
        assert!((0.2..0.3).contains(&found.outliers), "{}", found.outliers);
    }

    #[test]
    fn the_map_and_its_inverse_belong_together() {
        let map = truth();
        for camera in [[3.0, 5.0], [119.0, 2.0], [60.5, 44.5]] {
            let back = map.to_camera(map.to_projector(camera)).expect("a gentle distortion has an inverse");
            assert!((back[0] - camera[0]).hypot(back[1] - camera[1]) < 1e-6);
        }
    }

    #[test]
    fn too_few_points_are_an_error() {
        let truth = truth();
        let few: Vec<Match> = matches(&truth, |at, _| at).into_iter().take(10).collect();
        assert!(fit(&few, truth.camera, truth.projector, 0.4).is_err());
    }
}
