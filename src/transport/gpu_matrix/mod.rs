//! The matrix in a device's memory. The device computes products, and only patterns and photos are transferred.

mod kernel;
mod layer;
#[cfg(test)]
pub(super) mod tests;
mod vectors;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use wgpu::BufferUsages;

use self::kernel::{Kernel, Terms};
pub(super) use self::kernel::{Limits, cut};
pub(super) use self::layer::{Band, DeviceLayer};
pub(super) use self::vectors::DeviceVectors;
use super::layer::Layer;
use super::matrix::Product;
use super::{Part, RigShape, TransportMatrix};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::buffers::Results;
use crate::gpu::pipeline::Step;
use crate::operator::vectors::made_elsewhere;
use crate::operator::{Direction, Selection};
use crate::render::Tracer;

/// A copy of a [`TransportMatrix`] on a graphics device.
///
/// Weights are `f32`. Vectors and sums are `f64`, as on the processor. 32 lanes sum a row in a fixed order, which is not the order of the
/// processor. Repeated products are therefore equal to the bit, and differ from [`TransportMatrix::apply`] only by the rounding of sums.
pub struct GpuMatrix {
    gpu: Gpu,
    kernel: Kernel,
    rig: RigShape,
    layers: Vec<Arc<DeviceLayer>>,
    diagonals: Vec<wgpu::Buffer>,
    /// Whether direct light is a diagonal. If not, `diagonals` has empty buffers.
    has_diagonal: bool,
    limits: Limits,
    /// The pattern and the photo. Each buffer has the length of the longer vector, because the transpose exchanges their roles.
    from: wgpu::Buffer,
    to: Results,
    state: Mutex<State>,
}

/// The transpose and the dispatches, which are made at first use. A product locks them, because all products use the same vector buffers.
struct State {
    transposed: Option<Vec<Arc<DeviceLayer>>>,
    products: Vec<(Product, Vec<Step>)>,
}

impl std::fmt::Debug for GpuMatrix {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuMatrix").field("rig", &self.rig).finish_non_exhaustive()
    }
}

impl GpuMatrix {
    /// Copies the matrix to the device that `tracer` traces on. A device without `f64` or without enough memory gives [`Error::Device`].
    pub fn new(tracer: &Tracer, matrix: &TransportMatrix) -> Result<Self> {
        Self::on(tracer.gpu(), matrix)
    }

    pub(super) fn on(gpu: &Gpu, matrix: &TransportMatrix) -> Result<Self> {
        Self::within(gpu, matrix, Limits::of(gpu))
    }

    fn within(gpu: &Gpu, matrix: &TransportMatrix, limits: Limits) -> Result<Self> {
        let layer = |layer: &Layer| match layer.resident() {
            Some(resident) => Ok(Arc::clone(resident)),
            None => DeviceLayer::upload(gpu, layer.bounces(), &layer.to_rows(), limits).map(Arc::new),
        };
        let on_processor = "take the products on the processor: --products cpu";
        gpu.require_double_precision("products").map_err(|error| error.help(on_processor))?;
        let layers = matrix.layers.iter().map(layer).collect::<Result<_>>()?;
        Self::of_layers(gpu, matrix, layers, None, limits)
    }

    /// A matrix whose layers are on the device already. `transposed` has the layers of the transpose, if the rig is not coaxial.
    pub(super) fn of_layers(
        gpu: &Gpu,
        matrix: &TransportMatrix,
        layers: Vec<Arc<DeviceLayer>>,
        transposed: Option<Vec<Arc<DeviceLayer>>>,
        limits: Limits,
    ) -> Result<Self> {
        let kernel = gpu.kept("product", || Kernel::new(gpu))?;
        let rig = matrix.rig;
        let bytes = 8 * rig.projector.pixels().max(rig.camera.pixels()) as u64;
        let from = gpu.buffer("pattern", bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST)?;
        let to = Results::new(gpu, "photo", bytes)?;
        let diagonals = matrix.direct.iter().map(|plane| gpu.storage("matrix's diagonal", plane));
        let diagonals = diagonals.collect::<Result<_>>()?;
        let has_diagonal = matrix.direct.iter().all(|plane| plane.len() == rig.camera.pixels());
        let (state, gpu) = (Mutex::new(State { transposed, products: Vec::new() }), gpu.clone());
        Ok(Self { gpu, kernel, rig, layers, diagonals, has_diagonal, limits, from, to, state })
    }

    /// `y ← P x`, as [`TransportMatrix::apply`].
    ///
    /// # Errors
    /// [`Error::Dimension`] for vectors that do not fit; [`Error::Device`] if the device fails.
    pub fn apply(&self, part: Part, channel: usize, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.take(&mut self.state(), Product { direction: Direction::Forward, part, channel }, x, y)
    }

