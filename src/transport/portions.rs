//! Rows of the matrix that are merged portion by portion.

use std::ops::Range;

use super::RigShape;
use super::chunk::{CLASSES, Chunk};
use super::combine::{Combined, builders};
use super::merging::Merging;
use super::row_sums::RowSums;
use super::tiles::{Builder, Pieces};

/// Layers that get consecutive rows of a matrix portion by portion, where the contributions to all of them are never there at the same time.
pub(super) struct Portions<const C: usize> {
    rig: RigShape,
    layers: Vec<Builder>,
    /// For each layer, merged rows that are not in tiles yet, counted from the first row of the layers.
    pieces: Vec<Pieces>,
    sums: Vec<RowSums<C>>,
}

impl<const C: usize> Portions<C> {
    /// No rows yet, of so many, which get so many contributions of each class.
    pub(super) fn new(rig: RigShape, rows: usize, classes: usize, of_class: [usize; CLASSES]) -> Self {
        let layers = builders::<C>(of_class, rig, rows, classes, false);
        let pieces = layers.iter().map(|_| Pieces::new(0, Vec::new())).collect();
        Self { rig, layers, pieces, sums: Vec::new() }
    }

    /// Merges the next `rows`. The chunks have all contributions to them, in the order of [`combine`](super::combine::combine), and are handed back; `direct` is as
    /// there.
    pub(super) fn add(
        &mut self,
        chunks: Vec<Chunk<C>>,
        rows: &Range<usize>,
        direct: &[[[f64; 2]; C]],
    ) -> Vec<Chunk<C>> {
        let (mut merging, _) = Merging::new(chunks, self.rig, rows, false, direct);
        let merged = merging.pieces(&(0..rows.len()), self.layers.len());
        for ((layer, pieces), merged) in self.layers.iter_mut().zip(&mut self.pieces).zip(merged) {
            pieces.append(merged);
            while let Some(group) = layer.next_rows().filter(|group| group.end <= pieces.end()) {
                layer.push(pieces);
                pieces.release_before(group.end);
            }
        }
        self.sums.append(&mut merging.sums);
        merging.sources.into_chunks()
    }

    /// The layers, once all rows were added.
    pub(super) fn finish(self) -> Combined<C> {
        Combined { layers: self.layers.into_iter().map(Builder::finish).collect(), rows: self.sums }
    }
}
