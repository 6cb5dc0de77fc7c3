//! A machine vision camera on the network: GigE Vision (feature `gige`).
//!
//! | step | what it does | file |
//! |---|---|---|
//! | find | lists the cameras on the computer's networks, and what each can do | `discover` |
//! | session | opens a camera by its address and receives its frames; lost packets are sent again | `link` |
//! | describe | the keys of a rig file | `spec` |
//!
//! Everything else is shared with USB3 Vision: [`super::genicam`].

#[cfg(feature = "gige")]
mod discover;
#[cfg(feature = "gige")]
mod link;
mod spec;

#[cfg(feature = "gige")]
pub use discover::{FoundGigeCamera, cameras, gige_camera_abilities};
#[cfg(feature = "gige")]
pub use link::GigeVision;
pub use spec::GigeSpec;
