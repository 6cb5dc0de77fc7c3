//! A machine vision camera on USB 3: USB3 Vision (feature `usb3`), which has not been tried on hardware.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | who is there | on the computer's USB ports, and what it can do | `discover` |
//! | port | found by serial number, opened | `port` |
//! | session | its frames, released | `link` |
//! | in the rig file | its keys | `spec` |
//!
//! All else is common with GigE Vision, and proven there: [`super::genicam`].

#[cfg(feature = "usb3")]
mod discover;
#[cfg(feature = "usb3")]
mod link;
#[cfg(all(test, feature = "usb3"))]
mod played;
#[cfg(feature = "usb3")]
mod port;
mod spec;

#[cfg(feature = "usb3")]
pub use discover::{FoundUsbCamera, usb_camera_abilities, usb_cameras};
#[cfg(feature = "usb3")]
pub use link::Usb3Vision;
pub use spec::Usb3Spec;
