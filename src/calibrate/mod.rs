//! The calibration of a rig from captures alone: `krylux rig calibrate`.
//!
//! O'Toole and Kutulakos, section 8.1, need linear devices and a map from camera to projector pixels. The measurements in the table below
//! go beyond their text.
//!
//! | measured | from | file |
//! |---|---|---|
//! | latency | white after black, photographed after different waits | `session` |
//! | exposure, saturation | white | `exposure` |
//! | the camera's response, black level | an exposure series of white and black | `response` |
//! | gain, read noise | pairs of equal frames | `camera` |
//! | the projector's response, the lamp's drift | a ramp of levels, and white between them | `ramp` |
//! | the pixel map | Gray codes, or a checkerboard | `structured_light`, `pixel_map`, `map_fit`, `stripe_fit` |
//! | the brightness of the projector relative to the camera's | smooth patterns, by the symmetry of the light transport | `flat_field` |
//!
//! [`StructuredLight`] decodes Gray codes without a calibration, and [`map_check`](map_check()) tests the pixel map of a calibration. Both
//! help to set up a bench.

mod camera;
mod displacement;
mod exposure;
mod flat_field;
mod least_squares;
mod map_check;
pub(crate) mod map_fit;
mod pixel_map;
mod ramp;
mod report;
mod response;
mod session;
mod stripe_fit;
mod structured_light;

pub use displacement::Displacement;
pub use exposure::WhiteExposure;
pub use flat_field::flat_field_of_sheet;
pub use map_check::map_check;
pub use map_fit::Fit;
pub use report::{
    CalibrationReport, CameraFigures, MapBy, MapFigures, MeasuredValue, ProjectorFigures, StabilityFigures,
};
pub use structured_light::{Decoded, DecodedPixel, Stripes, StructuredLight};

use std::ops::ControlFlow;

use ramp::Ramp;
pub(crate) use session::CalibrationSession;
use session::CameraModel;

use crate::error::{Error, Result};
use crate::measure::{Calibration, FlatField, FrameSource, Stability};

/// The options of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrateOptions {
    /// The number of frames averaged for each level of the ramp and each pattern.
    pub takes: u32,
    /// The largest number of levels that are shown, at least 3. `None` means 257, or 33 when frames are more than half a second apart.
    pub levels: Option<usize>,
    /// The source of the pixel map. `None`: Gray codes, or a checkerboard for fewer than 1.5 camera pixels per projector pixel along an
    /// axis.
    pub map: Option<MapBy>,
    /// Whether projector and camera have the same pose and lens, so that the transport matrix is symmetric. Only then can uneven brightness
    /// of the devices be distinguished from the scene.
    pub coaxial: bool,
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        Self { takes: 2, levels: None, map: None, coaxial: true }
    }
}

/// The settle time is the measured latency times this factor.
const SETTLE_MARGIN: f64 = 1.25;

/// Measures all values of a [`Calibration`]. `progress` gets the name of each step before the step begins, and may stop the calibration.
///
/// # Errors
/// [`Error::Rig`] when the rig fails, or when its photos cannot be evaluated; [`Error::Interrupted`] when `progress` stops the calibration.
pub fn calibrate(
    frames: &mut dyn FrameSource,
    options: &CalibrateOptions,
    progress: &mut dyn FnMut(&'static str) -> ControlFlow<()>,
) -> Result<(Calibration, CalibrationReport)> {
    let mut step = |name| match progress(name) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Interrupted),
    };
    let mut session = CalibrationSession::new(frames);
    session.set_settle(session::CAREFUL);
    let white = session.filled(session.top());
    step("exposure")?;
    let exposure = exposure::fill(&mut session, &white)?;
    step("latency")?;
    let short = session.allowed(0.25 * exposure);
    let latency = session::latency(&mut session, short)?;
    let settle = latency.settle.value * SETTLE_MARGIN;
    session.set_settle(settle);
    step("camera")?;
    let camera = camera::camera(&mut session, &white, exposure)?;
    let model = CameraModel::of(&camera.response, exposure, options.takes);
    let most_levels = options.levels.unwrap_or_else(|| ramp::levels_for(settle + exposure));
    let mut ramps: Vec<Ramp> = Vec::new();
    for channel in 0..session.projector().channels {
        step("projector")?;
        ramps.push(ramp::ramp(&mut session, &model, channel, most_levels)?);
    }
    step("pixel map")?;
    let (registration, map) = pixel_map::pixel_map(&mut session, &model, options.map)?;
    let curves: Vec<Vec<f64>> = ramps.iter().map(|ramp| ramp.curve.clone()).collect();
    let ratio = if options.coaxial {
        step("flat field")?;
        Some(flat_field::ratio(&mut session, &model, &curves, (&registration, map.error))?)
    } else {
        None
    };
    let whites = ramps[0].whites.clone();
    let white_error = ramps.iter().map(|ramp| ramp.white_error).fold(0.0, f64::max);
    let drift_per_hour = ramp::drift_per_hour(&whites, white_error)?;
    let watched = whites.last().map_or(0.0, |last| last.0) - whites.first().map_or(0.0, |first| first.0);
    let calibration = Calibration {
        projector_info: session.projector().clone(),
        camera_info: session.camera().clone(),
        projector: curves,
        camera: camera.response,
        registration,
        flat_field: ratio.as_ref().map(|ratio| FlatField::of_ratio(&ratio.values)).transpose()?,
        stability: Stability { settle, drift_per_hour: drift_per_hour.value },
    };
    let report = CalibrationReport {
        stability: StabilityFigures {
            settle: latency.settle,
            drift_per_hour,
            watched,
            white_noise: camera.white_noise,
            whites,
            sweep: latency.sweep,
        },
        camera: camera.figures,
        projector: ramps.into_iter().map(|ramp| ramp.figures).collect(),
        map,
        evenness: ratio.map(|ratio| ratio.range),
        effort: session.effort(),
    };
    Ok((calibration, report))
}
