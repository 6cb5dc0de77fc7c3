//! Epipolar lines: the pixels of the camera and of the projector whose rays lie in one plane through both centres of projection.

use std::f64::consts::TAU;

use glam::DVec3;

use super::Camera;
use crate::image::Resolution;

/// The least width of a line in pixels, where it leaves the picture.
const LEAST_WIDTH: f64 = 0.75;

/// The number of the epipolar line of each pixel of the camera, and of each pixel of the projector, by the centres of the pixels. `sizes` are
/// those of photos and patterns. A camera pixel whose line does not meet the projector's picture has `None`. Returns `None` if both devices
/// have one centre.
///
/// A line ends at the epipole. Lines are about a pixel wide where they leave the projector's picture, on the sides away from the epipole, as
/// in Pollefeys, Koch and Van Gool, *A simple and efficient rectification method for general motion* (1999),
/// doi:10.1109/ICCV.1999.791296. The light of a thin lens is taken as that of its centre.
pub fn epipolar_lines(
    camera: &Camera,
    projector: &Camera,
    sizes: [Resolution; 2],
) -> Option<[Vec<Option<u32>>; 2]> {
    let [place, centre] = [camera, projector].map(|view| view.position.as_dvec3());
    let along = centre - place;
    // Positions are in single precision.
    let along = (along.length() > 1e-6 * place.length()).then(|| along.try_normalize())??;
    // Angles about the baseline count from the middle of the projector's picture, or from its top if the epipole is in the middle.
    let mut across =
        [projector.forward, projector.up].into_iter().map(|axis| axis.as_dvec3().reject_from(along));
    let zero = across.find(|axis| axis.length() > 1e-3)?.normalize();
    let quarter = along.cross(zero);
    let angle = |view: &Camera, size: Resolution, u: f32, v: f32| {
        let ray = view.ray_direction(u, v, size).as_dvec3();
        quarter.dot(ray).atan2(zero.dot(ray))
    };
    let [_, patterns] = sizes;
    let sides = sides_away_from(projector, patterns, along);
    let at = |u: f32, v: f32| angle(projector, patterns, u, v);
    // The angle that a pixel fills, across the line.
    let width = |u: f32, v: f32| {
        let step = |du: f32, dv: f32| at(u + du, v + dv) - at(u - du, v - dv);
        let [over, down] = [step(0.5, 0.0), step(0.0, 0.5)].map(|step| step - TAU * (step / TAU).round());
        over.hypot(down)
    };
    let corners = sides.iter().flatten().map(|&[u, v]| (at(u, v), width(u, v))).collect();
    let numbers = LineNumbers::new(corners, sides.iter().all(|side| !side.is_empty()));
    let of = |view: &Camera, size: Resolution| {
        let centres = (0..size.pixels()).map(|pixel| [pixel % size.width, pixel / size.width]);
        centres.map(|[x, y]| numbers.of(angle(view, size, x as f32 + 0.5, y as f32 + 0.5))).collect()
    };
    Some([of(camera, sizes[0]), of(projector, sizes[1])])
}

/// Lines through one point, numbered by their angles.
pub struct LineNumbers {
    edges: Vec<f64>,
    is_around: bool,
}

impl LineNumbers {
    /// Makes lines of about the width of a pixel. `corners` are points at the border of the picture: the angle of the line through each,
    /// and the angle that a pixel fills there. `is_around` tells whether the lines go all around.
    pub fn new(mut corners: Vec<(f64, f64)>, is_around: bool) -> Self {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut edges: Vec<f64> = Vec::new();
        for (angle, width) in &corners {
            if edges.last().is_none_or(|last| angle - last >= LEAST_WIDTH * width) {
                edges.push(*angle);
            }
        }
        if let (Some(last), Some(end)) = (edges.last_mut(), corners.last()) {
            *last = end.0;
        }
        Self { edges, is_around }
    }

    /// The number of the line of this angle; `None` if it misses the picture.
    pub fn of(&self, angle: f64) -> Option<u32> {
        match self.edges.partition_point(|&edge| edge <= angle) {
            after if self.is_around => Some((after % self.edges.len()) as u32),
            after if after == 0 || after == self.edges.len() => None,
            after => Some(after as u32 - 1),
        }
    }

    /// Whether two lines are the same or neighbours.
    pub fn are_near(&self, a: u32, b: u32) -> bool {
        let apart = a.abs_diff(b) as usize;
        apart <= 1 || self.is_around && apart + 1 >= self.edges.len()
    }
}

