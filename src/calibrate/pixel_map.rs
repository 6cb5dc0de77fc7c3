//! The measurement of the pixel map. Gray codes or a checkerboard (O'Toole and Kutulakos, section 8.1) give the lens map, and the lens map
//! gives the footprints of camera pixels. The lens map is ours.

use super::least_squares::Normal;
use super::map_fit;
use super::map_fit::Fit;
use super::report::{MapBy, MapFigures};
use super::session::{CalibrationSession, CameraModel};
use super::stripe_fit::refined;
use super::structured_light::{Decoded, gray_code, sum};
use crate::error::Result;
use crate::image::Resolution;
use crate::measure::Registration;
use crate::measure::footprint::by_overlap;
use crate::measure::lens_map::{LensMap, Match, centre};

/// A common lens map is accepted when the root mean square distance of the points from it is at most this, in projector pixels.
const FITS: f64 = 0.75;

/// A common lens map is accepted when less than this fraction of the points are outliers, for example due to reflections and edges.
const OUTLIERS: f64 = 0.5;

/// Gray codes need this many camera pixels per projector pixel along each axis. With fewer camera pixels, a camera pixel is decoded only if
/// it lies inside one projector pixel. This hides a shift by a fraction of a pixel.
const SAMPLED: f64 = 1.5;

/// The codes are exact when less than this fraction of the camera pixels is undecoded. Each decoded camera pixel then lies inside a
/// projector pixel.
const ALIGNED: f64 = 0.1;

/// Stripes must be at least this wide to be decoded, in camera pixels.
const STRIPE: f64 = 1.5;

/// Measures the lens map from camera to projector, and computes the pixel map from it.
pub(crate) fn pixel_map(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel,
    by: Option<MapBy>,
) -> Result<(Registration, MapFigures)> {
    let (camera, projector) = (session.camera().resolution, session.projector().resolution);
    let scale = scale(camera, projector);
    let coarse = coarse(camera, projector);
    // A checkerboard may have fewer squares than the fit of a map needs. In this case, Gray codes are used if the camera can decode them.
    let may_fall_back = by.is_none() && coarse == 0;
    let mut by = by.unwrap_or(if scale < SAMPLED { MapBy::Checkerboard } else { MapBy::GrayCode });
    let decoded = gray_code(session, model, coarse)?;
    let from_codes = map_fit::fit(&matches(&decoded, camera), camera, projector, 0.41 * decoded.step as f64);
    let is_aligned = |fit: &Fit| decoded.unreliable < ALIGNED && fit.outliers < ALIGNED && decoded.step == 1;
    if may_fall_back && from_codes.as_ref().is_ok_and(is_aligned) {
        by = MapBy::GrayCode;
    }
    let (fit, points) = match (by, from_codes) {
        (MapBy::GrayCode, fit) => (fit, decoded.seen.len()),
        (MapBy::Checkerboard, Err(error)) => return Err(error),
        (MapBy::Checkerboard, Ok(first)) => {
            let found = corners(session, model, &first.map, &decoded.lit)?;
            match map_fit::fit(&found, camera, projector, 0.2) {
                Err(_) if may_fall_back => {
                    by = MapBy::GrayCode;
                    (Ok(first), decoded.seen.len())
                }
                fit => (fit, found.len()),
            }
        }
    };
    let (registration, rms, error, unreliable, lens) = match fit? {
        fit if fit.rms < FITS * decoded.step as f64 && fit.outliers < OUTLIERS => {
            // The stripes refine the map, unless no camera pixel sees an edge: the codes are then exact, and the stripes less informative.
            let finer = refined(&fit, &decoded).ok().filter(|finer| finer.error < fit.error);
            let fit = finer.unwrap_or(fit);
            let registration = by_overlap(&fit.map, &decoded.lit);
            let lost = match by {
                MapBy::GrayCode => decoded.unreliable + (1.0 - decoded.unreliable) * fit.outliers,
                MapBy::Checkerboard => fit.outliers,
            };
            (registration, fit.rms, fit.error, lost, Some(fit.map))
        }
        // No common map fits, perhaps because the rig is not coaxial. Each decoded camera pixel is then used separately.
        fit if by == MapBy::GrayCode && decoded.step == 1 => {
            let registration = by_decoding(&decoded, camera, projector);
            (registration, fit.rms, (1.0_f64 / 6.0).sqrt(), decoded.unreliable, None)
        }
        fit => {
            let fitting = (points as f64 * (1.0 - fit.outliers)) as usize;
            return Err(map_fit::no_map(fitting, camera, projector));
        }
    };
    let masked = masked(&registration);
    Ok((registration, MapFigures { by, points, rms, error, unreliable, masked, lens }))
}

/// The pixel map by decoding. All camera pixels that were decoded to a projector pixel have equal weights. This map is used where no common
/// lens map fits, for example when the camera is not at the projector's centre of projection.
fn by_decoding(decoded: &Decoded, camera: Resolution, projector: Resolution) -> Registration {
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); projector.pixels()];
    for seen in &decoded.seen {
        let [column, row] = seen.at.map(|coordinate| coordinate as usize);
        rows[row * projector.width + column].push((seen.pixel as u32, 1.0));
    }
    for row in &mut rows {
        let count = row.len() as f64;
        row.iter_mut().for_each(|entry| entry.1 = 1.0 / count);
    }
    Registration::of_rows(camera, projector, rows)
}

