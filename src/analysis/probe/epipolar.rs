//! Epipolar lines from the map between two pictures, where the poses of camera and projector are not known.

use std::f64::consts::PI;

use faer::{Mat, Side};
use glam::{DMat3, DVec3};

use super::Homes;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::scene::LineNumbers;

/// The smallest ratio of the second to the first error of the fit. Points of one plane fit many bundles of epipolar lines equally well.
const APART: f64 = 3.0;

/// The least share of homes that are on the line of their camera pixel, or on the next one.
const ON_LINES: f64 = 0.8;

/// The number of the epipolar line of each camera pixel, and of each projector pixel. A camera pixel whose line does not meet the
/// projector's picture has `None`. A line goes through the epipole to both sides of it, if that is in the picture.
///
/// The fundamental matrix is fitted by the normalized eight-point algorithm: Hartley, *In defense of the eight-point algorithm* (1997),
/// doi:10.1109/34.601246.
///
/// # Errors
/// [`Error::Option`] naming `--mask` if the map does not tell the lines: few homes, a flat scene, or homes that are on no lines.
pub fn epipolar_lines_of_map(homes: &Homes, sizes: [Resolution; 2]) -> Result<[Vec<Option<u32>>; 2]> {
    let refused = |fault: &str| {
        Err(Error::option("--mask", format!("the map does not tell epipolar lines: {fault}"))
            .help("give a scene with the poses of the devices, or the mask's weights in a file"))
    };
    let [camera, projector] = sizes;
    Error::check_size("homes of camera pixels", camera.pixels(), homes.len())?;
    let pairs: Vec<[usize; 2]> =
        homes.iter().enumerate().filter_map(|(pixel, home)| home.map(|home| [pixel, home])).collect();
    if pairs.len() < 16 {
        return refused("fewer than 16 camera pixels have a home");
    }
    let [to_camera, to_projector] = [(0, camera), (1, projector)]
        .map(|(which, size)| normalization(pairs.iter().map(|pair| centre(pair[which], size))));
    let seen = |pixel: usize| to_camera * centre(pixel, camera);
    let lit = |pixel: usize| to_projector * centre(pixel, projector);
    let Some((matrix, epipole)) = fundamental(pairs.iter().map(|&[j, i]| [seen(j), lit(i)]), to_projector)?
    else {
        return refused("the scene is too flat, or camera and projector are in one place");
    };
    let first = epipole.any_orthonormal_vector();
    let second = epipole.cross(first);
    let angle = |line: DVec3| second.dot(line).atan2(first.dot(line)).rem_euclid(PI);
    let at = |u: f64, v: f64| angle(epipole.cross(to_projector * DVec3::new(u, v, 1.0)));
    let width = |u: f64, v: f64| {
        let step = |du: f64, dv: f64| at(u + du, v + dv) - at(u - du, v - dv);
        let [over, down] = [step(0.5, 0.0), step(0.0, 0.5)].map(|step| step - PI * (step / PI).round());
        over.hypot(down)
    };
    let [right, bottom] = [projector.width as f64, projector.height as f64];
    let over = (0..=projector.width).flat_map(|u| [[u as f64, 0.0], [u as f64, bottom]]);
    let down = (0..=projector.height).flat_map(|v| [[0.0, v as f64], [right, v as f64]]);
    let mut corners: Vec<(f64, f64)> = over.chain(down).map(|[u, v]| (at(u, v), width(u, v))).collect();
    corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Angles count from the widest gap, through which no line of the picture goes.
    let last = corners[corners.len() - 1].0 - PI;
    let gaps = std::iter::once(last).chain(corners.iter().map(|corner| corner.0));
    let widest = gaps.zip(&corners).map(|(before, corner)| (corner.0 - before, corner.0));
    let zero = widest.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |(_, zero)| zero);
    let from_zero = |angle: f64| (angle - zero).rem_euclid(PI);
    corners.iter_mut().for_each(|corner| corner.0 = from_zero(corner.0));
    let place = to_projector.inverse() * epipole;
    let is_around =
        (0.0..=right).contains(&(place.x / place.z)) && (0.0..=bottom).contains(&(place.y / place.z));
    let numbers = LineNumbers::new(corners, is_around);
    let of_camera: Vec<Option<u32>> =
        (0..camera.pixels()).map(|j| numbers.of(from_zero(angle(matrix * seen(j))))).collect();
    let of_projector: Vec<Option<u32>> =
        (0..projector.pixels()).map(|i| numbers.of(from_zero(angle(epipole.cross(lit(i)))))).collect();
    let is_on = |&&[j, i]: &&[usize; 2]| {
        of_camera[j].zip(of_projector[i]).is_some_and(|(a, b)| numbers.are_near(a, b))
    };
    let share = pairs.iter().filter(is_on).count() as f64 / pairs.len() as f64;
    if share < ON_LINES {
        return refused(&format!("{:.0} % of the homes are on the best lines", 100.0 * share));
    }
    Ok([of_camera, of_projector])
}

