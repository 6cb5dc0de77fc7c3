//! A camera behind Linux's video interface (feature `v4l`), which has not been tried on hardware.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | set up | format and size as asked for, nothing automatic, exposure and gain by hand, each read back | `set_up` |
//! | counts | bytes of a frame, row by row | `decode` |
//! | frames | it runs free: those from before are thrown away | `camera` |
//! | the interface itself | through the crate `v4l` | `device` |
//! | in the rig file | its keys | `spec` |
//!
//! All but `device` and `camera` is told of a video device by a trait, and tested on one that is played.

#[cfg(feature = "v4l")]
mod camera;
#[cfg(any(feature = "v4l", test))]
mod decode;
#[cfg(feature = "v4l")]
mod device;
#[cfg(any(feature = "v4l", test))]
mod set_up;
mod spec;

#[cfg(feature = "v4l")]
pub use camera::V4l;
#[cfg(feature = "v4l")]
pub use device::{FoundVideoDevice, video_devices};
pub use spec::{V4lFormat, V4lSpec};
