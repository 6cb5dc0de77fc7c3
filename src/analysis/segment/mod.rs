//! Light transport segmentation finds groups of pixels that exchange light with one another, and little light with other groups.
//!
//! Pixels are the nodes of a graph, and the global light `G_ij` between two pixels is the weight of their edge. The normalized cut (Shi and
//! Malik, doi:10.1109/34.868688) splits the graph where the exchanged light is small relative to the total light of each side. Relaxed to
//! real vectors, the cut is the generalized eigenproblem `(D − G) u = (1 − λ) D u`. Its smallest eigenvalues `1 − λ` belong to the largest
//! eigenvalues `λ` of `D^-½ G D^-½`, which Lanczos finds from a few dozen photos. K-means on the entries of the eigenvectors
//! ([`Embedding`]) gives any number of groups from one capture.
//!
//! The cut has a limit. Two surfaces that meet in a sharp crease exchange light at every scale. The eigenvalues of the continuous scene are
//! then not separate below some value (`guide/src/concepts/segmentation.md`), and fine groups follow the crease.
//!
//! Reference: O'Toole and Kutulakos, *Light Transport Analysis by Krylov Subspace Illumination*, section 5.

mod capture;
mod confirm;
mod cut_matrix;
mod embedding;
mod evidence;
mod graph;
mod grouping;
mod low_pass;
mod options;
mod regions;
mod segmentation;

pub use capture::Capture;
pub use confirm::Unseen;
pub use cut_matrix::CutMatrix;
pub use embedding::Embedding;
pub use evidence::{Evidence, FeatureView, Truth, adjusted_rand_index, evidence, feature_view};
pub use graph::Graph;
pub use options::{Coordinates, Cut, SegmentOptions};
pub use regions::{KEPT, Regions};
pub use segmentation::{MASKED, SURE, Segmentation, possible};

use crate::error::Result;
use crate::operator::Operator;

/// Segments a scene within a budget of photos. `global` is the scene's symmetric transport matrix (`n × n`) without the direct part. To
/// keep the photos taken before a failure, use a [`Capture`] instead. Fails as [`Capture::new`], [`Capture::run`] and
/// [`Capture::segmentation`] do.
pub fn segment(global: &mut dyn Operator, options: &SegmentOptions) -> Result<Segmentation> {
    let mut capture = Capture::new(options.clone())?;
    capture.run(global)?;
    capture.segmentation()
}
