//! Steps of a Krylov process that a device takes before the host asks for them.

use std::cell::Cell;
use std::collections::VecDeque;

use rayon::prelude::*;
use wgpu::{Buffer, BufferUsages, CommandEncoder};

use super::ahead::{Call, Shape};
use super::{DeviceVectors, INVOCATIONS, Part};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Readback;
use crate::gpu::pipeline::{Kernel, READ, Step, WRITE};
use crate::operator::vectors::is_ordinary;
use crate::operator::{Product, Sums};

/// Records the commands of a product with a column.
pub(super) type Record<'a> = &'a dyn Fn(&DeviceVectors, usize, &mut CommandEncoder);

/// Rows of the memory of `shaders/vectors_ahead.wgsl`. `BEFORE` rows are followed by records of `RECORD` rows.
const ABOVE: usize = 1;
const TERMS: usize = 4;
const BEFORE: usize = 5;
const KNOWN_PARTS: usize = 1;
const LATE_PARTS: usize = 2;
const REST: usize = 3;
const RECORD: usize = 4;

/// The uniform of a dispatch, with the layout of `Ahead` in `shaders/vectors_ahead.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Default, bytemuck::Pod, bytemuck::Zeroable)]
struct Parameters {
    columns: u32,
    first: u32,
    known: u32,
    is_last: u32,
    room: u32,
    place: u32,
}

/// Steps of one shape. The host asks for them one after the other.
pub(super) struct Flight {
    pub(super) shape: Shape,
    /// `settle` and `rest` of the shader.
    coefficients: [Step; 2],
    /// Removes the parts along the known vectors from `w`.
    remove_known: Step,
    memory: Buffer,
    /// The length of a row of the memory.
    room: usize,
    slots: Vec<Slot>,
    /// The slots of the steps that the host has not begun to ask for, oldest first.
    launched: VecDeque<(usize, Readback)>,
    /// The slot of the step that the host asks for, and the results.
    present: Option<(usize, Taken)>,
    /// The slot of the last step that the host has asked for wholly.
    pushed: Option<usize>,
    /// The number of steps that the host has asked for wholly.
    pub(super) steps: usize,
}

/// The vectors of a step that the next steps overwrite.
struct Slot {
    /// The last column before its late parts are removed.
    column: Buffer,
    pattern: Buffer,
    photo: Buffer,
    /// `w` after the product, if that is not the photo.
    product: Option<Buffer>,
    /// `w` after [`settle_and_dot`](crate::operator::Vectors::settle_and_dot).
    rest: Buffer,
    /// `w` without its parts along the known vectors, if there are any.
    left: Option<Buffer>,
    /// The record, and then the pattern and the photo if the host reads them.
    staging: Buffer,
}

/// The results of a step.
pub(super) struct Taken {
    /// The inner products of the product, and of the remainder; `None` if the square of the norm is not of ordinary size.
    pub(super) along: Option<Sums>,
    pub(super) rest: Option<Sums>,
    /// The parts that were removed from the product and from the last column.
    pub(super) known: Vec<f64>,
    pub(super) late: Vec<f64>,
    /// The divisor of the new column.
    pub(super) divisor: f64,
    /// The pattern and the photo, until the host takes them.
    product: Cell<Option<Product>>,
}

impl Taken {
    /// The results of a step with `total` columns, from the staging buffer of its slot.
    fn new(found: &[f64], room: usize, (total, recent): (usize, usize)) -> Self {
        let row = |row: usize, length: usize| found[row * room..][..length].to_vec();
        let sums = |mut sums: Vec<f64>| {
            let square = sums.pop().unwrap_or_default();
            is_ordinary(square).then(|| (sums, square.sqrt()))
        };
        let vectors = &found[RECORD * room..];
        let (from, to) = vectors.split_at(vectors.len() / 2);
        // The first write to new pages takes longer than the copy.
        let copied = |vector: &[f64]| vector.par_iter().copied().collect();
        Self {
            along: sums(row(0, recent + 1)),
            rest: sums(row(REST, total + 1)),
            known: row(KNOWN_PARTS, total),
            late: row(LATE_PARTS, total - 1),
            divisor: found[(LATE_PARTS + 1) * room - 1],
            product: Cell::new((!vectors.is_empty()).then(|| Product { from: copied(from), to: copied(to) })),
        }
    }
}

impl Slot {
    /// Room for a step of `vectors` of this shape. `reads` says whether the host reads patterns and photos.
    fn new(vectors: &DeviceVectors, shape: &Shape, room: usize, reads: bool) -> Result<Self> {
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let vector = |entries: usize| vectors.gpu.buffer("vector ahead", 8 * entries as u64, usage);
        let (rows, pixels) = (vectors.rows, vectors.pixels());
        let read = RECORD * room + if reads { 2 * pixels } else { 0 };
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        Ok(Self {
            column: vector(rows)?,
            pattern: vector(pixels)?,
            photo: vector(pixels)?,
            product: vectors.is_selection().then(|| vector(rows)).transpose()?,
            rest: vector(rows)?,
            left: (shape.known > 0).then(|| vector(rows)).transpose()?,
            staging: vectors.gpu.buffer("read-back", 8 * read as u64, usage)?,
        })
    }

