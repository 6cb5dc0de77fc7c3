//! A still camera that the program `gphoto2` drives. Another program decodes its RAW files. Both run as processes of their own, and
//! their output is parsed. This has not been tried on hardware.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | run | runs a program with a time limit | `program` |
//! | parse | reads lists of cameras and settings | `answers` |
//! | speeds | converts the names of shutter speeds to seconds | `speed` |
//! | set up | finds the camera, sets its settings and reads them back | `body` |
//! | counts | reads the decoder's picture | `pgm` |
//! | frames | releases the shutter, downloads, decodes and crops | `camera` |
//! | describe | the keys of a rig file | `spec` |

mod answers;
mod body;
mod camera;
mod pgm;
mod program;
mod spec;
mod speed;

pub use answers::FoundStillCamera;
pub use body::still_cameras;
pub use camera::Gphoto2;
pub use spec::Gphoto2Spec;
