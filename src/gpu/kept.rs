//! Things that are made once for a device and kept as long as it is open, such as compiled kernels; and large reads from its memory.

use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use bytemuck::Pod;
use rayon::prelude::*;
use wgpu::BufferUsages;

use super::Gpu;
use super::buffers::Readback;
use super::lent::Waiting;
use super::stopwatch::Stopwatch;
use crate::error::Result;

/// The objects that are kept for a device.
#[derive(Default)]
pub(crate) struct Kept {
    /// Things by type and name.
    things: Mutex<HashMap<(TypeId, String), Box<dyn Any + Send + Sync>>>,
    pub(super) stopwatch: Stopwatch,
    pub(super) waiting: Waiting,
}

/// The size in bytes of the pieces in which large buffers are read. The device transfers a piece while the host copies the one before.
const PIECE: u64 = 8 << 20;

/// The smallest staging buffer, in bytes.
const LEAST: u64 = 64 << 10;

/// The number of elements that a task copies.
const TASK: usize = 1 << 16;

/// A part of a buffer that is transferred at once: the buffer's number, the part's first byte, and its bytes.
type Piece = (usize, u64, u64);

impl Gpu {
    /// The object that was kept under `name`. If there is none, it is made and kept.
    pub(crate) fn kept<T: Clone + Send + Sync + 'static>(
        &self,
        name: &str,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        let key = (TypeId::of::<T>(), name.to_owned());
        let lock = || self.kept.things.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = lock().get(&key).and_then(|found| found.downcast_ref::<T>()) {
            return Ok(found.clone());
        }
        let made = make()?;
        lock().insert(key, Box::new(made.clone()));
        Ok(made)
    }

    /// Reads the first elements of a buffer, after all submitted work.
    pub(crate) fn read<T: Pod + Send + Sync>(&self, buffer: &wgpu::Buffer, count: usize) -> Result<Vec<T>> {
        let mut found = self.read_all(&[(buffer, count)])?;
        Ok(found.pop().unwrap_or_default())
    }

    /// Reads the first elements of several buffers, after all submitted work. Small buffers are transferred together.
    pub(crate) fn read_all<T: Pod + Send + Sync>(
        &self,
        buffers: &[(&wgpu::Buffer, usize)],
    ) -> Result<Vec<Vec<T>>> {
        let size = size_of::<T>() as u64;
        let batches = batches(&buffers.iter().map(|&(_, count)| count as u64 * size).collect::<Vec<_>>());
        let largest = batches.iter().map(|batch| batch.iter().map(|piece| piece.2).sum()).max().unwrap_or(0);
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let lend = || self.lend("read-back", largest.next_power_of_two().max(LEAST), usage);
        let staging = [lend()?, lend()?];
        let mut found: Vec<Vec<T>> = buffers.iter().map(|&(_, count)| vec![T::zeroed(); count]).collect();
        let mut before = None;
        for (batch, staging) in batches.iter().zip(staging.iter().cycle()) {
            let bytes = batch.iter().map(|piece| piece.2).sum();
            let submission = self.submit("read-back", |encoder| {
                let mut to = 0;
                for &(number, first, bytes) in batch {
                    encoder.copy_buffer_to_buffer(buffers[number].0, first, staging, to, bytes);
                    to += bytes;
                }
            })?;
            let readback = Readback::request(staging, bytes, submission);
            if let Some((readback, batch)) = before.replace((readback, batch)) {
                deliver(&readback.wait(self)?, batch, &mut found);
            }
        }
        if let Some((readback, batch)) = before {
            deliver(&readback.wait(self)?, batch, &mut found);
        }
        Ok(found)
    }
}

fn deliver<T: Pod + Send + Sync>(from: &[u8], batch: &[Piece], to: &mut [Vec<T>]) {
    let mut left: &[T] = bytemuck::cast_slice(from);
    for &(number, first, bytes) in batch {
        let count = bytes as usize / size_of::<T>();
        let (piece, rest) = left.split_at(count);
        let first = first as usize / size_of::<T>();
        let to = &mut to[number][first..first + count];
        to.par_chunks_mut(TASK).zip(piece.par_chunks(TASK)).for_each(|(to, piece)| to.copy_from_slice(piece));
        left = rest;
    }
}

/// Divides buffers of these sizes into pieces, and puts them together into batches of at most [`PIECE`] bytes.
fn batches(sizes: &[u64]) -> Vec<Vec<Piece>> {
    let (mut batches, mut room) = (Vec::<Vec<Piece>>::new(), 0);
    for (number, &size) in sizes.iter().enumerate() {
        let mut first = 0;
        while first < size {
            if room == 0 {
                batches.push(Vec::new());
                room = PIECE;
            }
            let bytes = room.min(size - first);
            if let Some(batch) = batches.last_mut() {
                batch.push((number, first, bytes));
            }
            first += bytes;
            room -= bytes;
        }
    }
    batches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_cover_each_buffer_once_and_in_order() {
        let sizes = [0, 12, 3 * PIECE + 8, 4, PIECE];
        let batches = batches(&sizes);
        assert!(batches.iter().all(|batch| batch.iter().map(|piece| piece.2).sum::<u64>() <= PIECE));
        for (number, &size) in sizes.iter().enumerate() {
            let mut next = 0;
            for &(_, first, bytes) in batches.iter().flatten().filter(|piece| piece.0 == number) {
                assert_eq!(first, next);
                next += bytes;
            }
            assert_eq!(next, size);
        }
    }

    #[test]
    fn buffers_of_any_size_are_read_as_they_were_written() {
        let gpu = Gpu::for_tests();
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let arrays: Vec<Vec<u32>> = [1, 7, 5_000_000, 3]
            .map(|count: u32| (0..count).map(|at| at.wrapping_mul(0x9e37_79b9) ^ count).collect())
            .into();
        let write = |array: &Vec<u32>| {
            let buffer = gpu.buffer("array", 4 * array.len() as u64, usage).expect("it fits");
            gpu.queue.write_buffer(&buffer, 0, bytemuck::cast_slice(array));
            buffer
        };
        let buffers: Vec<wgpu::Buffer> = arrays.iter().map(write).collect();
        let asked: Vec<_> =
            buffers.iter().zip(&arrays).map(|(buffer, array)| (buffer, array.len())).collect();
        assert!(gpu.read_all::<u32>(&asked).is_ok_and(|found| found == arrays));
        assert!(gpu.read::<u32>(&buffers[1], 7).is_ok_and(|found| found == arrays[1]));
    }

    #[test]
    fn a_thing_is_made_once_for_all_users_of_a_device() {
        let [first, second] = [(); 2].map(|()| Gpu::for_tests());
        let name = "a_thing_is_made_once";
        assert_eq!(first.kept(name, || Ok(1_u8)).ok(), Some(1));
        assert_eq!(second.kept(name, || Ok(2_u8)).ok(), Some(1));
        assert_eq!(second.kept(name, || Ok(2_u16)).ok(), Some(2), "another type is another thing");
    }
}
