//! The measurement of the pixel map, from Gray codes to footprints (O'Toole and Kutulakos, section 8.1).

use super::camera_model::CameraModel;
use super::checkerboard::corners;
use super::gray_code::{Decoded, gray_code};
use super::map_fit::{self, Fit};
use super::report::{MapBy, MapFigures};
use super::session::CalibrationSession;
use super::stripe_fit::refined;
use crate::error::Result;
use crate::image::Resolution;
use crate::measure::Registration;
use crate::measure::footprint::by_overlap;
use crate::measure::lens_map::{Match, centre};

/// A common map is accepted when the points have at most this root mean square distance from it, in projector
/// pixels.
const FITS: f64 = 0.75;

/// A common map is accepted when less than this share of the points are outliers, such as reflections and
/// edges.
const OUTLIERS: f64 = 0.5;

/// Gray codes need this many camera pixels per projector pixel along each axis. With fewer, only the camera pixels that lie inside one
/// projector pixel are decoded, which hides a shift by a part of a pixel.
const SAMPLED: f64 = 1.5;

/// Where fewer camera pixels than this share are not decoded, each of the others lies inside one projector pixel, and the codes are exact.
const ALIGNED: f64 = 0.1;

/// The least width of the finest stripes that can be decoded, in camera pixels.
const STRIPE: f64 = 1.5;

/// Measures the map from camera to projector, and makes the pixel map of it.
///
/// # Errors
/// Those of [`map_fit::fit`], and of taking frames.
pub(crate) fn pixel_map(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel<'_>,
    by: Option<MapBy>,
) -> Result<(Registration, MapFigures)> {
    let (camera, projector) = (session.camera().resolution, session.projector().resolution);
    let scale = scale(camera, projector);
    let coarse = coarse(camera, projector);
    // With fewer squares than a map needs, Gray codes that a camera can decode are better than nothing.
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
    let outliers = |fit: &Fit| fit.outliers;
    match fit {
        Ok(fit) if fit.rms < FITS * decoded.step as f64 && fit.outliers < OUTLIERS => {
            // Where no camera pixel sees an edge, the codes are exact, and the stripes tell less.
            let finer = refined(&fit, &decoded).ok().filter(|finer| finer.error < fit.error);
            let fit = finer.unwrap_or(fit);
            let registration = by_overlap(&fit.map, &decoded.lit);
            let lost = match by {
                MapBy::GrayCode => decoded.unreliable + (1.0 - decoded.unreliable) * outliers(&fit),
                MapBy::Checkerboard => outliers(&fit),
            };
            let figures = MapFigures {
                by,
                points,
                rms: fit.rms,
                error: fit.error,
                unreliable: lost,
                masked: masked(&registration),
                lens: Some(fit.map),
            };
            Ok((registration, figures))
        }
        // No common map fits, because the camera may be elsewhere. Then each camera pixel is used as it was
        // decoded.
        Ok(fit) if by == MapBy::GrayCode && decoded.step == 1 => {
            let registration = by_decoding(&decoded, camera, projector);
            let figures = MapFigures {
                by,
                points,
                rms: fit.rms,
                error: (1.0_f64 / 6.0).sqrt(),
                unreliable: decoded.unreliable,
                masked: masked(&registration),
                lens: None,
            };
            Ok((registration, figures))
        }
        Ok(fit) => Err(map_fit::no_map((points as f64 * (1.0 - fit.outliers)) as usize, camera, projector)),
        Err(error) => Err(error),
    }
}

/// The pixel map by decoding: all camera pixels that were decoded to a projector pixel have equal weights. It
/// serves where no common map fits, for example when the camera is not at the projector's centre of
/// projection.
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

/// The number of camera pixels per projector pixel along an axis; the smaller one of both axes.
fn scale(camera: Resolution, projector: Resolution) -> f64 {
    (camera.width as f64 / projector.width as f64).min(camera.height as f64 / projector.height as f64)
}

/// The number of the finest bits that this camera cannot decode.
pub(crate) fn coarse(camera: Resolution, projector: Resolution) -> u32 {
    // The finest stripes of a Gray code are two pixels wide.
    (STRIPE / (2.0 * scale(camera, projector))).log2().ceil().max(0.0) as u32
}

fn matches(decoded: &Decoded, camera: Resolution) -> Vec<Match> {
    decoded.seen.iter().map(|seen| Match { camera: centre(seen.pixel, camera), projector: seen.at }).collect()
}

/// The share of projector pixels that no camera pixel sees.
fn masked(registration: &Registration) -> f64 {
    let empty = registration.starts.windows(2).filter(|ends| ends[0] == ends[1]).count();
    empty as f64 / registration.projector.pixels() as f64
}

#[cfg(test)]
mod tests {
    use super::super::gray_code::DecodedPixel;
    use super::*;

    #[test]
    fn the_finest_stripes_are_as_wide_as_the_camera_needs() {
        let projector = Resolution::new(100, 100);
        // Stripes of two pixels are 3, 2, 1.4 and 0.7 camera pixels wide along the narrower axis.
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
}
