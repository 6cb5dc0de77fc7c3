//! What a camera's bytes and counts mean: pixel formats, and the colours of a sensor behind a mosaic of filters.
//!
//! | from | to | file |
//! |---|---|---|
//! | bytes of a pixel format | a count for each photosite | `format` |
//! | counts of a mosaic | pixels, a cell each | `mosaic` |
//! | what a rig file says | what the camera is | `sensor` |

mod format;
mod mosaic;
mod sensor;

pub use format::PixelFormat;
pub use mosaic::{Binning, Colour, Tiles};
pub(crate) use sensor::Sensor;
