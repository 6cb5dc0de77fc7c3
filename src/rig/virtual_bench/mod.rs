//! A virtual rig: a simulated scene behind a simulated projector and camera, which have the imperfections of real devices and are
//! driven through the same traits.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | levels → light | response, black level, blur, vignetting | `screen` |
//! | light → photo | the scene's light transport | [`crate::transport`] |
//! | photo → sensor | misregistration, the camera's own pixels | `optics` |
//! | time | latency, drift, ambient light, faults | `world`, `faults` |
//! | light → counts | vignetting, shot noise, read noise, response, quantization | `sensor`, `poisson` |
//!
//! Time is simulated: nothing sleeps. Every count is a function of the rig's description, the frame's number and the time.
//! Therefore runs repeat to the last bit, and an interrupted run continues where it stopped.

mod conditions;
mod devices;
mod faults;
mod open;
mod optics;
mod poisson;
mod response;
mod screen;
mod sensor;
mod sheet;
mod spec;
mod view;
mod world;

pub use conditions::{Ambient, Drift, Faults};
pub use response::Response;
pub use sheet::MatteSheet;
pub use spec::{Misregistration, VirtualCamera, VirtualProjector, VirtualRig, VirtualScene};
