//! The measurement of a rig: products `A x` with signed, real vectors `x`, computed from the integer levels of the projector and counts of
//! the camera.
//!
//! Raw frames come from a [`FrameSource`]: live devices ([`LiveFrames`]) or a journal in front of them ([`JournaledFrames`]). A
//! [`Calibration`] holds the devices' responses, noise and pixel map. The module `calibrate` measures a calibration. A [`Measurement`]
//! joins all stages, and its [`MeasuredOperator`] is the linear operator for the Krylov methods. A [`RigFile`] describes a rig.
//!
//! [`MeasureOptions`] can switch each correction off. Sections refer to O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace
//! Illumination*.
//!
//! | file | stage | section |
//! |---|---|---|
//! | `live` | waits until the light has settled, and distinguishes new frames from old frames | |
//! | `response` | converts counts to light with its noise, and light to levels | 8.1 (linear devices) |
//! | `exposure`, `hdr` | choose exposures, average frames, subtract the black photo, merge by inverse variance | 8.2 (black photo), 7.2 |
//! | `photo_pipeline` | divides photos by the lamp's brightness, which repeated photos of white measure | |
//! | `sight` | tells whether the camera sees the projector's white, and whether this white is steady | |
//! | `registration`, `footprint`, `spread` | resample photos to projector pixels, and give the noise of sums of photos | 8.1 (resampling) |
//! | `display` | rounds patterns to levels, and sums frames for more levels | 7.2 |
//! | `signed` | shows signed vectors as patterns, chosen by predicted noise | 7.1 (affine form) |
//! | `direct`, `direct_fit` | measure the direct light, and remove it for the pattern that was actually shown | 5.3 |
//! | `product` | computes products from photos, with a blur of pattern and photo | 8.2 (blur) |
//!
//! Photos are in linear DN per second for a full-range pattern. The value 1 of a pattern is the light of the projector's brightest level
//! minus the light of its black level. Every value of a photo has a variance, which is propagated from the variance of a sample:
//! `linear DN / gain + read_noise² + 1/12`.

mod calibration;

mod calibration_file;
mod captures;
mod direct;
mod direct_fit;
pub(crate) mod display;
mod exposure;
pub(crate) mod footprint;
mod frame_source;
mod hdr;
mod journal_records;
mod journaled;
pub(crate) mod lens_map;
mod live;
mod measurement;
mod options;
mod photo_pipeline;
mod photos;
mod product;
mod registration;
mod response;
mod rig_file;
pub(crate) mod sight;
mod signed;
pub(crate) mod spread;

pub use calibration::{Calibration, CameraResponse, FlatField, Registration, Stability};
pub use captures::{CaptureMap, Captures, is_captures};
#[cfg(feature = "paper")]
pub(crate) use direct::DirectPatterns;
pub use direct::{checkerboard, code_patterns, shifted_checkerboards};
pub use display::{bit_plane_amplification, bit_plane_weights};
#[cfg(test)]
pub(crate) use frame_source::simulated;
pub use frame_source::{CaptureRequest, Effort, FrameSource, Times};
pub use journal_records::JournaledPhoto;
pub use journaled::{JournaledFrames, Opener};
pub use lens_map::{LensMap, Match};
pub use live::LiveFrames;
pub use measurement::{MeasuredOperator, Measurement};
pub use options::{DirectBy, DitherBy, MeasureOptions, RigRecord, RunManifest, SignedBy};
pub use photo_pipeline::DriftReport;
pub use photos::{Photo, Plane};
pub use response::{NoiseRatio, noise_ratio};
pub use rig_file::{RigFile, RigKind, own_folder};
