//! The vectors of a Krylov process in a device's memory.

mod ahead;
mod flight;
mod of_product;

use std::borrow::Cow;
use std::ops::Range;

use wgpu::BufferUsages;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::buffers::Results;
use crate::gpu::pipeline::{Kernel, READ, Step, WRITE};
use crate::operator::vectors::{is_ordinary, made_elsewhere, norm_of_square};
use crate::operator::{Product, Settling, Sums, Vectors};
use ahead::Ahead;
use of_product::OfProduct;

/// The bytes of a buffer of columns, unless a single column is larger.
const CHUNK: u64 = 64 << 20;

/// The first columns, of this number, are in one buffer if the device permits it, so that they can be combined. No method combines more.
const COMBINED: usize = 12;

/// A bound beyond this number stands for no bound.
const FARTHEST: f64 = 1e200;

/// Stands for `w` in place of a column; `W` of `shaders/vectors.wgsl`.
const W: u32 = u32::MAX;

/// The entries of a block of sums; `ROWS` of `shaders/vectors.wgsl`.
const ROWS: usize = 1024;

/// The entries of a workgroup that takes each entry of a vector; `INVOCATIONS` of `shaders/vectors.wgsl`.
const INVOCATIONS: usize = 256;

/// The uniform of a dispatch, with the layout of `Part` in `shaders/vectors.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
struct Part {
    rows: u32,
    first: u32,
    columns: u32,
    place: u32,
    blocks: u32,
    square: u32,
    second: u32,
    third: u32,
}

/// Columns `V` and a vector `w` in `f64`. Sums have a fixed order, which is not the order of the host. Results therefore repeat to the bit,
/// and differ from those of the host only by rounding.
pub(in crate::transport) struct DeviceVectors {
    gpu: Gpu,
    rows: usize,
    columns: usize,
    /// The largest number of columns.
    room: usize,
    /// The number of columns in each chunk.
    together: usize,
    chunks: Vec<Chunk>,
    work: wgpu::Buffer,
    /// One vector, which is about to become a column, or was one.
    single: wgpu::Buffer,
    coefficients: Coefficients,
    sums: Results,
    /// `combine`, `scale_by` and `clip_by`.
    entrywise: [Step; 3],
    gather: Step,
    of: Option<OfProduct>,
    ahead: Ahead,
}

/// Some columns, and the dispatches that read them.
struct Chunk {
    columns: wgpu::Buffer,
    remove_from_work: Step,
    remove_from_single: Step,
    dots: Step,
}

/// The kernels of `shaders/vectors.wgsl`.
pub(super) fn kernels(gpu: &Gpu) -> Result<[Kernel; 8]> {
    gpu.kept("vectors", || {
        let buffers = [READ, READ, WRITE, WRITE];
        let entry_points =
            ["remove", "dots", "gather", "combine", "scale_by", "clip_by", "write_selected", "read_selected"];
        Kernel::all(gpu, "vectors", entry_points, &[], &buffers, |source| gpu.module("vectors", source))
    })
}

/// The coefficients of the columns in `w`, in the last column, and those of the terms of a combination with its divisor.
struct Coefficients {
    of_work: wgpu::Buffer,
    of_single: wgpu::Buffer,
    of_terms: wgpu::Buffer,
}

impl DeviceVectors {
    /// Makes room for `columns` columns of `rows` entries. Fails with [`Error::Device`] if the device has too little memory.
    pub(super) fn new(gpu: &Gpu, rows: usize, columns: usize) -> Result<Self> {
        let bytes = 8 * rows as u64;
        let largest = gpu.summary.max_storage_binding.min(gpu.summary.max_buffer);
        Self::in_chunks(gpu, rows, columns, CHUNK.max(COMBINED as u64 * bytes).min(largest))
    }

