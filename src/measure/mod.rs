//! From photons to a linear operator: what stands between a rig's integers and `A x` for a signed, real `x`.
//!
//! Each correction is a stage in a file of its own (O'Toole and Kutulakos, sections 7 and 8), and can be switched off
//! ([`MeasureOptions`]). Raw frames come from [`FrameSource`]; what is known of the devices is a [`Calibration`]; all together is a
//! [`Measurement`], whose [`MeasuredOperator`] the Krylov methods see.
//!
//! | file | stage |
//! |---|---|
//! | `live` | waits for the light to settle, and knows a new frame from an old one |
//! | `times` | where a session's seconds go |
//! | `averaging` | takes of one frame |
//! | `response` | counts to light with its noise, light to levels |
//! | `exposure`, `hdr` | exposures chosen, and merged by inverse variance |
//! | `ambient` | the black photo subtracted, nothing clipped |
//! | `drift` | the lamp's light, watched by a sentinel |
//! | `registration` | camera pixels to projector pixels, with the noise of any sum of photos |
//! | `display`, [`bit_planes`] | patterns to levels, and more levels than there are |
//! | `signed`, `noise` | signed vectors to patterns, by predicted noise |
//! | `direct` | the direct image, to be removed for the pattern actually shown |
//! | `blur` | on pattern and photo |
//!
//! Photos are in linear DN per second for a full-range pattern: 1 is the projector's brightest level less its black level. Every
//! value comes with its variance, propagated from `linear DN / gain + read_noise² + 1/12`.

mod ambient;
mod averaging;
pub mod bit_planes;
pub mod calibrate;
mod calibration;
mod calibration_file;
mod direct;
mod display;
mod drift;
mod exposure;
mod focus;
mod frame_source;
mod hdr;
mod journaled;
mod live;
mod measurement;
mod noise;
mod noise_ratio;
mod operator;
mod options;
mod photo;
mod photographer;
pub mod preview;
mod product;
mod record;
mod registration;
mod response;
pub mod rig_check;
mod rig_file;
mod signed;
mod times;

pub use calibration::{Calibration, CameraResponse, Registration, Stability};
pub use drift::DriftReport;
pub use focus::focus;
pub use frame_source::{CaptureRequest, Effort, FrameSource};
pub use journaled::{JournaledFrames, Opener, Pair};
pub use live::LiveFrames;
pub use measurement::Measurement;
pub use noise_ratio::{NoiseRatio, noise_ratio};
pub use operator::MeasuredOperator;
pub use options::{DirectBy, DitherBy, MeasureOptions, SignedBy};
pub use photo::{Photo, Plane};
pub use record::{RigRecord, RunManifest};
pub use rig_file::{RigFile, RigKind};
pub use times::Times;
