//! A matrix that is spread over the processes of a team: each traces the light paths from some pixels, and has the rows of these pixels.
//!
//! Every sum is taken in the order in which one process alone would take it, so that the bits do not depend on the number of processes:
//!
//! * A row of the matrix gets contributions from the paths of its own pixel, and from paths of other pixels that end there. Each process sends the
//!   latter to the process that has the row (`exchange`), which merges them by ascending start pixel. Of an entry of a symmetric matrix and its
//!   mirror image, one process merges one, and the other is a copy.
//! * Sums over rows and over all entries, from which the noise follows, are exact, so that they do not depend on the order (`sums`).
//! * A product of a row is the sum over its entries from left to right. The process that has the row takes it, and the leader puts the rows
//!   together (`product`). The transpose of a rig that is not coaxial is spread by the pixels of the projector, after its first use.
//! * A photo that is traced anew adds up contributions to every pixel in the order of the paths. The processes trace, the leader adds up
//!   (`retrace`).
//!
//! The leader tells the others what to do by a `Command`; a [`SceneWorker`] does it.

mod assembly;
mod balance;
mod command;
mod exchange;
mod product;
mod retrace;
mod scene;
mod sums;
#[cfg(test)]
mod tests;
mod transpose;
mod worker;

pub(super) use assembly::assemble;
pub(super) use retrace::trace;
pub use scene::share_scene;
pub use worker::SceneWorker;

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use crate::render::StartPixels;
use crate::team::Remote;

/// The parts of a matrix that other processes have, as the leader sees them.
#[derive(Clone, Debug)]
pub(super) struct Spread(Arc<Parts>);

/// See [`Spread`].
#[derive(Debug)]
struct Parts {
    remote: Remote,
    /// The pixels of each process, by rank: its rows are those of the camera, its columns those of the projector.
    pixels: Vec<StartPixels>,
    /// The number of entries that other processes have, and the bytes that these take there.
    nonzeros: usize,
    bytes: usize,
    /// Set once each process has its rows of the transpose.
    is_transposed: OnceLock<()>,
}

impl Spread {
    fn new(remote: Remote, pixels: Vec<StartPixels>, nonzeros: usize, bytes: usize) -> Self {
        Self(Arc::new(Parts { remote, pixels, nonzeros, bytes, is_transposed: OnceLock::new() }))
    }

    /// The number of entries that other processes have.
    pub(super) fn nonzeros(&self) -> usize {
        self.0.nonzeros
    }

    /// The bytes that they take there.
    pub(super) fn bytes(&self) -> usize {
        self.0.bytes
    }

    /// The number of processes that have a part.
    pub(super) fn processes(&self) -> usize {
        self.0.pixels.len()
    }

    /// The rows of a product that each process has, by rank. `transposed` is the product with the transpose of a matrix that is not symmetric.
    fn rows(&self, transposed: bool) -> impl Iterator<Item = Range<usize>> + '_ {
        self.0
            .pixels
            .iter()
            .map(move |own| if transposed { own.projector.clone() } else { own.camera.clone() })
    }
}