    /// Works like [`DeviceVectors::new`], with buffers of at most this many bytes, and of at least one column.
    pub(super) fn in_chunks(gpu: &Gpu, rows: usize, columns: usize, chunk: u64) -> Result<Self> {
        let [remove, dots, gather, combine, scale_by, clip_by, ..] = kernels(gpu)?;
        let bytes = 8 * rows as u64;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let buffer = |label: &str, bytes: u64| gpu.buffer(label, bytes, usage);
        let [work, single] = [buffer("vector", bytes)?, buffer("vector", bytes)?];
        let scalars = 8 * (columns as u64 + 1);
        let coefficients = Coefficients {
            of_work: buffer("coefficients", scalars)?,
            of_single: buffer("coefficients", scalars)?,
            of_terms: buffer("terms", 32)?,
        };
        let partial = buffer("sums of blocks", scalars * rows.div_ceil(ROWS) as u64)?;
        let sums = Results::new(gpu, "sums", scalars)?;
        let step =
            |kernel: &Kernel, buffers: [&wgpu::Buffer; 4]| kernel.step(gpu, &Part::default(), &buffers, 0);
        let together = (chunk / bytes.max(1)).clamp(1, columns.max(1) as u64) as usize;
        let chunk = |index| {
            let columns = together.min(columns.max(1) - index * together);
            let columns = buffer("columns", bytes * columns as u64)?;
            let Coefficients { of_work, of_single, .. } = &coefficients;
            Ok(Chunk {
                remove_from_work: step(&remove, [&columns, of_work, &work, &partial])?,
                remove_from_single: step(&remove, [&columns, of_single, &single, &partial])?,
                dots: step(&dots, [&columns, of_work, &work, &partial])?,
                columns,
            })
        };
        let chunks: Vec<Chunk> = (0..columns.max(1).div_ceil(together)).map(chunk).collect::<Result<_>>()?;
        let first = &chunks[0].columns;
        let entrywise = |kernel| step(kernel, [first, &coefficients.of_terms, &work, &single]);
        let entrywise = [entrywise(&combine)?, entrywise(&scale_by)?, entrywise(&clip_by)?];
        let gather = step(&gather, [first, &coefficients.of_work, &sums.buffer, &partial])?;
        let (ahead, gpu) = (Ahead::new(gpu), gpu.clone());
        Ok(Self {
            gpu,
            rows,
            columns: 0,
            room: columns,
            together,
            chunks,
            work,
            single,
            coefficients,
            sums,
            entrywise,
            gather,
            of: None,
            ahead,
        })
    }

    /// Records a copy of a column to the beginning of a buffer.
    fn copy_column(&self, index: usize, to: &wgpu::Buffer, encoder: &mut wgpu::CommandEncoder) {
        let (chunk, place) = self.place(index);
        encoder.copy_buffer_to_buffer(chunk, place, to, 0, self.bytes());
    }

    fn bytes(&self) -> u64 {
        8 * self.rows as u64
    }

    /// The buffer of a column, and its place in bytes.
    fn place(&self, index: usize) -> (&wgpu::Buffer, u64) {
        let place = (index % self.together) as u64 * self.bytes();
        (&self.chunks[index / self.together].columns, place)
    }

    /// The number by which kernels know a column of the first buffer, or `w`.
    fn combinable(&self, column: Option<usize>) -> Result<u32> {
        match column {
            Some(column) if column >= self.together => Err(made_elsewhere()),
            Some(column) => Ok(column as u32),
            None => Ok(W),
        }
    }

    /// Computes one of the `entrywise` kernels, and then copies.
    fn entry_by_entry(
        &mut self,
        kernel: usize,
        part: Part,
        coefficients: [f64; 4],
        copy: impl Fn(&Self, &mut wgpu::CommandEncoder),
    ) -> Result<()> {
        self.depart()?;
        self.plan_entries(kernel, part)?;
        self.gpu.submit("combination", |encoder| {
            let coefficients = bytemuck::bytes_of(&coefficients);
            self.gpu.queue.write_buffer(&self.coefficients.of_terms, 0, coefficients);
            Step::record(&self.gpu, "combination", [&self.entrywise[kernel]], encoder);
            copy(self, encoder);
        })?;
        Ok(())
    }

    fn plan_entries(&mut self, kernel: usize, part: Part) -> Result<()> {
        let part = Part { rows: self.rows as u32, ..part };
        self.entrywise[kernel].change(&self.gpu, &part, self.rows.div_ceil(INVOCATIONS) as u32)
    }

    /// Prepares [`DeviceVectors::record_push`].
    fn plan_push(&mut self) -> Result<()> {
        self.plan_entries(0, Part { columns: 1, first: W, second: W, third: W, ..Part::default() })
    }

    /// Records the copy of `w`, divided by the coefficients of the terms, to a column.
    fn record_push(&self, column: usize, encoder: &mut wgpu::CommandEncoder) {
        Step::record(&self.gpu, "combination", [&self.entrywise[0]], encoder);
        let (to, place) = self.place(column);
        encoder.copy_buffer_to_buffer(&self.single, 0, to, place, self.bytes());
    }

    /// The parts of the chunks from the first of these columns to the last. The first column's coefficient or sum is at `place`.
    fn parts(&self, columns: Range<usize>, place: usize) -> Vec<(usize, Part)> {
        let (together, blocks) = (self.together, self.rows.div_ceil(ROWS) as u32);
        let part = |chunk: usize| {
            let start = columns.start.max(chunk * together);
            let end = columns.end.min((chunk + 1) * together);
            let part = Part {
                rows: self.rows as u32,
                first: (start - chunk * together) as u32,
                columns: (end - start) as u32,
                place: (place + start - columns.start) as u32,
                blocks,
                ..Part::default()
            };
            (chunk, part)
        };
        let chunks = columns.start / together..columns.end.div_ceil(together);
        if columns.is_empty() { Vec::new() } else { chunks.map(part).collect() }
    }

