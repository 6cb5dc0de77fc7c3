//! The description of a virtual rig, including all imperfections. By default there are no imperfections.

use std::path::PathBuf;

use serde::Deserialize;

use super::world::{Iris, Pulse};
use crate::image::Resolution;
use crate::transport::Channels;

/// A description of a simulated scene behind imperfect devices.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualRig {
    /// The scene.
    pub scene: VirtualScene,
    /// The projector.
    pub projector: VirtualProjector,
    /// The camera.
    pub camera: VirtualCamera,
    /// The beam splitter between projector and camera.
    pub splitter: Splitter,
    /// Light that does not come from the projector.
    pub ambient: Ambient,
    /// The change of the projector's brightness with time.
    pub drift: Drift,
    /// The camera's frames that fail.
    pub faults: Faults,
    /// The seed of all random numbers of the devices. Equal seeds give identical counts.
    pub seed: u64,
}

/// The source of a virtual rig's light transport.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum VirtualScene {
    /// A scene file, which krylux traces.
    File {
        /// The scene file.
        path: PathBuf,
        /// The name of the scene's camera whose pose the rig takes. `None`: the scene's only camera.
        camera: Option<String>,
        /// A camera file with poses of camera and projector that replace the poses in the scene. `None`: the poses in the scene.
        camera_file: Option<PathBuf>,
        /// The number of pixels of the projector, and of the photo before the camera resamples it.
        size: Resolution,
        /// Light paths per pixel.
        samples: u32,
        /// The largest number of surface hits of a path.
        max_bounces: u32,
        /// The seed of the tracer's random numbers.
        seed: u32,
    },
    /// A light transport matrix from a file, which needs no graphics device.
    Matrix {
        /// The file of the matrix, which must be square with one channel.
        path: PathBuf,
        /// The number of pixels of the projector, and of the photo before the camera resamples it.
        size: Resolution,
    },
}

impl VirtualScene {
    /// The number of pixels of the projector, and of the photo before the camera resamples it.
    pub fn size(&self) -> Resolution {
        match self {
            Self::File { size, .. } | Self::Matrix { size, .. } => *size,
        }
    }
}

/// A description of a virtual projector. Level `l` of `L` levels emits the fraction `b + (1 − b) · response(l / (L − 1))` of white,
/// where `b` is the black level.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VirtualProjector {
    /// Bits of a level, 1 to 12.
    pub bits: u32,
    /// 1 (gray) or 3.
    pub channels: usize,
    /// The exponent of the response `x^gamma`. `None`: 1.
    pub gamma: Option<f64>,
    /// The response as light at equally spaced levels, from 0 to 1. It replaces `gamma`.
    pub curve: Option<Vec<f64>>,
    /// The fraction of white that level 0 emits.
    pub black_level: f64,
    /// The fraction by which the corners are darker than the centre. The loss grows with the square of the distance from the centre.
    pub vignetting: f64,
    /// Standard deviation of the Gaussian blur, in projector pixels.
    pub blur: f64,
    /// Seconds from a frame's confirmation until its light appears. Until then the previous frame's light remains.
    pub latency: f64,
    /// Seconds from one refresh to the next. Showing a frame takes this long.
    pub frame_time: f64,
    /// The light that the white segment of a colour wheel adds to gray, as a fraction of the light that red, green and blue have in common
    /// in a pixel. White is then brighter than red, green and blue together by this fraction. Light is still measured relative to white.
    pub white_segment: f64,
    /// The automatic iris, by which the brightness follows the frame.
    pub iris: Iris,
    /// The pulses in which the light of a frame is emitted.
    pub pulse: Pulse,
    /// Whether the projector treats its levels as video levels: of 255, levels up to 16 are black, and levels from 235 on are white.
    pub limited_range: bool,
    /// The fraction of the frame's width and height that is cut off, half of it at each end. The remainder is stretched to the full field.
    pub overscan: f64,
}

impl Default for VirtualProjector {
    fn default() -> Self {
        Self {
            bits: 8,
            channels: 1,
            gamma: None,
            curve: None,
            black_level: 0.0,
            vignetting: 0.0,
            blur: 0.0,
            latency: 0.0,
            frame_time: 0.0,
            white_segment: 0.0,
            iris: Iris::default(),
            pulse: Pulse::default(),
            limited_range: false,
            overscan: 0.0,
        }
    }
}

