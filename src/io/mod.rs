//! Files: arrays, images, matrices, saved models and the record of a run.
//!
//! | file | module |
//! |---|---|
//! | `.npy` arrays, `H×W`, `H×W×3`, `k×H×W` or `k` | [`npy`] |
//! | `.exr` layers, 32-bit floats | [`exr`] |
//! | `.png`: 8-bit pictures out, 8 or 16 bits in | [`png`], [`raster`], after [`tone`] has mapped radiance to sRGB |
//! | `.npz` (for `scipy.sparse.load_npz`) and `.mtx` matrices | [`sparse`] |
//! | `run.json`, the record of a run | [`manifest`] |
//! | `model/`, a captured low-rank model | [`model`] |
//!
//! [`picture`] reads and writes an image by its file's extension. Every writer goes through [`atomic`]: a file is there as a
//! whole or not at all, and the same content gives the same bytes.

pub mod atomic;
pub mod clock;
pub mod exr;
pub mod manifest;
pub mod model;
pub mod npy;
pub mod picture;
pub mod png;
pub mod raster;
pub mod sparse;
pub mod srgb;
pub mod tone;
