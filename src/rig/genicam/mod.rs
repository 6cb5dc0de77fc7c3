//! Machine vision cameras: what GigE Vision and USB3 Vision have in common, which is the camera's own GenICam description of
//! what is where.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | what is wanted | format, region, gain, exposures; what the counts will be | `settings` |
//! | set up | against the camera's limits, nothing automatic, one frame for each software trigger | `set_up` |
//! | abilities | what the camera says it can do | `abilities` |
//! | time | the camera's clock against the rig's | `anchor` |
//! | frames | triggered one by one, numbered through, a lost session opened anew | `camera`, `numbers` |
//!
//! The protocols are those of the crate `viva-genicam`.

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