/// A description of a virtual camera. After an exposure of `t` seconds to `light`, a pixel holds
/// `e = Poisson(t · (sensitivity · light + dark_current))` electrons. Its count is
/// `black_level + (2^bits − 1 − black_level) · (response(e / full_well) + Normal(read_noise / full_well))`, rounded and clamped to \[0,
/// saturation\]. The full well is the saturation capacity of EMVA 1288.
///
/// The sensitivity is chosen so that the white photo (without ambient light and drift) fills the fraction `white_fill` of the full well
/// within `white_exposure` seconds, at the 99th percentile of the pixels.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VirtualCamera {
    /// Width and height in pixels. `None`: the size of the scene.
    pub size: Option<[usize; 2]>,
    /// 1 (mono) or 3.
    pub channels: usize,
    /// Bits of a count, 8 to 16.
    pub bits: u32,
    /// The count without light.
    pub black_level: f64,
    /// The highest count. `None`: `2^bits − 1`.
    pub saturation: Option<u16>,
    /// The number of electrons at which all bits of the count are set.
    pub full_well: f64,
    /// The fraction of the full well that the white photo fills in `white_exposure` seconds.
    pub white_fill: f64,
    /// The exposure, in seconds, in which the white photo fills the fraction `white_fill` of the full well.
    pub white_exposure: f64,
    /// Whether the number of electrons follows a Poisson distribution.
    pub shot_noise: bool,
    /// Standard deviation of the read noise in electrons.
    pub read_noise: f64,
    /// Electrons per second without light.
    pub dark_current: f64,
    /// The fraction by which the corners are less sensitive than the centre. The loss grows with the square of the distance from the
    /// centre.
    pub vignetting: f64,
    /// Standard deviation of the Gaussian blur of the camera's lens, in camera pixels.
    pub blur: f64,
    /// Seconds between the times at which the first and the last row begin an exposure; 0: all rows begin at once.
    pub rolling_shutter: f64,
    /// The exponent of the response `x^gamma`. `None`: 1.
    pub gamma: Option<f64>,
    /// The response as counts at equally spaced light, from 0 to 1. It replaces `gamma`.
    pub curve: Option<Vec<f64>>,
    /// The shortest and the longest exposure in seconds.
    pub exposures: [f64; 2],
    /// The step of exposures in seconds. Every exposure is a whole multiple of this step; 0: every exposure is possible.
    pub exposure_step: f64,
    /// Seconds from the end of an exposure until the frame arrives.
    pub readout: f64,
    /// Seconds to wait for a frame that does not arrive.
    pub timeout: f64,
    /// The response of each camera channel (row) to each projector channel (column). `None`: the identity.
    pub crosstalk: Option<[[f64; 3]; 3]>,
    /// The shift of the camera's view to the right and down, in projector pixels (see [`VirtualCamera::sees`]).
    pub shift: [f64; 2],
    /// The rotation in degrees, clockwise in the picture.
    pub rotation: f64,
    /// The scale. A camera with a scale above 1 sees more than the projector's field.
    pub scale: f64,
    /// The rows of a matrix that maps homogeneous positions in projector pixels. The matrix replaces `shift`, `rotation` and `scale`.
    pub homography: Option<[[f64; 3]; 3]>,
    /// The radial distortion `k₁`.
    pub distortion: f64,
}

impl Default for VirtualCamera {
    fn default() -> Self {
        Self {
            size: None,
            channels: 1,
            bits: 16,
            black_level: 0.0,
            saturation: None,
            full_well: 60_000.0,
            white_fill: 0.5,
            white_exposure: 0.1,
            shot_noise: false,
            read_noise: 0.0,
            dark_current: 0.0,
            vignetting: 0.0,
            blur: 0.0,
            rolling_shutter: 0.0,
            gamma: None,
            curve: None,
            exposures: [1e-5, 100.0],
            exposure_step: 0.0,
            readout: 0.0,
            timeout: 1.0,
            crosstalk: None,
            shift: [0.0; 2],
            rotation: 0.0,
            scale: 1.0,
            homography: None,
            distortion: 0.0,
        }
    }
}

fn response(gamma: Option<f64>, curve: Option<&Vec<f64>>) -> Response {
    match curve {
        Some(values) => Response::Curve(values.clone()),
        None => Response::Gamma(gamma.unwrap_or(1.0)),
    }
}

impl VirtualProjector {
    /// The emitted light, without the black level, as a function of the level. Both go from 0 to 1.
    pub fn response(&self) -> Response {
        response(self.gamma, self.curve.as_ref())
    }
}

impl VirtualCamera {
    /// The count as a function of the electrons. Both go from 0 to 1.
    pub fn response(&self) -> Response {
        response(self.gamma, self.curve.as_ref())
    }

    /// The highest count.
    pub fn highest(&self) -> u16 {
        self.saturation.unwrap_or(((1_u32 << self.bits) - 1) as u16)
    }
}

