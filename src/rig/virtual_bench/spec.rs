//! What is written about a virtual rig: every imperfection, at its default none at all.

use std::path::PathBuf;

use serde::Deserialize;

use super::Response;
use super::conditions::{Ambient, Drift, Faults};
use crate::image::Resolution;
use crate::transport::Channels;

/// A simulated scene behind imperfect devices.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualRig {
    /// What is lit and seen.
    pub scene: VirtualScene,
    /// What shows.
    pub projector: VirtualProjector,
    /// What sees.
    pub camera: VirtualCamera,
    /// Light that does not come from the projector.
    pub ambient: Ambient,
    /// How the projector's brightness wanders.
    pub drift: Drift,
    /// Frames that go wrong.
    pub faults: Faults,
    /// Selects all random numbers of the devices; equal seeds give equal bits.
    pub seed: u64,
}

/// Where the light of a virtual rig is computed from.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum VirtualScene {
    /// A scene, traced.
    File {
        /// The scene.
        path: PathBuf,
        /// The scene's camera to stand the rig at; it may be left out when there is only one.
        camera: Option<String>,
        /// A file that says where camera and projector stand, instead of the scene's own.
        camera_file: Option<PathBuf>,
        /// The projector's pixels, and the photo's before the camera resamples it.
        size: Resolution,
        /// Light paths per pixel.
        samples: u32,
        /// Surfaces that a path meets at most.
        max_bounces: u32,
        /// Selects the random numbers of the tracer.
        seed: u32,
    },
    /// A light transport matrix from a file: it needs no graphics device.
    Matrix {
        /// The matrix, square, of one channel.
        path: PathBuf,
        /// The projector's pixels, and the photo's before the camera resamples it.
        size: Resolution,
    },
}

impl VirtualScene {
    /// The projector's pixels, and the photo's before the camera resamples it.
    pub fn size(&self) -> Resolution {
        match self {
            Self::File { size, .. } | Self::Matrix { size, .. } => *size,
        }
    }
}

/// A virtual projector. Level `l` of `L` emits `b + (1 − b) · response(l / (L − 1))` of white, with the black level `b`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VirtualProjector {
    /// Bits of a level, 1 to 12.
    pub bits: u32,
    /// 1 (gray) or 3.
    pub channels: usize,
    /// The response `x^gamma`.
    pub gamma: Option<f64>,
    /// The response as light at equally spaced levels, from 0 to 1, instead of a gamma.
    pub curve: Option<Vec<f64>>,
    /// The share of white that level 0 still emits.
    pub black_level: f64,
    /// By which share it is darker in the corners than in the centre; it falls off with the square of the distance.
    pub vignetting: f64,
    /// Standard deviation of its Gaussian blur, in its pixels.
    pub blur: f64,
    /// Seconds from a frame's confirmation until its light is there. Before that, it is the old frame's.
    pub latency: f64,
    /// Seconds from one refresh to the next: what showing a frame takes.
    pub frame_time: f64,
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
        }
    }
}