/// The number of camera pixels per projector pixel, along the axis where this number is smaller.
fn scale(camera: Resolution, projector: Resolution) -> f64 {
    (camera.width as f64 / projector.width as f64).min(camera.height as f64 / projector.height as f64)
}

/// The number of finest bits of the Gray code that this camera cannot decode.
pub(crate) fn coarse(camera: Resolution, projector: Resolution) -> u32 {
    // The finest stripes of a Gray code are two pixels wide.
    (STRIPE / (2.0 * scale(camera, projector))).log2().ceil().max(0.0) as u32
}

fn matches(decoded: &Decoded, camera: Resolution) -> Vec<Match> {
    decoded.seen.iter().map(|seen| Match { camera: centre(seen.pixel, camera), projector: seen.at }).collect()
}

/// The fraction of projector pixels that no camera pixel sees.
fn masked(registration: &Registration) -> f64 {
    let empty = registration.starts.windows(2).filter(|ends| ends[0] == ends[1]).count();
    empty as f64 / registration.projector.pixels() as f64
}

// The corners of a checkerboard serve cameras that do not resolve single projector pixels. (In section 8.1 and figure 16 of O'Toole and
// Kutulakos, each projector pixel has a square of its own, and is paired with the camera pixel at the square's centre.) The contrast
// `(p − q)/(p + q)` of the photos `p` of a checkerboard and `q` of its inverse does not depend on the scene's albedo. Each inner corner
// is a saddle point of the contrast. It is found as the saddle point of a fitted quadratic polynomial (Lucchese and Mitra 2002).

/// The side of a square of the checkerboard, in camera pixels.
const SQUARE: f64 = 6.0;

/// Shows a checkerboard, and finds its corners near the positions that `map` predicts. Only camera pixels that are `lit` are used.
pub(crate) fn corners(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel,
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

/// The saddle point near `near`, in camera pixels from the top left corner. `None` when there is no saddle, or too few pixels are lit.
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
                    // The weight falls smoothly to 0 at the border of the window, so that pixels do not enter or leave abruptly as the
                    // window moves.
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
    use crate::calibrate::structured_light::DecodedPixel;
    use crate::image::Resolution;

    #[test]
    fn the_finest_stripes_are_as_wide_as_the_camera_needs() {
        let projector = Resolution::new(100, 100);
        // Stripes of two projector pixels are 3, 2, 1.4 and 0.7 camera pixels wide along the axis with fewer camera pixels.
        for (camera, bits) in [((150, 200), 0), ((200, 100), 0), ((70, 300), 1), ((300, 35), 2)] {
            assert_eq!(coarse(Resolution::new(camera.0, camera.1), projector), bits, "{camera:?}");
        }
        assert_eq!(scale(Resolution::new(50, 300), Resolution::new(100, 200)), 0.5);
        assert_eq!(scale(Resolution::new(300, 50), Resolution::new(100, 200)), 0.25);
    }

    #[test]
    fn decoded_pixels_share_the_projector_pixel_that_they_see() {
        let (camera, projector) = (Resolution::new(4, 2), Resolution::new(3, 2));
        let seen = [(1, [2.5, 1.5]), (6, [2.9, 1.0]), (3, [0.5, 1.2]), (4, [1.0, 0.0])];
        let seen = seen.map(|(pixel, at)| DecodedPixel { pixel, at, fine: at }).to_vec();
        let decoded = Decoded {
            seen,
            between: Vec::new(),
            lit: vec![true; 8],
            unreliable: 0.0,
            step: 1,
            white: vec![1.0; 8],
            black: vec![0.0; 8],
            direct: vec![1.0; 8],
            noise: vec![0.0; 8],
            saturated: vec![false; 8],
            stripes: Vec::new(),
        };
        let map = by_decoding(&decoded, camera, projector);
        let rows: Vec<Vec<(usize, f64)>> = (0..6).map(|pixel| map.row(pixel).collect()).collect();
        let expected = [vec![], vec![(4, 1.0)], vec![], vec![(3, 1.0)], vec![], vec![(1, 0.5), (6, 0.5)]];
        assert_eq!(rows, expected);
        assert_eq!(masked(&map), 0.5, "three of six are seen by nobody");
    }

    const SIZE: Resolution = Resolution { width: 40, height: 30 };

    /// The contrast around a rotated saddle point at `place`. The saddle is not equally steep along its two axes.
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
            // The contrast is a quadratic polynomial, like the fit, so only rounding errors remain.
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
        // 52 pixels are nearer than four pixels to the corner: four of them are in column 16, six in column 17, and eight in column 18.
        let at = found(&contrast, &lit_from(18), [20.0, 15.0]).expect("ten of 52 are dark");
        assert!((at[0] - 20.0).hypot(at[1] - 15.0) < 1e-9, "{at:?}");
        assert_eq!(found(&contrast, &lit_from(19), [20.0, 15.0]), None, "eighteen of them");
    }
}
