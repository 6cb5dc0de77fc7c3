//! Scratch buffers that are used again: to make and to free a large buffer takes a GPU's driver longer than to fill it.

use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use wgpu::BufferUsages;

use super::Gpu;
use super::kept::Kept;
use crate::error::Result;

/// The maximum number of bytes that wait to be used again.
const MOST_BYTES: u64 = 2 << 30;

/// Buffers that wait to be used again, oldest first.
#[derive(Default)]
pub(super) struct Waiting(Mutex<Vec<wgpu::Buffer>>);

impl Waiting {
    fn lock(&self) -> MutexGuard<'_, Vec<wgpu::Buffer>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Frees all of them. Returns whether there were any.
    pub(super) fn clear(&self) -> bool {
        !std::mem::take(&mut *self.lock()).is_empty()
    }
}

/// A buffer that waits to be used again when this is dropped.
pub(crate) struct Lent {
    buffer: wgpu::Buffer,
    kept: Arc<Kept>,
}

impl Deref for Lent {
    type Target = wgpu::Buffer;

    fn deref(&self) -> &wgpu::Buffer {
        &self.buffer
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        let mut waiting = self.kept.waiting.lock();
        waiting.push(self.buffer.clone());
        while waiting.iter().map(wgpu::Buffer::size).sum::<u64>() > MOST_BYTES {
            waiting.remove(0);
        }
    }
}

impl Gpu {
    /// Frees the buffers that wait to be used again.
    pub(crate) fn free_scratch(&self) {
        self.kept.waiting.clear();
    }

    /// A storage buffer of at least this many bytes, for a kernel that writes before it reads: its contents are those of an earlier use.
    pub(crate) fn scratch(&self, label: &str, bytes: u64) -> Result<Lent> {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        self.lend(label, bytes, usage)
    }

    /// Works like [`Gpu::scratch`], for another usage.
    pub(super) fn lend(&self, label: &str, bytes: u64, usage: BufferUsages) -> Result<Lent> {
        let mut waiting = self.kept.waiting.lock();
        // A much larger buffer may be needed elsewhere.
        let sizes = bytes..=2 * bytes.max(1 << 16);
        let fits = |buffer: &wgpu::Buffer| buffer.usage() == usage && sizes.contains(&buffer.size());
        let best = (0..waiting.len()).filter(|&at| fits(&waiting[at])).min_by_key(|&at| waiting[at].size());
        let found = best.map(|at| waiting.remove(at));
        drop(waiting);
        let buffer = match found {
            Some(buffer) => buffer,
            None => self.buffer(label, bytes.next_multiple_of(4).max(4), usage)?,
        };
        Ok(Lent { buffer, kept: Arc::clone(&self.kept) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_is_used_again_for_the_next_one_of_its_size() {
        // A device of its own, whose buffers no other test takes.
        let gpu = Gpu { kept: Arc::default(), ..Gpu::for_tests() };
        let lend = |bytes| gpu.scratch("scratch", bytes).expect("it fits");
        let first = lend(1 << 20);
        let buffer = first.buffer.clone();
        assert_ne!(*lend(1 << 20), buffer, "it is in use");
        drop(first);
        let again = [lend(1 << 20), lend((1 << 20) - 100)];
        assert!(again.iter().any(|lent| **lent == buffer), "both are used again");
        assert_eq!(gpu.kept.waiting.lock().len(), 0);
        drop(again);
        assert!(lend(1 << 18).size() == 1 << 18, "both are too large");
        assert!(gpu.kept.waiting.clear() && !gpu.kept.waiting.clear());
    }
}
