//! The traced light transport matrix: a diagonal, and sparse layers for different numbers of bounces.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::gpu_matrix::DeviceVectors;
use super::layer::{Bounces, Layer, square};
use super::spread::Spread;
use super::tiles::{BLOCK_WIDTH, CompressedRows, Interleaved, Summable};
use super::{Channels, GpuMatrix, RigShape};
use crate::error::Result;
use crate::image::Resolution;
use crate::operator::vectors::made_elsewhere;
use crate::operator::{Adjoint, Direction, Operator, Selection, Symmetry, Vectors};
use crate::sparse::Csr;

/// The number of rows that a task multiplies if the matrix has only a diagonal.
const BAND: usize = 4096;

/// A part of the light, selected by the number of bounces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Part {
    /// All light, `A`.
    Full,
    /// Light of one bounce. For a coaxial pinhole rig, its matrix is diagonal.
    Direct,
    /// Light of two and more bounces.
    Global,
}

impl Part {
    pub(super) fn holds(self, bounces: u32) -> bool {
        match self {
            Self::Full => true,
            Self::Direct => bounces == 1,
            Self::Global => bounces > 1,
        }
    }

    pub(super) fn has(self, layer: Bounces) -> bool {
        self.holds(if layer == Bounces::One { 1 } else { 2 })
    }
}

#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Product {
    pub(super) direction: Direction,
    pub(super) part: Part,
    pub(super) channel: usize,
}

/// `A = diag(direct) + Σ layers`, with a row for each camera pixel and a column for each projector pixel.
///
/// The matrix of a coaxial rig is symmetric to the last bit, and so is each of its parts. Products are summed in `f64`, in an order that
/// does not depend on the number of threads.
#[derive(Clone, Debug)]
pub struct TransportMatrix {
    pub(crate) rig: RigShape,
    pub(crate) channels: Channels,
    /// The diagonal, indexed by `[channel][pixel]`. It is empty if the rig is not coaxial.
    pub(crate) direct: Vec<Vec<f32>>,
    pub(crate) layers: Vec<Layer>,
    /// The rows that this process holds in its layers. These are all rows, unless the matrix is spread over several processes.
    pub(super) rows: Range<usize>,
    pub(super) spread: Option<Arc<Spread>>,
}

/// Two matrices are equal if their entries are equal to the last bit. Both must also hold the same rows.
impl PartialEq for TransportMatrix {
    fn eq(&self, other: &Self) -> bool {
        (self.rig, self.channels, &self.rows) == (other.rig, other.channels, &other.rows)
            && (&self.direct, &self.layers) == (&other.direct, &other.layers)
    }
}

impl TransportMatrix {
    pub(crate) fn new(rig: RigShape, channels: Channels, direct: Vec<Vec<f32>>, layers: Vec<Layer>) -> Self {
        Self { rig, channels, direct, layers, rows: 0..rig.camera.pixels(), spread: None }
    }

    /// The camera's resolution. The matrix has one row for each camera pixel.
    pub fn resolution(&self) -> Resolution {
        self.rig.camera
    }

    /// The projector's resolution. The matrix has one column for each projector pixel.
    pub fn projector_resolution(&self) -> Resolution {
        self.rig.projector
    }

    /// Whether the rig is coaxial, so that `A = Aᵀ`.
    pub fn is_symmetric(&self) -> bool {
        self.rig.symmetric
    }

    /// The one or three channels of the matrix. Each channel is a separate linear system.
    pub fn channels(&self) -> Channels {
        self.channels
    }

    /// The number of stored entries, without the diagonal.
    pub fn nonzeros(&self) -> usize {
        let elsewhere = self.spread.as_ref().map_or(0, |spread| spread.nonzeros);
        self.layers.iter().map(Layer::nonzeros).sum::<usize>() + elsewhere
    }

    /// The size of the matrix in memory in bytes, summed over all processes that hold a part of it.
    pub fn bytes(&self) -> usize {
        let direct = self.direct.iter().map(|plane| 4 * plane.len()).sum::<usize>();
        let elsewhere = self.spread.as_ref().map_or(0, |spread| spread.bytes);
        self.layers.iter().map(Layer::bytes).sum::<usize>() + direct + elsewhere
    }

    /// The number of processes that hold a part of the matrix.
    pub fn processes(&self) -> usize {
        self.spread.as_ref().map_or(1, |spread| spread.pixels.len())
    }

