//! A rig: a projector and a camera, in the devices' own integers.
//!
//! A [`Frame`] holds the levels that a projector is told to show; a [`RawFrame`] holds the counts of a camera. Nothing here is
//! linear or calibrated: [`crate::measure`] turns levels and counts into light. Hardware and virtual devices implement the
//! same three traits, [`Projector`], [`Camera`] and [`Clock`]; an open rig is a [`Devices`] and may move between threads.
//! [`Devices`] has a complete example of a projector and a camera of your own.
//!
//! | kind of rig | projector | camera |
//! |---|---|---|
//! | [`VirtualRig`] | [`VirtualProjector`] | [`VirtualCamera`] |
//! | [`HardwareRig`] | [`X11Projector`], a monitor of an X server | one of the kinds of [`CameraSpec`] |
//! | [`ProgramRig`], the devices of a program | any [`Projector`] | any [`Camera`] |
//!
//! | kind of camera | needs |
//! |---|---|
//! | `GigeVision`, on the network | the feature `gige` (default) |
//! | `Usb3Vision`, on USB 3 | the feature `usb3` (default) |
//! | `V4l`, behind Linux's video interface | the feature `v4l` |
//! | [`Gphoto2`], a still camera | the programs `gphoto2` and `dcraw` (or another RAW decoder) |

mod attached;
mod busy;
mod cameras;
mod clock;
#[cfg(any(feature = "gige", feature = "usb3"))]
mod describe;
mod devices;
mod frame;
pub(crate) mod genicam;
mod gige;
mod gphoto2;
mod hardware;
mod info;
pub(crate) mod nearest;
pub(crate) mod pixels;
mod program;
mod usb3;
mod v4l;
mod virtual_bench;
mod x11;

pub use attached::{AttachedCamera, AttachedDevices};
#[cfg(not(all(feature = "gige", feature = "usb3", feature = "v4l")))]
use cameras::not_built;
pub use cameras::{CameraKind, CameraSpec};
pub use clock::WallClock;
pub use devices::{Camera, Clock, Devices, Losses, Projector, Shown, Stamp, Waited};
pub use frame::{Frame, RawFrame};
#[cfg(any(feature = "gige", feature = "usb3"))]
pub use genicam::Abilities;
pub use gige::GigeSpec;
#[cfg(feature = "gige")]
pub use gige::{FoundGigeCamera, GigeVision, cameras, gige_camera_abilities};
pub use gphoto2::{FoundStillCamera, Gphoto2, Gphoto2Spec, still_cameras};
pub use hardware::HardwareRig;
pub use info::{CameraInfo, ProjectorInfo};
pub use pixels::{Binning, Colour, PixelFormat, Tiles};
pub use program::{DeviceOpener, ProgramCamera, ProgramProjector, ProgramRig};
pub use usb3::Usb3Spec;
#[cfg(feature = "usb3")]
pub use usb3::{FoundUsbCamera, Usb3Vision, usb_camera_abilities, usb_cameras};
#[cfg(feature = "v4l")]
pub use v4l::{FoundVideoDevice, V4l, video_devices};
pub use v4l::{V4lFormat, V4lSpec};
pub use virtual_bench::{
    Ambient, Drift, Faults, Iris, MatteSheet, Misregistration, Pulse, Response, Splitter, VirtualCamera,
    VirtualProjector, VirtualRig, VirtualScene,
};
pub use x11::{
    Helper, MonitorInfo, ProjectorKind, ShowTimes, X11Monitor, X11Projector, X11Spec, monitors,
    serve_projector,
};

/// An error of the device "camera"; `help` says what to do.
fn camera_fault(fault: impl Into<String>, help: impl Into<String>) -> crate::Error {
    crate::Error::Rig { device: "camera".into(), fault: fault.into(), help: help.into() }
}