    /// Computes a product. `matrix` must be the matrix that was copied to the device. If the rig is not coaxial, the transpose is copied at
    /// first use.
    pub(super) fn multiply(
        &self,
        matrix: &TransportMatrix,
        product: Product,
        from: &[f64],
        to: &mut [f64],
    ) -> Result<()> {
        let (mut state, product) = self.prepare(matrix, product)?;
        self.take(&mut state, product, from, to)
    }

    /// Copies the transpose to the device if this product is the first that needs it. Returns the product that the device computes in place
    /// of this one.
    fn prepare(
        &self,
        matrix: &TransportMatrix,
        product: Product,
    ) -> Result<(MutexGuard<'_, State>, Product)> {
        let mut state = self.state();
        if product.direction == Direction::Adjoint && !self.rig.symmetric && state.transposed.is_none() {
            let layer = |layer: &Layer| {
                let rows = layer.fetch()?.to_rows().transposed(&(0..self.rig.projector.pixels()), 0);
                DeviceLayer::upload(&self.gpu, layer.bounces(), &rows, self.limits).map(Arc::new)
            };
            state.transposed = Some(matrix.layers.iter().map(layer).collect::<Result<_>>()?);
        }
        // The matrix of a coaxial rig is its own transpose.
        let direction = if self.rig.symmetric { Direction::Forward } else { product.direction };
        Ok((state, Product { direction, ..product }))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn steps<'a>(&self, state: &'a mut State, product: Product) -> Result<&'a [Step]> {
        let known = state.products.iter().position(|(known, _)| *known == product);
        let index = match known {
            Some(index) => index,
            None => {
                let steps = self.new_steps(state, product)?;
                state.products.push((product, steps));
                state.products.len() - 1
            }
        };
        Ok(&state.products[index].1)
    }

    fn new_steps(&self, state: &State, product: Product) -> Result<Vec<Step>> {
        let Product { part, channel, direction } = product;
        let (layers, rows) = match &state.transposed {
            Some(transposed) if direction == Direction::Adjoint => (transposed, self.rig.projector),
            _ => (&self.layers, self.rig.camera),
        };
        let diagonal = part.holds(1) && self.has_diagonal;
        let shared = [&self.diagonals[channel], &self.from, &self.to.buffer];
        let mut steps = Vec::new();
        let mut is_first = true;
        for layer in layers.iter().filter(|layer| part.has(layer.bounces)) {
            let terms = Terms { diagonal: diagonal && is_first, adds: !is_first };
            for band in &layer.bands {
                let of_channel = Some((band, channel));
                steps.push(self.kernel.step(&self.gpu, band.rows.clone(), of_channel, terms, shared)?);
            }
            is_first = false;
        }
        if is_first {
            let (rows, terms) = (rows.pixels(), Terms { diagonal, adds: false });
            for first in (0..rows).step_by(self.limits.rows) {
                // A resolution has at most 2³² pixels.
                let rows = first as u32..rows.min(first + self.limits.rows) as u32;
                steps.push(self.kernel.step(&self.gpu, rows, None, terms, shared)?);
            }
        }
        Ok(steps)
    }

    fn take(&self, state: &mut State, product: Product, from: &[f64], to: &mut [f64]) -> Result<()> {
        let expected = [self.rig.projector.pixels(), self.rig.camera.pixels()];
        let found = match product.direction {
            Direction::Forward => [from.len(), to.len()],
            Direction::Adjoint => [to.len(), from.len()],
        };
        if found != expected {
            return Err(Error::dimension(
                "pixels of pattern and photo",
                format!("{} and {}", expected[0], expected[1]),
                format!("{} and {}", found[0], found[1]),
            ));
        }
        let gpu = &self.gpu;
        let steps = self.steps(state, product)?;
        let photo = self.to.launch(gpu, "product", size_of_val(to) as u64, |encoder| {
            gpu.queue.write_buffer(&self.from, 0, bytemuck::cast_slice(from));
            Step::record(gpu, "products", steps, encoder);
        })?;
        to.copy_from_slice(bytemuck::cast_slice(&photo.wait(gpu)?));
        Ok(())
    }
}