    /// The diagonal of `channel`: direct light that returns to its own pixel through a pinhole. It is empty if the rig is not coaxial.
    pub fn direct(&self, channel: usize) -> &[f32] {
        &self.direct[channel]
    }

    /// The bounces of each layer.
    pub fn bounces(&self) -> impl Iterator<Item = Bounces> + '_ {
        self.layers.iter().map(Layer::bounces)
    }

    /// The sparse layers by number of bounces. The first layer has light of one bounce, unless the diagonal holds all of that light. Light
    /// of two bounces and light of more bounces follow, in two layers or in one. If the matrix is spread over several processes, this
    /// process first collects all layers, which takes the memory of the whole matrix. [`Error::Team`](crate::Error::Team) means that
    /// another process sent something other than rows of these layers.
    pub fn layers(&self) -> Result<Cow<'_, [Layer]>> {
        match &self.spread {
            None => {
                self.fetch()?;
                Ok(Cow::Borrowed(&self.layers))
            }
            Some(spread) => spread.gathered(&self.layers).map(Cow::Owned),
        }
    }

    /// Reads the layers from the device that has assembled them, unless they are in memory already. Otherwise the first product on the
    /// processor does so, and panics if the device fails. A device that fails gives [`crate::Error::Device`].
    pub fn fetch(&self) -> Result<()> {
        self.layers.iter().try_for_each(|layer| layer.fetch().map(drop))
    }

    /// `y ← P x` for the `part` `P` of one channel. `x` has an entry for each projector pixel, and may be negative. `y` has an entry for
    /// each camera pixel.
    pub fn apply(&self, part: Part, channel: usize, x: &[f64], y: &mut [f64]) {
        self.multiply(Product { direction: Direction::Forward, part, channel }, x, y);
    }

    /// `x ← Pᵀ y` for the `part` `P` of one channel. This is a photo of the dual rig, in which camera and projector are exchanged. `y` has
    /// an entry for each camera pixel, and `x` for each projector pixel.
    pub fn apply_transpose(&self, part: Part, channel: usize, y: &[f64], x: &mut [f64]) {
        self.multiply(Product { direction: Direction::Adjoint, part, channel }, y, x);
    }

    /// `y_k ← P x_k` for each vector of `xs`, with the same bits as [`TransportMatrix::apply`]. The matrix is read once for up to four
    /// products. `ys` and `xs` have the same length. Each vector of `ys` has an entry for each camera pixel.
    pub fn apply_block(&self, part: Part, channel: usize, xs: &[&[f64]], ys: &mut [&mut [f64]]) {
        self.multiply_block(Product { direction: Direction::Forward, part, channel }, xs, ys);
    }

    fn multiply_block(&self, product: Product, from: &[&[f64]], to: &mut [&mut [f64]]) {
        assert_eq!(from.len(), to.len(), "a product for each vector");
        for (from, to) in from.chunks(BLOCK_WIDTH).zip(to.chunks_mut(BLOCK_WIDTH)) {
            if let ([from], [to]) = (from, &mut *to) {
                self.multiply(product, from, to);
                continue;
            }
            let mut values = vec![Interleaved::default(); to[0].len()];
            self.multiply(product, &interleave(from), &mut values);
            deinterleave(&values, to);
        }
    }

    fn multiply<V: Summable>(&self, product: Product, from: &[V], to: &mut [V]) {
        let (camera, projector) = (self.rig.camera.pixels(), self.rig.projector.pixels());
        let [lit, seen] = match product.direction {
            Direction::Forward => [from.len(), to.len()],
            Direction::Adjoint => [to.len(), from.len()],
        };
        assert_eq!((lit, seen), (projector, camera), "x has the projector's pixels, and y the camera's");
        match &self.spread {
            None => self.multiply_own(product, self.rows.start, from, to),
            Some(spread) => spread.multiply(self, product, from, to),
        }
    }

    /// Computes this process's rows of a product. The first of these rows is row `first` of the product.
    pub(super) fn multiply_own<V: Summable>(
        &self,
        Product { direction, part, channel }: Product,
        first: usize,
        from: &[V],
        to: &mut [V],
    ) {
        let transposed = direction == Direction::Adjoint && !self.rig.symmetric;
        let layers = self.layers.iter().filter(|layer| part.has(layer.bounces()));
        let layers: Vec<&Layer> =
            layers.map(|layer| if transposed { layer.transpose() } else { layer }).collect();
        let direct = if part.holds(1) { self.direct[channel].as_slice() } else { &[] };
        // All layers have the same number of rows, so their bands have equal sizes.
        let rows = layers.first().map_or(BAND, |layer| layer.tiles().band_rows());
        to.par_chunks_mut(rows).enumerate().for_each(|(band, to)| {
            let of_band = first + band * rows..first + band * rows + to.len();
            let mut products = layers.iter().map(|layer| layer.tiles().product(channel, band, from));
            let sums = products.next().unwrap_or_else(|| vec![V::default(); to.len()]);
            match direct.get(of_band.clone()) {
                Some(direct) => {
                    let direct = direct.iter().zip(&from[of_band]);
                    to.iter_mut().zip(sums).zip(direct).for_each(|((to, product), (&direct, from))| {
                        *to = from.times(f64::from(direct)).plus(product);
                    });
                }
                None => to.copy_from_slice(&sums),
            }
            for product in products {
                to.iter_mut().zip(product).for_each(|(to, product)| *to = to.plus(product));
            }
        });
    }

    /// The Frobenius norm of the `part` of one channel. If several layers have an entry at the same position, each entry is squared on its
    /// own. The result is then smaller than the norm of the sum of the layers.
    pub fn frobenius_norm(&self, part: Part, channel: usize) -> f64 {
        let mut all = 0.0;
        for (at, layer) in self.layers.iter().enumerate().filter(|(_, layer)| part.has(layer.bounces())) {
            let own = layer.squares(channel, 0.0);
            all += self.spread.as_ref().map_or(own, |spread| spread.squares(at, channel, own));
        }
        if part.holds(1) {
            all += self.direct[channel].iter().map(|&value| square(value)).sum::<f64>();
        }
        all.sqrt()
    }

    /// The `part` of one channel as a compressed sparse matrix, for example to write it to a file. Entries of several layers at the same
    /// position are added and rounded to `f32`. The call fails like [`TransportMatrix::layers`], or if [`Csr`] rejects the arrays.
    pub fn to_csr(&self, part: Part, channel: usize) -> Result<Csr> {
        let layers = self.layers()?;
        let layers: Vec<CompressedRows> =
            layers.iter().filter(|layer| part.has(layer.bounces())).map(Layer::to_rows).collect();
        let mut row_start = vec![0];
        let (mut columns, mut weights) = (Vec::new(), Vec::new());
        let mut entries: Vec<(u32, f32)> = Vec::new();
        for row in 0..self.rig.camera.pixels() {
            entries.clear();
            for layer in &layers {
                let of_row = layer.row_start[row]..layer.row_start[row + 1];
                let weights = &layer.weights[channel][of_row.clone()];
                entries.extend(layer.columns[of_row].iter().copied().zip(weights.iter().copied()));
            }
            if part.holds(1) {
                let diagonal = self.direct[channel].get(row).copied().filter(|&direct| direct != 0.0);
                entries.extend(diagonal.map(|diagonal| (row as u32, diagonal)));
            }
            entries.sort_by_key(|entry| entry.0);
            for run in entries.chunk_by(|a, b| a.0 == b.0) {
                columns.push(run[0].0);
                let sum: f64 = run.iter().map(|entry| f64::from(entry.1)).sum();
                weights.push(f64::from(sum as f32));
            }
            row_start.push(columns.len());
        }
        Csr::new(self.rig.projector.pixels(), row_start, columns, weights)
    }
}

