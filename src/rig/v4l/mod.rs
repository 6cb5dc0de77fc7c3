//! A camera of Linux's video interface V4L2 (feature `v4l`). This has not been tried on hardware.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | set up | sets format, size, exposure and gain, switches automatics off, and reads each back | `set_up` |
//! | counts | converts the bytes of a frame to counts | `decode` |
//! | frames | takes frames of a camera that runs freely, and discards those that began too early | `camera` |
//! | interface | calls the kernel through the crate `v4l` | `device` |
//! | describe | the keys of a rig file | `spec` |
//!
//! `set_up` reaches the device through a trait, so that it is tested on a simulated device.

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
