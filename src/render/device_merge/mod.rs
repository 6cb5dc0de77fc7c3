//! Contributions to the matrix, sorted and summed on the device. A dispatch then returns a list of terms. The records of its paths would be
//! several times as long.
//!
//! The key of a contribution is the pixel at the other end of its path and the class of its bounces. A radix sort orders the contributions
//! of all paths from a pixel by key. Contributions of equal keys are summed in path order, in single precision. The host sums in double
//! precision, so its terms differ by rounding alone ([`agree`]). Both sum the first large dispatch of a tracer, to detect wrong sums.
//!
//! A device that is the processor itself gains nothing: it reads records in place, and its sort would run on the same cores.

mod steps;
#[cfg(test)]
mod tests;

use steps::{Buffers, Kernels, MergeStep, TOTALS, all_steps, base_parameters, offset};
use wgpu::CommandEncoder;

use super::batch::{Batch, RecordLayout};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Readback;

/// The most four-byte words of a buffer here: 128 MiB, which every device allows.
const MOST_WORDS: u64 = 1 << 25;

/// The rules by which contributions become terms.
pub(crate) struct MergeRequest<'a> {
    pub(crate) channels: usize,
    pub(crate) luminance: [f32; 3],
    /// Whether the second bounce is class 1 and all later ones class 2; otherwise they are all class 1. One bounce is class 0.
    pub(crate) split: bool,
    /// For a number of paths from each pixel: the weight of a sample in the mean, and the weights of samples of both halves in its error.
    pub(crate) weights: &'a dyn Fn(u32) -> [f64; 3],
}

/// The terms of a dispatch, in ascending order of the pixel that paths start from, and then of key.
#[derive(Clone, Copy)]
pub(crate) struct Merged<'a> {
    words: &'a [u32],
    channels: usize,
    first_pixel: u32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct MergedTerm<'a> {
    /// The pixel that the paths of this term start from.
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

    /// The terms in about `count` parts. All terms of a pixel are in one part.
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
pub(super) struct Trust {
    /// The caller's choice. By default, only a device that is not the processor itself does so.
    pub(super) asked: Option<bool>,
    /// Whether the terms of a large dispatch were compared with the host's.
    is_checked: bool,
    is_lost: bool,
    kernels: Option<Kernels>,
}

impl Trust {
    pub(super) fn new() -> Self {
        Self { asked: None, is_checked: false, is_lost: false, kernels: None }
    }

    pub(super) fn merging<'a>(
        &'a mut self,
        gpu: &Gpu,
        request: &'a MergeRequest<'a>,
    ) -> Result<MergeSession<'a>> {
        let kernels = match &self.kernels {
            Some(kernels) => kernels.clone(),
            None => self.kernels.insert(Kernels::new(gpu)?).clone(),
        };
        Ok(MergeSession { request, kernels, is_checked: &mut self.is_checked, is_lost: &mut self.is_lost })
    }

    /// Whether the device is to sort and sum.
    pub(super) fn merges(&self, gpu: &Gpu) -> bool {
        !self.is_lost && self.asked.unwrap_or(!gpu.summary.is_processor())
    }
}

pub(super) struct MergeSession<'a> {
    pub(super) request: &'a MergeRequest<'a>,
    kernels: Kernels,
    pub(super) is_checked: &'a mut bool,
    pub(super) is_lost: &'a mut bool,
}

/// Sorts and sums the contributions of one dispatch at a time.
pub(super) struct DeviceMerge {
    kernels: Kernels,
    buffers: Buffers,
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
    /// Reserves room for the contributions of at most `paths` paths, whose records are in `records`. `None` where they do not fit, or where
    /// a dispatch cannot have all paths of a pixel.
    pub(super) fn new(
        gpu: &Gpu,
        MergeSession { request, kernels, .. }: &MergeSession<'_>,
        (layout, other_pixels): (&RecordLayout, u64),
        paths: u32,
        records: &wgpu::Buffer,
    ) -> Result<Option<Self>> {
        let channels = request.channels;
        let entries = u64::from(paths) * layout.most_ends() as u64;
        let words = entries * words_of_term(channels) as u64;
        let most = MOST_WORDS.min(gpu.summary.max_storage_binding / 4).min(gpu.summary.max_buffer / 4);
        if paths < layout.samples || entries == 0 || words.max(4 * entries) > most {
            return Ok(None);
        }
        let buffers = Buffers::new(gpu, kernels, records, (entries as u32, paths), channels)?;
        Ok(Some(Self { kernels: kernels.clone(), buffers, channels, other_pixels }))
    }

