//! Contributions to the matrix are sorted and summed on the device. A dispatch then returns a list of terms. Without this, it would return
//! the records of its paths, which are several times as long.
//!
//! The key of a contribution is the pixel at the other end of its path and the class of its bounces. A radix sort orders the contributions
//! of all paths from a pixel by key. Contributions with equal keys are summed in path order, in single precision. The host sums in double
//! precision, so its terms differ only by rounding ([`agree`]). To detect wrong sums, host and device both sum the first large dispatch.
//!
//! If the device is the processor itself, nothing is gained: the host reads records in place, and the sort would run on the same cores.

mod steps;
#[cfg(test)]
mod tests;

use steps::{Kernels, MOST_STEPS, MergeParameters, all_steps, base_parameters};
use wgpu::{BufferUsages, CommandEncoder};

use super::batch::{Batch, RecordLayout};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Readback, Results};

/// The maximum number of four-byte words of a buffer here: 128 MiB, which every device allows.
const MOST_WORDS: u64 = 1 << 25;

/// The number of bytes between the parameters of consecutive steps. It is a multiple of the alignment that devices require.
const STRIDE: u64 = 256;

/// Bytes of the totals: the number of entries, the number of terms, and two unused words.
const TOTALS: u64 = 16;

/// Describes how contributions become terms.
pub(crate) struct MergeRequest<'a> {
    pub(crate) channels: usize,
    pub(crate) luminance: [f32; 3],
    /// Whether light of two bounces is a separate class, as in [`class`].
    pub(crate) split: bool,
    /// Maps the number of paths from each pixel to three weights of a sample: its weight in the mean, and its weight in the error if it
    /// belongs to the first or to the second half.
    pub(crate) weights: &'a dyn Fn(u32) -> [f64; 3],
}

/// The terms of a dispatch. They ascend by the pixel at which paths start, and then by key.
#[derive(Clone, Copy)]
pub(crate) struct Merged<'a> {
    words: &'a [u32],
    channels: usize,
    first_pixel: u32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct MergedTerm<'a> {
    /// The pixel at which the paths of this term start.
    pub(crate) start: u32,
    /// The pixel at the other end of these paths, times four, plus the class of bounces.
    pub(crate) key: u32,
    mean: &'a [u32],
    error: &'a [u32],
}

impl MergedTerm<'_> {
    pub(crate) fn mean<const C: usize>(&self) -> [f32; C] {
        std::array::from_fn(|channel| f32::from_bits(self.mean[channel]))
    }

    pub(crate) fn error<const C: usize>(&self) -> [f32; C] {
        std::array::from_fn(|channel| f32::from_bits(self.error[channel]))
    }
}

impl<'a> Merged<'a> {
    pub(crate) fn terms(&self) -> impl Iterator<Item = MergedTerm<'a>> + use<'a> {
        let (channels, first_pixel) = (self.channels, self.first_pixel);
        self.words.chunks_exact(words_of_term(channels)).map(move |words| {
            let (mean, error) = words[2..].split_at(channels);
            MergedTerm { start: first_pixel + words[0], key: words[1], mean, error }
        })
    }

    /// Divides the terms into about `count` parts. All terms of a pixel are in the same part.
    pub(crate) fn parts(&self, count: usize) -> Vec<Self> {
        let size = words_of_term(self.channels);
        let terms = self.words.len() / size;
        let start = |term: usize| self.words[term * size];
        let mut bounds = vec![0];
        for part in 1..=count.max(1) {
            let mut bound = (terms * part / count.max(1)).max(bounds[bounds.len() - 1]);
            while bound > 0 && bound < terms && start(bound) == start(bound - 1) {
                bound += 1;
            }
            bounds.push(bound);
        }
        bounds
            .windows(2)
            .map(|pair| Self { words: &self.words[pair[0] * size..pair[1] * size], ..*self })
            .collect()
    }
}

/// The number of four-byte words of a term: start, key, means and errors.
fn words_of_term(channels: usize) -> usize {
    2 + 2 * channels
}

/// Whether a tracer lets its device sort and sum contributions.
#[derive(Default)]
pub(super) struct Trust {
    /// The caller's choice. By default, a device sorts and sums unless it is the processor itself.
    pub(super) asked: Option<bool>,
    /// Whether the terms of a large dispatch have been compared with the host's terms.
    pub(super) is_checked: bool,
    pub(super) is_lost: bool,
    kernels: Option<Kernels>,
}

impl Trust {
    /// The kernels, which are compiled at first use.
    pub(super) fn kernels(&mut self, gpu: &Gpu) -> Result<Kernels> {
        match &self.kernels {
            Some(kernels) => Ok(kernels.clone()),
            None => Ok(self.kernels.insert(Kernels::new(gpu)?).clone()),
        }
    }

