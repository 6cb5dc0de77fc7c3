//! Structured light without a whole calibration: exposure, Gray codes, and single photos, as often as needed
//! while a bench is set up.

use super::camera_model::CameraModel;
use super::exposure::{WhiteExposure, fill, search};
use super::gray_code::{Decoded, gray_code, photo};
use super::linear::Linear;
use super::map_fit::{Fit, fit};
use super::pixel_map::coarse;
use super::session::CalibrationSession;
use super::transfer::transfer;
use crate::error::Result;
use crate::image::{Resolution, percentile};
use crate::measure::footprint::by_overlap;
use crate::measure::lens_map::{Match, centre};
use crate::measure::{CameraResponse, FrameSource, Registration};
use crate::rig::RawFrame;

/// Pairs of equal frames at each of three brightnesses, by which the noise is measured when no calibration is
/// known.
const PAIRS: usize = 2;

/// Counts from this share of the range on are regarded as saturated when no calibration is known.
const LIMIT: f64 = 0.98;

/// Takes photos of structured light on an open rig. All photos have the same exposure; their values are
/// linear DN, summed over the camera's channels.
pub struct StructuredLight<'a> {
    session: CalibrationSession<'a>,
    linear: Linear,
    limit: f64,
    gain: f64,
    read_noise: f64,
    exposure: f64,
}

impl<'a> StructuredLight<'a> {
    /// Takes photos from `frames` with this exposure in seconds, or with the one at which white fills the
    /// camera's range. When the camera's response is not `known`, black level and noise are measured from a
    /// few photos, and the response is assumed to be linear.
    ///
    /// # Errors
    /// [`crate::Error::Rig`] when the rig fails or does not see white; [`crate::Error::Saturated`] when white
    /// saturates the camera at every exposure.
    pub fn new(
        frames: &'a mut dyn FrameSource,
        known: Option<&CameraResponse>,
        exposure: Option<f64>,
    ) -> Result<Self> {
        let mut session = CalibrationSession::new(frames);
        let white = session.filled(session.top());
        let exposure = match exposure {
            Some(exposure) => exposure,
            None => fill(&mut session, &white)?,
        };
        if let Some(known) = known {
            let linear = Linear { black: known.black, curve: known.curve.clone() };
            let CameraResponse { saturation, gain, read_noise, .. } = *known;
            return Ok(Self { session, linear, limit: saturation, gain, read_noise, exposure });
        }
        let shortest = session.camera().exposures[0];
        let black = session.filled(0);
        let limit = LIMIT * session.full();
        let mut pairs: Vec<[RawFrame; 2]> = Vec::new();
        for (frame, exposure) in [(&black, shortest), (&white, 0.25 * exposure), (&white, exposure)] {
            for _ in 0..PAIRS {
                let exposure = session.allowed(exposure);
                pairs.push([session.capture(frame, exposure)?, session.capture(frame, exposure)?]);
            }
        }
        let dark = percentile(pairs[0][0].counts.iter().map(|&count| count.into()), 0.5);
        let linear = Linear { black: dark, curve: None };
        let noise = transfer(&pairs, &linear, limit)?;
        let (gain, read_noise) = (noise.gain.value, noise.read_noise.value);
        Ok(Self { session, linear, limit, gain, read_noise, exposure })
    }

    /// The exposure in seconds at which white fills about 70 % of the camera's range, and whether the camera
    /// has one.
    ///
    /// # Errors
    /// Those of taking frames.
    pub fn white_exposure(frames: &mut dyn FrameSource) -> Result<(f64, WhiteExposure)> {
        let mut session = CalibrationSession::new(frames);
        let white = session.filled(session.top());
        search(&mut session, &white)
    }

    /// The exposure of all photos, in seconds.
    pub fn exposure(&self) -> f64 {
        self.exposure
    }

    /// The camera's pixels.
    pub fn camera(&self) -> Resolution {
        self.session.camera().resolution
    }

    /// The projector's pixels.
    pub fn projector(&self) -> Resolution {
        self.session.projector().resolution
    }

    /// Shows Gray codes, and decodes which projector pixel each camera pixel sees.
    ///
    /// # Errors
    /// Those of taking frames.
    pub fn codes(&mut self) -> Result<Decoded> {
        let coarse = coarse(self.camera(), self.projector());
        let Self { session, linear, limit, gain, read_noise, exposure } = self;
        gray_code(session, &model(linear, *limit, [*gain, *read_noise, *exposure]), coarse)
    }

    /// The map from camera to projector that most of the decoded pixels agree on.
    ///
    /// # Errors
    /// [`crate::Error::Rig`] when there is no such map.
    pub fn fit(&self, decoded: &Decoded) -> Result<Fit> {
        let camera = self.camera();
        let matches: Vec<Match> = decoded
            .all()
            .map(|seen| Match { camera: centre(seen.pixel, camera), projector: seen.fine })
            .collect();
        fit(&matches, camera, self.projector(), 0.41 * decoded.step as f64)
    }

    /// The photo of a pattern of the pixels (column, row) that are `lit`: one value per camera pixel.
    ///
    /// # Errors
    /// Those of taking frames.
    pub fn photograph(&mut self, lit: impl Fn(usize, usize) -> bool) -> Result<Vec<f64>> {
        let Self { session, linear, limit, gain, read_noise, exposure } = self;
        Ok(photo(session, &model(linear, *limit, [*gain, *read_noise, *exposure]), lit)?.0)
    }

    /// The variance of a photo's value, in linear DN², where the light is this many linear DN.
    pub fn variance(&self, light: f64) -> f64 {
        let channels = self.session.camera().channels as f64;
        light.max(0.0) / self.gain + channels * (self.read_noise.powi(2) + 1.0 / 12.0)
    }
}

impl Fit {
    /// The pixel map that follows from this lens map: which camera pixels see each projector pixel. Camera
    /// pixels that are not `used` are left out.
    pub fn footprints(&self, used: &[bool]) -> Registration {
        by_overlap(&self.map, used)
    }
}

fn model(linear: &Linear, limit: f64, [gain, read_noise, exposure]: [f64; 3]) -> CameraModel<'_> {
    CameraModel { linear, gain, read_noise, limit, exposure, takes: 1 }
}
