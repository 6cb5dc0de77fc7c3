//! From photons to a linear operator: what stands between a rig's integers and `A x` for a signed, real `x`.
//!
//! Each correction is a stage in a file of its own (O'Toole and Kutulakos, sections 7 and 8). Raw frames come from
//! [`Shots`]; what is known of the devices is a [`Calibration`].

mod calibration;
mod journaled;
mod live;
mod options;
mod shots;

pub use calibration::{Calibration, CameraResponse, Registration, Stability};
pub use journaled::{Journaled, Opener, Pair};
pub use live::Live;
pub use options::{DirectBy, MeasureOptions, SignedBy};
pub use shots::{Effort, Shot, Shots};
