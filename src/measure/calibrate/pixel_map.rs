//! The pixel map, from codes to footprints.

use super::camera_model::CameraModel;
use super::checkerboard::corners;
use super::footprint::{by_decoding, by_overlap};
use super::gray_code::{Decoded, gray_code};
use super::lens_map::{Match, centre};
use super::map_fit::{self, Fit};
use super::report::{MapBy, MapFigures};
use super::session::CalibrationSession;
use crate::error::Result;
use crate::image::Resolution;
use crate::measure::Registration;

/// A common map belongs to a rig whose points lie this near to it, in projector pixels.
const FITS: f64 = 0.75;

/// A quarter of the points may go their own way: reflections, and edges.
const OUTLIERS: f64 = 0.5;

/// Camera pixels that the finest stripes should be wide, where they are to be decoded.
const STRIPE: f64 = 1.5;

/// Measures the map and makes footprints of it.
///
/// # Errors
/// As [`map_fit::fit`]; whatever keeps frames from being taken.
pub(super) fn pixel_map(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel<'_>,
    by: Option<MapBy>,
) -> Result<(Registration, MapFigures)> {
    let (camera, projector) = (session.camera().resolution, session.projector().resolution);
    let scale = scale(camera, projector);
    let coarse = coarse(camera, projector);
    let by = by.unwrap_or(if scale < 0.95 { MapBy::Checkerboard } else { MapBy::GrayCode });
    let decoded = gray_code(session, model, coarse)?;
    let from_codes = map_fit::fit(&matches(&decoded, camera), camera, projector, 0.41 * decoded.step as f64);
    let (fit, points) = match (by, from_codes) {
        (MapBy::GrayCode, fit) => (fit, decoded.seen.len()),
        (MapBy::Checkerboard, Err(error)) => return Err(error),
        (MapBy::Checkerboard, Ok(first)) => {
            let found = corners(session, model, &first.map, &decoded.lit)?;
            (map_fit::fit(&found, camera, projector, 0.2), found.len())
        }
    };
    let outliers = |fit: &Fit| fit.outliers;
    match fit {
        Ok(fit) if fit.rms < FITS * decoded.step as f64 && fit.outliers < OUTLIERS => {
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
        // No common map: the camera may look from elsewhere. Then each pixel stands for itself.
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
        Ok(fit) => Err(map_fit::no_map((points as f64 * (1.0 - fit.outliers)) as usize)),
        Err(error) => Err(error),
    }
}

/// Camera pixels for one of the projector's, on a side.
fn scale(camera: Resolution, projector: Resolution) -> f64 {
    (camera.width as f64 / projector.width as f64).min(camera.height as f64 / projector.height as f64)
}

/// How many of the finest bits this camera could not decode.
pub(super) fn coarse(camera: Resolution, projector: Resolution) -> u32 {
    // The finest stripes of a Gray code are two pixels wide.
    (STRIPE / (2.0 * scale(camera, projector))).log2().ceil().max(0.0) as u32
}

fn matches(decoded: &Decoded, camera: Resolution) -> Vec<Match> {
    decoded.seen.iter().map(|seen| Match { camera: centre(seen.pixel, camera), projector: seen.at }).collect()
}

fn masked(registration: &Registration) -> f64 {
    let empty = registration.starts.windows(2).filter(|ends| ends[0] == ends[1]).count();
    empty as f64 / registration.projector.pixels() as f64
}
