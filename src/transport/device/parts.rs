//! The terms of the light paths, from each dispatch of the tracer. They are in arenas on the device, part by part.

use std::collections::VecDeque;
use std::ops::Range;

use wgpu::BufferUsages;

use super::Limits;
use super::kernels::{Assembly, Kernels, MOST_OF_PART, Step};
use super::rows::too_many;
use crate::error::{Error, Result};
use crate::gpu::buffers::{Readback, Results};
use crate::gpu::{Gpu, Lent};
use crate::render::{Consumer, RecordLayout, ResidentPaths};
use crate::transport::RigShape;
use crate::transport::contributions::CLASSES;

/// How the samples of a pixel are divided into parts. Each part lies within one half of the samples, and has at most [`MOST_OF_PART`]
/// contributions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Division {
    samples: u32,
    first_half: u32,
    samples_of_part: u32,
    pub(super) parts_of_first_half: u32,
    pub(super) parts_of_pixel: u32,
}

impl Division {
    pub(super) fn new(samples: u32, most_ends: usize) -> Self {
        let first_half = samples.div_ceil(2);
        let samples_of_part = (MOST_OF_PART / (most_ends as u32).max(1)).max(1);
        let parts_of_first_half = first_half.div_ceil(samples_of_part);
        let parts_of_pixel = parts_of_first_half + (samples - first_half).div_ceil(samples_of_part);
        Self { samples, first_half, samples_of_part, parts_of_first_half, parts_of_pixel }
    }

    /// The number of the first path of a part. Paths are numbered `pixel · samples + sample`.
    fn first_path(self, part: u64) -> u64 {
        let (pixel, number) = (part / u64::from(self.parts_of_pixel), part % u64::from(self.parts_of_pixel));
        let halfway = u64::from(self.parts_of_first_half);
        let sample = if number < halfway {
            number * u64::from(self.samples_of_part)
        } else {
            u64::from(self.first_half) + (number - halfway) * u64::from(self.samples_of_part)
        };
        pixel * u64::from(self.samples) + sample
    }

    /// The part that begins with this path.
    fn part_of(self, path: u64) -> u64 {
        let (pixel, sample) = (path / u64::from(self.samples), path % u64::from(self.samples));
        let (first_half, of_part) = (u64::from(self.first_half), u64::from(self.samples_of_part));
        let number = if sample < first_half {
            sample / of_part
        } else {
            u64::from(self.parts_of_first_half) + (sample - first_half) / of_part
        };
        pixel * u64::from(self.parts_of_pixel) + number
    }

    /// The number of paths from `first` on that are whole parts: at most `most`, but at least one part.
    fn paths_from(self, first: u64, most: u32) -> u32 {
        let part = self.part_of(first);
        let last = self.part_of(first + u64::from(most)).max(part + 1);
        (self.first_path(last) - first) as u32
    }
}

/// The number of paths after which the number of all terms is estimated.
const ENOUGH: u64 = 1 << 22;

/// Terms of consecutive parts.
pub(super) struct Arena {
    pub(super) parts: Range<u32>,
    pub(super) keys: Lent,
    pub(super) values: Lent,
    top: wgpu::Buffer,
    step: Step,
    /// The terms of all dispatches that are done.
    terms: u64,
    /// The largest possible number of terms of each dispatch in flight.
    in_flight: VecDeque<u64>,
    room: u64,
}

/// The terms of the paths from one endpoint of the rig.
pub(super) struct Endpoint {
    pub(super) layout: RecordLayout,
    pub(super) division: Division,
    pub(super) paths: u64,
    pub(super) base: Assembly,
    records: wgpu::Buffer,
    /// For each part: its first term in its arena, the number of its terms, its rays, and its unfinished paths.
    pub(super) parts: Lent,
    /// For each part and channel, the sums of direct and of ambient light; a placeholder if there is neither.
    pub(super) heads: Lent,
    pub(super) arenas: Vec<Arena>,
}

impl Endpoint {
    pub(super) fn pixels(&self) -> u32 {
        (self.paths / u64::from(self.division.samples)) as u32
    }

    pub(super) fn terms(&self) -> u64 {
        self.arenas.iter().map(|arena| arena.terms).sum()
    }
}

struct InFlight {
    arena: usize,
    slot: usize,
    paths: u32,
    readback: Option<Readback>,
}

/// The classes of bounces that occur: the lowest one, and the number of classes from there on.
#[derive(Clone, Copy)]
pub(super) struct ClassRange {
    pub(super) lowest: u32,
    pub(super) count: u32,
}

impl ClassRange {
    /// The classes in the records of this layout. If connections from the first surface are direct light, none has one bounce.
    pub(super) fn of(direct: bool, split: bool) -> Self {
        let lowest = u32::from(direct);
        Self { lowest, count: CLASSES as u32 - u32::from(!split) - lowest }
    }

