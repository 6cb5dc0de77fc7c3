//! Footprints: the camera pixels that see each projector pixel, by the overlap of their areas.

use rayon::prelude::*;

use super::calibration::Registration;
use super::lens_map::LensMap;
use super::sharp_weights::{Overlaps, Shares};
use crate::image::Resolution;

/// A projector pixel counts as seen when lit camera pixels cover at least this share of its area.
const COVERED: f64 = 0.25;

/// The pixel map by overlap: each projector pixel is seen by the camera pixels that overlap it, with weights by which it contains
/// little light of its neighbours. Camera pixels that are not `lit` do not count. The rows of projector pixels that are covered too
/// little are empty.
pub(super) fn by_overlap(map: &LensMap, lit: &[bool]) -> Registration {
    let (areas, rows) = overlaps(map, lit);
    let shares = Shares::new(&areas, &rows);
    let covered = |row: &Vec<(u32, f64)>| row.iter().map(|entry| entry.1).sum::<f64>() > COVERED;
    let overlaps = Overlaps { projector: map.projector, rows: &rows };
    let sharp = |(pixel, row)| if covered(row) { shares.sharpened(pixel, &overlaps) } else { Vec::new() };
    let rows = rows.par_iter().enumerate().map(sharp).collect();
    Registration { lens: Some(map.clone()), ..Registration::of_rows(map.camera, map.projector, rows) }
}

/// The shares of the areas of the `lit` camera pixels that lie in projector pixels.
pub(super) fn shares(map: &LensMap, lit: &[bool]) -> Shares {
    let (areas, rows) = overlaps(map, lit);
    Shares::new(&areas, &rows)
}

/// The areas of the `lit` camera pixels in the projector's raster, and their overlaps with each projector pixel.
fn overlaps(map: &LensMap, lit: &[bool]) -> (Vec<f64>, Vec<Vec<(u32, f64)>>) {
    let Resolution { width, height } = map.projector;
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); map.projector.pixels()];
    let mut areas = vec![0.0; map.camera.pixels()];
    for (pixel, _) in lit.iter().enumerate().filter(|(_, lit)| **lit) {
        let [x, y] = [(pixel % map.camera.width) as f64, (pixel / map.camera.width) as f64];
        let corners: Vec<[f64; 2]> = [[x, y], [x + 1.0, y], [x + 1.0, y + 1.0], [x, y + 1.0]]
            .map(|corner| map.to_projector(corner))
            .to_vec();
        areas[pixel] = area(&corners);
        let span = |axis: usize, size: usize| {
            let along = corners.iter().map(|corner| corner[axis]);
            let low = along.clone().fold(f64::INFINITY, f64::min).floor().max(0.0);
            let high = along.fold(f64::NEG_INFINITY, f64::max).ceil().min(size as f64);
            low as usize..high.max(0.0) as usize
        };
        for row in span(1, height) {
            for column in span(0, width) {
                let common = overlap(&corners, [column as f64, row as f64]);
                if common > 1e-9 {
                    rows[row * width + column].push((pixel as u32, common));
                }
            }
        }
    }
    (areas, rows)
}

impl Registration {
    /// The pixel map with these rows: camera pixels and their weights.
    pub(super) fn of_rows(camera: Resolution, projector: Resolution, rows: Vec<Vec<(u32, f64)>>) -> Self {
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
fn area(points: &[[f64; 2]]) -> f64 {
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

    #[test]
    fn a_camera_pixel_between_two_projector_pixels_has_half_weight_in_each() {
        let raster = Resolution::new(4, 1);
        let unit = 0.5 * 4.0_f64.hypot(1.0);
        let map = LensMap {
            camera: raster,
            projector: raster,
            homography: [1.0, 0.0, 0.5 / unit, 0.0, 1.0, 0.0, 0.0, 0.0],
            distortion: [0.0; 2],
        };
        let found = by_overlap(&map, &[true, true, false, true]);
        assert_eq!(
            found.starts,
            [0, 1, 3, 4, 5],
            "the first and the last are covered by half, and the third by one lit and one dark camera pixel"
        );
        assert_eq!(found.pixels, [0, 0, 1, 1, 3]);
        let expected = [1.0, 0.5, 0.5, 1.0, 1.0];
        assert!(
            found.weights.iter().zip(expected).all(|(weight, expected)| (weight - expected).abs() < 1e-9)
        );
    }

    #[test]
    fn the_overlap_of_a_rotated_square_is_the_area_inside() {
        let diamond = [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]];
        assert!((overlap(&diamond, [0.0, 0.0]) - 0.5).abs() < 1e-12);
        assert_eq!(overlap(&diamond, [1.0, 1.0]), 0.0);
    }
}
