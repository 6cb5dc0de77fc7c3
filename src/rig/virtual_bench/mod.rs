//! A virtual rig: a simulated scene behind devices with every imperfection that real ones have, driven through the same
//! traits.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | levels → light | response, black level, blur, vignetting | `screen` |
//! | light → photo | the scene's light transport | [`crate::transport`] |
//! | photo → sensor | misregistration, the camera's own pixels | `optics` |
//! | when, and how bright | latency, drift, ambient light, faults | `world`, `faults` |
//! | light → counts | vignetting, photons, read noise, response, quantization | `sensor`, `poisson` |
//!
//! Time is simulated: nothing sleeps. All is a function of the rig's description, the frame's number and the time, so that
//! runs repeat to the last bit, and an interrupted one goes on where it stopped.

mod conditions;
mod devices;
mod faults;
mod open;
mod optics;
mod poisson;
mod response;
mod screen;
mod sensor;
mod spec;
mod view;
mod world;

pub use conditions::{Ambient, Drift, Faults};
pub use response::Response;
pub use spec::{Misregistration, VirtualCamera, VirtualProjector, VirtualRig, VirtualScene};