    /// Whether the device is to sort and sum.
    pub(super) fn merges(&self, gpu: &Gpu) -> bool {
        !self.is_lost && self.asked.unwrap_or(!gpu.summary.is_processor())
    }
}

/// Sorts and sums the contributions of one dispatch at a time.
pub(super) struct DeviceMerge {
    kernels: Kernels,
    parameters: wgpu::Buffer,
    totals: Results,
    terms: Results,
    /// The bind groups: one with the entries in the first buffer, and one with the entries in the second.
    groups: [wgpu::BindGroup; 2],
    channels: usize,
    other_pixels: u64,
}

pub(super) struct MergeInFlight {
    totals: Readback,
    first_pixel: u32,
}

/// The terms of a dispatch in memory. Drop it and call [`DeviceMerge::release`] before the next dispatch.
pub(super) struct MergedView {
    view: wgpu::BufferView,
    words: usize,
    channels: usize,
    first_pixel: u32,
}

impl MergedView {
    pub(super) fn merged(&self) -> Merged<'_> {
        let words: &[u32] = bytemuck::cast_slice(&self.view);
        Merged { words: &words[..self.words], channels: self.channels, first_pixel: self.first_pixel }
    }
}

impl DeviceMerge {
    /// Allocates memory for the contributions of at most `paths` paths, whose records are in `records`. The result is `None` if they do not
    /// fit, or if a dispatch cannot contain all paths of a pixel.
    pub(super) fn new(
        gpu: &Gpu,
        kernels: &Kernels,
        channels: usize,
        (layout, other_pixels): (&RecordLayout, u64),
        paths: u32,
        records: &wgpu::Buffer,
    ) -> Result<Option<Self>> {
        let entries = u64::from(paths) * layout.most_ends() as u64;
        let words_of_terms = entries * words_of_term(channels) as u64;
        let most = MOST_WORDS.min(gpu.summary.max_storage_binding / 4).min(gpu.summary.max_buffer / 4);
        if paths < layout.samples || entries == 0 || words_of_terms.max(4 * entries) > most {
            return Ok(None);
        }
        let words = |label: &str, count: u64| gpu.buffer(label, 4 * count, BufferUsages::STORAGE);
        let [one, other] = [words("entries", 4 * entries)?, words("moved entries", 4 * entries)?];
        let values = words("values", entries * channels as u64)?;
        let [counters, sums] = steps::counters(entries as u32, paths);
        let (counters, sums) = (words("counters", counters)?, words("sums", sums)?);
        let totals = Results::new(gpu, "totals", TOTALS)?;
        let terms = Results::new(gpu, "terms", 4 * words_of_terms)?;
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let parameters = gpu.buffer("parameters of merging", STRIDE * MOST_STEPS as u64, usage)?;
        let group = |[entries, moved]: [&wgpu::Buffer; 2]| {
            let parameters = wgpu::BufferBinding {
                buffer: &parameters,
                offset: 0,
                size: std::num::NonZero::new(size_of::<MergeParameters>() as u64),
            };
            let storage = [records, entries, moved, &values, &counters, &sums, &totals.buffer, &terms.buffer];
            let resources = std::iter::once(wgpu::BindingResource::Buffer(parameters))
                .chain(storage.map(wgpu::Buffer::as_entire_binding));
            gpu.bind("merging", &kernels.layout, resources)
        };
        let groups = gpu.guarded("bindings of merging", || [group([&one, &other]), group([&other, &one])])?;
        let kernels = kernels.clone();
        Ok(Some(Self { kernels, parameters, totals, terms, groups, channels, other_pixels }))
    }

    pub(super) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut CommandEncoder,
        request: &MergeRequest<'_>,
        layout: &RecordLayout,
        paths: u32,
    ) {
        let steps = all_steps(&base_parameters(request, layout, paths), self.other_pixels, layout);
        let mut bytes = vec![0_u8; steps.len() * STRIDE as usize];
        for (step, to) in steps.iter().zip(bytes.chunks_exact_mut(STRIDE as usize)) {
            to[..size_of::<MergeParameters>()].copy_from_slice(bytemuck::bytes_of(&step.parameters));
        }
        gpu.queue.write_buffer(&self.parameters, 0, &bytes);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for (index, step) in steps.iter().enumerate() {
            let offset = (index as u64 * STRIDE) as u32;
            pass.set_pipeline(self.kernels.pipeline(step.kernel));
            pass.set_bind_group(0, &self.groups[usize::from(step.is_swapped)], &[offset]);
            pass.dispatch_workgroups(step.workgroups, 1, 1);
        }
        drop(pass);
        self.totals.copy(encoder, TOTALS);
    }

    /// Requests the number of terms after `submission`. The first path of the dispatch is the first path of `first_pixel`.
    pub(super) fn request(&self, submission: wgpu::SubmissionIndex, first_pixel: u32) -> MergeInFlight {
        MergeInFlight { totals: self.totals.request(TOTALS, submission), first_pixel }
    }

    /// Waits for the number of terms, and then for the terms.
    pub(super) fn wait(&self, gpu: &Gpu, in_flight: MergeInFlight) -> Result<MergedView> {
        let view = self.totals.wait(gpu, in_flight.totals)?;
        let terms = bytemuck::cast_slice::<u8, u32>(&view)[1];
        drop(view);
        self.totals.release();
        let words = terms as usize * words_of_term(self.channels);
        // A read-back must have some bytes, even without terms.
        let bytes = 4 * words.max(2) as u64;
        let submission =
            gpu.guarded("read-back of terms", || self.terms.submit(gpu, gpu.encoder(), bytes))?;
        let view = self.terms.wait(gpu, self.terms.request(bytes, submission))?;
        Ok(MergedView { view, words, channels: self.channels, first_pixel: in_flight.first_pixel })
    }

    /// Makes the terms writable again for the device.
    pub(super) fn release(&self) {
        self.terms.release();
    }
}

