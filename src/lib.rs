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
//! cli → report → analysis → krylov → operator, sparse, image
//!     ↘      ↘          ↘ transport → render → gpu, scene → image
//!      cache → report, transport
//!      measure → rig, journal, operator
//!      paper → analysis, transport, measure
//! ```
//!
//! | in the paper | here |
//! |---|---|
//! | photo = `A` · pattern, coaxial rig (section 2) | [`render`] traces it once, [`transport`] replays it |
//! | Krylov subspace illumination (sections 3 and 4) | [`krylov`]: eigenpairs, linear systems, boxes, estimators |
//! | light transport segmentation (section 5) | [`analysis::segment`] |
//! | photos with real devices (sections 7 and 8) | [`measure`] makes them an operator, [`rig`] drives the devices, [`journal`] keeps every photo |
//! | light transport compensation | [`analysis::compensate`](mod@analysis::compensate) |
//! | *Optical computing* (2010): low-rank relighting | [`analysis::low_rank`](mod@analysis::low_rank) |
//! | direct and global light, probing | [`analysis::separate`](mod@analysis::separate), [`analysis::probe`](mod@analysis::probe) |
//! | the figures | [`paper`] makes them again, and holds them to bounds |
//!
//! Units, conventions and the symmetric estimator stand in [`render`] and [`transport`].
//!
//! # From a scene to its groups
//!
//! ```
//! use std::path::Path;
//!
//! use krylux::analysis::{SegmentOptions, segment::segment};
//! use krylux::image::Resolution;
//! use krylux::render::{TraceSettings, Tracer};
//! use krylux::transport::{Channels, MatrixOperator, Part, assemble};
//!
//! # fn main() -> krylux::Result<()> {
//! let scene = krylux::scene::load(Path::new("assets/scenes/zigzag/scene.glb"), None)?;
//! let mut tracer = Tracer::new(&scene, None)?;
//! let settings = TraceSettings::new(Resolution::new(32, 32), 64);
//! let traced = assemble(&mut tracer, &settings, Channels::Luma)?;
//!
//! let mut global = MatrixOperator::new(&traced.matrix, Part::Global, 0);
//! let options = SegmentOptions { photos: 20, groups: vec![2], ..SegmentOptions::default() };
//! let found = segment(&mut global, &options)?;
//! // Two regions exchange no light, so the eigenvalue 1 comes twice.
//! assert!(found.photos == 20 && found.eigenvalues[1] > 0.999);
//! # Ok(())
//! # }
//! ```

pub mod analysis;
pub mod cache;
pub mod cli;
pub mod error;
pub mod gpu;
pub mod image;
pub mod io;
pub mod journal;
pub mod krylov;
pub mod lab;
pub mod measure;
pub mod observer;
pub mod operator;
pub mod paper;
pub mod render;
pub mod report;
pub mod rig;
pub mod scene;
pub mod sparse;
pub mod transport;

pub use error::{Error, Result};
