//! A virtual rig: a simulated scene behind a simulated projector and camera, which have the imperfections of real devices and are
//! driven through the same traits.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | levels → light | limited range, response, black level, overscan, blur, vignetting | `screen` |
//! | light → photo | the scene's light transport | [`crate::transport`] |
//! | photo → sensor | misregistration, the camera's own pixels, its blur, the splitter's ghost and stray light | `optics`, `view` |
//! | time | latency, iris, pulses, drift, ambient light, rolling shutter, faults | `world`, `emission`, `faults` |
//! | light → counts | vignetting, shot noise, read noise, response, quantization | `sensor`, `poisson` |
//!
//! Time is simulated: nothing sleeps. Every count is a function of the rig's description, the frame's number and the time.
//! Therefore runs repeat to the last bit, and an interrupted run continues where it stopped.

mod conditions;
mod devices;
mod emission;
mod faults;
mod open;
mod optics;
mod poisson;
mod response;
mod screen;
mod sensor;
mod sheet;
mod spec;
mod splitter;
mod view;
mod world;

pub use conditions::{Ambient, Drift, Faults};
pub use emission::{Iris, Pulse};
pub use response::Response;
pub use sheet::MatteSheet;
pub use spec::{Misregistration, VirtualCamera, VirtualProjector, VirtualRig, VirtualScene};
pub use splitter::Splitter;