/// A virtual camera. After an exposure of `t` seconds to `light`, a pixel holds
/// `e = Poisson(t · (sensitivity · light + dark_current))` electrons, and its count is
/// `black_level + (2^bits − 1 − black_level) · (response(e / full_well) + Normal(read_noise / full_well))`, rounded and
/// brought to \[0, saturation\]: the full well is the saturation capacity of EMVA 1288, what is more spills over.
///
/// The sensitivity is such that the white photo (in the dark, at no drift) fills `white_fill` of the full well within
/// `white_exposure` seconds, at the brightest pixels but 1 in 100.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VirtualCamera {
    /// Width and height in pixels; none: the scene's.
    pub size: Option<[usize; 2]>,
    /// 1 (mono) or 3.
    pub channels: usize,
    /// Bits of a count, 8 to 16.
    pub bits: u32,
    /// The count without light.
    pub black_level: f64,
    /// The highest count; none: all bits set.
    pub saturation: Option<u16>,
    /// Electrons that a pixel can hold: at these, all bits are set.
    pub full_well: f64,
    /// The share of the full well that white fills in `white_exposure` seconds.
    pub white_fill: f64,
    /// See `white_fill`.
    pub white_exposure: f64,
    /// Whether photons come one by one.
    pub shot_noise: bool,
    /// Standard deviation in electrons.
    pub read_noise: f64,
    /// Electrons per second without light.
    pub dark_current: f64,
    /// By which share it is less sensitive in the corners than in the centre; it falls off with the square of the distance.
    pub vignetting: f64,
    /// The response `x^gamma`.
    pub gamma: Option<f64>,
    /// The response as counts at equally spaced light, from 0 to 1, instead of a gamma.
    pub curve: Option<Vec<f64>>,
    /// The shortest and the longest exposure in seconds.
    pub exposures: [f64; 2],
    /// Exposures are whole multiples of this many seconds; 0: any.
    pub exposure_step: f64,
    /// Seconds from the end of an exposure until the frame is there.
    pub readout: f64,
    /// Seconds after which a frame that does not come is given up.
    pub timeout: f64,
    /// What each of its three channels sees of each of the projector's three, a row for each of its own; none: of the same alone.
    pub crosstalk: Option<[[f64; 3]; 3]>,
    /// See [`Misregistration`].
    pub shift: [f64; 2],
    /// See [`Misregistration`].
    pub rotation: f64,
    /// See [`Misregistration`].
    pub scale: f64,
    /// See [`Misregistration`].
    pub homography: Option<[[f64; 3]; 3]>,
    /// See [`Misregistration`].
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

/// Where a camera pixel looks, if not where it should.
///
/// Both rasters cover the same field, so that a point of the camera's lies at a point `q` of the photo's raster, in projector
/// pixels from its top left corner. There it would look without fault. It looks at `H(c + (q − c)(1 + k₁ r²))`, with the
/// centre `c` of the field and `r` the distance from it relative to the corner's. `H` turns by `rotation` degrees (clockwise
/// as seen) and scales about the centre, then shifts; or is the given homography, of the same coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Misregistration {
    /// To the right and down, in projector pixels.
    pub shift: [f64; 2],
    /// Degrees.
    pub rotation: f64,
    /// More than 1: it sees more than the field.
    pub scale: f64,
    /// Instead of the three above: rows of a matrix on homogeneous positions in projector pixels.
    pub homography: Option<[[f64; 3]; 3]>,
    /// `k₁`.
    pub distortion: f64,
}

fn response(gamma: Option<f64>, curve: Option<&Vec<f64>>) -> Response {
    match curve {
        Some(values) => Response::Curve(values.clone()),
        None => Response::Gamma(gamma.unwrap_or(1.0)),
    }
}

impl VirtualProjector {
    /// Light against level, both from 0 to 1, without the black level.
    pub fn response(&self) -> Response {
        response(self.gamma, self.curve.as_ref())
    }
}

impl VirtualCamera {
    /// Counts against electrons, both from 0 to 1.
    pub fn response(&self) -> Response {
        response(self.gamma, self.curve.as_ref())
    }

    /// Where its pixels look.
    pub fn misregistration(&self) -> Misregistration {
        let Self { shift, rotation, scale, homography, distortion, .. } = *self;
        Misregistration { shift, rotation, scale, homography, distortion }
    }

    /// The highest count.
    pub fn highest(&self) -> u16 {
        self.saturation.unwrap_or(((1_u32 << self.bits) - 1) as u16)
    }
}

impl VirtualRig {
    /// Devices without fault, of 8 and 16 bits, on this scene.
    pub fn ideal(scene: VirtualScene) -> Self {
        Self {
            scene,
            projector: VirtualProjector::default(),
            camera: VirtualCamera::default(),
            ambient: Ambient::default(),
            drift: Drift::default(),
            faults: Faults::default(),
            seed: 0,
        }
    }

    /// The light transport that it needs: coloured as soon as one of the devices is.
    pub fn channels(&self) -> Channels {
        if self.projector.channels.max(self.camera.channels) > 1 { Channels::Rgb } else { Channels::Luma }
    }
}