    /// `w` when the host has come as far as `call`.
    fn work(&self, call: Call) -> &Buffer {
        match call {
            Call::Product | Call::Dots => self.product.as_ref().unwrap_or(&self.photo),
            Call::Settle => &self.rest,
            _ => self.left.as_ref().unwrap_or(&self.rest),
        }
    }
}

/// The kernels of `shaders/vectors_ahead.wgsl`.
pub(super) fn kernels(gpu: &Gpu) -> Result<[Kernel; 2]> {
    gpu.kept("vectors_ahead", || {
        Kernel::all(gpu, "vectors_ahead", ["settle", "rest"], &[], &[READ, WRITE], |source| {
            gpu.module("vectors_ahead", source)
        })
    })
}

/// Records a copy of a whole buffer to the beginning of another one.
fn copy(from: &Buffer, to: &Buffer, encoder: &mut CommandEncoder) {
    encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size());
}

impl Flight {
    /// Makes room for `depth` steps that follow a regular step of this shape, whose sums are on the device. The known vectors must be in the
    /// first buffer of columns. `tridiagonal` has the entries above, on and below the diagonal for each column.
    pub(super) fn new(
        vectors: &DeviceVectors,
        shape: Shape,
        (depth, reads): (usize, bool),
        tridiagonal: &[[f64; 3]],
    ) -> Result<Self> {
        let (gpu, room) = (&vectors.gpu, vectors.room + 1);
        let [settle, rest] = kernels(gpu)?;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let rows = BEFORE + depth * RECORD;
        let memory = gpu.buffer("coefficients ahead", (8 * rows * room) as u64, usage)?;
        for place in 0..3 {
            let entries: Vec<f64> = tridiagonal.iter().map(|entries| entries[place]).collect();
            let start = (8 * (ABOVE + place) * room) as u64;
            gpu.fill("tridiagonal matrix", &memory, start, bytemuck::cast_slice(&entries))?;
        }
        let step =
            |kernel: &Kernel| kernel.step(gpu, &Parameters::default(), &[&vectors.sums.buffer, &memory], 1);
        let coefficients = [step(&settle)?, step(&rest)?];
        let [remove, ..] = super::kernels(gpu)?;
        let part = Part { rows: vectors.rows as u32, columns: shape.known as u32, ..Part::default() };
        let buffers = [&vectors.chunks[0].columns, &vectors.coefficients.of_work, &vectors.work, &memory];
        let remove_known = remove.step(gpu, &part, &buffers, vectors.rows.div_ceil(INVOCATIONS) as u32)?;
        let slots = (0..depth).map(|_| Slot::new(vectors, &shape, room, reads)).collect::<Result<_>>()?;
        let (launched, present, pushed, steps) = (VecDeque::new(), None, None, 0);
        let mut flight =
            Self { shape, coefficients, remove_known, memory, room, slots, launched, present, pushed, steps };
        let parameters = flight.parameters(vectors.columns - 1, 0);
        flight.coefficients[1].change(gpu, &parameters, 1)?;
        gpu.submit("coefficients", |encoder| {
            Step::record(gpu, "coefficients", [&flight.coefficients[1]], encoder);
        })?;
        Ok(flight)
    }

    /// The number of steps that the host has not begun to ask for.
    pub(super) fn launched(&self) -> usize {
        self.launched.len()
    }

    fn parameters(&self, columns: usize, slot: usize) -> Parameters {
        Parameters {
            columns: columns as u32,
            first: columns.saturating_sub(self.shape.recent) as u32,
            known: self.shape.known as u32,
            is_last: u32::from(self.shape.waiting == 1),
            room: self.room as u32,
            place: ((BEFORE + slot * RECORD) * self.room) as u32,
        }
    }

