//! From a camera's bytes to counts and pixels: pixel formats, and colour sensors with a mosaic of filters.
//!
//! | from | to | file |
//! |---|---|---|
//! | bytes of a pixel format | a count for each photosite | `format` |
//! | counts of a mosaic | a pixel for each 2×2 cell | `mosaic` |
//! | the description in a rig file | the camera's properties | `sensor` |

mod format;
mod mosaic;
mod sensor;

pub use format::PixelFormat;
pub use mosaic::{Binning, Colour, Tiles};
pub(crate) use sensor::Sensor;