/// The number of contributions that the device sums before it adds them to the earlier sum; `TOGETHER` of `shaders/merge_sums.wgsl`.
const TOGETHER: f64 = 64.0;

/// The number of roundings of a contribution apart from summation: for its luminance, its weight, and the sum of both halves.
const OTHER_ROUNDINGS: f64 = 8.0;

pub(super) struct HostTerm {
    start: u32,
    key: u32,
    mean: [f64; 3],
    error: [f64; 3],
    /// The sum of the magnitudes of the values that were added to the mean or to the error.
    size: [f64; 3],
    contributions: u32,
}

#[cfg(test)]
impl HostTerm {
    /// The term as a device writes it, for one channel.
    fn words(&self) -> [u32; 4] {
        [self.start, self.key, (self.mean[0] as f32).to_bits(), (self.error[0] as f32).to_bits()]
    }
}

/// The class of a connection: 0 for one bounce, 1 for more. If `split` is set, 1 means two bounces, and 2 means more.
pub(crate) fn class(bounces: u32, split: bool) -> u32 {
    match bounces {
        1 => 0,
        2 => 1,
        _ if split => 2,
        _ => 1,
    }
}

/// The terms of a batch, as the host computes them. The batch must have all paths of its pixels.
pub(super) fn host_terms(batch: &Batch<'_>, request: &MergeRequest<'_>) -> Vec<HostTerm> {
    let [mean, first, second] = (request.weights)(batch.samples());
    let mut found: Vec<(u32, u32, usize, [f32; 3])> = Vec::new();
    for run in batch.runs() {
        for end in run.paths.clone().flat_map(|path| batch.ends(path)).filter(|end| end.is_seen) {
            let class = class(end.bounces, request.split);
            let [red, green, blue] = end.value;
            let [r, g, b] = request.luminance;
            let value = match request.channels {
                1 => [red * r + green * g + blue * b, 0.0, 0.0],
                _ => end.value,
            };
            if value != [0.0; 3] {
                found.push((run.pixel, end.pixel << 2 | class, run.half, value));
            }
        }
    }
    found.sort_by_key(|&(start, key, ..)| (start, key));
    let of_term = |same: &[(u32, u32, usize, [f32; 3])]| {
        let (start, key, ..) = same[0];
        let none = [0.0; 3];
        let mut term =
            HostTerm { start, key, mean: none, error: none, size: none, contributions: same.len() as u32 };
        for &(.., half, value) in same {
            let of_error = [first, second][half];
            for (channel, value) in value.map(f64::from).into_iter().enumerate() {
                term.mean[channel] += mean * value;
                term.error[channel] += of_error * value;
                term.size[channel] += (mean.abs().max(of_error.abs()) * value).abs();
            }
        }
        term
    };
    found.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(of_term).collect()
}

/// Whether the device's terms equal `expected` up to rounding. In a sum of `n` contributions, each contribution is rounded at most about
/// `64 + n/64` times, each time by at most 2⁻²⁴ of the sum.
pub(super) fn agree(merged: &Merged<'_>, expected: &[HostTerm]) -> bool {
    let mut left = expected.iter();
    let each = merged.terms().all(|term| {
        let Some(expected) = left.next() else { return false };
        let n = f64::from(expected.contributions);
        let roundings = n.min(TOGETHER + n / TOGETHER) + OTHER_ROUNDINGS;
        let near = |found: &[u32], exact: &[f64; 3]| {
            found.iter().zip(exact).zip(&expected.size).all(|((&found, exact), size)| {
                let off = (f64::from(f32::from_bits(found)) - exact).abs();
                off <= roundings * 2.0_f64.powi(-24) * size
            })
        };
        (term.start, term.key) == (expected.start, expected.key)
            && near(term.mean, &expected.mean)
            && near(term.error, &expected.error)
    });
    each && left.next().is_none()
}