    /// Prepares [`DeviceVectors::record`]: `w ← w − V h` over the columns of `removed`, then `u ← u − V s` for column `last` and the columns
    /// before it, unless it is 0, and then `Vᵀ w` over the columns of `dots`, and `‖w‖²`. `h` begins with the coefficient of column 0.
    fn plan(&mut self, removed: Range<usize>, last: usize, dots: Option<Range<usize>>) -> Result<Sweep> {
        let gpu = self.gpu.clone();
        let of_work = self.parts(removed.clone(), removed.start);
        let of_single = self.parts(0..last, 0);
        let mut of_dots = dots.map_or_else(Vec::new, |columns| {
            if columns.is_empty() {
                return vec![(0, Part { columns: 0, ..self.parts(0..1, 0)[0].1 })];
            }
            self.parts(columns, 0)
        });
        let entries = self.rows.div_ceil(INVOCATIONS) as u32;
        for &(chunk, part) in &of_work {
            self.chunks[chunk].remove_from_work.change(&gpu, &part, entries)?;
        }
        for &(chunk, part) in &of_single {
            self.chunks[chunk].remove_from_single.change(&gpu, &part, entries)?;
        }
        if let Some((_, part)) = of_dots.last_mut() {
            part.square = 1;
            let all = Part { columns: part.place + part.columns + 1, ..*part };
            self.gather.change(&gpu, &all, all.columns)?;
        }
        for &(chunk, part) in &of_dots {
            self.chunks[chunk].dots.change(&gpu, &part, part.blocks)?;
        }
        let chunks = |parts: Vec<(usize, Part)>| parts.into_iter().map(|(chunk, _)| chunk).collect();
        Ok(Sweep { of_work: chunks(of_work), of_single: chunks(of_single), last, of_dots: chunks(of_dots) })
    }

    /// Records the sweep that was prepared last, with the coefficients that are on the device then.
    fn record(&self, sweep: &Sweep, encoder: &mut wgpu::CommandEncoder) {
        let Sweep { of_work, of_single, last, of_dots } = sweep;
        let steps = of_work.iter().map(|&chunk| &self.chunks[chunk].remove_from_work);
        Step::record(&self.gpu, "orthogonalization", steps, encoder);
        if *last > 0 {
            let (column, place) = self.place(*last);
            self.copy_column(*last, &self.single, encoder);
            let steps = of_single.iter().map(|&chunk| &self.chunks[chunk].remove_from_single);
            Step::record(&self.gpu, "orthogonalization", steps, encoder);
            encoder.copy_buffer_to_buffer(&self.single, 0, column, place, self.bytes());
        }
        if !of_dots.is_empty() {
            let steps = of_dots.iter().map(|&chunk| &self.chunks[chunk].dots);
            Step::record(&self.gpu, "inner products", steps.chain([&self.gather]), encoder);
        }
    }

    /// `w ← w − V h`, over the columns from the given one, then `u ← u − V s` for the last column `u` and the columns before it. Then
    /// `Vᵀ w` over the columns from `dots`, and `‖w‖`; without `dots` nothing is read back.
    fn sweep(&mut self, (first, h): (usize, &[f64]), s: &[f64], dots: Option<usize>) -> Result<Sums> {
        let dots = dots.map(|first| first.min(self.columns)..self.columns);
        let sweep = self.plan(first..first + h.len(), s.len(), dots.clone())?;
        let gpu = &self.gpu;
        let record = |encoder: &mut wgpu::CommandEncoder| {
            gpu.queue.write_buffer(&self.coefficients.of_work, 8 * first as u64, bytemuck::cast_slice(h));
            gpu.queue.write_buffer(&self.coefficients.of_single, 0, bytemuck::cast_slice(s));
            self.record(&sweep, encoder);
        };
        let Some(dots) = dots else {
            gpu.submit("orthogonalization", record)?;
            return Ok((Vec::new(), 0.0));
        };
        let found = self.sums.launch(gpu, "inner products", 8 * (dots.len() as u64 + 1), record)?;
        let mut sums: Vec<f64> = bytemuck::pod_collect_to_vec(&found.wait(gpu)?[..]);
        let square = sums.pop().unwrap_or_default();
        let length = if is_ordinary(square) { square.sqrt() } else { norm_of_square(square, &self.work()?) };
        Ok((sums, length))
    }
}

/// The chunks that take part in a sweep, and the column that changes.
struct Sweep {
    of_work: Vec<usize>,
    of_single: Vec<usize>,
    last: usize,
    of_dots: Vec<usize>,
}

impl Vectors for DeviceVectors {
    fn rows(&self) -> usize {
        self.rows
    }

    fn columns(&self) -> usize {
        self.columns
    }

