//! krylux (Krylov + lux): a light transport laboratory.
//!
//! A projector lights a scene, a camera takes a photo, the projector shows this photo as the next pattern, and so on. These photos span the
//! Krylov subspace of the scene's light transport matrix `A` (photo = `A` · pattern). A few dozen photos therefore yield the eigenvectors
//! of `A`, and the results that follow from them, without a measurement of `A` itself. The method is in section 4 of O'Toole and Kutulakos,
//! *Light Transport Analysis by Krylov Subspace Illumination*, which comments call the paper. See also *Optical computing for fast light
//! transport analysis*, 2010, doi:10.1145/1882261.1866165. The guide in `guide/` has concepts, tutorials and the reference of the program.
//!
//! # Five lines
//!
//! [`lab`] is the entry point: [`open()`] takes a scene, a rig file, the folder of an earlier run, or a matrix.
//!
//! ```
//! use krylux::krylov::{EigsOptions, eigs};
//! use krylux::transport::Part;
//! use krylux::verbs::Segment;
//!
//! fn ask(source: &str, folder: &std::path::Path) -> krylux::Result<()> {
//!     let mut lab = krylux::open(source)?;
//!     let mut global = lab.operator(Part::Global)?;
//!     let pairs = eigs(&mut global, &EigsOptions { count: 4, ..EigsOptions::default() })?;
//!     let groups = lab.ask(&Segment { groups: vec![2, 6], ..Segment::default() })?;
//!     lab.save(folder, &groups)?;
//!     // The scene has two regions that exchange no light, so the eigenvalue 1 of the normalized graph occurs twice.
//!     assert!(pairs.values.len() == 4 && groups.segmentation.eigenvalues[1] > 0.99);
//!     Ok(())
//! }
//!
//! # fn main() -> krylux::Result<()> {
//! # let folder = tempfile::tempdir().expect("a temporary folder can be made");
//! ask("assets/scenes/zigzag/scene.glb", &folder.path().join("scene"))?;
//! # Ok(())
//! # }
//! ```
//!
//! [`Lab::builder`](lab::Lab::builder) changes the defaults. If a folder is given, the journal in it keeps every photo before the photo is
//! used, and the folder can itself be opened as a source. The same lines run on a rig and on a run:
//!
//! ```
//! use krylux::lab::Lab;
//! use krylux::verbs::Segment;
//!
//! # fn main() -> krylux::Result<()> {
//! # let folder = tempfile::tempdir().expect("a temporary folder can be made");
//! let run = folder.path().join("rig");
//! let mut rig = Lab::builder("assets/rigs/ideal.toml").size(24, 24).folder(&run).open()?;
//! let request = Segment { groups: vec![2], photos: Some(12), eigenvectors: 4, ..Segment::default() };
//! let first = rig.ask(&request)?;
//! rig.finish(&first)?;
//!
//! // The photos of the run answer the same request, with no rig attached.
//! let mut replay = krylux::open(&run)?;
//! let again = replay.ask(&request)?;
//! assert_eq!(first.segmentation.labels, again.segmentation.labels);
//! # Ok(())
//! # }
//! ```
//!
//! # Examples
//!
//! | `cargo run --release --example …` | shows |
//! |---|---|
//! | `first_groups` | the README's five lines |
//! | `segment` | groups of pixels that exchange light, with the report |
//! | `compensate` | a pattern under which a scene looks like a target |
//! | `own_verb` | a question of your own: its request, its answer and its page ([`lab::Verb`]) |
//! | `own_matrix` | eigenpairs of a matrix or a function of your own ([`krylov`], [`operator::Closure`]) |
//! | `own_camera` | a projector and a camera of your own behind the traits of [`rig`] |
//! | `relight_run` | a scene relit from the folder of a finished run |
//! | `sweep_albedo` | one number over twenty values of a material ([`scene`], [`Lab::builder_of_scene`](lab::Lab::builder_of_scene)) |
//!
//! The Python package in `python/` uses the same entry point: laboratories, operators and solvers for NumPy and SciPy.
//!
//! # The map
//!
//! | in the paper, or beyond it | here |
//! |---|---|
//! | photo = `A` · pattern, coaxial rig (section 3) | [`render`] traces it once, [`transport`] replays it |
//! | Krylov subspaces, eigenpairs (section 4), linear systems (section 6.2) | [`krylov`] |
//! | light transport segmentation (section 5) | [`analysis::segment`] |
//! | photos with real devices (sections 7 and 8) | [`measure`] makes them an operator, [`rig`] drives the devices, [`journal`] keeps every photo |
//! | light transport compensation (section 6) | [`analysis::compensate`](mod@analysis::compensate) |
//! | direct and global light (section 5.3) | [`analysis::separate`](mod@analysis::separate) |
//! | figures 2, 4 to 6 and 8 to 13 | [`paper`] makes them again, and holds them to bounds of its own |
//! | beyond: bounds on the solution, singular values, estimators | [`krylov`] |
//! | beyond: low-rank relighting (*Optical computing*, 2010) | [`analysis::low_rank`](mod@analysis::low_rank) |
//! | beyond: probing | [`analysis::probe`](mod@analysis::probe) |
//! | beyond: patterns painted by hand, their photo seen at once | [`paint`] |
//! | beyond: matrices that are too large for one machine | [`team`]: each process traces and keeps a part |
//!
//! Units, conventions and the symmetric estimator are described in [`render`] and [`transport`].
//!
//! # The rooms
//!
//! Each module imports only modules below it, so data flows one way. The list is complete; a test compares it with the sources.
//!
//! <!-- rooms: begin -->
//! ```text
//! cli       → paint, paper, verbs, lab, report, bench, analysis, cache, measure, rig, transport, render, scene, team, io, observer, finding, image, file, machine, error
//! paint     → verbs, lab, report, analysis, transport, krylov, io, sparse, operator, image, error
//! paper     → lab, report, analysis, calibrate, measure, transport, scene, team, krylov, io, sparse, operator, observer, image, error
//! verbs     → lab, report, bench, analysis, calibrate, measure, rig, transport, scene, krylov, io, sparse, operator, observer, finding, image, machine, error
//! lab       → report, bench, analysis, calibrate, cache, measure, rig, transport, render, scene, gpu, team, krylov, io, sparse, operator, journal, observer, finding, image, file, machine, error
//! report    → analysis, measure, krylov, io, finding, image, file, error
//! bench     → analysis, calibrate, measure, rig, io, operator, finding, image, error
//! analysis  → measure, rig, transport, scene, krylov, io, sparse, operator, observer, finding, image, error
//! calibrate → measure, rig, transport, finding, image, error
//! cache     → transport, render, scene, gpu, io, image, file, error
//! measure   → rig, transport, render, io, sparse, operator, journal, finding, image, file, error
//! rig       → transport, sparse, image, machine, error
//! transport → render, scene, gpu, team, io, sparse, operator, journal, observer, image, error
//! render    → scene, gpu, team, observer, image, error
//! scene     → finding, image, file, error
//! gpu       → machine, error
//! team      → error
//! krylov    → operator, observer, error
//! io        → sparse, finding, image, file, machine, error
//! sparse    → operator, error
//! operator  → observer, error
//! journal   → file, error
//! observer  → finding
//! finding   → error
//! image     → error
//! file      → machine, error
//! machine   →
//! error     →
//! ```
//! <!-- rooms: end -->
// The types of a device are nested more deeply than the compiler follows by default.
#![recursion_limit = "256"]

pub mod analysis;
pub mod bench;
pub mod cache;
pub mod calibrate;
pub mod cli;
pub mod error;
mod file;
pub mod finding;
pub mod gpu;
pub mod image;
pub mod io;
pub mod journal;
pub mod krylov;
pub mod lab;
mod machine;
pub mod measure;
pub mod observer;
pub mod operator;
pub mod paint;
#[cfg(feature = "paper")]
pub mod paper;
pub mod render;
pub mod report;
pub mod rig;
pub mod scene;
pub mod sparse;
pub mod team;
pub mod transport;
pub mod verbs;

pub use error::{Error, Result};
pub use lab::open;
