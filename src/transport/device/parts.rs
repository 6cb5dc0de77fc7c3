//! The terms of the light paths, from each dispatch of the tracer. They are in arenas on the device, part by part.

use std::collections::VecDeque;
use std::ops::Range;

use wgpu::{BufferUsages, CommandEncoder};

use super::Assembling;
use super::kernels::{Assembly, MOST_OF_PART, record};
use super::rows::too_many;
use crate::error::{Error, Result};
use crate::gpu::Lent;
use crate::gpu::buffers::Readback;
use crate::gpu::pipeline::Step;
use crate::render::{Consumer, RecordLayout, ResidentPaths};
use crate::transport::Channels;
use crate::transport::contributions::CLASSES;

/// How the samples of a pixel are divided into parts. Each part lies within one half of the samples, and has at most [`MOST_OF_PART`]
/// contributions.
impl Assembly {
    pub(super) fn divided(self, samples: u32, most_ends: usize) -> Self {
        let first_half = samples.div_ceil(2);
        let samples_of_part = (MOST_OF_PART / (most_ends as u32).max(1)).max(1);
        let parts_of_first_half = first_half.div_ceil(samples_of_part);
        let parts_of_pixel = parts_of_first_half + (samples - first_half).div_ceil(samples_of_part);
        Self { samples, first_half, samples_of_part, parts_of_first_half, parts_of_pixel, ..self }
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
    pub(super) terms: u64,
    room: u64,
}

/// The terms of the paths from one endpoint of the rig.
pub(super) struct Endpoint {
    pub(super) layout: RecordLayout,
    /// The number of all paths.
    paths: u64,
    /// The paths that this device traces.
    own: Range<u64>,
    /// The parameters that all steps for these paths have in common.
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
        (self.paths / u64::from(self.base.samples)) as u32
    }

    pub(super) fn terms(&self) -> u64 {
        self.arenas.iter().map(|arena| arena.terms).sum()
    }

    /// The number of sums in `heads` for each part.
    pub(super) fn heads_of_part(&self, channels: Channels) -> usize {
        if self.layout.direct || self.layout.ambient { 2 * channels.count() } else { 0 }
    }
}

struct InFlight {
    arena: usize,
    paths: u32,
    /// The number of terms in the arena.
    top: Readback,
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
pub(super) struct Parts<'a> {
    pub(super) of: &'a Assembling<'a>,
    /// The number of terms of each row of the matrix, and then of each row of its transpose if the rig is not symmetric.
    pub(super) counts: wgpu::Buffer,
    pub(super) endpoints: Vec<Endpoint>,
    in_flight: VecDeque<InFlight>,
    /// The paths of this endpoint that are done.
    finished: u64,
}

impl<'a> Parts<'a> {
    pub(super) fn new(of: &'a Assembling<'a>) -> Result<Self> {
        let rows = of.rig.camera.pixels() + if of.rig.symmetric { 0 } else { of.rig.projector.pixels() };
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let counts = of.gpu.buffer("terms of rows", 4 * rows as u64, usage)?;
        Ok(Self { of, counts, endpoints: Vec::new(), in_flight: VecDeque::new(), finished: 0 })
    }

    fn current(&self) -> &Endpoint {
        &self.endpoints[self.endpoints.len() - 1]
    }

    fn current_mut(&mut self) -> &mut Endpoint {
        let last = self.endpoints.len() - 1;
        &mut self.endpoints[last]
    }

    /// An empty arena of an endpoint, for terms from the part `first` on.
    pub(super) fn arena(&self, endpoint: &Endpoint, first: u32, room: u64) -> Result<Arena> {
        let gpu = self.of.gpu;
        let keys = gpu.scratch("keys of terms", 4 * room)?;
        let values = gpu.scratch("values of terms", 4 * room * self.of.channels.count() as u64)?;
        let top = gpu.buffer("number of terms", 4, BufferUsages::STORAGE | BufferUsages::COPY_SRC)?;
        let buffers =
            [&endpoint.records, &top, &*keys, &*values, &*endpoint.parts, &self.counts, &*endpoint.heads];
        let step = self.of.kernels.parts.step(gpu, &endpoint.base, &buffers, 0)?;
        Ok(Arena { parts: first..first, keys, values, top, step, terms: 0, room })
    }
}

