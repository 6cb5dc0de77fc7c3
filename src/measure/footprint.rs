//! Footprints: the camera pixels that see each projector pixel, by the overlap of their areas.

use rayon::prelude::*;

use super::calibration::Registration;
use super::lens_map::LensMap;
use super::rows::Entry;
use super::sharp_weights::{Overlaps, Shares};
use crate::image::Resolution;

/// A projector pixel counts as seen when lit camera pixels cover at least this share of its area.
const COVERED: f64 = 0.25;

/// The pixel map by overlap: each projector pixel is seen by the camera pixels that overlap it, with weights by which it contains
/// little light of its neighbours. Camera pixels that are not `lit` do not count. The rows of projector pixels that are covered too
/// little are empty.
pub(crate) fn by_overlap(map: &LensMap, lit: &[bool]) -> Registration {
    let (areas, rows) = overlaps(map, lit);
    let shares = Shares::new(&areas, &rows);
    let covered = |row: &Vec<Entry>| row.iter().map(|entry| entry.1).sum::<f64>() > COVERED;
    let overlaps = Overlaps { projector: map.projector, rows: &rows };
    let sharp = |(pixel, row)| if covered(row) { shares.sharpened(pixel, &overlaps) } else { Vec::new() };
    let rows = rows.par_iter().enumerate().map(sharp).collect();
    Registration { lens: Some(map.clone()), ..Registration::of_rows(map.camera, map.projector, rows) }
}

/// The shares of the areas of the `lit` camera pixels that lie in projector pixels.
pub(crate) fn shares(map: &LensMap, lit: &[bool]) -> Shares {
    let (areas, rows) = overlaps(map, lit);
    Shares::new(&areas, &rows)
}

/// The areas of the `lit` camera pixels in the projector's raster, and their overlaps with each projector pixel.
fn overlaps(map: &LensMap, lit: &[bool]) -> (Vec<f64>, Vec<Vec<Entry>>) {
    let mut rows: Vec<Vec<Entry>> = vec![Vec::new(); map.projector.pixels()];
    let mut areas = vec![0.0; map.camera.pixels()];
    for (pixel, _) in lit.iter().enumerate().filter(|(_, lit)| **lit) {
        let corners = corners(map, pixel);
        areas[pixel] = area(&corners);
        for ([column, row], common) in overlapped(corners, map.projector) {
            if common > 1e-9 {
                rows[row * map.projector.width + column].push((pixel as u32, common));
            }
        }
    }
    (areas, rows)
}

/// The corners of a camera pixel in the projector's raster, in order around it.
pub(crate) fn corners(map: &LensMap, pixel: usize) -> [[f64; 2]; 4] {
    let [x, y] = [(pixel % map.camera.width) as f64, (pixel / map.camera.width) as f64];
    [[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]].map(|corner| map.to_projector(corner))
}

/// The projector pixels, by column and row, near a camera pixel with these corners, and the areas that they have in common.
pub(crate) fn overlapped(
    corners: [[f64; 2]; 4],
    projector: Resolution,
) -> impl Iterator<Item = ([usize; 2], f64)> {
    let [columns, rows] = [(0, projector.width), (1, projector.height)].map(|(axis, size)| {
        let along = corners.iter().map(|corner| corner[axis]);
        let low = along.clone().fold(f64::INFINITY, f64::min).floor().max(0.0);
        let high = along.fold(f64::NEG_INFINITY, f64::max).ceil().min(size as f64);
        low as usize..high.max(0.0) as usize
    });
    rows.flat_map(move |row| columns.clone().map(move |column| [column, row]))
        .map(move |at| (at, overlap(&corners, at.map(|at| at as f64))))
}

impl Registration {
    /// The pixel map with these rows: camera pixels and their weights.
    pub(crate) fn of_rows(camera: Resolution, projector: Resolution, rows: Vec<Vec<Entry>>) -> Self {
        let (mut starts, mut pixels, mut weights) = (vec![0], Vec::new(), Vec::new());
        for row in rows {
            pixels.extend(row.iter().map(|entry| entry.0));
            weights.extend(row.iter().map(|entry| entry.1));
            starts.push(pixels.len());
        }
        Self { camera, projector, starts, pixels, weights, lens: None }
    }
}

