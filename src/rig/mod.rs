//! A rig is a projector and a camera, in the devices' integers.
//!
//! A [`Frame`] holds the levels for a projector, and a [`RawFrame`] holds the counts of a camera. Nothing here is linear or calibrated:
//! [`crate::measure`] turns levels and counts into light. Hardware and virtual devices implement the same three traits, [`Projector`],
//! [`Camera`] and [`Clock`]. An open rig is a [`Devices`], which may move between threads. Its documentation has a complete example of your
//! own devices.
//!
//! | kind of rig | projector | camera |
//! |---|---|---|
//! | [`VirtualRig`] | [`VirtualProjector`] | [`VirtualCamera`] |
//! | [`HardwareRig`] | [`X11Projector`], a monitor of an X server | one of the kinds of [`CameraSpec`] |
//! | [`ProgramRig`], the devices of a program | any [`Projector`] | any [`Camera`] |
//!
//! | kind of camera | requirement |
//! |---|---|
//! | `GigeVision`, on the network | the feature `gige` (default) |
//! | `Usb3Vision`, on USB 3 | the feature `usb3` (default) |
//! | `V4l`, behind Linux's video interface | the feature `v4l` |
//! | [`Gphoto2`], a still camera | the programs `gphoto2` and `dcraw` (or another RAW decoder) |

mod attached;
mod cameras;
mod devices;
mod frame;
#[cfg(any(feature = "gige", feature = "usb3"))]
mod genicam;
#[cfg(feature = "gige")]
mod gige;
mod gphoto2;
mod hardware;
pub(crate) mod nearest;
mod pixel_format;
mod program;
pub(crate) mod sensor;
#[cfg(feature = "usb3")]
mod usb3;
#[cfg(feature = "v4l")]
mod v4l;
#[cfg(any(feature = "v4l", test))]
mod v4l_set_up;
mod virtual_bench;
mod x11;

pub use attached::{AttachedCamera, AttachedDevices};
#[cfg(not(all(feature = "gige", feature = "usb3", feature = "v4l")))]
use cameras::not_built;
pub use cameras::{CameraKind, CameraSpec, GigeSpec, Usb3Spec, V4lFormat, V4lSpec};
pub use devices::{Camera, Clock, Devices, Losses, Projector, Shown, Stamp, Waited, WallClock};
pub use frame::{CameraInfo, Frame, ProjectorInfo, RawFrame};
#[cfg(any(feature = "gige", feature = "usb3"))]
pub use genicam::set_up::Abilities;
#[cfg(feature = "gige")]
pub use gige::{FoundGigeCamera, GigeVision, cameras, gige_camera_abilities};
pub use gphoto2::answers::FoundStillCamera;
pub use gphoto2::body::still_cameras;
pub use gphoto2::{Gphoto2, Gphoto2Spec};
pub use hardware::HardwareRig;
pub use pixel_format::PixelFormat;
pub use program::{DeviceOpener, ProgramCamera, ProgramProjector, ProgramRig};
pub use sensor::{Binning, Colour, Tiles};
#[cfg(feature = "usb3")]
pub use usb3::{FoundUsbCamera, Usb3Vision, usb_camera_abilities, usb_cameras};
#[cfg(feature = "v4l")]
pub use v4l::{FoundVideoDevice, V4l, video_devices};
pub use virtual_bench::MatteSheet;
pub use virtual_bench::spec::{
    Ambient, Drift, Faults, Misregistration, Response, Splitter, VirtualCamera, VirtualProjector, VirtualRig,
    VirtualScene,
};
pub use virtual_bench::world::{Iris, Pulse};
#[cfg(not(feature = "x11"))]
pub use x11::absent::monitors;
pub use x11::helper::{Helper, serve_projector};
#[cfg(feature = "x11")]
pub use x11::monitor::monitors;
pub use x11::projector::{ShowTimes, X11Projector};
pub use x11::{MonitorInfo, ProjectorKind, X11Monitor, X11Spec};

/// An error of the device "camera", with the remedy `help`.
fn camera_fault(fault: impl Into<String>, help: impl Into<String>) -> crate::Error {
    crate::Error::rig("camera", fault).help(help)
}