    /// Submits one more step, for a basis of `total` columns before it. `vectors` must be those of [`Flight::new`], with room for a column.
    pub(super) fn launch(
        &mut self,
        vectors: &mut DeviceVectors,
        total: usize,
        record: Record<'_>,
    ) -> Result<()> {
        let gpu = vectors.gpu.clone();
        let latest = self.launched.back().map(|(slot, _)| *slot).or(self.pushed);
        let number = latest.map_or(0, |slot| (slot + 1) % self.slots.len());
        let Shape { waiting, recent, known, .. } = self.shape;
        let parameters = self.parameters(total, number);
        for step in &mut self.coefficients {
            step.change(&gpu, &parameters, 1)?;
        }
        let (slot, [settle, rest], memory) = (&self.slots[number], &self.coefficients, &self.memory);
        let row = |row: usize| (8 * row * self.room) as u64;
        let first = BEFORE + number * RECORD;
        let fetch = |from: usize, to: &Buffer, entries: usize, encoder: &mut CommandEncoder| {
            encoder.copy_buffer_to_buffer(memory, row(from), to, 0, 8 * entries as u64);
        };

        let dots = vectors.plan(0..0, 0, Some(total - recent..total))?;
        gpu.submit("product ahead", |encoder| {
            vectors.copy_column(total - 1, &slot.column, encoder);
            record(vectors, total - waiting, encoder);
            vectors.copy_product([&slot.pattern, &slot.photo], encoder);
            slot.product.iter().for_each(|product| copy(&vectors.work, product, encoder));
            vectors.record(&dots, encoder);
            Step::record(&gpu, "coefficients", [settle], encoder);
            fetch(first + KNOWN_PARTS, &vectors.coefficients.of_work, total, encoder);
            fetch(first + LATE_PARTS, &vectors.coefficients.of_single, total - 1, encoder);
        })?;
        let sweep = vectors.plan(0..total, total - 1, Some(0..total))?;
        vectors.plan_push()?;
        let submission = gpu.submit("orthogonalization ahead", |encoder| {
            vectors.record(&sweep, encoder);
            Step::record(&gpu, "coefficients", [rest], encoder);
            copy(&vectors.work, &slot.rest, encoder);
            if let Some(left) = &slot.left {
                fetch(first + REST, &vectors.coefficients.of_work, known, encoder);
                Step::record(&gpu, "orthogonalization", [&self.remove_known], encoder);
                copy(&vectors.work, left, encoder);
            }
            fetch(TERMS, &vectors.coefficients.of_terms, 4, encoder);
            vectors.record_push(total, encoder);
            let (staging, mut place) = (&slot.staging, row(RECORD));
            encoder.copy_buffer_to_buffer(memory, row(first), staging, 0, place);
            let is_read = staging.size() > place;
            for vector in [&slot.pattern, &slot.photo].into_iter().filter(|_| is_read) {
                encoder.copy_buffer_to_buffer(vector, 0, staging, place, vector.size());
                place += vector.size();
            }
        })?;
        let readback = Readback::request(&slot.staging, slot.staging.size(), submission);
        self.launched.push_back((number, readback));
        Ok(())
    }

    /// Begins the next step, for a basis of `total` columns before it. Returns whether it was launched.
    pub(super) fn begin(&mut self, gpu: &Gpu, total: usize) -> Result<bool> {
        let Some((slot, readback)) = self.launched.pop_front() else { return Ok(false) };
        let found = readback.wait(gpu)?;
        let taken = Taken::new(bytemuck::cast_slice(&found), self.room, (total, self.shape.recent));
        self.present = Some((slot, taken));
        Ok(true)
    }

    /// The results of the step that the host asks for.
    pub(super) fn taken(&self) -> Option<&Taken> {
        self.present.as_ref().map(|(_, taken)| taken)
    }

    /// Ends the step that the host asks for.
    pub(super) fn push(&mut self) {
        self.pushed = self.present.take().map(|(slot, _)| slot);
        self.steps += 1;
    }

    /// The slot of the last step that the host has begun to ask for.
    fn latest(&self) -> Option<&Slot> {
        self.present.as_ref().map(|(slot, _)| *slot).or(self.pushed).map(|slot| &self.slots[slot])
    }

    /// `w` as the host expects it, if it has come as far as `call`.
    pub(super) fn work(&self, call: Call) -> Option<&Buffer> {
        self.latest().map(|slot| slot.work(call))
    }

    /// The last column as the host expects it, unless it is that of the basis.
    pub(super) fn last_column(&self, call: Call) -> Option<&Buffer> {
        let next = self.launched.front().map(|(slot, _)| &self.slots[*slot].column);
        match call {
            Call::Product | Call::Dots => self.latest().map(|slot| &slot.column),
            Call::Settle | Call::Remove => None,
            _ => next,
        }
    }

    /// The last product that the host has asked for, on the device, and once in the host's memory if it is there.
    pub(super) fn product(&self) -> Option<([&Buffer; 2], Option<Product>)> {
        let read = self.taken().and_then(|taken| taken.product.take());
        self.latest().map(|slot| ([&slot.pattern, &slot.photo], read))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout};

    #[test]
    fn parameters_and_rows_lie_as_the_shader_reads_them() {
        assert_layout!("vectors_ahead", "Ahead", Parameters: columns, first, known, is_last, room, place);
        let before = [("ABOVE", ABOVE), ("DIAGONAL", ABOVE + 1), ("BELOW", ABOVE + 2), ("TERMS", TERMS)];
        let record = [("KNOWN_PARTS", KNOWN_PARTS), ("LATE_PARTS", LATE_PARTS), ("REST", REST)];
        for (name, row) in before.into_iter().chain(record) {
            assert_constant("vectors_ahead", name, row as u32);
        }
        assert_eq!((BEFORE, RECORD), (TERMS + 1, REST + 1));
    }
}
