//! A machine vision camera on the network: GigE Vision, with the camera's own GenICam description saying what is where.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | who answers | on the computer's networks, and what it can do | `discover`, `abilities` |
//! | session | opened by address, set up, released; its frames | `link` |
//! | time | the camera's clock against the rig's | `anchor` |
//! | counts | bytes of a pixel format to digital numbers | `spec` |
//! | frames | triggered one by one, numbered through, a lost session opened anew | `camera` |
//!
//! The protocol is the crate `viva-genicam`'s (feature `gige`): registers, heartbeat, packets that are lost and sent again.

#[cfg(feature = "gige")]
mod abilities;
#[cfg(feature = "gige")]
mod anchor;
#[cfg(feature = "gige")]
mod camera;
#[cfg(feature = "gige")]
mod discover;
#[cfg(feature = "gige")]
mod link;
mod spec;

#[cfg(feature = "gige")]
pub use abilities::{Abilities, abilities};
#[cfg(feature = "gige")]
pub use camera::GigeVision;
#[cfg(feature = "gige")]
pub use discover::{FoundCamera, cameras};
pub use spec::{CameraKind, GigeSpec, PixelFormat};

use crate::error::Error;

/// What the error is about.
const DEVICE: &str = "camera";

/// An error of the camera.
pub(super) fn fault(fault: impl Into<String>, help: impl Into<String>) -> Error {
    Error::Rig { device: DEVICE.into(), fault: fault.into(), help: help.into() }
}