/// `y = P x` for one part and channel of a transport matrix. Each product is one photo. The processor multiplies up to four vectors at
/// once.
#[derive(Clone, Copy, Debug)]
pub struct MatrixOperator<'a> {
    matrix: &'a TransportMatrix,
    /// The copy of the matrix on the device, if the device computes the products.
    device: Option<&'a GpuMatrix>,
    part: Part,
    channel: usize,
}

impl<'a> MatrixOperator<'a> {
    /// An operator whose products the processor computes. [`super::Assembled::operator`] can also use a device. The channel must be below
    /// [`Channels::count`].
    pub fn new(matrix: &'a TransportMatrix, part: Part, channel: usize) -> Self {
        Self { matrix, device: None, part, channel }
    }

    pub(super) fn on(self, device: Option<&'a GpuMatrix>) -> Self {
        Self { device, ..self }
    }

    fn block(&self, direction: Direction, from: &[&[f64]], to: &mut [&mut [f64]]) -> Result<()> {
        let product = Product { direction, part: self.part, channel: self.channel };
        match self.device {
            Some(device) => {
                from.iter().zip(to).try_for_each(|(from, to)| device.multiply(self.matrix, product, from, to))
            }
            None => {
                self.matrix.multiply_block(product, from, to);
                Ok(())
            }
        }
    }
}