    fn column(&self, index: usize) -> Result<Cow<'_, [f64]>> {
        let (column, place) = self.expected_column(index);
        self.gpu.submit("column", |encoder| {
            encoder.copy_buffer_to_buffer(column, place, &self.single, 0, self.bytes());
        })?;
        Ok(Cow::Owned(self.gpu.read(&self.single, self.rows)?))
    }

    fn work(&self) -> Result<Cow<'_, [f64]>> {
        Ok(Cow::Owned(self.gpu.read(self.expected_work(), self.rows)?))
    }

    fn load(&mut self, x: &[f64]) -> Result<()> {
        self.depart()?;
        self.gpu.fill("vector", &self.work, 0, bytemuck::cast_slice(x))
    }

    fn clear(&mut self) {
        self.forget();
        self.columns = 0;
    }

    fn push(&mut self, divisor: f64) -> Result<()> {
        if self.columns == self.room {
            return Err(Error::device(format!(
                "the basis has no room for more than {} vectors",
                self.columns
            )));
        }
        self.push_of_step(divisor, |vectors| {
            // A division by 1 would give the same bits, but Vulkan does not promise it.
            if divisor == 1.0 {
                vectors.keep(vectors.columns)
            } else {
                vectors.combine(Some(vectors.columns), &[(1.0, None)], divisor)
            }
        })
    }

    fn combine(&mut self, to: Option<usize>, terms: &[(f64, Option<usize>)], divisor: f64) -> Result<()> {
        let at = |term: usize| terms.get(term).map_or(Ok(W), |&(_, column)| self.combinable(column));
        let part = Part {
            columns: terms.len() as u32,
            first: at(0)?,
            second: at(1)?,
            third: at(2)?,
            ..Part::default()
        };
        let mut coefficients = [0.0, 0.0, 0.0, divisor];
        coefficients.iter_mut().zip(terms).for_each(|(coefficient, (c, _))| *coefficient = *c);
        self.entry_by_entry(0, part, coefficients, |vectors, encoder| {
            let (to, place) = to.map_or((&vectors.work, 0), |column| vectors.place(column));
            encoder.copy_buffer_to_buffer(&vectors.single, 0, to, place, vectors.bytes());
        })
    }

    fn keep(&mut self, index: usize) -> Result<()> {
        self.depart()?;
        let (column, place) = self.place(index);
        self.gpu.submit("column", |encoder| {
            encoder.copy_buffer_to_buffer(&self.work, 0, column, place, self.bytes());
        })?;
        Ok(())
    }

    fn scale_by(&mut self, index: usize) -> Result<()> {
        let part = Part { first: self.combinable(Some(index))?, ..Part::default() };
        self.entry_by_entry(1, part, [0.0; 4], |_, _| {})
    }

    fn clip_by(&mut self, index: usize, (lower, upper): (f64, f64)) -> Result<()> {
        let part = Part { first: self.combinable(Some(index))?, ..Part::default() };
        // The kernel multiplies finite numbers.
        let [lower, upper] = [lower, upper].map(|bound| bound.clamp(-FARTHEST, FARTHEST));
        self.entry_by_entry(2, part, [lower, upper, 0.0, 0.0], |_, _| {})
    }

    fn remove(&mut self, h: &[f64]) -> Result<()> {
        let first = h.iter().position(|h| *h != 0.0).unwrap_or(h.len());
        self.remove_of_step(h, |vectors| vectors.sweep((first, &h[first..]), &[], None).map(drop))
    }

    fn dots_and_norm(&mut self, first: usize) -> Result<Sums> {
        self.dots_of_step(first, |vectors| vectors.sweep((0, &[]), &[], Some(first)))
    }

    fn remove_and_dot(&mut self, h: &[f64]) -> Result<Sums> {
        self.depart()?;
        self.sweep((0, h), &[], Some(0))
    }

    fn settle_and_dot(&mut self, settling: &Settling<'_>) -> Result<Sums> {
        let Settling { late, along, ahead } = settling;
        let first = self.columns - along.len();
        self.settled_of_step(settling, |vectors| {
            if late.is_empty() {
                return vectors.sweep((first, along), &[], Some(0));
            }
            let known: Vec<f64> = ahead.iter().take(first).chain(*along).copied().collect();
            vectors.sweep((0, &known), late, Some(0))
        })
    }

    fn product(&self) -> Result<Product> {
        self.expected_product()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout};

    #[test]
    fn parts_lie_as_the_shader_reads_them() {
        assert_layout!("vectors", "Part", Part: rows, first, columns, place, blocks, square, second, third);
        assert_constant("vectors", "ROWS", ROWS as u32);
        assert_constant("vectors", "W", W);
        assert_constant("vectors", "INVOCATIONS", INVOCATIONS as u32);
    }
}
