//! Arrays on large memory pages. A product reads long arrays in full, and hardware prefetching restarts at each page.

use std::fmt;
use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

use bytemuck::Pod;
use memmap2::MmapMut;

/// Arrays of at least this many bytes get memory pages of their own.
const LONG: usize = 4 << 20;

pub(in crate::transport) struct Pages<T> {
    memory: Memory,
    length: usize,
    of: PhantomData<T>,
}

enum Memory {
    /// Words of eight bytes, because no element type here needs a larger alignment.
    Short(Vec<u64>),
    Long(MmapMut),
}

impl<T: Pod> Pages<T> {
    pub(in crate::transport) fn zeros(length: usize) -> Self {
        let bytes = length * size_of::<T>();
        let long = (bytes >= LONG).then(|| MmapMut::map_anon(bytes).ok()).flatten();
        let memory = long.map_or_else(|| Memory::Short(vec![0; bytes.div_ceil(8)]), Memory::Long);
        #[cfg(target_os = "linux")]
        if let Memory::Long(map) = &memory {
            // If the system has no large pages, it uses small ones.
            let _ = map.advise(memmap2::Advice::HugePage);
        }
        Self { memory, length, of: PhantomData }
    }
}

impl<T: Pod> Deref for Pages<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        let bytes = self.length * size_of::<T>();
        match &self.memory {
            Memory::Short(words) => bytemuck::cast_slice(&bytemuck::cast_slice::<_, u8>(words)[..bytes]),
            Memory::Long(map) => bytemuck::cast_slice(&map[..bytes]),
        }
    }
}

impl<T: Pod> DerefMut for Pages<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        let bytes = self.length * size_of::<T>();
        match &mut self.memory {
            Memory::Short(words) => {
                bytemuck::cast_slice_mut(&mut bytemuck::cast_slice_mut::<_, u8>(words)[..bytes])
            }
            Memory::Long(map) => bytemuck::cast_slice_mut(&mut map[..bytes]),
        }
    }
}

impl<T: Pod> Clone for Pages<T> {
    fn clone(&self) -> Self {
        let mut copy = Self::zeros(self.length);
        copy.copy_from_slice(self);
        copy
    }
}

impl<T: Pod + fmt::Debug> fmt::Debug for Pages<T> {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        self[..].fmt(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_and_long_arrays_are_zeros_and_keep_what_is_written() {
        for length in [0, 1, 3, LONG / 4 - 1, LONG / 4, LONG / 4 + 1] {
            let mut array = Pages::<f32>::zeros(length);
            assert_eq!(array.len(), length);
            assert!(array.iter().all(|&value| value == 0.0));
            array.iter_mut().zip(1..).for_each(|(value, number)| *value = number as f32);
            let copy = array.clone();
            assert!(copy.iter().zip(1..).all(|(&value, number)| value == number as f32));
        }
    }

    #[test]
    fn an_array_is_shown_as_its_elements() {
        let mut array = Pages::<u16>::zeros(3);
        array[1] = 7;
        assert_eq!(format!("{array:?}"), "[0, 7, 0]");
    }
}
