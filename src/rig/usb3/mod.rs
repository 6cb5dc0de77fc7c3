//! A machine vision camera on USB 3: USB3 Vision (feature `usb3`), which has not been tried on hardware.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | find | lists the cameras on the computer's USB ports, and what each can do | `discover` |
//! | open | finds a camera by its serial number | `port` |
//! | session | receives its frames | `link` |
//! | describe | the keys of a rig file | `spec` |
//!
//! Everything else is shared with GigE Vision, and tested there: [`super::genicam`].

#[cfg(feature = "usb3")]
mod discover;
#[cfg(feature = "usb3")]
mod link;
#[cfg(feature = "usb3")]
mod port;
#[cfg(all(test, feature = "usb3"))]
mod simulated;
mod spec;

#[cfg(feature = "usb3")]
pub use discover::{FoundUsbCamera, usb_camera_abilities, usb_cameras};
#[cfg(feature = "usb3")]
pub use link::Usb3Vision;
pub use spec::Usb3Spec;
