//! A rig looked at without a whole calibration: exposure, codes, and single photos, again and again while somebody moves it.

use super::exposure::{WhiteExposure, fill, search};
use super::footprint::by_overlap;
use super::gray_code::{Decoded, Light, gray_code, photo};
use super::lens_map::{Match, centre};
use super::linear::Linear;
use super::map_fit::{Fit, fit};
use super::pixel_map::coarse;
use super::session::{CalibrationSession, percentile};
use super::transfer::transfer;
use crate::error::Result;
use crate::image::Resolution;
use crate::measure::{CameraResponse, FrameSource, Registration};
use crate::rig::RawFrame;

/// Pairs of equal frames that tell the noise where no calibration does, at each of three brightnesses.
const PAIRS: usize = 2;

/// Share of the range from which on counts are taken for saturated where no calibration says.
const LIMIT: f64 = 0.98;

/// Looks at a rig. All photos are of one exposure, in linear DN summed over the camera's channels.
pub struct Observer<'a> {
    sitting: CalibrationSession<'a>,
    linear: Linear,
    limit: f64,
    gain: f64,
    read_noise: f64,
    exposure: f64,
}

impl<'a> Observer<'a> {
    /// Looks through `shots` at this exposure, or at the one that white fills the range in. What is not known of the camera is told
    /// from a few photos: its black level and its noise, and its response is taken for a line.
    ///
    /// # Errors
    /// As calibration: when the rig fails, or white cannot be exposed.
    pub fn new(
        shots: &'a mut dyn FrameSource,
        known: Option<&CameraResponse>,
        exposure: Option<f64>,
    ) -> Result<Self> {
        let mut sitting = CalibrationSession::new(shots);
        let white = sitting.filled(sitting.top());
        let exposure = match exposure {
            Some(exposure) => exposure,
            None => fill(&mut sitting, &white)?,
        };
        if let Some(known) = known {
            let linear = Linear { black: known.black, curve: known.curve.clone() };
            let CameraResponse { saturation, gain, read_noise, .. } = *known;
            return Ok(Self { sitting, linear, limit: saturation, gain, read_noise, exposure });
        }
        let shortest = sitting.camera().exposures[0];
        let black = sitting.filled(0);
        let limit = LIMIT * sitting.full();
        let mut pairs: Vec<[RawFrame; 2]> = Vec::new();
        for (frame, exposure) in [(&black, shortest), (&white, 0.25 * exposure), (&white, exposure)] {
            for _ in 0..PAIRS {
                let exposure = sitting.allowed(exposure);
                pairs.push([sitting.capture(frame, exposure)?, sitting.capture(frame, exposure)?]);
            }
        }
        let dark = percentile(pairs[0][0].counts.iter().map(|&count| count.into()), 0.5);
        let linear = Linear { black: dark, curve: None };
        let noise = transfer(&pairs, &linear, limit)?;
        let (gain, read_noise) = (noise.gain.value, noise.read_noise.value);
        Ok(Self { sitting, linear, limit, gain, read_noise, exposure })
    }

    /// The exposure at which white fills the range as far as can be, in seconds, and how far that is.
    ///
    /// # Errors
    /// Whatever keeps frames from being taken.
    pub fn white_exposure(shots: &mut dyn FrameSource) -> Result<(f64, WhiteExposure)> {
        let mut sitting = CalibrationSession::new(shots);
        let white = sitting.filled(sitting.top());
        search(&mut sitting, &white)
    }

    /// Seconds of each exposure.
    pub fn exposure(&self) -> f64 {
        self.exposure
    }

    /// The camera's pixels.
    pub fn camera(&self) -> Resolution {
        self.sitting.camera().resolution
    }

    /// The projector's pixels.
    pub fn projector(&self) -> Resolution {
        self.sitting.projector().resolution
    }

    /// Shows Gray codes, and decodes which projector pixel each camera pixel looks at.
    ///
    /// # Errors
    /// Whatever keeps frames from being taken.
    pub fn codes(&mut self) -> Result<Decoded> {
        let coarse = coarse(self.camera(), self.projector());
        let Self { sitting, linear, limit, gain, read_noise, exposure } = self;
        gray_code(sitting, &light(linear, *limit, [*gain, *read_noise, *exposure]), coarse)
    }

    /// The map that most of the decoded pixels agree on.
    ///
    /// # Errors
    /// [`crate::Error::Rig`] when there is none.
    pub fn fit(&self, decoded: &Decoded) -> Result<Fit> {
        let camera = self.camera();
        let matches: Vec<Match> = decoded
            .all()
            .map(|seen| Match { camera: centre(seen.pixel, camera), projector: seen.fine })
            .collect();
        fit(&matches, camera, self.projector(), 0.41 * decoded.step as f64)
    }

    /// The photo of a pattern that is lit where `lit` says so, by column and row: an entry for each camera pixel.
    ///
    /// # Errors
    /// Whatever keeps frames from being taken.
    pub fn photograph(&mut self, lit: impl Fn(usize, usize) -> bool) -> Result<Vec<f64>> {
        let Self { sitting, linear, limit, gain, read_noise, exposure } = self;
        Ok(photo(sitting, &light(linear, *limit, [*gain, *read_noise, *exposure]), lit)?.0)
    }

    /// The variance of one photo's entry of so much light.
    pub fn variance(&self, light: f64) -> f64 {
        let channels = self.sitting.camera().channels as f64;
        light.max(0.0) / self.gain + channels * (self.read_noise.powi(2) + 1.0 / 12.0)
    }
}

impl Fit {
    /// Which camera pixels see each projector pixel by this map; those that are not `used` do not count.
    pub fn footprints(&self, used: &[bool]) -> Registration {
        by_overlap(&self.map, used)
    }
}

fn light(linear: &Linear, limit: f64, [gain, read_noise, exposure]: [f64; 3]) -> Light<'_> {
    Light { linear, gain, read_noise, exposure, takes: 1, limit }
}