    pub(super) fn bits(self) -> u32 {
        self.count.next_power_of_two().ilog2()
    }
}

/// Sums the contributions of a trace, dispatch by dispatch.
pub(super) struct Parts {
    kernels: Kernels,
    limits: Limits,
    channels: usize,
    rig: RigShape,
    /// The parameters that all steps have in common.
    base: Assembly,
    /// The number of terms of each row of the matrix, and then of each row of its transpose if the rig is not symmetric.
    pub(super) counts: wgpu::Buffer,
    pub(super) endpoints: Vec<Endpoint>,
    /// The buffers through which the host reads how full an arena is.
    slots: Vec<wgpu::Buffer>,
    in_flight: VecDeque<InFlight>,
    /// The paths of this endpoint that are done.
    finished: u64,
}

impl Parts {
    pub(super) fn new(
        gpu: &Gpu,
        kernels: Kernels,
        limits: Limits,
        (channels, rig): (usize, RigShape),
        base: Assembly,
    ) -> Result<Self> {
        let rows = rig.camera.pixels() + if rig.symmetric { 0 } else { rig.projector.pixels() };
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let counts = gpu.buffer("terms of rows", 4 * rows as u64, usage)?;
        let slot = |_| gpu.buffer("terms of an arena", 4, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let slots = (0..2).map(slot).collect::<Result<_>>()?;
        let (endpoints, in_flight) = (Vec::new(), VecDeque::new());
        let finished = 0;
        Ok(Self { kernels, limits, channels, rig, base, counts, endpoints, slots, in_flight, finished })
    }

    fn current(&self) -> &Endpoint {
        &self.endpoints[self.endpoints.len() - 1]
    }

    /// An empty arena for terms from the part `first` on.
    fn arena(&self, gpu: &Gpu, first: u32, terms: u64) -> Result<Arena> {
        let endpoint = self.current();
        let keys = gpu.scratch("keys of terms", 4 * terms)?;
        let values = gpu.scratch("values of terms", 4 * terms * self.channels as u64)?;
        let top = gpu.buffer("number of terms", 4, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
        let buffers =
            [&endpoint.records, &top, &*keys, &*values, &*endpoint.parts, &self.counts, &*endpoint.heads];
        let step = self.kernels.parts.step(gpu, &endpoint.base, &buffers, 0)?;
        Ok(Arena {
            parts: first..first,
            keys,
            values,
            top,
            step,
            terms: 0,
            in_flight: VecDeque::new(),
            room: terms,
        })
    }
}

impl Consumer for Parts {
    fn begin(&mut self, gpu: &Gpu, layout: &RecordLayout, paths: u64, records: &wgpu::Buffer) -> Result<()> {
        let division = Division::new(layout.samples, layout.most_ends());
        let pixels = paths / u64::from(layout.samples);
        let parts = pixels * u64::from(division.parts_of_pixel);
        if u32::try_from(parts).is_err() {
            return Err(Error::device(format!(
                "the paths have {parts} parts, and a GPU counts to {}",
                u32::MAX
            )));
        }
        // The numbers of the counts of the camera's pixels come first, and then those of the projector's.
        let after = if self.rig.symmetric { 0 } else { self.rig.camera.pixels() as u32 };
        let base = Assembly {
            samples: division.samples,
            first_half: division.first_half,
            samples_of_part: division.samples_of_part,
            parts_of_pixel: division.parts_of_pixel,
            parts_of_first_half: division.parts_of_first_half,
            max_bounces: layout.max_bounces,
            gathers: u32::from(layout.gathers),
            ambient: u32::from(layout.ambient),
            stride: layout.stride() as u32,
            own_base: if layout.from_camera { 0 } else { after },
            other_base: if layout.from_camera { after } else { 0 },
            ..self.base
        };
        let heads = if layout.direct || layout.ambient { 2 * parts * self.channels as u64 } else { 1 };
        let endpoint = Endpoint {
            layout: *layout,
            division,
            paths,
            base,
            records: records.clone(),
            parts: gpu.scratch("parts of paths", 16 * parts)?,
            heads: gpu.scratch("direct light of parts", 8 * heads)?,
            arenas: Vec::new(),
        };
        self.endpoints.push(endpoint);
        self.finished = 0;
        Ok(())
    }

    fn paths_from(&self, first_path: u64, most: u32) -> u32 {
        self.current().division.paths_from(first_path, most)
    }

    fn prepare(&mut self, gpu: &Gpu, of: &ResidentPaths) -> Result<()> {
        let &Endpoint { division, layout, paths, base, .. } = self.current();
        let first = division.part_of(of.first_path) as u32;
        let parts = division.part_of(of.first_path + u64::from(of.paths)) as u32 - first;
        let most_ends = layout.most_ends() as u64;
        let most = u64::from(of.paths) * most_ends;
        let has_room = |arena: &Arena| arena.terms + arena.in_flight.iter().sum::<u64>() + most <= arena.room;
        if !self.current().arenas.last().is_some_and(has_room) {
            let wanted = (paths - of.first_path) * most_ends;
            let arena = self.arena(gpu, first, wanted.min(self.limits.arena).max(most).max(1))?;
            let last = self.endpoints.len() - 1;
            self.endpoints[last].arenas.push(arena);
        }
        let last = self.endpoints.len() - 1;
        let arenas = &mut self.endpoints[last].arenas;
        let index = arenas.len() - 1;
        let arena = &mut arenas[index];
        let samples = u64::from(division.samples);
        let parameters = Assembly {
            paths: of.paths,
            first_pixel: (of.first_path / samples) as u32,
            first_sample: (of.first_path % samples) as u32,
            first_part: first,
            parts,
            mark: of.mark,
            ..base
        };
        arena.step.change(gpu, &parameters, parts)?;
        arena.parts.end = first + parts;
        arena.in_flight.push_back(most);
        let slot =
            (0..self.slots.len()).find(|slot| self.in_flight.iter().all(|flight| flight.slot != *slot));
        self.in_flight.push_back(InFlight {
            arena: index,
            slot: slot.unwrap_or(0),
            paths: of.paths,
            readback: None,
        });
        Ok(())
    }

    fn record(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) {
        if let Some(InFlight { arena, slot, .. }) = self.in_flight.back() {
            let arena = &self.current().arenas[*arena];
            Step::record(gpu, [&arena.step], encoder);
            encoder.copy_buffer_to_buffer(&arena.top, 0, &self.slots[*slot], 0, 4);
        }
    }

    fn submitted(&mut self, submission: &wgpu::SubmissionIndex) {
        if let Some(in_flight) = self.in_flight.back_mut() {
            let slot = Results::through(&self.slots[in_flight.slot]);
            in_flight.readback = Some(slot.request(4, submission.clone()));
        }
    }

    fn finished(&mut self, gpu: &Gpu) -> Result<()> {
        let Some(InFlight { arena, slot, paths, readback: Some(readback) }) = self.in_flight.pop_front()
        else {
            return Ok(());
        };
        self.finished += u64::from(paths);
        let slot = Results::through(&self.slots[slot]);
        let view = slot.wait(gpu, readback)?;
        let top = bytemuck::cast_slice::<u8, u32>(&view)[0];
        drop(view);
        slot.release();
        let last = self.endpoints.len() - 1;
        let arena = &mut self.endpoints[last].arenas[arena];
        arena.terms = u64::from(top);
        arena.in_flight.pop_front();
        let endpoint = self.current();
        // Each term of a coaxial rig goes to two rows.
        let expected = 2.0 * endpoint.terms() as f64 * endpoint.paths as f64 / self.finished.max(1) as f64;
        if self.finished >= ENOUGH && expected > f64::from(u32::MAX) {
            return Err(too_many(expected as u64));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_follow_one_another_and_lie_within_halves() {
        for (samples, most_ends) in [(1, 5), (2, 5), (64, 5), (65, 5), (300, 5), (7, 128), (1000, 3)] {
            let division = Division::new(samples, most_ends);
            let all = 3 * u64::from(division.parts_of_pixel);
            for part in 0..all {
                let [first, end] = [part, part + 1].map(|part| division.first_path(part));
                assert_eq!(division.part_of(first), part);
                let of_part = end - first;
                assert!(of_part > 0 && of_part * most_ends as u64 <= u64::from(MOST_OF_PART));
                let samples = u64::from(samples);
                let half = |path: u64| (path / samples, 2 * (path % samples) >= samples);
                assert_eq!(half(first), half(end - 1), "{samples} samples, part {part}");
                for most in [1, 70, 1000] {
                    let paths = u64::from(division.paths_from(first, most));
                    assert_eq!(division.first_path(division.part_of(first + paths)), first + paths);
                    assert!(paths > 0 && paths <= u64::from(most).max(of_part));
                }
            }
            assert_eq!(division.first_path(all), 3 * u64::from(samples));
        }
    }

    #[test]
    fn classes_are_those_that_occur() {
        let of = |direct, split| {
            let range = ClassRange::of(direct, split);
            (range.lowest, range.count, range.bits())
        };
        assert_eq!([of(true, false), of(true, true)], [(1, 1, 0), (1, 2, 1)]);
        assert_eq!([of(false, false), of(false, true)], [(0, 2, 1), (0, 3, 2)]);
    }
}
