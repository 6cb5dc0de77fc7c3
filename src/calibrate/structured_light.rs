//! Gray codes, and structured light without a full calibration. The measurement can be repeated as often as needed while a bench is set up.

use super::camera::transfer;
use super::exposure::{WhiteExposure, fill, search};
use super::map_fit::{Fit, fit};
use super::pixel_map::coarse;
use super::session::{CalibrationSession, CameraModel, Linear, Mean};
use crate::error::Result;
use crate::image::{Resolution, percentile};
use crate::measure::lens_map::{Match, centre};
use crate::measure::{CameraResponse, FrameSource};
use crate::rig::RawFrame;

/// The number of pairs of equal frames at each of three brightnesses, from which the noise is measured when no calibration is known.
const PAIRS: usize = 2;

/// When no calibration is known, counts of at least this fraction of the range are regarded as saturated.
const LIMIT: f64 = 0.98;

/// Takes photos of structured light on an open rig, all with one exposure. Photos are in linear DN, summed over the camera's channels.
pub struct StructuredLight<'a> {
    session: CalibrationSession<'a>,
    model: CameraModel,
}

impl<'a> StructuredLight<'a> {
    /// Takes photos from `frames` with the given exposure in seconds, or else with the exposure at which white fills the camera's range.
    /// When the camera's response is not `known`, black level and noise are measured from a few photos, and the response is assumed to be
    /// linear.
    ///
    /// # Errors
    /// [`crate::Error::Rig`] when the rig fails or does not see white; [`crate::Error::Saturated`] when white always saturates the camera.
    pub fn new(
        frames: &'a mut dyn FrameSource,
        known: Option<&CameraResponse>,
        exposure: Option<f64>,
    ) -> Result<Self> {
        let mut session = CalibrationSession::new(frames);
        let white = session.filled(session.top());
        let exposure = exposure.map_or_else(|| fill(&mut session, &white), Ok)?;
        if let Some(known) = known {
            return Ok(Self { session, model: CameraModel::of(known, exposure, 1) });
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
        let dark = pairs[0][0].percentile(0.5);
        let linear = Linear { black: dark, curve: None };
        let noise = transfer(&pairs, &linear, limit)?;
        let (gain, read_noise) = (noise.gain.value, noise.read_noise.value);
        let model = CameraModel { linear, gain, read_noise, limit, exposure, takes: 1 };
        Ok(Self { session, model })
    }

    /// The given exposure in seconds, or else the one at which white fills about 70 % of the camera's range; and whether the camera has such
    /// an exposure, which is not examined for a given one.
    pub fn white_exposure(given: Option<f64>, frames: &mut dyn FrameSource) -> Result<(f64, WhiteExposure)> {
        if let Some(exposure) = given {
            return Ok((exposure, WhiteExposure::Filled));
        }
        let mut session = CalibrationSession::new(frames);
        let white = session.filled(session.top());
        search(&mut session, &white)
    }

    /// The exposure of all photos, in seconds.
    pub fn exposure(&self) -> f64 {
        self.model.exposure
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
    pub fn codes(&mut self) -> Result<Decoded> {
        let coarse = coarse(self.camera(), self.projector());
        gray_code(&mut self.session, &self.model, coarse)
    }

    /// Fits the map from camera to projector on which most of the decoded pixels agree.
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

    /// Photographs a pattern whose pixels (column, row) are bright where `lit` is true. The photo has one value per camera pixel.
    pub fn photograph(&mut self, lit: impl Fn(usize, usize) -> bool) -> Result<Vec<f64>> {
        sum(&mut self.session, &self.model, lit)
    }

    /// The variance of a pixel of the photo, in linear DN², for `light` in linear DN.
    pub fn variance(&self, light: f64) -> f64 {
        let channels = self.session.camera().channels as f64;
        light.max(0.0) / self.model.gain + channels * (self.model.read_noise.powi(2) + 1.0 / 12.0)
    }
}

// Gray codes show which projector pixel each camera pixel sees. O'Toole and Kutulakos, section 8.1, call Gray patterns useful for finding
// the camera pixels in the footprint of a projector pixel, as an alternative to a checkerboard. The decoding is not in their text.
//
// The indices of columns and rows are projected bit by bit in Gray code, each bit together with its inverse. A camera pixel decodes a bit
// by comparing the two photos. Global light is nearly the same in both photos, because it does not resolve fine stripes. A bit is decided
// only if the difference of the two photos is a sufficient fraction of the direct light, which the finest stripes measure (Xu and Aliaga
// 2007). A camera pixel with an undecided bit is left out.

/// A bit is decided only when the difference of pattern and inverse is at least this fraction of the direct light.
const DECIDED: f64 = 0.25;

/// A bit is decided only when the difference is at least this many standard deviations of its noise.
pub(crate) const SIGMAS: f64 = 5.0;

/// A lit camera pixel has at least this fraction of the median light, which is taken over all pixels whose light exceeds the noise.
const LIT: f64 = 0.02;

/// A decoded camera pixel and the projector coordinates that it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecodedPixel {
    /// The index of the camera pixel.
    pub pixel: usize,
    /// The centre of the projector pixels that the camera pixel may see, in pixels from the top left corner of the raster.
    pub at: [f64; 2],
    /// The centroid of the projector pixels that the camera pixel sees, to fractions of a pixel. It follows from the contrast of the
    /// stripes whose edges the camera pixel sees.
    pub fine: [f64; 2],
}

/// The result of decoding Gray codes. Photos have one value per camera pixel, in linear DN summed over channels.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// The camera pixels that were decoded.
    pub seen: Vec<DecodedPixel>,
    /// The camera pixels at the edge between two steps of the code, so that one bit is undecided. Their `fine` coordinates are equally
    /// precise.
    pub between: Vec<DecodedPixel>,
    /// For each camera pixel, whether the projector lights it.
    pub lit: Vec<bool>,
    /// The fraction of lit pixels that were not decoded.
    pub unreliable: f64,
    /// The number of projector pixels per step of the decoded coordinates. It exceeds 1 when fine bits were left out.
    pub step: usize,
    /// The light of white minus the light of black.
    pub white: Vec<f64>,
    /// The light of black.
    pub black: Vec<f64>,
    /// The direct light: the part of `white` that follows the finest stripes.
    pub direct: Vec<f64>,
    /// The standard deviation of `white`, and of every other difference of two photos.
    pub noise: Vec<f64>,
    /// For each camera pixel, whether it is saturated under white.
    pub saturated: Vec<bool>,
    /// The differences for the two finest stripe patterns along each axis.
    pub stripes: Vec<Stripes>,
}

