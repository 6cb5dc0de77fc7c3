//! Products of a matrix that is spread over several processes, and its rows brought together.

use std::ops::Range;

use super::Spread;
use super::command::{Command, unread};
use crate::error::Result;
use crate::team::{Comm, Turn};
use crate::transport::TransportMatrix;
use crate::transport::layer::Layer;
use crate::transport::matrix::{Direction, Product};
use crate::transport::tiles::{Interleaved, Summable};
use crate::transport::wire;

impl Spread {
    /// Gives the other processes a command about the matrix.
    pub(super) fn command(&self, command: &Command) -> Turn<'_> {
        // Only names of files can lack bytes, and these commands have none.
        self.0.remote.command(&command.to_bytes().unwrap_or_default())
    }

    /// The product of a matrix of which `own` has the rows of this process, the leader.
    pub(in crate::transport) fn multiply<V: Summable>(
        &self,
        own: &TransportMatrix,
        product: Product,
        from: &[V],
        to: &mut [V],
    ) {
        let transposed = product.direction == Direction::Backward && !own.is_symmetric();
        if transposed {
            self.0.is_transposed.get_or_init(|| self.transpose(own));
        }
        let interleaved = size_of::<V>() == size_of::<Interleaved>();
        let turn = self.command(&Command::Multiply { product, interleaved });
        turn.broadcast(bytemuck::cast_slice(from));
        let mut rows = self.rows(transposed);
        let first = rows.next().unwrap_or_default();
        own.multiply_own(product, first.start, from, &mut to[first]);
        for (rank, rows) in turn.others().zip(rows) {
            let found = turn.comm().receive(rank);
            bytemuck::cast_slice_mut::<V, u8>(&mut to[rows]).copy_from_slice(&found);
        }
    }

    /// All rows of the layers, of which `own` has those of this process.
    pub(in crate::transport) fn gathered(&self, own: &[Layer]) -> Result<Vec<Layer>> {
        let layer = |(at, own): (usize, &Layer)| {
            let mut rows = own.to_rows();
            let turn = self.command(&Command::Rows { layer: at });
            for bytes in turn.receive_all() {
                wire::append_rows(&mut rows, &bytes).map_err(unread)?;
            }
            Ok(Layer::new(own.bounces(), own.tiles().cols(), vec![rows]))
        };
        own.iter().enumerate().map(layer).collect()
    }

    /// The squares of all entries of a layer, added row by row to the sum of those of this process.
    pub(in crate::transport) fn squares(&self, layer: usize, channel: usize, own: f64) -> f64 {
        let turn = self.command(&Command::Squares { layer, channel });
        turn.others().fold(own, |sum, rank| {
            turn.comm().send(rank, &sum.to_le_bytes());
            let sum = turn.comm().receive(rank).try_into().map(f64::from_le_bytes);
            sum.expect("all processes run the same program")
        })
    }
}

/// The rows of a product that this process has, for the leader, which sends the vector.
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
