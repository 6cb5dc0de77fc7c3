//! A machine vision camera on the network: GigE Vision (feature `gige`).
//!
//! | step | what it does | file |
//! |---|---|---|
//! | who answers | on the computer's networks, and what it can do | `discover` |
//! | session | opened by address, released; its frames, lost packets of which are sent again | `link` |
//! | in the rig file | its keys | `spec` |
//!
//! All else is common with USB3 Vision: [`super::genicam`].

#[cfg(feature = "gige")]
mod discover;
#[cfg(feature = "gige")]
mod link;
mod spec;

#[cfg(feature = "gige")]
pub use discover::{FoundCamera, camera_abilities, cameras};
#[cfg(feature = "gige")]
pub use link::GigeVision;
pub use spec::GigeSpec;
