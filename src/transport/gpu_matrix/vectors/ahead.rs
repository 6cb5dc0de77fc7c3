//! Which steps a device can take before the host asks for them.
//!
//! A step of a Lanczos or block Lanczos process is regular if it consists of these calls: the product of a waiting column, the inner products
//! with the last columns, the removal of the parts along them together with the late parts of the last column, the removal of what is left
//! along known vectors, and the push. The coefficients of a regular step follow from its inner products and from those of the steps before. A
//! device that computes them itself needs no answer of the host, and takes several steps while the host reads the results of the first one.
//!
//! The process on the host makes all its calls and decisions as it would without steps in flight. A call finds the results of the device if
//! the coefficients of the host are those that the device used, up to rounding. Any other call that changes vectors first brings them back as
//! they were at that call. A breakdown, a second pass, or a process that ends therefore costs only the steps that were taken in vain.

use std::cell::Cell;

use super::flight::{self, Flight, Record};
use super::{DeviceVectors, Sums};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::operator::Settling;
use crate::transport::matrix::Product;

/// The most steps in flight on a GPU: the device takes one step while the host reads the one before.
const ON_GPU: usize = 2;

/// Software Vulkan computes on the host's own processor, so that more steps in flight gain nothing. The host has asked for the product of
/// the one step, and the device computes the rest of it.
const ON_PROCESSOR: usize = 1;

/// A flight of fewer steps is not worth its buffers. After some of them, there are no more flights.
const WORTH: usize = 8;
const MOST_SHORT: usize = 3;

/// The last call of the host that belongs to a regular step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Call {
    Product,
    Dots,
    Settle,
    /// Removes parts along the known vectors. Processes without them leave it out.
    Remove,
    Push,
    Other,
}

/// What the steps of a process have in common.
#[derive(Clone, PartialEq)]
pub(super) struct Shape {
    /// The matrix on the device, and its part.
    source: (wgpu::Buffer, Product),
    /// The number of columns from the multiplied one on.
    pub(super) waiting: usize,
    /// The number of last columns along which the product has large parts.
    pub(super) recent: usize,
    /// The number of first columns that are known vectors.
    pub(super) known: usize,
}

/// The calls of the host so far, and the steps in flight.
pub(super) struct Ahead {
    depth: usize,
    /// The number of flights of fewer than `WORTH` steps.
    short: usize,
    call: Call,
    /// The shape of the present step, as far as its calls show it; after a push, that of a regular step whose sums are on the device.
    shape: Option<Shape>,
    along: Vec<f64>,
    rest: Sums,
    /// The largest norm of a product.
    scale: f64,
    /// For each column whose step was regular, from `start` on: the entries of the tridiagonal matrix above, on and below its diagonal.
    tridiagonal: Vec<[f64; 3]>,
    start: usize,
    /// Whether the host reads patterns and photos.
    reads: Cell<bool>,
    flight: Option<Flight>,
}

impl Ahead {
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self::with_depth(if gpu.summary.is_processor() { ON_PROCESSOR } else { ON_GPU })
    }

    /// With at most `depth` steps in flight.
    pub(super) fn with_depth(depth: usize) -> Self {
        Self {
            depth,
            short: 0,
            call: Call::Other,
            shape: None,
            along: Vec::new(),
            rest: Sums::default(),
            scale: 0.0,
            tridiagonal: Vec::new(),
            start: 0,
            reads: Cell::new(false),
            flight: None,
        }
    }

    /// Returns true if the tridiagonal matrix has all columns of a basis from the known ones on, except the last one.
    fn is_tridiagonal(&self, known: usize, columns: usize) -> bool {
        self.start == known && self.start + self.tridiagonal.len() + 1 == columns
    }

    /// Notes a regular step of a basis of `total` columns.
    fn note_step(&mut self, total: usize, divisor: f64) {
        let last = total - 1;
        if self.start + self.tridiagonal.len() != last {
            self.tridiagonal.clear();
            self.start = last;
        }
        let from_end = |place: usize| self.along.iter().rev().nth(place).copied().unwrap_or(0.0);
        self.tridiagonal.push([from_end(1), from_end(0), divisor]);
    }
}

/// Returns true if no entries of equal place differ by more than `bound`.
fn are_near(found: &[f64], used: &[f64], bound: f64) -> bool {
    found.len() == used.len() && found.iter().zip(used).all(|(found, used)| (found - used).abs() <= bound)
}