/// The centre of a pixel, as a homogeneous vector.
fn centre(pixel: usize, size: Resolution) -> DVec3 {
    DVec3::new((pixel % size.width) as f64 + 0.5, (pixel / size.width) as f64 + 0.5, 1.0)
}

/// The matrix that moves the mean of points to the origin, and makes their mean square distance from it 2.
fn normalization(points: impl Iterator<Item = DVec3> + Clone) -> DMat3 {
    let count = points.clone().count() as f64;
    let mean = points.clone().sum::<DVec3>() / count;
    let square = points.map(|point| (point - mean).length_squared()).sum::<f64>() / count;
    let scale = (2.0 / square.max(f64::MIN_POSITIVE)).sqrt();
    let [x, y] = [mean.x, mean.y].map(|at| -scale * at);
    DMat3::from_cols(DVec3::X * scale, DVec3::Y * scale, DVec3::new(x, y, 1.0))
}

/// The fundamental matrix `F` of pairs of points, with `litᵀ F seen = 0`, and the epipole `e` in the second picture, with `eᵀ F = 0` and norm
/// 1. Returns nothing if the pairs do not determine it. `pixel` is the normalization of the second picture.
fn fundamental(pairs: impl Iterator<Item = [DVec3; 2]>, pixel: DMat3) -> Result<Option<(DMat3, DVec3)>> {
    let mut sums = Mat::<f64>::zeros(9, 9);
    let mut count = 0.0;
    for [seen, lit] in pairs {
        let products: [f64; 9] = std::array::from_fn(|k| lit[k / 3] * seen[k % 3]);
        for (i, a) in products.iter().enumerate() {
            products.iter().enumerate().for_each(|(j, b)| sums[(i, j)] += a * b);
        }
        count += 1.0;
    }
    let infinite = |_| Error::Numerical("the map has values that are not finite".into());
    let eigen = sums.self_adjoint_eigen(Side::Lower).map_err(infinite)?;
    let errors = eigen.S().column_vector();
    // The centre of a pixel is off by up to half of it, which has a variance of 1/12.
    let rounding = count * pixel.x_axis.x.powi(2) / 12.0;
    if errors[1] < APART * APART * errors[0].max(rounding * 0.1) {
        return Ok(None);
    }
    let vectors = eigen.U();
    let entry = |row: usize, column: usize| vectors[(3 * row + column, 0)];
    let full = Mat::from_fn(3, 3, entry);
    let svd = full.svd().map_err(|_| Error::Numerical("the map has values that are not finite".into()))?;
    let column = |of: faer::MatRef<'_, f64>| DVec3::new(of[(0, 2)], of[(1, 2)], of[(2, 2)]);
    let (epipole, origin) = (column(svd.U()), column(svd.V()));
    let matrix = DMat3::from_cols_array(&std::array::from_fn(|k| entry(k % 3, k / 3)));
    // The matrix gets rank two, so that all lines meet in the epipole.
    let outer = DMat3::from_cols(origin * origin.x, origin * origin.y, origin * origin.z);
    Ok(Some((matrix * (DMat3::IDENTITY - outer), epipole)))
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;
    use crate::scene::Camera;

    const SIZES: [Resolution; 2] =
        [Resolution { width: 40, height: 30 }, Resolution { width: 32, height: 32 }];

    /// The homes of a surface of this depth.
    fn homes(camera: &Camera, projector: &Camera, depth: f32) -> Vec<Option<usize>> {
        let home = |pixel: usize| {
            let (x, y) = ((pixel % SIZES[0].width) as f32 + 0.5, (pixel / SIZES[0].width) as f32 + 0.5);
            let ray = camera.ray_direction(x, y, SIZES[0]);
            let surface = depth * ((0.31 * x).sin() * (0.37 * y).cos() + if x > 20.0 { 0.5 } else { -0.5 });
            let point = camera.position + ray * ((camera.position.z - surface) / -ray.z);
            let (u, v) = projector.project(point, SIZES[1])?;
            let is_in = u >= 0.0 && v >= 0.0 && u < SIZES[1].width as f32 && v < SIZES[1].height as f32;
            is_in.then_some(v as usize * SIZES[1].width + u as usize)
        };
        (0..SIZES[0].pixels()).map(home).collect()
    }

    #[test]
    fn the_lines_of_a_map_are_those_of_the_poses() -> Result<()> {
        let camera = Camera::looking(vec3(0.0, 0.0, 2.0), Vec3::NEG_Z);
        for (what, position, forward) in [
            ("beside", vec3(0.6, 0.0, 2.0), vec3(-0.3, 0.0, -1.0)),
            ("above", vec3(-0.1, 0.5, 1.8), vec3(0.0, -0.2, -1.0)),
            ("in front", vec3(0.4, 0.3, 1.6), vec3(-0.2, -0.15, -1.0)),
        ] {
            let projector = Camera::looking(position, forward);
            let found = epipolar_lines_of_map(&homes(&camera, &projector, 0.5), SIZES)?;
            // Points of a surface that the fit has not seen.
            let other = homes(&camera, &projector, -0.4);
            let count = found[1].iter().flatten().max().map_or(0, |last| i64::from(*last));
            let share = |shift: i64| {
                let pairs =
                    other.iter().enumerate().filter_map(|(j, home)| found[0][j].zip(found[1][(*home)?]));
                let near: Vec<bool> =
                    pairs.map(|(a, b)| (i64::from(a) - i64::from(b) - shift).abs() <= 2).collect();
                near.iter().filter(|near| **near).count() as f64 / near.len() as f64
            };
            println!("{what}: {count} lines, {:.3} on them, {:.3} six farther", share(0), share(6));
            assert!(count > 20 && share(0) > 0.95 && share(6) < 0.1, "{what}");
        }
        Ok(())
    }

    #[test]
    fn a_map_that_tells_no_lines_is_refused() {
        let camera = Camera::looking(vec3(0.0, 0.0, 2.0), Vec3::NEG_Z);
        let projector = Camera::looking(vec3(0.6, 0.0, 2.0), vec3(-0.3, 0.0, -1.0));
        let said = |homes: &Homes| match epipolar_lines_of_map(homes, SIZES) {
            Ok(_) => "lines".to_owned(),
            Err(error) => error.to_string(),
        };
        assert!(said(&homes(&camera, &projector, 0.0)).contains("flat"));
        assert!(said(&homes(&camera, &camera, 0.5)).contains("flat"));
        assert!(said(&vec![None; SIZES[0].pixels()]).contains("fewer than 16"));
        let mixed: Vec<Option<usize>> =
            (0..SIZES[0].pixels()).map(|pixel| Some(pixel * pixel * 37 % SIZES[1].pixels())).collect();
        let said = said(&mixed);
        assert!(said.contains("flat") || said.contains("of the homes"), "{said}");
    }
}
