//! Reads and writes files: arrays, images, matrices, saved models, and the record of a run.
//!
//! | file | module |
//! |---|---|
//! | `.npy` arrays, `H×W`, `H×W×3`, `k×H×W` or `k` | [`npy`] |
//! | `.exr` layers, 32-bit floats | [`exr`] |
//! | `.png` pictures: 8 bits when written, 8 or 16 bits when read | [`picture`], [`raster`] |
//! | `.jpg`, `.tif`, `.hdr`, `.pfm`, `.pgm` and `.ppm` pictures, which are read only | [`picture`] |
//! | `.npz` (for `scipy.sparse.load_npz`) and `.mtx` matrices | [`sparse`] |
//! | `run.json`, the record of a run | [`manifest`] |
//! | `model/`, a captured low-rank model | [`model`] |
//!
//! [`picture`] reads and writes images in the format that the file's extension selects. [`atomic`] writes all files: a file appears
//! completely or not at all. Equal content gives equal bytes.

pub mod exr;
pub mod manifest;
pub mod model;
pub mod name;
pub mod npy;
pub mod picture;
pub mod raster;
pub mod sparse;

pub use crate::file::atomic;
