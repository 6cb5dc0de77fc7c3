//! Machine vision cameras: what GigE Vision and USB3 Vision share. Both describe their features by GenICam.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | settings | hold format, region, gain and exposures that a rig file asks for | `settings` |
//! | set up | checks the camera's limits, switches automatics off, selects one frame for each software trigger | `set_up` |
//! | abilities | reads what the camera can do | `abilities` |
//! | time | relates the camera's clock to the rig's | `anchor` |
//! | frames | triggers and numbers frames, opens a lost session again | `camera`, `numbers` |
//!
//! The crate `viva-genicam` implements the protocols.

#[cfg(any(feature = "gige", feature = "usb3"))]
mod abilities;
#[cfg(any(feature = "gige", feature = "usb3"))]
mod anchor;
#[cfg(any(feature = "gige", feature = "usb3"))]
mod camera;
#[cfg(any(feature = "gige", feature = "usb3"))]
mod numbers;
#[cfg(any(feature = "gige", feature = "usb3"))]
mod set_up;
mod settings;

#[cfg(any(feature = "gige", feature = "usb3"))]
pub use abilities::Abilities;
#[cfg(any(feature = "gige", feature = "usb3"))]
pub(super) use camera::{Transport, Triggered};
#[cfg(any(feature = "gige", feature = "usb3"))]
pub(super) use set_up::said;
pub(crate) use settings::Settings;
