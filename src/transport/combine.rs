//! The rows of the matrix, combined from the contributions of each pixel's paths and their transpose.
//!
//! A whole coaxial matrix is symmetric, so that only its triangle on and above the diagonal is merged. Row by row,
//! fewer contributions are needed: their memory is given back while that of the matrix grows.

use std::ops::Range;

use super::RigShape;
use super::chunk::CLASSES;
use super::fixed::{RowSums, Scale};
use super::found::Found;
use super::merging::{Merging, Pairs};
use super::row_sums::{Outline, outline};
use super::squares::EntrySquares;
use super::tiles::{Builder, Pieces, Tiles};
use super::transpose::Sources;

/// The sparse part of the matrix, with the sums from which its noise follows.
pub(super) struct Combined<const C: usize> {
    /// One layer for each class: one bounce, then the others.
    pub(super) layers: Vec<Tiles>,
    /// Sums for each of the rows.
    pub(super) rows: Vec<RowSums<C>>,
    /// Squares of all entries; of a symmetric matrix, those on and above the diagonal of the rows, where what is above it counts twice.
    pub(super) squares: EntrySquares,
}

/// Merges what was found into these `rows` of `classes` layers. `direct` is the diagonal, with mean and error for each of the rows and
/// channel, or empty. There are all contributions to these rows, those of the camera's paths first, by ascending start pixel.
pub(super) fn combine<const C: usize>(
    found: Found<C>,
    rig: RigShape,
    rows: Range<usize>,
    classes: usize,
    direct: &[[[f64; 2]; C]],
) -> Combined<C> {
    let pixels = rig.camera.pixels();
    let triangle = rig.symmetric && rows == (0..pixels);
    let scale = Scale::new(found.about.largest);
    let chunks = found.into_chunks();
    let Outline { mut sums, terms, of_class } = outline(&chunks, rig, &rows, triangle, scale);
    sums.iter_mut().zip(direct).for_each(|(sums, direct)| sums.add_direct(direct));
    let sources = Sources::new(chunks, rig, &rows, triangle);
    let pairs = if rig.symmetric { Pairs::Triangle } else { Pairs::Apart };
    let mut merging = Merging::new(sources, pairs, rows.start, terms, direct);
    let mut layers = builders::<C>(of_class, rig, rows.len(), classes, triangle);
    // All layers take the same rows.
    while let Some(group) = layers.iter().find_map(Builder::next_rows) {
        let pieces = merging.pieces(&group, classes);
        if triangle {
            merging.sources.release_before(group.end);
        }
        for (layer, pieces) in layers.iter_mut().zip(pieces) {
            layer.push(Pieces::new(group.start, pieces));
        }
    }
    let layers = layers.into_iter().map(Builder::finish).collect();
    Combined { layers, rows: sums, squares: merging.squares }
}

/// Tiles of each layer, without rows yet. `of_class` counts the contributions of each class to what is merged.
pub(super) fn builders<const C: usize>(
    of_class: [usize; CLASSES],
    rig: RigShape,
    rows: usize,
    classes: usize,
    triangle: bool,
) -> Vec<Builder> {
    let builder = |&entries: &usize| {
        let entries = if triangle { 2 * entries } else { entries };
        Builder::new([rows, rig.projector.pixels()], C, entries, triangle)
    };
    of_class[..classes].iter().map(builder).collect()
}