impl Consumer for Parts<'_> {
    fn begin(&mut self, layout: &RecordLayout, paths: Range<u64>, records: &wgpu::Buffer) -> Result<()> {
        let (gpu, rig) = (self.of.gpu, self.of.rig);
        let own = paths;
        let pixels = if layout.from_camera { rig.camera } else { rig.projector }.pixels();
        let paths = pixels as u64 * u64::from(layout.samples);
        // The numbers of the counts of the camera's pixels come first, and then those of the projector's.
        let after = if rig.symmetric { 0 } else { rig.camera.pixels() as u32 };
        let base = Assembly {
            max_bounces: layout.max_bounces,
            gathers: u32::from(layout.gathers),
            ambient: u32::from(layout.ambient),
            stride: layout.stride() as u32,
            own_base: if layout.from_camera { 0 } else { after },
            other_base: if layout.from_camera { after } else { 0 },
            ..self.of.base.divided(layout.samples, layout.most_ends())
        };
        let parts = pixels as u64 * u64::from(base.parts_of_pixel);
        if u32::try_from(parts).is_err() {
            return Err(Error::device(format!(
                "the paths have {parts} parts, and a GPU counts to {}",
                u32::MAX
            )));
        }
        let heads =
            if layout.direct || layout.ambient { 2 * parts * self.of.channels.count() as u64 } else { 1 };
        self.endpoints.push(Endpoint {
            layout: *layout,
            paths,
            own,
            base,
            records: records.clone(),
            parts: gpu.scratch("parts of paths", 16 * parts)?,
            heads: gpu.scratch("direct light of parts", 8 * heads)?,
            arenas: Vec::new(),
        });
        self.finished = 0;
        Ok(())
    }

    fn paths_from(&self, first_path: u64, most: u32) -> u32 {
        self.current().base.paths_from(first_path, most)
    }

    fn submit(&mut self, of: &ResidentPaths, trace: &mut dyn FnMut(&mut CommandEncoder)) -> Result<()> {
        let gpu = self.of.gpu;
        let &Endpoint { layout, ref own, base, .. } = self.current();
        let end = own.end;
        let first = base.part_of(of.first_path) as u32;
        let parts = base.part_of(of.first_path + u64::from(of.paths)) as u32 - first;
        let most_of = |paths: u64| paths * layout.most_ends() as u64;
        let most = most_of(of.paths.into());
        let arenas = self.current().arenas.len();
        let in_flight = self.in_flight.iter().filter(|flight| flight.arena + 1 == arenas);
        let reserved = in_flight.map(|flight| most_of(flight.paths.into())).sum::<u64>() + most;
        let has_room = |arena: &Arena| arena.terms + reserved <= arena.room;
        if !self.current().arenas.last().is_some_and(has_room) {
            let wanted = most_of(end - of.first_path);
            let arena =
                self.arena(self.current(), first, wanted.min(self.of.limits.arena).max(most).max(1))?;
            self.current_mut().arenas.push(arena);
        }
        let arenas = &mut self.current_mut().arenas;
        let index = arenas.len() - 1;
        let arena = &mut arenas[index];
        let samples = u64::from(base.samples);
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
        let read = gpu.buffer("terms of an arena", 4, BufferUsages::MAP_READ | BufferUsages::COPY_DST)?;
        let submission = gpu.submit("dispatch", |encoder| {
            trace(encoder);
            record(gpu, [&arena.step], encoder);
            encoder.copy_buffer_to_buffer(&arena.top, 0, &read, 0, 4);
        })?;
        let top = Readback::request(&read, 4, submission);
        self.in_flight.push_back(InFlight { arena: index, paths: of.paths, top });
        Ok(())
    }

    fn finish(&mut self) -> Result<()> {
        let Some(InFlight { arena, paths, top }) = self.in_flight.pop_front() else { return Ok(()) };
        self.finished += u64::from(paths);
        let top = bytemuck::cast_slice::<u8, u32>(&top.wait(self.of.gpu)?)[0];
        self.current_mut().arenas[arena].terms = u64::from(top);
        let endpoint = self.current();
        // Each term of a coaxial rig goes to two rows.
        let own = (endpoint.own.end - endpoint.own.start) as f64;
        let expected = 2.0 * endpoint.terms() as f64 * own / self.finished.max(1) as f64;
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
            let division = Assembly::default().divided(samples, most_ends);
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
