//! What a run leaves behind: arrays, pictures, matrices, plots, the page and the record of how they came about.
//!
//! | file | module |
//! |---|---|
//! | `.npy` arrays, `H×W`, `H×W×3`, `k×H×W` or `k` | [`npy`] |
//! | `.exr` layers, 32-bit floats | [`exr`] |
//! | `.png` for people | [`png`], after [`tone`], [`colormap`] or [`palette`] chose the colours |
//! | `.npz` (for `scipy.sparse.load_npz`) and `.mtx` matrices | [`sparse`] |
//! | `report.html` | [`html`], with plots by [`plot`] and [`scatter`] |
//! | `run.json` | [`manifest`] |
//! | `model/` | [`model`] |
//! | every photo of a run on one sheet | [`strip`] |
//! | everything of one verb | [`segmentation`], [`eigenpairs`], [`compensation`], [`separation`], [`relighting`], [`probing`], [`solution`], [`audit`], [`calibration`] |
//! | what is seen while a bench is set up | [`preview`], [`alignment`] |
//! | the paper's figures beside what it says of them | [`gallery`] |
//!
//! [`picture`] reads and writes an image by its file's extension; [`viewer`] shows images while they come. Every writer goes through [`atomic`]: a file is
//! there as a whole or not at all, and the same content gives the same bytes.

pub mod alignment;
pub mod atomic;
pub mod audit;
mod axis;
pub mod calibration;
pub mod clock;
pub mod colormap;
pub mod compensation;
pub mod eigenpairs;
pub mod exr;
mod figure;
pub mod gallery;
pub mod html;
pub mod manifest;
pub mod model;
mod notes;
pub mod npy;
mod oklab;
pub mod palette;
pub mod picture;
mod planes;
pub mod plot;
pub mod png;
pub mod preview;
pub mod probing;
mod raster;
pub mod relighting;
mod residuals;
mod run;
pub mod scatter;
pub mod segmentation;
pub mod separation;
pub mod solution;
pub mod sparse;
mod spectrum;
mod srgb;
pub mod strip;
mod svg;
pub mod tone;
pub mod viewer;

pub(crate) use run::stages;
