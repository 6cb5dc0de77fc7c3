//! The matrix in a device's memory. Products are taken there, and only patterns and photos are transferred.

mod bands;
mod figures;
mod kernel;
#[cfg(test)]
pub(super) mod tests;

use std::sync::{Mutex, PoisonError};

use wgpu::BufferUsages;

use self::bands::{DeviceLayer, Limits};
use self::kernel::{Kernel, Shared, Step, Terms};
use super::layer::Layer;
use super::{Part, RigShape, TransportMatrix};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::buffers::Results;
use crate::render::Tracer;

/// A copy of a [`TransportMatrix`] on a graphics device.
///
/// Weights are `f32`, vectors and sums `f64`, as on the processor. 32 lanes sum a row in a fixed order, which
/// is not the processor's. So products repeat to the bit, and differ from [`TransportMatrix::apply`] by the
/// rounding of sums only.
pub struct GpuMatrix {
    gpu: Gpu,
    kernel: Kernel,
    rig: RigShape,
    layers: Vec<DeviceLayer>,
    /// One buffer for each channel.
    diagonals: Vec<wgpu::Buffer>,
    /// Whether direct light is a diagonal; without one the buffers above are empty.
    has_diagonal: bool,
    limits: Limits,
    vectors: Vectors,
    state: Mutex<State>,
}

/// The buffers of pattern and photo on the device.
struct Vectors {
    from: wgpu::Buffer,
    to: Results,
}

/// What is made when first needed. A product holds its lock, since all products share the vectors.
#[derive(Default)]
struct State {
    transposed: Option<Vec<DeviceLayer>>,
    products: Vec<(Product, Vec<Step>)>,
}

/// Which product: of which part and channel, and whether with the transpose.
#[derive(Clone, Copy, PartialEq)]
struct Product {
    part: Part,
    channel: usize,
    is_transposed: bool,
}

impl std::fmt::Debug for GpuMatrix {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GpuMatrix").field("rig", &self.rig).finish_non_exhaustive()
    }
}

impl GpuMatrix {
    /// Copies the matrix to the device that `tracer` traces on.
    ///
    /// # Errors
    /// [`Error::Device`] where the device has no `f64` or not enough memory.
    pub fn new(tracer: &Tracer, matrix: &TransportMatrix) -> Result<Self> {
        Self::on(tracer.gpu(), matrix)
    }

    pub(super) fn on(gpu: &Gpu, matrix: &TransportMatrix) -> Result<Self> {
        Self::within(gpu, matrix, Limits::of(gpu))
    }

    fn within(gpu: &Gpu, matrix: &TransportMatrix, limits: Limits) -> Result<Self> {
        if !gpu.summary.double_precision {
            return Err(Error::Device {
                fault: format!("{} cannot calculate in f64, which products need", gpu.summary.name),
                help: "take the products on the processor: --products cpu".into(),
            });
        }
        let kernel = Kernel::new(gpu)?;
        let rig = matrix.rig;
        let vectors = Vectors::new(gpu, rig)?;
        let diagonals = matrix.direct.iter().map(|plane| gpu.storage("matrix's diagonal", plane));
        let diagonals = diagonals.collect::<Result<_>>()?;
        let has_diagonal = matrix.direct.iter().all(|plane| plane.len() == rig.camera.pixels());
        let layer = |layer: &Layer| DeviceLayer::upload(gpu, layer.bounces(), &layer.to_rows(), limits);
        let layers = matrix.layers.iter().map(layer).collect::<Result<_>>()?;
        let state = Mutex::default();
        let gpu = gpu.clone();
        Ok(Self { gpu, kernel, rig, layers, diagonals, has_diagonal, limits, vectors, state })
    }

    /// `y ← P x`, as [`TransportMatrix::apply`].
    ///
    /// # Errors
    /// [`Error::Dimension`] for vectors that do not fit; [`Error::Device`] when the device failed.
    pub fn apply(&self, part: Part, channel: usize, x: &[f64], y: &mut [f64]) -> Result<()> {
        self.check([x.len(), y.len()])?;
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let product = Product { part, channel, is_transposed: false };
        let steps = self.steps(&mut state, product)?;
        self.multiply(steps, x, y)
    }

