//! Products of a matrix that is spread over several processes, its transpose, and the collection of its rows.

use std::ops::Range;

use super::{Command, Spread, is_transposed, own_rows};
use crate::error::Result;
use crate::render::StartPixels;
use crate::team::{Comm, Turn};
use crate::transport::layer::Layer;
use crate::transport::matrix::Product;
use crate::transport::tiles::{CompressedRows, Interleaved, Summable};
use crate::transport::{TransportMatrix, wire};

impl Spread {
    fn command(&self, command: &Command) -> Turn<'_> {
        self.0.remote.command(command).expect("numbers can be sent")
    }

    /// The product of a matrix. `own` has the rows of this process, the leader.
    pub(in crate::transport) fn multiply<V: Summable>(
        &self,
        own: &TransportMatrix,
        product: Product,
        from: &[V],
        to: &mut [V],
    ) {
        if is_transposed(own, product) {
            self.0.is_transposed.get_or_init(|| {
                let turn = self.command(&Command::Transpose);
                transpose_part(turn.comm(), own, &self.0.pixels);
            });
        }
        let interleaved = size_of::<V>() == size_of::<Interleaved>();
        let turn = self.command(&Command::Multiply { product, interleaved });
        turn.broadcast(bytemuck::cast_slice(from));
        let mut rows = self.0.pixels.iter().map(|pixels| own_rows(own, product, pixels).clone());
        let first = rows.next().unwrap_or_default();
        own.multiply_own(product, first.start, from, &mut to[first]);
        for (rank, rows) in turn.others().zip(rows) {
            let found = turn.comm().receive(rank);
            bytemuck::cast_slice_mut::<V, u8>(&mut to[rows]).copy_from_slice(&found);
        }
    }

    /// All rows of the layers. `own` are the rows of this process.
    pub(in crate::transport) fn gathered(&self, own: &[Layer]) -> Result<Vec<Layer>> {
        let layer = |(at, own): (usize, &Layer)| {
            let mut rows = vec![own.to_rows()];
            let channels = rows[0].weights.len();
            for bytes in self.command(&Command::Rows { layer: at }).receive_all() {
                rows.push(wire::take_rows(&bytes, channels).map_err(wire::unread)?);
            }
            Ok(Layer::new(own.bounces(), own.tiles().cols(), rows))
        };
        own.iter().enumerate().map(layer).collect()
    }

    /// The squares of all entries of a layer, added row by row to `own`, which is the sum over the rows of this process.
    pub(in crate::transport) fn squares(&self, layer: usize, channel: usize, own: f64) -> f64 {
        let turn = self.command(&Command::Squares { layer, channel });
        turn.others().fold(own, |sum, rank| {
            turn.comm().send(rank, &sum.to_le_bytes());
            number(&turn.comm().receive(rank))
        })
    }
}

pub(super) fn number(message: &[u8]) -> f64 {
    message.try_into().map(f64::from_le_bytes).expect("all processes run the same program")
}

/// Computes this process's rows of a product for the leader, which sends the vector.
pub(super) fn multiply_part<V: Summable>(
    comm: &dyn Comm,
    own: &TransportMatrix,
    product: Product,
    rows: &Range<usize>,
) {
    let from: Vec<V> = bytemuck::pod_collect_to_vec(&comm.broadcast(None));
    let mut to = vec![V::default(); rows.len()];
    own.multiply_own(product, rows.start, &from, &mut to);
    comm.send(0, bytemuck::cast_slice(&to));
}

/// Makes this process's rows of the transpose, one for each of its projector pixels. Every process of the team must call it.
pub(super) fn transpose_part(comm: &dyn Comm, own: &TransportMatrix, pixels: &[StartPixels]) {
    for layer in &own.layers {
        let rows = layer.to_rows();
        let message = |to: &StartPixels| wire::rows_to_bytes(&rows.transposed(&to.projector, own.rows.start));
        let received = comm.exchange(pixels.iter().map(message).collect());
        let channels = rows.weights.len();
        // The rows of the matrix arrive by rank, so they are in order.
        let parts: Vec<CompressedRows> = received
            .iter()
            .map(|bytes| wire::take_rows(bytes, channels).expect("all processes run the same program"))
            .collect();
        let count = pixels[comm.rank()].projector.len();
        let mut joined = CompressedRows::with_room(channels, count, 0);
        for row in 0..count {
            parts.iter().for_each(|part| joined.extend(part, part.row(row)));
            joined.end_row();
        }
        layer.keep_transpose(Layer::new(layer.bounces(), own.rig.camera.pixels(), vec![joined]));
    }
}