/// The area of the intersection of a convex polygon with the unit square whose top left corner is `at`
/// (Sutherland and Hodgman).
fn overlap(polygon: &[[f64; 2]], at: [f64; 2]) -> f64 {
    let mut points = polygon.to_vec();
    for (axis, bound, sign) in
        [(0, at[0], 1.0), (0, at[0] + 1.0, -1.0), (1, at[1], 1.0), (1, at[1] + 1.0, -1.0)]
    {
        let inside = |point: &[f64; 2]| sign * (point[axis] - bound) >= 0.0;
        let mut clipped = Vec::with_capacity(points.len() + 1);
        for index in 0..points.len() {
            let (from, to) = (points[index], points[(index + 1) % points.len()]);
            if inside(&from) {
                clipped.push(from);
            }
            if inside(&from) != inside(&to) {
                let share = (bound - from[axis]) / (to[axis] - from[axis]);
                clipped.push([from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]);
            }
        }
        points = clipped;
    }
    area(&points)
}

/// The area of a polygon.
pub(crate) fn area(points: &[[f64; 2]]) -> f64 {
    let twice: f64 = (0..points.len())
        .map(|index| {
            let (a, b) = (points[index], points[(index + 1) % points.len()]);
            a[0] * b[1] - b[0] * a[1]
        })
        .sum();
    0.5 * twice.abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::spread::Spread;

    /// A camera of `camera` pixels that looks past by `shift` projector pixels.
    fn shifted(camera: Resolution, projector: Resolution, shift: f64) -> LensMap {
        let unit = 0.5 * (projector.width as f64).hypot(projector.height as f64);
        LensMap {
            camera,
            projector,
            homography: [1.0, 0.0, shift / unit, 0.0, 1.0, 0.0, 0.0, 0.0],
            distortion: [0.0; 2],
        }
    }

    #[test]
    fn a_pixel_that_is_covered_too_little_has_no_camera_pixels() {
        let raster = Resolution::new(4, 1);
        let found = by_overlap(&shifted(raster, raster, 0.5), &[true, false, false, true]);
        let seen = found.seen();
        // The first, second and fourth are covered by half; the third by none that is lit.
        assert_eq!(seen, [true, true, false, true]);
    }

    #[test]
    fn a_finer_camera_sees_each_pixel_by_itself_and_even_light_stays_even() {
        let (projector, camera) = (Resolution::new(12, 8), Resolution::new(30, 20));
        let map = shifted(camera, projector, 0.3);
        let found = by_overlap(&map, &vec![true; camera.pixels()]);
        let spread = Spread::new(&found, &map);
        let one = |pixel: usize| -> Vec<f64> {
            (0..projector.pixels()).map(|at| f64::from(u8::from(at == pixel))).collect()
        };
        for pixel in 0..projector.pixels() {
            let own = spread.apply(&one(pixel))[pixel];
            // A mean over all camera pixels that overlap it would hold 0.6 of its light along each axis: 0.4 in all.
            assert!((0.97..1.03).contains(&own), "{own} at {pixel}");
        }
        let even = spread.apply(&vec![1.0; projector.pixels()]);
        // Shares below 1e-4 are left out; a row has some ten of them.
        assert!(even.iter().all(|light| (light - 1.0).abs() < 2e-3), "{even:?}");
        let noise = found.weights.iter().map(|weight| weight * weight).sum::<f64>() / 96.0;
        assert!(noise < 0.5, "six camera pixels see each, and at least two of them inside: {noise}");
    }

    #[test]
    fn the_overlap_of_a_rotated_square_is_the_area_inside() {
        let diamond = [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];
        assert!((overlap(&diamond, [0.0, 0.0]) - 0.5).abs() < 1e-12);
        assert_eq!(overlap(&diamond, [1.0, 1.0]), 0.0);
    }
}