impl VirtualRig {
    /// A rig without imperfections for this scene, with a projector of 8 bits and a camera of 16 bits.
    pub fn ideal(scene: VirtualScene) -> Self {
        Self {
            scene,
            projector: VirtualProjector::default(),
            camera: VirtualCamera::default(),
            splitter: Splitter::default(),
            ambient: Ambient::default(),
            drift: Drift::default(),
            faults: Faults::default(),
            seed: 0,
        }
    }

    /// The channels of light transport that the rig needs: `Rgb` if one of the devices has colour.
    pub fn channels(&self) -> Channels {
        if self.projector.channels.max(self.camera.channels) > 1 { Channels::Rgb } else { Channels::Luma }
    }
}

/// A curve through (0, 0) and (1, 1).
#[derive(Clone, Debug, PartialEq)]
pub enum Response {
    /// The power `y = x^gamma`; 1 is linear.
    Gamma(f64),
    /// At least two values at equally spaced `x` from 0 to 1, with linear interpolation between them.
    Curve(Vec<f64>),
}

impl Response {
    /// The value at `x`, which is clamped to \[0, 1\]. The values at both ends are exact.
    pub fn at(&self, x: f64) -> f64 {
        let x = x.clamp(0.0, 1.0);
        match self {
            Self::Gamma(1.0) => x,
            Self::Gamma(gamma) => x.powf(*gamma),
            Self::Curve(values) => {
                let last = values.len() - 1;
                let at = x * last as f64;
                let below = (at as usize).min(last - 1);
                let share = at - below as f64;
                (1.0 - share) * values[below] + share * values[below + 1]
            }
        }
    }
}

/// The faults of the beam splitter that the camera looks through. By default there are no faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Splitter {
    /// The fraction of the light that forms a second image of the scene, reflected at the back of the splitter.
    pub ghost: f64,
    /// The displacement of the second image to the right and down, in projector pixels.
    pub ghost_shift: [f64; 2],
    /// The projector's light that reaches all camera pixels evenly without the scene, for instance because a light trap reflects. For a
    /// white frame, the stray light is this fraction of the mean of the white photo. In general, it is proportional to the frame's mean
    /// light.
    pub stray: f64,
}

/// Light that does not come from the projector. It is equal at all camera pixels, except for the camera's vignetting.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ambient {
    /// The level relative to the mean of the white photo.
    pub level: f64,
    /// The relative amplitude of the sinusoidal variation of the level with time. A photo contains the mean light over its exposure.
    pub variation: f64,
    /// The period of the sine in seconds.
    pub period: f64,
}

/// The change of the projector's brightness with time `t`: `(1 + per_hour · t / 3600)(1 + swing · sin(2π t / period))`. A photo contains
/// the mean light over its exposure.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Drift {
    /// The relative change per hour.
    pub per_hour: f64,
    /// The relative amplitude of the sine.
    pub swing: f64,
    /// The period of the sine in seconds.
    pub period: f64,
}

/// The frames that fail. Each fault is given either by its probability or by the numbers of the frames, which count from 1. With a
/// probability, the seed and the frame's number select the frames.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Faults {
    /// The probability that a frame does not arrive.
    pub dropped: f64,
    /// The probability that the previous frame arrives again in place of a frame.
    pub repeated: f64,
    /// The probability that a frame arrives that was exposed before the last pattern was shown.
    pub late: f64,
    /// The probability that a frame's exposure began when the last pattern was confirmed, before the pattern settled.
    pub early: f64,
    /// The frames that do not arrive.
    pub dropped_frames: Vec<u64>,
    /// The frames that are replaced by the previous frame.
    pub repeated_frames: Vec<u64>,
    /// The frames that were exposed before the last pattern was shown.
    pub late_frames: Vec<u64>,
    /// The frames whose exposure did not wait for the pattern to settle.
    pub early_frames: Vec<u64>,
    /// The frames after which the camera hangs until it is restarted.
    pub freeze_after: Vec<u64>,
    /// Whether a restart does not help a camera that hangs.
    pub freeze_for_good: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_meets_its_values_and_is_linear_between() {
        let curve = Response::Curve(vec![0.0, 0.1, 1.0]);
        assert_eq!([0.0, 0.5, 1.0, 2.0, -1.0].map(|x| curve.at(x)), [0.0, 0.1, 1.0, 1.0, 0.0]);
        assert!((curve.at(0.75) - 0.55).abs() < 1e-15);
        assert_eq!([0.0, 0.5, 1.0].map(|x| Response::Gamma(2.0).at(x)), [0.0, 0.25, 1.0]);
    }
}
