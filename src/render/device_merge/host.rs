//! The terms of a dispatch as the host sums them, and whether those of the device agree with them.

use super::{MergeRequest, Merged};
use crate::render::batch::Batch;

/// Contributions that the device sums before it adds their sum to that of the others; `TOGETHER` of `shaders/merge_sums.wgsl`.
const TOGETHER: f64 = 64.0;

/// Roundings of a contribution besides those of its sum: its luminance, its weight, and the sum of both halves.
const OTHER_ROUNDINGS: f64 = 8.0;

/// A term in double precision.
pub(in crate::render) struct HostTerm {
    start: u32,
    key: u32,
    mean: [f64; 3],
    error: [f64; 3],
    /// The sum of what was added to the mean or to the error, without its signs.
    size: [f64; 3],
    contributions: u32,
}

#[cfg(test)]
impl HostTerm {
    /// As a device writes it, for one channel.
    pub(super) fn words(&self) -> [u32; 4] {
        [self.start, self.key, (self.mean[0] as f32).to_bits(), (self.error[0] as f32).to_bits()]
    }
}

/// The terms of a batch, which has all paths of its pixels.
pub(in crate::render) fn terms(batch: &Batch<'_>, request: &MergeRequest<'_>) -> Vec<HostTerm> {
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

/// Whether the terms of the device are these, but for rounding: in a sum of `n` contributions each is rounded at most about `64 + n/64` times, each time by
/// at most 2⁻²⁴ of the sum.
pub(in crate::render) fn agree(merged: &Merged<'_>, expected: &[HostTerm]) -> bool {
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
