//! A rig: the projector that shows and the camera that sees, in integers, as the devices themselves count.
//!
//! Nothing here is linear or calibrated: a [`Frame`] is what a projector is told to show, a [`RawFrame`] what a camera
//! counted, and what both mean as light is for [`crate::measure`] to say. Hardware and virtual devices stand behind the
//! same three traits, [`Projector`], [`Camera`] and [`Clock`]; together they are a [`Bench`].
//!
//! | kind of rig | projector | camera |
//! |---|---|---|
//! | [`VirtualRig`] | [`VirtualProjector`] | [`VirtualCamera`] |
//! | [`HardwareRig`] | [`X11Projector`], a monitor of an X server | `GigeVision` (feature `gige`), on the network |

mod clock;
mod devices;
mod file;
mod frame;
mod gige;
mod hardware;
mod nearest;
mod virtual_bench;
mod x11;

pub use clock::WallClock;
pub use devices::{Bench, Camera, CameraInfo, Clock, Projector, ProjectorInfo, Shown, Stamp};
pub use file::{RigFile, RigKind};
pub use frame::{Frame, RawFrame};
#[cfg(feature = "gige")]
pub use gige::{Abilities, FoundCamera, GigeVision, abilities as camera_abilities, cameras};
pub use gige::{CameraKind, GigeSpec, PixelFormat};
pub use hardware::HardwareRig;
pub use virtual_bench::{
    Ambient, Drift, Faults, Misregistration, Response, VirtualCamera, VirtualProjector, VirtualRig,
    VirtualScene,
};
pub use x11::{
    Helper, MonitorInfo, ProjectorKind, ShowTimes, X11Monitor, X11Projector, X11Spec, monitors,
    serve_projector,
};