    /// `x ← Pᵀ y`, as [`TransportMatrix::apply_transpose`]. For a rig that is not coaxial, the transpose of
    /// `matrix` (the matrix that this is a copy of) is copied to the device when first needed.
    ///
    /// # Errors
    /// As [`GpuMatrix::apply`]; [`Error::Device`] also where the transpose does not fit the memory.
    pub fn apply_transpose(
        &self,
        matrix: &TransportMatrix,
        part: Part,
        channel: usize,
        y: &[f64],
        x: &mut [f64],
    ) -> Result<()> {
        self.check([x.len(), y.len()])?;
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if !self.rig.symmetric && state.transposed.is_none() {
            let layer = |layer: &Layer| {
                let (_, rows) = layer.transposed_rows();
                DeviceLayer::upload(&self.gpu, layer.bounces(), &rows, self.limits)
            };
            state.transposed = Some(matrix.layers.iter().map(layer).collect::<Result<_>>()?);
        }
        let product = Product { part, channel, is_transposed: !self.rig.symmetric };
        let steps = self.steps(&mut state, product)?;
        self.multiply(steps, y, x)
    }

    fn check(&self, found: [usize; 2]) -> Result<()> {
        let [x, y] = [self.rig.projector.pixels(), self.rig.camera.pixels()];
        if found == [x, y] {
            return Ok(());
        }
        Err(Error::Dimension {
            what: "pixels of pattern and photo",
            expected: format!("{x} and {y}"),
            found: format!("{} and {}", found[0], found[1]),
        })
    }

    /// The dispatches of a product; prepared once.
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
        let Product { part, channel, is_transposed } = product;
        let (layers, rows) = match &state.transposed {
            Some(transposed) if is_transposed => (transposed, self.rig.projector),
            _ => (&self.layers, self.rig.camera),
        };
        let diagonal = part.holds(1) && self.has_diagonal;
        let shared = Shared {
            diagonal: &self.diagonals[channel],
            from: &self.vectors.from,
            to: &self.vectors.to.buffer,
        };
        let mut steps = Vec::new();
        let mut is_first = true;
        for layer in layers.iter().filter(|layer| part.has(layer.bounces)) {
            let terms = Terms { diagonal: diagonal && is_first, adds: !is_first };
            for band in &layer.bands {
                steps.push(self.kernel.band(&self.gpu, (band, channel), terms, &shared)?);
            }
            is_first = false;
        }
        if is_first {
            let rows = rows.pixels();
            for first in (0..rows).step_by(self.limits.rows) {
                // A resolution has at most 2³² pixels.
                let rows = first as u32..rows.min(first + self.limits.rows) as u32;
                steps.push(self.kernel.diagonal(
                    &self.gpu,
                    rows,
                    Terms { diagonal, adds: false },
                    &shared,
                )?);
            }
        }
        Ok(steps)
    }

    fn multiply(&self, steps: &[Step], from: &[f64], to: &mut [f64]) -> Result<()> {
        let gpu = &self.gpu;
        let Vectors { from: pattern, to: photo } = &self.vectors;
        let bytes = size_of_val(to) as u64;
        let submission = gpu.guarded("product", || {
            gpu.queue.write_buffer(pattern, 0, bytemuck::cast_slice(from));
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.kernel.encode(&mut encoder, steps);
            photo.submit(gpu, encoder, bytes)
        })?;
        let view = photo.wait(gpu, photo.request(bytes, submission))?;
        to.copy_from_slice(bytemuck::cast_slice(&view));
        drop(view);
        photo.release();
        Ok(())
    }
}

impl Vectors {
    /// Each buffer is as long as the longer of pattern and photo: they change places for the transpose.
    fn new(gpu: &Gpu, rig: RigShape) -> Result<Self> {
        let bytes = 8 * rig.projector.pixels().max(rig.camera.pixels()) as u64;
        Ok(Self {
            from: gpu.buffer("pattern", bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST)?,
            to: Results::new(gpu, "photo", bytes)?,
        })
    }
}
