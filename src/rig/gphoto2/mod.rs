//! A still camera, driven by the program `gphoto2`; its RAW files are decoded by another program. Neither is linked: they are
//! run, and their answers read. It has not been tried on hardware.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | run | a program, with a limit to its time | `program` |
//! | answers | which cameras there are, what can be set and to what | `answers` |
//! | speeds | shutter speeds as cameras word them, in seconds | `speed` |
//! | body | found, its settings set and read back | `body` |
//! | counts | the decoder's picture | `pgm` |
//! | frames | set, released, downloaded, decoded, cut out | `camera` |
//! | in the rig file | its keys | `spec` |

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
