//! A robust fit of the lens map to correspondences with outliers: RANSAC, then Gauss–Newton iteration with Tukey's weights.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::least_squares::{Clusters, Equations, Normal, form};
use crate::error::{Error, Result};
use crate::image::{Resolution, percentile};
use crate::measure::lens_map::{LensMap, Match, PARAMETERS, evaluate, half_diagonal, normalized};
use crate::measure::sight;

/// The number of quadruples of correspondences that RANSAC tries.
const TRIALS: usize = 400;

/// A camera point and the projector point that it sees, both in normalized coordinates.
type Point = ([f64; 2], [f64; 2]);

/// A lens map fitted to correspondences.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// The map that most of the correspondences agree on.
    pub map: LensMap,
    /// The root mean square distance of the inliers from the map, in projector pixels.
    pub rms: f64,
    /// The standard error of the map itself, root mean square over the field, in projector pixels.
    pub error: f64,
    /// The fraction of outliers among the correspondences.
    pub outliers: f64,
}

/// Fits the map to correspondences with outliers. `spread` is the expected error of a correct correspondence, in projector pixels. Fails
/// with [`Error::Rig`] when fewer than 24 of the correspondences agree on a map.
pub(crate) fn fit(matches: &[Match], camera: Resolution, projector: Resolution, spread: f64) -> Result<Fit> {
    let points: Vec<Point> = matches
        .iter()
        .map(|found| (normalized(found.camera, camera), normalized(found.projector, projector)))
        .collect();
    if points.len() < 24 {
        return Err(no_map(points.len(), camera, projector));
    }
    let unit = half_diagonal(projector);
    let mut parameters =
        first(&points, 6.0 * spread / unit).ok_or_else(|| no_map(points.len(), camera, projector))?;
    let mut scale = 2.0 * spread / unit;
    for _ in 0..8 {
        parameters = refine(&points, parameters, 3.0 * scale)?;
        let inside = distances(&points, &parameters).into_iter().filter(|&distance| distance < 4.0 * scale);
        // The median distance is 1.18 σ for a two-dimensional Gaussian with standard deviation σ.
        let median = percentile(inside, 0.5) / 1.18;
        scale = median.max(1e-9 / unit);
    }
    let limit = 4.0 * scale;
    let inside: Vec<f64> = distances(&points, &parameters).into_iter().filter(|&d| d < limit).collect();
    if inside.len() < 24 {
        return Err(no_map(inside.len(), camera, projector));
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

/// The error when no map fits the correspondences: only `count` points agree on a map.
pub(crate) fn no_map(count: usize, camera: Resolution, projector: Resolution) -> Error {
    let coarse = sight::too_few(camera, projector).map(|found| (format!(": {}", found.found), found.help));
    let (because, help) = coarse.unwrap_or_else(|| {
        (
            String::new(),
            "bring the projector's image into the camera's view and into focus, and remove what moves".into(),
        )
    });
    Error::rig("camera", format!(
            "only {count} points agree on where projector pixels are seen, and no map can be fitted to them{because}"
        )).help(help)
}

/// The distance of each point from the map, in normalized coordinates.
fn distances(points: &[Point], parameters: &[f64; PARAMETERS]) -> Vec<f64> {
    let distance = |&(camera, projector): &Point| {
        let (at, _) = evaluate(parameters, camera);
        (at[0] - projector[0]).hypot(at[1] - projector[1])
    };
    points.iter().map(distance).collect()
}

/// Finds the homography of four correspondences that agrees with the largest number of points (RANSAC).
fn first(points: &[Point], within: f64) -> Option<[f64; PARAMETERS]> {
    let mut random = Pcg64::seed_from_u64(0);
    let mut best: Option<(usize, [f64; PARAMETERS])> = None;
    for _ in 0..TRIALS {
        let mut normal = Normal::new(8);
        for _ in 0..4 {
            let ([u, v], [x, y]) = points[random.random_range(0..points.len())];
            normal.add_full(&[u, v, 1.0, 0.0, 0.0, 0.0, -x * u, -x * v], x, 1.0);
            normal.add_full(&[0.0, 0.0, 0.0, u, v, 1.0, -y * u, -y * v], y, 1.0);
        }
        // Collinear points, or a point that was drawn twice, do not determine a homography.
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

/// Tukey's biweight.
pub(crate) fn weight(distance: f64, limit: f64) -> f64 {
    (1.0 - (distance / limit).powi(2)).max(0.0).powi(2)
}

/// The equations of a correspondence, one for each axis. If the distance from the map is at least `limit`, the weight is 0.
fn equations(&(camera, projector): &Point, parameters: &[f64; PARAMETERS], limit: f64) -> Equations<2> {
    let (at, slopes) = evaluate(parameters, camera);
    let residuals = [projector[0] - at[0], projector[1] - at[1]];
    Equations { residuals, slopes, weight: weight(residuals[0].hypot(residuals[1]), limit) }
}

fn normal_equations(points: &[Point], parameters: &[f64; PARAMETERS], limit: f64) -> Normal {
    let mut normal = Normal::new(PARAMETERS);
    points.iter().for_each(|point| equations(point, parameters, limit).add_to(&mut normal));
    normal
}

/// Takes a few Gauss–Newton steps. Points whose distance from the map is more than `limit` are left out.
fn refine(points: &[Point], mut parameters: [f64; PARAMETERS], limit: f64) -> Result<[f64; PARAMETERS]> {
    for _ in 0..6 {
        let step = normal_equations(points, &parameters, limit).damped(1e-9).solve()?.values;
        parameters.iter_mut().zip(&step).for_each(|(parameter, step)| *parameter += step);
        if step.iter().all(|step| step.abs() < 1e-13) {
            break;
        }
    }
    Ok(parameters)
}

/// The standard error of the map, root mean square over the correspondences: the larger of two estimates.
///
/// The first estimate assumes that all correspondences are independent, each with the scatter `rms`. However, codes are rounded to
/// projector pixels, and the rounding error is the same along a whole row or column. The second estimate therefore sums the gradients of
/// all correspondences in one projector row or column before it squares the sums (a cluster-robust covariance).
fn field_error(points: &[Point], parameters: &[f64; PARAMETERS], limit: f64, rms: f64) -> Result<f64> {
    let inverse = normal_equations(points, parameters, limit).solve()?.covariance;
    let mut clusters = Clusters::default();
    for point in points {
        let Equations { residuals, slopes, weight } = equations(point, parameters, limit);
        for axis in [0, 1] {
            clusters.add((axis, point.1[axis].to_bits()), &slopes[axis], weight * residuals[axis]);
        }
    }
    let robust = clusters.covariance(&inverse);
    let (mut independent, mut clustered) = (0.0, 0.0);
    for &(camera, _) in points {
        for row in evaluate(parameters, camera).1 {
            independent += 0.5 * rms * rms * form(&inverse, &row);
            clustered += form(&robust, &row);
        }
    }
    Ok((f64::max(independent, clustered) / points.len() as f64).sqrt())
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
    fn whole_pixel_codes_with_a_quarter_of_outliers_give_the_map_to_a_twentieth_of_a_pixel() {
        let truth = truth();
        let wrong = |at: [f64; 2], pixel: usize| match pixel % 4 {
            0 => [(pixel * 7919 % 6400) as f64 / 100.0, (pixel * 104_729 % 4800) as f64 / 100.0],
            _ => at.map(|coordinate| coordinate.floor() + 0.5),
        };
        let found =
            fit(&matches(&truth, wrong), truth.camera, truth.projector, 0.41).expect("enough matches");
        let off = off(&found.map, &truth);
        // For 8000 independent correspondences with an error of √(1/6) pixel each, ten parameters would give an error of 0.41 √(10/16000) =
        // 0.010. The rounding errors repeat along rows and columns, so the stated error is larger: 0.018. They also vary systematically
        // from column to column, which the stated error does not include. The actual error is 0.042.
        assert!(off < 0.05, "{off}");
        assert!((0.5..3.0).contains(&(off / found.error)), "{off} against {}", found.error);
        assert!((found.rms - (1.0_f64 / 6.0).sqrt()).abs() < 0.05, "{}", found.rms);
        assert!((0.2..0.3).contains(&found.outliers), "{}", found.outliers);
    }

    #[test]
    fn too_few_points_are_an_error() {
        let truth = truth();
        let few: Vec<Match> = matches(&truth, |at, _| at).into_iter().take(10).collect();
        assert!(fit(&few, truth.camera, truth.projector, 0.4).is_err());
    }

    #[test]
    fn exact_correspondences_give_the_map_itself() {
        let truth = truth();
        let found =
            fit(&matches(&truth, |at, _| at), truth.camera, truth.projector, 0.4).expect("they agree");
        assert!(off(&found.map, &truth) < 1e-7, "{:?}", found.map);
        assert!(found.rms < 1e-7 && found.outliers == 0.0, "{found:?}");
    }

    /// Let `n` points have an error of σ along both axes and weights of mean `w̄`. If they determine ten parameters, the map's error is `σ
    /// √(10 / (n w̄))`, root mean square over the field.
    #[test]
    fn independent_errors_of_points_make_the_error_of_the_map_that_least_squares_say() {
        use rand_distr::{Distribution, StandardNormal};
        let truth = truth();
        let mut random = Pcg64::seed_from_u64(5);
        let sigma = 0.3;
        let mut normal = || sigma * Distribution::<f64>::sample(&StandardNormal, &mut random);
        let noise: Vec<[f64; 2]> = (0..truth.camera.pixels()).map(|_| [normal(), normal()]).collect();
        let points = matches(&truth, |at, pixel| [at[0] + noise[pixel][0], at[1] + noise[pixel][1]]);
        let found = fit(&points, truth.camera, truth.projector, sigma).expect("they agree");
        // Points within 4 σ of the map are inliers. Nearly all points are within this distance.
        assert!((found.rms / (sigma * 2.0_f64.sqrt()) - 1.0).abs() < 0.02, "{}", found.rms);
        assert!(found.outliers < 0.002, "{}", found.outliers);
        // If distances have the density d exp(−d²/2), Tukey's weights with a limit of 3 σ have the mean 1 − 4/9 + 8/81 − … = 0.63.
        let mean: f64 = (0..3000)
            .map(|at| 0.001 * (f64::from(at) + 0.5))
            .map(|d| 0.001 * d * (-0.5 * d * d).exp() * weight(d, 3.0))
            .sum();
        let expected = sigma * (10.0 / truth.camera.pixels() as f64 / mean).sqrt();
        // The relative standard error of `rms` is 1/√10800. The median, which scales the weights, has a relative error of two percent.
        assert!((found.error / expected - 1.0).abs() < 0.05, "{} against {expected}", found.error);
        // The chi-square of ten parameters has a relative standard deviation of √(2/10), and the test draws only one sample of it.
        assert!((0.4..1.6).contains(&(off(&found.map, &truth) / expected)));
    }

    #[test]
    fn a_map_takes_twenty_four_points_that_agree() {
        let truth = truth();
        let all = matches(&truth, |at, _| at);
        let some = |count: usize| -> Vec<Match> { (0..count).map(|at| all[at * 443 % all.len()]).collect() };
        assert!(fit(&some(24), truth.camera, truth.projector, 0.4).is_ok());
        let error = fit(&some(23), truth.camera, truth.projector, 0.4).map_err(|error| error.to_string());
        assert!(error.as_ref().is_err_and(|text| text.contains("only 23 points")), "{error:?}");
        // 17 of 40 points are outliers, each in a different place, so 23 points agree.
        let mixed = |wrong: usize| {
            let mut points = some(40);
            for (at, point) in points.iter_mut().take(wrong).enumerate() {
                point.projector = [(at * 7919 % 640) as f64 / 10.0, (at * 4729 % 480) as f64 / 10.0];
            }
            fit(&points, truth.camera, truth.projector, 0.4)
        };
        let found = mixed(16).expect("24 agree");
        assert!((found.outliers - 16.0 / 40.0).abs() < 1e-12 && off(&found.map, &truth) < 1e-6, "{found:?}");
        assert!(mixed(17).is_err());
    }

    #[test]
    fn weights_fall_from_one_to_nothing_at_the_limit() {
        assert_eq!([0.0, 1.0, 2.0, 3.0].map(|distance| weight(distance, 2.0)), [1.0, 0.5625, 0.0, 0.0]);
    }
}
