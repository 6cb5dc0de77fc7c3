//! From photons to a linear operator: what stands between a rig's integers and `A x` for a signed, real `x`.
//!
//! Each correction is a stage in a file of its own (O'Toole and Kutulakos, sections 7 and 8). Raw frames come from
//! [`Shots`]; what is known of the devices is a [`Calibration`].

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
mod hdr;
mod journaled;
mod live;
mod measurement;
mod noise;
mod operator;
mod options;
mod photo;
mod photographer;
mod registration;
mod response;
mod shots;
mod signed;

pub use calibration::{Calibration, CameraResponse, Registration, Stability};
pub use drift::DriftReport;
pub use journaled::{Journaled, Opener, Pair};
pub use live::Live;
pub use measurement::Measurement;
pub use operator::MeasuredOperator;
pub use options::{DirectBy, DitherBy, MeasureOptions, SignedBy};
pub use photo::{Photo, Plane};
pub use shots::{Effort, Shot, Shots};