/// The photo of stripes minus the photo of the inverse stripes.
#[derive(Clone, Debug)]
pub struct Stripes {
    /// The axis along which the stripes alternate: 0 for columns, 1 for rows.
    pub axis: usize,
    /// The bit of the Gray code that the stripes show.
    pub bit: u32,
    /// The difference of the two photos, one value per camera pixel.
    pub difference: Vec<f64>,
}

pub(crate) fn gray_bit(index: usize, shift: u32) -> bool {
    ((index ^ (index >> 1)) >> shift) & 1 == 1
}

pub(crate) fn from_gray(code: usize) -> usize {
    let (mut index, mut rest) = (0, code);
    while rest != 0 {
        index ^= rest;
        rest >>= 1;
    }
    index
}

impl Decoded {
    /// All camera pixels with fractional coordinates: `seen`, then `between`.
    pub fn all(&self) -> impl Iterator<Item = &DecodedPixel> {
        self.seen.iter().chain(&self.between)
    }
}

/// Shows the codes and decodes them. The `coarse` finest bits of each axis are left out.
pub(crate) fn gray_code(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel,
    coarse: u32,
) -> Result<Decoded> {
    let Resolution { width, height } = session.projector().resolution;
    let (white, saturated) = photo(session, model, |_, _| true)?;
    let black = sum(session, model, |_, _| false)?;
    let difference: Vec<f64> = white.iter().zip(&black).map(|(white, black)| white - black).collect();
    let bits = [width, height].map(|size| usize::BITS - (size - 1).leading_zeros());
    let mut axes = Vec::new();
    for (axis, &bits) in bits.iter().enumerate() {
        let mut planes = Vec::new();
        for shift in coarse.min(bits.saturating_sub(1))..bits {
            let lit = |x: usize, y: usize| gray_bit([x, y][axis], shift);
            let pattern = sum(session, model, lit)?;
            let inverse = sum(session, model, |x, y| !lit(x, y))?;
            planes.push((shift, pattern.iter().zip(&inverse).map(|(p, q)| p - q).collect::<Vec<f64>>()));
        }
        axes.push(planes);
    }
    let channels = session.camera().channels as f64;
    let noise = |pixel: usize| {
        let electrons = (white[pixel] + black[pixel]).max(0.0) / model.gain;
        ((electrons + 2.0 * channels * model.read_noise.powi(2)) / f64::from(model.takes)).sqrt()
    };
    let noise: Vec<f64> = (0..difference.len()).map(noise).collect();
    let lit = lit(&difference, |pixel| noise[pixel]);
    let step = 1 << coarse;
    let direct: Vec<f64> = (0..difference.len())
        .map(|pixel| {
            let fine = axes.iter().flat_map(|planes| planes.iter().take(2)).map(|plane| plane.1[pixel].abs());
            fine.fold(0.0, f64::max)
        })
        .collect();
    let (mut seen, mut between) = (Vec::new(), Vec::new());
    for pixel in (0..difference.len()).filter(|&pixel| lit[pixel]) {
        let threshold = (DECIDED * direct[pixel]).max(SIGMAS * noise[pixel]);
        // Computes the centre and the centroid along an axis, and whether every bit is decided.
        let place = |axis: usize, size: usize| -> Option<(f64, f64, bool)> {
            let (mut code, mut undecided) = (0, 0);
            for (shift, plane) in &axes[axis] {
                let bit = 1 << (shift - coarse.min(*shift));
                code |= if plane[pixel] > 0.0 { bit } else { 0 };
                undecided |= if plane[pixel].abs() < threshold { bit } else { 0 };
            }
            let index = from_gray(code);
            // If a pixel sees the edge between two steps, the bit in which the two steps differ may stay undecided.
            if undecided != 0 && from_gray(code ^ undecided).abs_diff(index) != 1 {
                return None;
            }
            let from = index * step;
            let centre = 0.5 * (from + (from + step).min(size)) as f64;
            // Each edge between two steps appears in the stripes of exactly one bit.
            let beyond = |edge: usize| {
                let plane = axes[axis].get(edge.trailing_zeros() as usize).filter(|_| edge > 0);
                plane.map_or(0.0, |plane| 0.5 * (1.0 - (plane.1[pixel].abs() / direct[pixel]).min(1.0)))
            };
            let centroid = centre + step as f64 * (beyond(index + 1) - beyond(index));
            (from < size).then_some((centre, centroid, undecided == 0))
        };
        if let (Some(x), Some(y)) = (place(0, width), place(1, height)) {
            let found = DecodedPixel { pixel, at: [x.0, y.0], fine: [x.1, y.1] };
            if x.2 && y.2 { seen.push(found) } else { between.push(found) }
        }
    }
    let count = lit.iter().filter(|&&lit| lit).count();
    let unreliable = if count == 0 { 1.0 } else { 1.0 - seen.len() as f64 / count as f64 };
    let finest = |(axis, planes): (usize, Vec<(u32, Vec<f64>)>)| {
        planes.into_iter().take(2).map(move |(bit, difference)| Stripes { axis, bit, difference })
    };
    let stripes = axes.into_iter().enumerate().flat_map(finest).collect();
    let white = difference;
    Ok(Decoded { seen, between, lit, unreliable, step, white, black, direct, noise, saturated, stripes })
}