    pub(super) fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut CommandEncoder,
        request: &MergeRequest<'_>,
        layout: &RecordLayout,
        paths: u32,
    ) {
        let steps: Vec<MergeStep> =
            all_steps(&base_parameters(request, layout, paths), self.other_pixels, layout);
        self.buffers.write_parameters(gpu, &steps);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        for (index, step) in steps.iter().enumerate() {
            pass.set_pipeline(self.kernels.pipeline(step.kernel));
            pass.set_bind_group(0, &self.buffers.groups[usize::from(step.is_swapped)], &[offset(index)]);
            pass.dispatch_workgroups(step.workgroups, 1, 1);
        }
        drop(pass);
        self.buffers.totals.copy(encoder, TOTALS);
    }

    /// Asks for the number of terms after `submission`. The first path of the dispatch is the first path of `first_pixel`.
    pub(super) fn request(&self, submission: wgpu::SubmissionIndex, first_pixel: u32) -> MergeInFlight {
        MergeInFlight { totals: self.buffers.totals.request(TOTALS, submission), first_pixel }
    }

    pub(super) fn wait(&self, gpu: &Gpu, in_flight: MergeInFlight) -> Result<MergedView> {
        let terms = self.buffers.wait_totals(gpu, in_flight.totals)?;
        let words = terms as usize * words_of_term(self.channels);
        let view = self.buffers.read_terms(gpu, words as u64)?;
        Ok(MergedView { view, words, channels: self.channels, first_pixel: in_flight.first_pixel })
    }

    /// Makes the terms writable again for the device.
    pub(super) fn release(&self) {
        self.buffers.terms.release();
    }
}

/// The number of contributions that the device sums before it adds their sum to the rest; `TOGETHER` of `shaders/merge_sums.wgsl`.
const TOGETHER: f64 = 64.0;

/// Roundings of a contribution besides the roundings of its sum: its luminance, its weight, and the sum of both halves.
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

/// The terms of a batch, which has all paths of its pixels.
pub(super) fn host_terms(batch: &Batch<'_>, request: &MergeRequest<'_>) -> Vec<HostTerm> {
    let [mean, first, second] = (request.weights)(batch.samples());
    let mut found: Vec<(u32, u32, usize, [f32; 3])> = Vec::new();
    for run in batch.runs() {
        for end in run.paths.clone().flat_map(|path| batch.ends(path)).filter(|end| end.is_seen) {
            let class = match end.bounces {
                1 => 0,
                2 => 1,
                _ if request.split => 2,
                _ => 1,
            };
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

/// Whether the device's terms equal `expected` up to rounding. In a sum of `n` contributions, each is rounded at most about `64 + n/64`
/// times, each time by at most 2⁻²⁴ of the sum.
pub(super) fn agree(merged: &Merged<'_>, expected: &[HostTerm]) -> bool {
    let mut left = expected.iter();
    let each = merged.terms().all(|term| {
        let Some(expected) = left.next() else { return false };
        let n = f64::from(expected.contributions);
        let roundings = n.min(TOGETHER + n / TOGETHER) + OTHER_ROUNDINGS;
        let near = |found: [f32; 3], exact: [f64; 3], channels: usize| {
            (0..channels).all(|channel| {
                let off = (f64::from(found[channel]) - exact[channel]).abs();
                off <= roundings * 2.0_f64.powi(-24) * expected.size[channel]
            })
        };
        let padded = |values: &dyn Fn(usize) -> f32, channels: usize| {
            std::array::from_fn(|channel| if channel < channels { values(channel) } else { 0.0 })
        };
        let channels = merged.channels;
        let (mean, error) = match channels {
            1 => {
                let ([mean], [error]) = (term.mean::<1>(), term.error::<1>());
                (padded(&|_| mean, 1), padded(&|_| error, 1))
            }
            _ => (term.mean::<3>(), term.error::<3>()),
        };
        (term.start, term.key) == (expected.start, expected.key)
            && near(mean, expected.mean, channels)
            && near(error, expected.error, channels)
    });
    each && left.next().is_none()
}
