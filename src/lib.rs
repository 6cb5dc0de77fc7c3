//! krylux (Krylov + lux): a light transport laboratory.
//!
//! A projector lights a scene, a camera takes the photo, the photo is projected back, and so on. These photos span
//! the Krylov subspace of the scene's light transport matrix `A` (photo = `A` · pattern), so its eigenvectors and
//! what follows from them are had from a few dozen photos, without ever measuring `A` itself. The method is
//! O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*.
//!
//! # The map
//!
//! Data flows one way; a module uses only those below it.
//!
//! ```text
//! cli → report → analysis → krylov → operator, image
//!            ↘          ↘ transport → render → gpu, scene → image
//! ```
//!
//! | in the paper | here |
//! |---|---|
//! | photo = `A` · pattern, coaxial rig (section 2) | [`render`] traces it once, [`transport`] replays it |
//! | Krylov subspace illumination (sections 3 and 4) | [`krylov`] |
//! | light transport segmentation (section 5) | [`analysis::segment`] |
//!
//! Units, conventions and the symmetric estimator stand in [`render`] and [`transport`].

pub mod analysis;
pub mod cli;
pub mod error;
pub mod gpu;
pub mod image;
pub mod krylov;
pub mod operator;
pub mod render;
pub mod report;
pub mod scene;
pub mod sparse;
pub mod transport;

pub use error::{Error, Result};