/// The corners of pixels on those sides of the picture at which lines from the epipole leave the picture. The other sides are empty.
/// `along` is the direction of the baseline.
fn sides_away_from(projector: &Camera, size: Resolution, along: DVec3) -> [Vec<[f32; 2]>; 4] {
    let [x, y, depth] =
        [projector.right, projector.up, projector.forward].map(|axis| along.dot(axis.as_dvec3()));
    // The epipole is at `[x, y] / depth` of the image plane at unit distance, or at infinity.
    let sign = if depth < 0.0 { -1.0 } else { 1.0 };
    let [right, top] = projector.half_extents(size).map(f64::from);
    let (width, height) = (size.width as f32, size.height as f32);
    let down = |u: f32| (0..=size.height).map(|v| [u, v as f32]).collect();
    let over = |v: f32| (0..=size.width).map(|u| [u as f32, v]).collect();
    let if_away = |reach: f64, side: Vec<[f32; 2]>| if sign * reach > 0.0 { side } else { Vec::new() };
    [
        if_away(depth * right - x, down(width)),
        if_away(depth * right + x, down(0.0)),
        if_away(depth * top - y, over(0.0)),
        if_away(depth * top + y, over(height)),
    ]
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::*;

    #[test]
    fn the_lines_of_a_rectified_pair_are_rows() {
        let camera = Camera::looking(vec3(0.3, -0.2, 1.0), Vec3::NEG_Z);
        let size = Resolution::new(13, 9);
        for shift in [0.2, -0.2] {
            let projector = Camera { position: camera.position + shift * camera.right, ..camera.clone() };
            let [seen, lit] = epipolar_lines(&camera, &projector, [size; 2]).expect("they stand apart");
            let rows: Vec<_> = lit.chunks(size.width).map(|row| row[0]).collect();
            assert!(
                seen == lit
                    && lit.chunks(size.width).zip(&rows).all(|(row, first)| row.iter().all(|l| l == first))
            );
            assert!(rows.is_sorted_by(|a, b| a < b) || rows.is_sorted_by(|a, b| a > b), "{rows:?}");
        }
        assert!(epipolar_lines(&camera, &camera, [size; 2]).is_none());
    }

    /// A point lights the projector's and the camera's pixels of one line. Each pixel stands for its centre, so that a point at an edge may
    /// be one line off in each picture.
    #[test]
    fn both_pictures_of_a_point_are_on_one_line() {
        let camera = Camera::looking(vec3(0.0, 0.0, 2.0), Vec3::NEG_Z);
        let sizes = [Resolution::new(40, 30), Resolution::new(32, 32)];
        for (what, position, forward) in [
            ("beside", vec3(0.6, 0.0, 2.0), vec3(-0.3, 0.0, -1.0)),
            ("above", vec3(-0.1, 0.5, 1.8), vec3(0.0, -0.2, -1.0)),
            ("in front, with the epipole in the picture", vec3(0.05, 0.02, 1.4), Vec3::NEG_Z),
        ] {
            let projector = Camera::looking(position, forward);
            let lines = epipolar_lines(&camera, &projector, sizes).expect("they stand apart");
            let count = lines[1].iter().flatten().max().map_or(0, |last| i64::from(*last) + 1);
            let (mut seen, mut close, mut wrong) = (0, 0, 0);
            for step in 0..4000 {
                let t = f64::from(step) * 0.618_034;
                let point =
                    vec3((t * 7.0).sin() as f32, (t * 11.0).sin() as f32, 0.3 * (t * 13.0).sin() as f32);
                let on = |view: &Camera, size: Resolution| {
                    let (u, v) = view.project(point, size)?;
                    let is_in = u >= 0.0 && v >= 0.0 && u < size.width as f32 && v < size.height as f32;
                    is_in.then_some(v as usize * size.width + u as usize)
                };
                let (Some(j), Some(i)) = (on(&camera, sizes[0]), on(&projector, sizes[1])) else { continue };
                let (Some(of_camera), Some(of_projector)) = (lines[0][j], lines[1][i]) else { continue };
                let apart = |shift: i64| {
                    let off = (i64::from(of_camera) + shift - i64::from(of_projector)).rem_euclid(count);
                    off.min(count - off)
                };
                seen += 1;
                close += usize::from(apart(0) <= 2);
                wrong += usize::from(apart(6) <= 2);
            }
            println!("{what}: {count} lines, {close} and {wrong} of {seen}");
            assert!(
                seen > 300 && close * 100 >= seen * 95 && wrong * 10 < seen,
                "{what}: {close} {wrong} {seen}"
            );
        }
    }
}