/// The photo of a pattern: linear DN of each camera pixel, summed over channels.
pub(crate) fn sum(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel,
    lit: impl Fn(usize, usize) -> bool,
) -> Result<Vec<f64>> {
    Ok(photo(session, model, lit)?.0)
}

/// The photo of a pattern, and for each camera pixel whether a channel is saturated.
pub(crate) fn photo(
    session: &mut CalibrationSession<'_>,
    model: &CameraModel,
    lit: impl Fn(usize, usize) -> bool,
) -> Result<(Vec<f64>, Vec<bool>)> {
    let frame = session.drawn(lit)?;
    let Mean { counts, peaks, .. } = session.mean(&frame, model.exposure, model.takes)?;
    let channels = session.camera().channels;
    let values = counts
        .chunks_exact(channels)
        .map(|pixel| pixel.iter().map(|&count| model.linear.of(count)).sum())
        .collect();
    let over = |pixel: &[u16]| pixel.iter().any(|&peak| f64::from(peak) >= model.limit);
    Ok((values, peaks.chunks_exact(channels).map(over).collect()))
}

/// For each camera pixel, whether the projector lights it. `difference` is the photo of white minus the photo of black.
fn lit(difference: &[f64], noise: impl Fn(usize) -> f64) -> Vec<bool> {
    let above: Vec<f64> = (0..difference.len())
        .filter(|&pixel| difference[pixel] > SIGMAS * noise(pixel))
        .map(|pixel| difference[pixel])
        .collect();
    let median = percentile(above, 0.5);
    (0..difference.len()).map(|pixel| difference[pixel] > (SIGMAS * noise(pixel)).max(LIT * median)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gray_codes_of_neighbours_differ_in_one_bit_and_decode_to_their_index() {
        let code = |index| (0..10).fold(0, |code, shift| code | usize::from(gray_bit(index, shift)) << shift);
        for index in 0..1000 {
            assert_eq!(from_gray(code(index)), index);
            assert_eq!((code(index) ^ code(index + 1)).count_ones(), 1);
        }
    }
}