/// Steps in flight.
impl DeviceVectors {
    /// Takes the product with a column, by the commands of `record`, or finds it taken. `source` names the matrix and its part.
    pub(in crate::transport::gpu_matrix) fn multiply(
        &mut self,
        source: (wgpu::Buffer, Product),
        column: usize,
        record: Record<'_>,
    ) -> Result<()> {
        let waiting = self.columns.saturating_sub(column);
        let is_next = |shape: &Shape| shape.source == source && shape.waiting == waiting;
        let follows = self.ahead.call == Call::Push && self.ahead.shape.as_ref().is_some_and(is_next);
        if !follows {
            self.land()?;
        } else if self.ahead.flight.is_none() {
            self.take_off()?;
        }
        self.ahead.call = Call::Product;
        let shape = Shape { source, waiting, recent: 0, known: 0 };
        if let Some(mut flight) = self.ahead.flight.take() {
            let total = self.columns;
            while flight.launched() < self.ahead.depth && total + flight.launched() < self.room {
                flight.launch(self, total + flight.launched(), record)?;
            }
            if flight.begin(&self.gpu, total)? {
                self.ahead.flight = Some(flight);
                self.ahead.shape = Some(shape);
                return Ok(());
            }
        }
        self.ahead.shape = Some(shape);
        self.gpu.submit("product", |encoder| record(self, column, encoder)).map(drop)
    }

    /// Prepares steps in flight after a regular step, if all their coefficients follow from those of the steps before.
    fn take_off(&mut self) -> Result<()> {
        let Some(shape) = self.ahead.shape.clone() else { return Ok(()) };
        let ahead = &self.ahead;
        // The first steps of a process have inner products with all columns.
        let is_steady = 0 < shape.recent && shape.recent < self.columns - 1;
        let follows = shape.waiting > 1 || ahead.is_tridiagonal(shape.known, self.columns);
        let has_room = self.columns < self.room && shape.known <= self.together;
        let is_possible = has_room && ahead.depth > 0 && ahead.short < MOST_SHORT;
        if !is_steady || !follows || !is_possible {
            return Ok(());
        }
        let mut tridiagonal = vec![[0.0; 3]; ahead.start];
        tridiagonal.extend(&ahead.tridiagonal);
        flight::kernels(&self.gpu)?;
        match Flight::new(self, shape, (ahead.depth, ahead.reads.get()), &tridiagonal) {
            Ok(flight) => self.ahead.flight = Some(flight),
            Err(_) => {
                self.gpu.require_working()?;
                self.ahead.depth = 0;
            }
        }
        Ok(())
    }

    /// Brings back the vectors as the host expects them after its last call, if there are steps in flight.
    pub(super) fn land(&mut self) -> Result<()> {
        let Some(flight) = self.ahead.flight.take() else { return Ok(()) };
        let call = self.ahead.call;
        self.ahead.short += usize::from(flight.steps < WORTH);
        if matches!(call, Call::Settle | Call::Remove) {
            // The sums on the device are those of a later step.
            self.ahead.shape = None;
        }
        let (last, place) = self.place(self.columns - 1);
        self.gpu.submit("landing", |encoder| {
            let mut copy = |from: &wgpu::Buffer, to, place| {
                encoder.copy_buffer_to_buffer(from, 0, to, place, from.size());
            };
            flight.last_column(call).into_iter().for_each(|column| copy(column, last, place));
            flight.work(call).into_iter().for_each(|work| copy(work, &self.work, 0));
            if let (Some((from, _)), Some(of)) = (flight.product(), &self.of) {
                from.into_iter().zip([&of.pattern, &of.photo]).for_each(|(from, to)| copy(from, to, 0));
            }
        })?;
        Ok(())
    }

    /// Lands, and forgets the steps of the process.
    pub(super) fn forget(&mut self) {
        // A device that fails here fails at the next call, too.
        let landed = self.depart();
        debug_assert!(landed.is_ok() || self.gpu.require_working().is_err());
        self.ahead.shape = None;
        self.ahead.scale = 0.0;
        self.ahead.tridiagonal.clear();
    }

    /// Lands, for a call that is not one of a regular step.
    pub(super) fn depart(&mut self) -> Result<()> {
        self.land()?;
        self.ahead.call = Call::Other;
        Ok(())
    }

    /// Answers [`Vectors::dots_and_norm`](crate::operator::Vectors::dots_and_norm) from the steps in flight, or by `compute`.
    pub(super) fn dots_of_step(
        &mut self,
        first: usize,
        compute: impl FnOnce(&mut Self) -> Result<Sums>,
    ) -> Result<Sums> {
        let recent = self.columns.saturating_sub(first);
        // Others may ask for the norm of a product before the process does.
        let is_next = matches!(self.ahead.call, Call::Product | Call::Dots);
        let flight = self.ahead.flight.as_ref().filter(|flight| is_next && flight.shape.recent == recent);
        let found = flight.and_then(|flight| flight.taken()?.along.clone());
        let found = match found {
            Some(found) => found,
            None => {
                self.land()?;
                compute(self)?
            }
        };
        let Ahead { call, shape, along, scale, .. } = &mut self.ahead;
        *call = if is_next { Call::Dots } else { Call::Other };
        shape.iter_mut().for_each(|shape| shape.recent = recent);
        along.clone_from(&found.0);
        if is_next && found.1.is_finite() {
            *scale = scale.max(found.1);
        }
        Ok(found)
    }

