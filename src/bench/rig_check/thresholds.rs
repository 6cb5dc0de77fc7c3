//! The bounds at which a finding of the check becomes a warning or a failure.

/// An exposure may differ from a whole number of projector refreshes by this share of one refresh.
pub const REFRESH_FRACTION: f64 = 0.02;

/// The check warns when there is disk space for fewer photos. This is a long session: a capture with several exposures and takes, its
/// calibration, and a second try.
pub const SESSION_PHOTOS: u64 = 5000;

/// The check fails when there is disk space for fewer photos than this, because not even one capture fits.
pub const MIN_PHOTOS: u64 = 200;

/// The check warns when white's 98th percentile is below this share of the camera's range. Most of the range is then unused.
pub const DIM_WHITE: f64 = 0.2;

/// The check fails when white's 98th percentile is below this share of the camera's range. The camera then does not see the projector.
pub const INVISIBLE_WHITE: f64 = 0.01;

/// The check warns when more than this share of white's samples is saturated.
pub const SATURATED_WARNING: f64 = 0.01;

/// The check fails when more than this share of white's samples is saturated.
pub const SATURATED_FAILURE: f64 = 0.1;

/// The check warns when the light without a pattern exceeds this share of white's light, which adds a tenth to the noise of white.
pub const AMBIENT: f64 = 0.2;

/// The check warns when drift and flicker change white by more than this share between photos. `krylux audit` has the same bound.
pub const REPEATABILITY: f64 = 0.01;

/// The check fails when white right after black has less light than a repeated white by more than this share. The latency measurement of
/// the calibration has the same tolerance.
pub const SETTLING: f64 = 2e-3;

/// The check warns when a photo's noise, as a multiple of the noise that the calibration predicts, is outside this interval.
pub const NOISE_RATIO: [f64; 2] = [0.8, 1.25];

/// The check warns when the error of the pixel map exceeds this many projector pixels. The calibration promises this accuracy.
pub const MAP_OFFSET_WARNING: f64 = 0.1;

/// The check fails when the error of the pixel map exceeds this many projector pixels. A third of the direct light is then assigned to a
/// neighbouring pixel.
pub const MAP_OFFSET_FAILURE: f64 = 0.3;

/// The check fails when the correlation of a photo of a random pattern with the pattern is less than this.
pub const MIN_CORRELATION: f64 = 0.5;

/// The bound on an automatic iris: the sum of the quadrants of white may differ from white by this share.
pub const IRIS: f64 = 0.02;

/// The same as [`IRIS`] where the camera's response is not known. A response of `x^0.95` causes a difference of 4 %.
pub const IRIS_UNCALIBRATED: f64 = 0.05;

/// The bound on the white segment of a colour wheel: the sum of red, green and blue may differ from gray by this share.
pub const COLOURS: f64 = 0.02;

/// The same as [`COLOURS`] where the camera's response is not known. With a monochrome camera, `x^0.95` causes a difference of 5.6 %.
pub const COLOURS_UNCALIBRATED: f64 = 0.07;

/// The check warns when more than this share of white's light reaches all pixels evenly and follows the pattern.
pub const STRAY: f64 = 0.02;

/// The check warns when level 235 of 255 is darker than white by less than this share. A level in proportion to light is 8 % darker.
pub const CLIPPED: f64 = 0.01;

/// The bound on pulses of light: white's light per second may differ by this share between exposures of parts of a refresh.
pub const PULSES: f64 = 0.02;

/// The same as [`PULSES`] where the camera's response is not known. A response of `x^0.95` causes a difference of 5 %.
pub const PULSES_UNCALIBRATED: f64 = 0.08;

/// The check warns when the last rows of a photo see more of a newly shown frame than the first rows, by more than this share.
pub const ROLLING: f64 = 0.02;

/// The check warns when the frame's border has less than this share of the expected light.
pub const BORDER: f64 = 0.5;

/// The check warns when stripes are blurred by more projector pixels than this. Camera pixels as coarse as the projector's blur by up to
/// 0.35.
pub const BLUR: f64 = 0.6;

/// The check warns when a second image has more than this share of the first one's light. A mirror ball and the noise of an 8-bit camera
/// have caused 1.2 %.
pub const GHOST: f64 = 0.02;

pub use crate::finding::SIGMAS;
