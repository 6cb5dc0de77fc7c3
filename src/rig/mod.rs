//! A rig: the projector that shows and the camera that sees, in integers, as the devices themselves count.
//!
//! Nothing here is linear or calibrated: a [`Frame`] is what a projector is told to show, a [`RawFrame`] what a camera
//! counted, and what both mean as light is for [`crate::measure`] to say. Hardware and virtual devices stand behind the
//! same three traits, [`Projector`], [`Camera`] and [`Clock`]; together they are a [`Bench`].

mod devices;
mod frame;
mod stamp;

pub use devices::{Bench, Camera, CameraInfo, Clock, Projector, ProjectorInfo, Shown};
pub use frame::{Frame, RawFrame};
pub use stamp::Stamp;