    /// Answers [`Vectors::settle_and_dot`](crate::operator::Vectors::settle_and_dot) as [`DeviceVectors::dots_of_step`].
    pub(super) fn settled_of_step(
        &mut self,
        settling: &Settling<'_>,
        compute: impl FnOnce(&mut Self) -> Result<Sums>,
    ) -> Result<Sums> {
        let is_next = self.ahead.call == Call::Dots && settling.along == self.ahead.along;
        let (total, scale) = (self.columns, self.ahead.scale);
        let taken = self.ahead.flight.as_ref().filter(|_| is_next).and_then(Flight::taken);
        let taken = taken.filter(|taken| {
            let first = total - settling.along.len();
            let size = taken.late.iter().fold(0.0_f64, |size, late| size.max(late.abs()));
            // The late parts are quotients. The known parts are sums of `total` terms, and the device leaves out the terms with entries of the
            // matrix beside the tridiagonal, which are rounding errors.
            let bound = f64::EPSILON * size;
            let ahead = settling.ahead.get(..first).unwrap_or_default();
            taken.known[first..] == *settling.along
                && are_near(settling.late, &taken.late, 8.0 * bound)
                && are_near(ahead, &taken.known[..first], (total + 16) as f64 * scale * bound)
        });
        let found = match taken.and_then(|taken| taken.rest.clone()) {
            Some(found) => found,
            None => {
                self.land()?;
                compute(self)?
            }
        };
        self.ahead.call = if is_next { Call::Settle } else { Call::Other };
        self.ahead.rest.clone_from(&found);
        Ok(found)
    }

    /// Removes parts as [`Vectors::remove`](crate::operator::Vectors::remove), if they are not removed yet.
    pub(super) fn remove_of_step(
        &mut self,
        h: &[f64],
        compute: impl FnOnce(&mut Self) -> Result<()>,
    ) -> Result<()> {
        let is_next = self.ahead.call == Call::Settle && self.ahead.rest.0.starts_with(h);
        let is_taken = |flight: &Flight| is_next && flight.shape.known == h.len();
        if !self.ahead.flight.as_ref().is_some_and(is_taken) {
            self.land()?;
            compute(self)?;
        }
        self.ahead.call = if is_next { Call::Remove } else { Call::Other };
        self.ahead.shape.iter_mut().for_each(|shape| shape.known = h.len());
        Ok(())
    }

    /// Pushes as [`Vectors::push`](crate::operator::Vectors::push), if it is not done yet.
    pub(super) fn push_of_step(
        &mut self,
        divisor: f64,
        compute: impl FnOnce(&mut Self) -> Result<()>,
    ) -> Result<()> {
        let is_regular =
            matches!(self.ahead.call, Call::Settle | Call::Remove) && divisor == self.ahead.rest.1;
        let (total, known) = (self.columns, self.ahead.shape.as_ref().map(|shape| shape.known));
        // The device's square root may differ in the last bit, because Vulkan does not promise its rounding. The host then pushes. The host
        // also pushes for a divisor of 1, because a division by 1 on the device may change bits.
        let is_taken = |flight: &&mut Flight| {
            let found = flight.taken().is_some_and(|taken| taken.divisor == divisor && divisor != 1.0);
            is_regular && found && Some(flight.shape.known) == known
        };
        match self.ahead.flight.as_mut().filter(is_taken) {
            Some(flight) => flight.push(),
            None => {
                self.land()?;
                compute(self)?;
            }
        }
        self.columns += 1;
        self.ahead.call = Call::Push;
        if is_regular {
            self.ahead.note_step(total, divisor);
        } else {
            self.ahead.shape = None;
        }
        Ok(())
    }

    /// The buffer of a column as the host expects it, and its place in bytes.
    pub(super) fn expected_column(&self, index: usize) -> (&wgpu::Buffer, u64) {
        let flight = self.ahead.flight.as_ref().filter(|_| index + 1 == self.columns);
        match flight.and_then(|flight| flight.last_column(self.ahead.call)) {
            Some(column) => (column, 0),
            None => self.place(index),
        }
    }

    /// `w` as the host expects it.
    pub(super) fn expected_work(&self) -> &wgpu::Buffer {
        let flight = self.ahead.flight.as_ref();
        flight.and_then(|flight| flight.work(self.ahead.call)).unwrap_or(&self.work)
    }

    /// The last product that the host has asked for.
    pub(super) fn expected_product(&self) -> Result<crate::operator::Product> {
        self.ahead.reads.set(true);
        let (buffers, pixels) = match (self.ahead.flight.as_ref().and_then(Flight::product), &self.of) {
            (Some((_, Some(read))), _) => return Ok(read),
            (Some((buffers, None)), Some(of)) => (buffers, of.pixels),
            (None, Some(of)) => ([&of.pattern, &of.photo], of.pixels),
            (_, None) => return Err(crate::operator::vectors::made_elsewhere()),
        };
        let mut both = self.gpu.read_all(&buffers.map(|buffer| (buffer, pixels)))?;
        let to = both.pop().unwrap_or_default();
        Ok(crate::operator::Product { from: both.pop().unwrap_or_default(), to })
    }
}

#[cfg(test)]
mod tests;