/// Products with vectors that stay on the device.
impl GpuMatrix {
    /// Room for vectors of a square matrix, as [`Operator::vectors`](crate::operator::Operator::vectors), or `None` if the device's memory
    /// has none.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails; [`Error::Dimension`] for a selection that does not fit.
    pub(super) fn vectors(
        &self,
        columns: usize,
        selection: Option<Selection<'_>>,
    ) -> Result<Option<DeviceVectors>> {
        let [rows, cols] = [self.rig.camera.pixels(), self.rig.projector.pixels()];
        if rows != cols {
            return Ok(None);
        }
        if let Some(Selection { entries, factors }) = selection {
            Error::check_size("factors of a selection", entries.len(), factors.len())?;
            let last = entries.last().copied().unwrap_or(0);
            if last >= rows || !entries.is_sorted_by(|a, b| a < b) {
                let expected = format!("ascending, below {rows}");
                return Err(Error::dimension(
                    "the entries of a selection",
                    expected,
                    format!("up to {last}"),
                ));
            }
        }
        vectors::kernels(&self.gpu)?;
        let made = DeviceVectors::new(&self.gpu, selection.map_or(rows, |of| of.entries.len()), columns)
            .and_then(|vectors| vectors.of_product(rows, selection));
        match made {
            Ok(vectors) => Ok(Some(vectors)),
            Err(_) => self.gpu.require_working().map(|()| None),
        }
    }

    /// `w ← P v`, or `w ← S P Sᵀ v` with the selection of the vectors, for a column `v` and a part `P` or its transpose. Waits for the
    /// product only if it was taken in advance. `matrix` is as for [`GpuMatrix::multiply`]. Fails as [`GpuMatrix::apply`], and with
    /// [`Error::Numerical`] for vectors of another size.
    pub(super) fn multiply_within(
        &self,
        matrix: &TransportMatrix,
        product: Product,
        vectors: &mut DeviceVectors,
        column: usize,
    ) -> Result<()> {
        let pixels = self.rig.camera.pixels();
        if vectors.pixels() != pixels || self.rig.projector.pixels() != pixels {
            return Err(made_elsewhere());
        }
        let (mut state, product) = self.prepare(matrix, product)?;
        let steps = self.steps(&mut state, product)?;
        let record = |vectors: &DeviceVectors, column: usize, encoder: &mut wgpu::CommandEncoder| {
            vectors.write_pattern(column, &self.from, encoder);
            Step::record(&self.gpu, "products", steps, encoder);
            vectors.read_photo(&self.to.buffer, encoder);
        };
        vectors.multiply((self.from.clone(), product), column, &record)
    }
}

/// Measurements for the benchmarks: products without transfers to or from the host, and plain copies for comparison.
impl GpuMatrix {
    /// The bytes that a product with all light of one channel reads and writes, each counted once.
    pub fn bytes_of_product(&self) -> u64 {
        let of_band = |band: &Band| {
            band.starts.size() + band.columns.size() + band.weights.first().map_or(0, wgpu::Buffer::size)
        };
        let bands = self.layers.iter().flat_map(|layer| &layer.bands);
        let vectors = 8 * (self.rig.projector.pixels() + self.rig.camera.pixels()) as u64;
        let diagonal =
            if self.has_diagonal { self.diagonals.first().map_or(0, wgpu::Buffer::size) } else { 0 };
        bands.map(of_band).sum::<u64>() + diagonal + vectors
    }

    /// The number of dispatches of a product with all light of one channel.
    pub fn dispatches(&self) -> usize {
        self.layers.iter().map(|layer| layer.bands.len()).sum::<usize>().max(1)
    }

    /// The time of `count` products with all light of the first channel, one after the other on the device, with the pattern of the most
    /// recent product. A device that fails gives [`crate::Error::Device`].
    pub fn time_products(&self, count: u32) -> Result<Duration> {
        let mut state = self.state();
        let product = Product { part: Part::Full, channel: 0, direction: Direction::Forward };
        let steps = self.steps(&mut state, product)?;
        self.time("products", |encoder| {
            (0..count).for_each(|_| Step::record(&self.gpu, "products", steps, encoder));
        })
    }

    /// The time of `count` copies of `bytes` from one buffer to another, which read and write each byte once. A device that fails or lacks
    /// memory gives [`crate::Error::Device`].
    pub fn time_copies(&self, bytes: u64, count: u32) -> Result<Duration> {
        let bytes = bytes.next_multiple_of(4);
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let [from, to] = [self.gpu.buffer("copied", bytes, usage)?, self.gpu.buffer("copy", bytes, usage)?];
        let copy = |encoder: &mut wgpu::CommandEncoder| {
            (0..count).for_each(|_| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes));
        };
        // The first run also clears the buffers, so only the time of the second run is returned.
        self.time("copies", copy)?;
        self.time("copies", copy)
    }

    fn time(&self, what: &str, work: impl FnOnce(&mut wgpu::CommandEncoder)) -> Result<Duration> {
        let start = Instant::now();
        let submission = self.gpu.submit(what, work)?;
        self.gpu.wait(Some(submission))?;
        Ok(start.elapsed())
    }
}
