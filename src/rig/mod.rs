//! A rig: the projector that shows and the camera that sees, in integers, as the devices themselves count.
//!
//! Nothing here is linear or calibrated: a [`Frame`] is what a projector is told to show, a [`RawFrame`] what a camera
//! counted, and what both mean as light is for [`crate::measure`] to say. Hardware and virtual devices stand behind the
//! same three traits, [`Projector`], [`Camera`] and [`Clock`]; together they are a [`Devices`].
//!
//! | kind of rig | projector | camera |
//! |---|---|---|
//! | [`VirtualRig`] | [`VirtualProjector`] | [`VirtualCamera`] |
//! | [`HardwareRig`] | [`X11Projector`], a monitor of an X server | one of the kinds of [`CameraSpec`] |
//!
//! | kind of camera | needs |
//! |---|---|
//! | `GigeVision`, on the network | the feature `gige` (default) |
//! | `Usb3Vision`, on USB 3 | the feature `usb3` (default) |
//! | `V4l`, behind Linux's video interface | the feature `v4l` |
//! | [`Gphoto2`], a still camera | the program `gphoto2`, and one that decodes RAW |

mod cameras;
mod clock;
mod devices;
mod frame;
pub(crate) mod genicam;
mod gige;
mod gphoto2;
mod hardware;
pub(crate) mod nearest;
pub(crate) mod pixels;
mod usb3;
mod v4l;
mod virtual_bench;
mod x11;

#[cfg(not(all(feature = "gige", feature = "usb3", feature = "v4l")))]
pub(crate) use cameras::left_out;
pub use cameras::{CameraKind, CameraSpec};
pub use clock::WallClock;
pub use devices::{Camera, CameraInfo, Clock, Devices, Projector, ProjectorInfo, Shown, Stamp, Waited};
pub use frame::{Frame, RawFrame};
#[cfg(any(feature = "gige", feature = "usb3"))]
pub use genicam::Abilities;
pub use gige::GigeSpec;
#[cfg(feature = "gige")]
pub use gige::{FoundCamera, GigeVision, camera_abilities, cameras};
pub use gphoto2::{FoundStillCamera, Gphoto2, Gphoto2Spec, still_cameras};
pub use hardware::HardwareRig;
pub use pixels::{Binning, Colour, PixelFormat, Tiles};
pub use usb3::Usb3Spec;
#[cfg(feature = "usb3")]
pub use usb3::{FoundUsbCamera, Usb3Vision, usb_camera_abilities, usb_cameras};
#[cfg(feature = "v4l")]
pub use v4l::{FoundVideoDevice, V4l, video_devices};
pub use v4l::{V4lFormat, V4lSpec};
pub use virtual_bench::{
    Ambient, Drift, Faults, Misregistration, Response, VirtualCamera, VirtualProjector, VirtualRig,
    VirtualScene,
};
pub use x11::{
    Helper, MonitorInfo, ProjectorKind, ShowTimes, X11Monitor, X11Projector, X11Spec, monitors,
    serve_projector,
};

/// An error of the camera.
fn camera_fault(fault: impl Into<String>, help: impl Into<String>) -> crate::Error {
    crate::Error::Rig { device: "camera".into(), fault: fault.into(), help: help.into() }
}
