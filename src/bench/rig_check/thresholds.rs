//! The bounds of the check: where a finding becomes a warning, and where it fails.

/// An exposure may differ from a whole number of the projector's refreshes by this share of one refresh.
pub const REFRESH_FRACTION: f64 = 0.02;

/// Photos of a long session: a capture with several exposures and takes, its calibration, and a second try.
/// Less disk space than that is a warning.
pub const SESSION_PHOTOS: u64 = 5000;

/// With disk space for fewer photos than this the check fails: not even one capture fits.
pub const MIN_PHOTOS: u64 = 200;

/// White's 98th percentile, as a share of the camera's range, below which most of the range is unused: a
/// warning.
pub const DIM_WHITE: f64 = 0.2;

/// White's 98th percentile, as a share of the camera's range, below which the camera does not see the
/// projector: a failure.
pub const INVISIBLE_WHITE: f64 = 0.01;

/// A warning when more than this share of white's samples is saturated.
pub const SATURATED_WARNING: f64 = 0.01;

/// A failure when more than this share of white's samples is saturated.
pub const SATURATED_FAILURE: f64 = 0.1;

/// A warning when the light without a pattern is more than this share of white's light. At this share it adds
/// a tenth to the noise of white.
pub const AMBIENT: f64 = 0.2;

/// A warning when drift and flicker change the light of white by more than this share from photo to photo.
/// `krylux audit` has the same bound.
pub const REPEATABILITY: f64 = 0.01;

/// A failure when white right after black has less light than a repeated white by more than this share. The
/// latency measurement of the calibration has the same tolerance.
pub const SETTLING: f64 = 2e-3;

/// A warning when the noise of a photo, as a multiple of what the calibration predicts, lies outside of this
/// interval.
pub const NOISE_RATIO: [f64; 2] = [0.8, 1.25];

/// A warning when the pixel map is off by more than this, in projector pixels. The calibration promises as
/// much.
pub const MAP_OFFSET_WARNING: f64 = 0.1;

/// A failure when the pixel map is off by more than this, in projector pixels: a third of the direct light is
/// then assigned to a neighbouring pixel.
pub const MAP_OFFSET_FAILURE: f64 = 0.3;

/// A failure when the photo of a random pattern correlates less than this with the pattern that was shown.
pub const MIN_CORRELATION: f64 = 0.5;

/// The automatic iris: the quadrants of white may differ from white by this share.
pub const IRIS: f64 = 0.02;

/// As [`IRIS`], where the camera's response is not known. A response of `x^0.95` makes them differ by 4 %.
pub const IRIS_UNCALIBRATED: f64 = 0.05;

/// The white segment of a colour wheel: red, green and blue may differ from gray by this share.
pub const COLOURS: f64 = 0.02;

/// As [`COLOURS`], where the camera's response is not known. A response of `x^0.95` makes them differ by 5.6 % where the camera has no colours.
pub const COLOURS_UNCALIBRATED: f64 = 0.07;

/// A warning when this share of white's light reaches all pixels evenly, and follows the pattern.
pub const STRAY: f64 = 0.02;

/// A warning when level 235 of 255 is darker than white by less than this share. In proportion it would be 8 %.
pub const CLIPPED: f64 = 0.01;

/// Pulses of light: white's light per second may differ by this share between exposures of parts of a refresh.
pub const PULSES: f64 = 0.02;

/// As [`PULSES`], where the camera's response is not known. A response of `x^0.95` makes 5 %.
pub const PULSES_UNCALIBRATED: f64 = 0.08;

/// A warning when the last rows of a photo see more of a frame that was just shown than the first rows, by this share.
pub const ROLLING: f64 = 0.02;

/// A warning when the frame's border has less than this share of the light that it should have.
pub const BORDER: f64 = 0.5;

/// A warning when stripes are blurred by more than this, in projector pixels. The pixels of a camera as coarse as the projector blur by
/// up to 0.35.
pub const BLUR: f64 = 0.6;

/// A warning when a second image of the frame has more than this share of the first one's light. A mirror ball and the noise of a camera of
/// 8 bits have made 1.2 %.
pub const GHOST: f64 = 0.02;

pub use crate::finding::SIGMAS;