impl Operator for MatrixOperator<'_> {
    fn rows(&self) -> usize {
        self.matrix.rig.camera.pixels()
    }

    fn cols(&self) -> usize {
        self.matrix.rig.projector.pixels()
    }

    fn symmetry(&self) -> Symmetry {
        self.matrix.rig.symmetry()
    }

    fn apply_block(&mut self, xs: &[&[f64]], ys: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Forward, xs, ys)
    }

    fn block_size(&self) -> usize {
        if self.device.is_none() { BLOCK_WIDTH } else { 1 }
    }

    fn confirming(&mut self, _: bool) -> bool {
        true
    }

    /// On a device that computes the products.
    fn vectors(&self, columns: usize, selection: Option<Selection<'_>>) -> Result<Option<Box<dyn Vectors>>> {
        let Some(device) = self.device else { return Ok(None) };
        Ok(device.vectors(columns, selection)?.map(|vectors| Box::new(vectors) as Box<dyn Vectors>))
    }

    fn apply_within(&mut self, vectors: &mut dyn Vectors, column: usize, direction: Direction) -> Result<()> {
        let vectors = (vectors as &mut dyn std::any::Any).downcast_mut::<DeviceVectors>();
        match self.device.zip(vectors) {
            Some((device, vectors)) => {
                let product = Product { part: self.part, channel: self.channel, direction };
                device.multiply_within(self.matrix, product, vectors, column)
            }
            None => Err(made_elsewhere()),
        }
    }
}

impl Adjoint for MatrixOperator<'_> {
    fn apply_adjoint_block(&mut self, ys: &[&[f64]], xs: &mut [&mut [f64]]) -> Result<()> {
        self.block(Direction::Adjoint, ys, xs)
    }
}

const TASK: usize = 4096;

/// Interleaves at most four vectors of equal length. Element `i` holds entry `i` of each vector, and zeros in place of missing vectors.
pub(super) fn interleave(vectors: &[&[f64]]) -> Vec<Interleaved> {
    let mut values = vec![Interleaved::default(); vectors.first().map_or(0, |vector| vector.len())];
    values.par_chunks_mut(TASK).enumerate().for_each(|(task, values)| {
        for (place, vector) in vectors.iter().enumerate() {
            let vector = &vector[task * TASK..];
            values.iter_mut().zip(vector).for_each(|(value, &entry)| value.0[place] = entry);
        }
    });
    values
}

/// The reverse of [`interleave`]: writes each vector to its own slice.
pub(super) fn deinterleave(values: &[Interleaved], to: &mut [&mut [f64]]) {
    to.par_iter_mut().enumerate().for_each(|(place, vector)| {
        vector.iter_mut().zip(values).for_each(|(entry, value)| *entry = value.0[place]);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The vectors are longer than the parts of two tasks. Three vectors fill three of the four places of an element.
    #[test]
    fn vectors_of_several_tasks_are_interleaved_in_their_order() {
        let length = 2 * TASK + 7;
        let vectors: Vec<Vec<f64>> =
            (0..3).map(|place| (0..length).map(|entry| (10 * entry + place) as f64).collect()).collect();
        let values = interleave(&vectors.iter().map(Vec::as_slice).collect::<Vec<_>>());
        assert_eq!(values.len(), length);
        for (entry, value) in values.iter().enumerate() {
            let first = (10 * entry) as f64;
            assert_eq!(value.0, [first, first + 1.0, first + 2.0, 0.0]);
        }
        let mut back = vec![vec![f64::NAN; length]; 3];
        deinterleave(&values, &mut back.iter_mut().map(Vec::as_mut_slice).collect::<Vec<_>>());
        assert!(back == vectors);
    }
}
