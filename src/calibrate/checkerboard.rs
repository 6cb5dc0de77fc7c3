//! The corners of a projected checkerboard, for cameras that do not resolve single projector pixels (O'Toole
//! and Kutulakos, section 8.1).
//!
//! The contrast `(p − q)/(p + q)` of the photos of a checkerboard and of its inverse does not depend on the
//! scene's albedo. Each inner corner is a saddle point of it. Its centre is that of a quadratic polynomial
//! fitted to the pixels around it (Lucchese and Mitra 2002).

use super::camera_model::CameraModel;
use super::gray_code::sum;
use super::least_squares::Normal;
use super::session::CalibrationSession;
use crate::error::Result;
use crate::measure::lens_map::{LensMap, Match};

/// The side of a square, in camera pixels.
const SQUARE: f64 = 6.0;

/// Shows a checkerboard, and finds its corners near the places that `map` predicts. Camera pixels that are
/// not `lit` are not used.
///
/// # Errors
/// Those of taking frames.
pub(crate) fn corners(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel<'_>,
    map: &LensMap,
    lit: &[bool],
) -> Result<Vec<Match>> {
    let scale = map.camera.width as f64 / map.projector.width as f64;
    let square = ((SQUARE / scale).ceil() as usize).max(1);
    let bright = |x: usize, y: usize| (x / square + y / square).is_multiple_of(2);
    let pattern = sum(session, model, bright)?;
    let inverse = sum(session, model, |x, y| !bright(x, y))?;
    let contrast: Vec<f64> =
        pattern.iter().zip(&inverse).map(|(p, q)| (p - q) / (p + q).max(f64::MIN_POSITIVE)).collect();
    let reach = 0.6 * square as f64 * scale;
    let mut matches = Vec::new();
    for row in (square..map.projector.height).step_by(square) {
        for column in (square..map.projector.width).step_by(square) {
            let projector = [column as f64, row as f64];
            let near = map.to_camera(projector);
            let saddle = near.and_then(|near| saddle(&contrast, lit, map, near, reach));
            matches.extend(saddle.map(|camera| Match { camera, projector }));
        }
    }
    Ok(matches)
}

/// The saddle point near `near`, in the camera's pixels from its top left corner. `None` when there is none,
/// or when too few pixels are lit.
fn saddle(contrast: &[f64], lit: &[bool], map: &LensMap, near: [f64; 2], reach: f64) -> Option<[f64; 2]> {
    let mut at = near;
    for _ in 0..12 {
        let mut normal = Normal::new(6);
        let (mut count, mut all) = (0, 0);
        let [left, top] = at.map(|centre| (centre - reach - 0.5).ceil());
        let [right, bottom] = at.map(|centre| (centre + reach - 0.5).floor());
        if left < 0.0 || top < 0.0 || right >= map.camera.width as f64 || bottom >= map.camera.height as f64 {
            return None;
        }
        for row in top as usize..=bottom as usize {
            for column in left as usize..=right as usize {
                let [x, y] = [column as f64 + 0.5 - at[0], row as f64 + 0.5 - at[1]];
                let distance = x.hypot(y) / reach;
                if distance >= 1.0 {
                    continue;
                }
                all += 1;
                let pixel = row * map.camera.width + column;
                if lit[pixel] {
                    count += 1;
                    // With a smooth window, no pixel enters or leaves it abruptly as the centre moves.
                    let weight = (1.0 - distance * distance).powi(2);
                    normal.add_full(&[1.0, x, y, x * x, x * y, y * y], contrast[pixel], weight);
                }
            }
        }
        if count < 12 || count * 5 < all * 4 {
            return None;
        }
        let [_, a, b, xx, xy, yy] = normal.solve().ok()?.values.try_into().ok()?;
        let determinant: f64 = 4.0 * xx * yy - xy * xy;
        if determinant >= 0.0 || xy.abs() * reach * reach < 0.1 {
            return None;
        }
        let step = [(xy * b - 2.0 * yy * a) / determinant, (xy * a - 2.0 * xx * b) / determinant];
        if step[0].hypot(step[1]) > reach {
            return None;
        }
        at = [at[0] + step[0], at[1] + step[1]];
        if step[0].hypot(step[1]) < 1e-6 {
            break;
        }
    }
    ((at[0] - near[0]).hypot(at[1] - near[1]) < reach).then_some(at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    const SIZE: Resolution = Resolution { width: 40, height: 30 };

    /// A saddle that is turned and not as steep along both axes, at a place between pixels.
    fn board(place: [f64; 2]) -> Vec<f64> {
        let of = |pixel: usize| {
            let [x, y] = [(pixel % 40) as f64 + 0.5 - place[0], (pixel / 40) as f64 + 0.5 - place[1]];
            0.05 * x * y + 0.01 * x * x - 0.015 * y * y + 0.1
        };
        (0..SIZE.pixels()).map(of).collect()
    }

    fn found(contrast: &[f64], lit: &[bool], near: [f64; 2]) -> Option<[f64; 2]> {
        let homography = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
        let map = LensMap { camera: SIZE, projector: SIZE, homography, distortion: [0.0; 2] };
        saddle(contrast, lit, &map, near, 4.0)
    }

    #[test]
    fn a_saddle_is_found_to_rounding_and_only_one_that_is_near() {
        let lit = vec![true; SIZE.pixels()];
        for (place, near) in
            [([20.3, 14.6], [19.0, 16.0]), ([4.6, 4.9], [5.5, 4.7]), ([35.4, 25.3], [35.0, 25.0])]
        {
            let at = found(&board(place), &lit, near).expect("it is there");
            // The contrast is the polynomial that is fitted.
            assert!((at[0] - place[0]).hypot(at[1] - place[1]) < 1e-9, "{at:?} for {place:?}");
        }
        let centre = board([20.3, 14.6]);
        assert_eq!(found(&centre, &lit, [24.0, 17.0]), None, "farther than four pixels");
        assert_eq!(found(&centre, &lit, [3.4, 14.0]), None, "its window leaves the picture on the left");
        assert_eq!(found(&centre, &lit, [20.0, 27.0]), None, "and at the bottom");
        let hill: Vec<f64> = centre
            .iter()
            .enumerate()
            .map(|(pixel, value)| {
                let [x, y] = [(pixel % 40) as f64 - 19.8, (pixel / 40) as f64 - 14.1];
                value + 0.1 * (x * x + y * y)
            })
            .collect();
        assert_eq!(found(&hill, &lit, [20.0, 14.0]), None, "a bowl is no saddle");
        let flat: Vec<f64> = centre.iter().map(|value| 0.05 * value).collect();
        assert_eq!(found(&flat, &lit, [20.0, 14.0]), None, "the contrast over the window is below a tenth");
    }

    #[test]
    fn a_fifth_of_the_window_may_be_dark() {
        let contrast = board([20.0, 15.0]);
        let lit_from =
            |column: usize| -> Vec<bool> { (0..SIZE.pixels()).map(|pixel| pixel % 40 >= column).collect() };
        // Fifty-two pixels are nearer than four; columns 16 and 17 have four and six of them, column 18 eight.
        let at = found(&contrast, &lit_from(18), [20.0, 15.0]).expect("ten of 52 are dark");
        assert!((at[0] - 20.0).hypot(at[1] - 15.0) < 1e-9, "{at:?}");
        assert_eq!(found(&contrast, &lit_from(19), [20.0, 15.0]), None, "eighteen of them");
    }
}
