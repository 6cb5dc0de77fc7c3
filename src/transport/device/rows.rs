//! From terms to the rows of the matrix, band by band: terms move to the rows of the pixels at which their paths start and end; each row is
//! sorted and summed; and its entries move to the arrays of the layers.

use std::ops::Range;

use wgpu::BufferUsages;

use super::Assembling;
use super::kernels::{
    Assembly, BLOCK, FROM_PROJECTOR, HAS_MIRRORED, HAS_OWN, MOST_OF_ROW, OF_GROUP, SYMMETRIC, WEIGHTS,
    record, submit,
};
use super::parts::Endpoint;
use crate::error::{Error, Result};
use crate::gpu::Lent;
use crate::gpu::pipeline::{Kernel, Step};
use crate::transport::Bounces;
use crate::transport::gpu_matrix::{self, Band, DeviceLayer, cut};

/// The maximum number of terms of a row. One workgroup sorts a row, and a longer one might take it so long that the driver resets the device.
const LONGEST_ROW: u32 = 1 << 16;

/// The error for more terms of rows than 32 bits count.
pub(super) fn too_many(terms: u64) -> Error {
    Error::device(format!("the rows have {terms} terms, and a GPU counts to {}", u32::MAX))
}

/// The rows of a matrix, and the terms from which they are made.
pub(super) struct Rows<'a> {
    pub(super) of: &'a Assembling<'a>,
    /// Each endpoint of the rig with its flags: whether paths start or end at the pixels of the rows.
    pub(super) sources: Vec<(&'a Endpoint, u32)>,
    pub(super) counts: &'a wgpu::Buffer,
    /// The place at which the counts of these rows begin.
    pub(super) first_count: u32,
    pub(super) rows: u32,
    pub(super) columns: usize,
    /// Direct light and its error for each row and channel; a placeholder if the matrix has no diagonal.
    pub(super) estimates: &'a wgpu::Buffer,
    /// Receives the sums of each row.
    pub(super) sums: &'a wgpu::Buffer,
}

/// The buffers of a band while it is made, which the next band uses again: the terms of rows, the columns and the values of entries, the
/// numbers of terms that have arrived in each row, and the entries of each class in each row.
type Scratch = [Lent; 5];

impl Endpoint {
    /// The flags of paths whose light goes to the rows of the matrix, or of its transpose.
    pub(super) fn flags(&self, is_transposed: bool) -> u32 {
        if self.layout.symmetric {
            return HAS_OWN | HAS_MIRRORED | SYMMETRIC;
        }
        let direction = if self.layout.from_camera != is_transposed { HAS_OWN } else { HAS_MIRRORED };
        direction | if self.layout.from_camera { 0 } else { FROM_PROJECTOR }
    }
}

impl Rows<'_> {
    fn words(&self, label: &str, count: u64) -> Result<wgpu::Buffer> {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        self.of.gpu.buffer(label, 4 * count.max(1), usage)
    }

    /// Makes one layer for each class of bounces.
    pub(super) fn layers(&self, bounces: &[Bounces]) -> Result<Vec<DeviceLayer>> {
        let &Assembling { gpu, limits, base, .. } = self.of;
        let channels = self.of.channels.count();
        let starts = self.words("starts of rows", u64::from(self.rows) + 1)?;
        let totals = self.words("totals", 2)?;
        let of_terms = Assembly { own_base: self.first_count, rows: self.rows, ..base };
        submit(gpu, &self.scan(&of_terms, [self.counts, &starts, &totals])?)?;
        let found = gpu.read::<u32>(&totals, 2)?;
        let (total, longest) = (u64::from(found[0]), found[1]);
        // The counts of the scan have 32 bits.
        let expected: u64 =
            self.sources.iter().map(|(endpoint, flags)| of_flags(endpoint.terms(), *flags)).sum();
        if total != expected {
            return Err(too_many(expected));
        }
        if longest > LONGEST_ROW {
            return Err(Error::device(format!(
                "a row has {longest} terms, and a GPU is given at most {LONGEST_ROW} to sort"
            )));
        }
        let bands = if total <= limits.entries as u64 {
            std::iter::once(0..self.rows as usize).collect::<Vec<_>>()
        } else {
            let starts = gpu.read::<u32>(&starts, self.rows as usize + 1)?;
            let starts: Vec<usize> = starts.into_iter().map(|start| start as usize).collect();
            cut(&starts, gpu_matrix::Limits { entries: limits.entries, rows: usize::MAX })
        };
        let most = if bands.len() == 1 { total } else { limits.entries.max(longest as usize) as u64 };
        let most_rows = bands.iter().map(ExactSizeIterator::len).max().unwrap_or(0) as u64;
        let values = most * channels as u64;
        let words = |label, count: u64| gpu.scratch(label, 4 * count);
        let scratch = [
            words("terms of rows", most + values)?,
            words("columns of entries", most)?,
            words("values of entries", values)?,
            words("terms that have arrived", most_rows)?,
            words("entries of classes", most_rows * (1 << base.class_bits))?,
        ];
        let shape = [self.rows as usize, self.columns];
        let empty = |&bounces: &Bounces| DeviceLayer::empty(gpu, bounces, shape, channels);
        let mut layers: Vec<DeviceLayer> = bounces.iter().map(empty).collect();
        let mut squares = Vec::new();
        for band in bands {
            let rows = band.start as u32..band.end as u32;
            let made = self.band(&scratch, &starts, &rows, longest > MOST_OF_ROW)?;
            for (number, (layer, (band, entries))) in layers.iter_mut().zip(made).enumerate() {
                for (channel, weights) in band.weights.iter().enumerate() {
                    squares.push((number, channel, self.squares(weights, entries as u32)?));
                }
                layer.push(band, entries);
            }
        }
        let asked: Vec<_> = squares.iter().map(|(.., (buffer, groups))| (buffer, *groups)).collect();
        for ((number, channel, _), found) in squares.iter().zip(gpu.read_all::<f64>(&asked)?) {
            layers[*number].squares[*channel] += found.iter().sum::<f64>();
        }
        Ok(layers)
    }

    /// Submits the sum of the squares of these weights. Returns the place of the partial sums, and their number.
    fn squares(&self, weights: &wgpu::Buffer, entries: u32) -> Result<(wgpu::Buffer, usize)> {
        let &Assembling { gpu, ref kernels, base, .. } = self.of;
        let groups = entries.div_ceil(WEIGHTS);
        let to = self.words("squares of weights", 2 * u64::from(groups))?;
        let parameters = Assembly { rows: entries, ..base };
        submit(gpu, &[kernels.squares.step(gpu, &parameters, &[weights, &to], groups)?])?;
        Ok((to, groups as usize))
    }

    /// The steps that sum `parameters.rows` counts. `buffers` are the counts, the place of the prefix sums, and the totals.
    fn scan(&self, parameters: &Assembly, [counts, starts, totals]: [&wgpu::Buffer; 3]) -> Result<Vec<Step>> {
        let groups = parameters.rows.div_ceil(BLOCK);
        let blocks = self.words("sums of blocks", u64::from(groups))?;
        let groups = [groups, 1, groups];
        let step = |(kernel, groups): (&Kernel, u32)| {
            kernel.step(self.of.gpu, parameters, &[counts, starts, &blocks, totals], groups)
        };
        self.of.kernels.scan.iter().zip(groups).map(step).collect()
    }

    /// The entries of these rows, for each class, with their number.
    fn band(
        &self,
        scratch: &Scratch,
        starts: &wgpu::Buffer,
        rows: &Range<u32>,
        has_long_rows: bool,
    ) -> Result<Vec<(Band, usize)>> {
        let &Assembling { gpu, ref kernels, classes: of_classes, base, .. } = self.of;
        let [row_terms, entry_columns, entry_values, cursors, classes] = scratch;
        let count = rows.end - rows.start;
        let of_band = Assembly { first_row: rows.start, rows: count, ..base };
        let mut steps = Vec::new();
        for (endpoint, flags) in &self.sources {
            for arena in endpoint.arenas.iter().filter(|arena| !arena.parts.is_empty()) {
                let parts = arena.parts.end - arena.parts.start;
                let parameters = Assembly {
                    first_part: arena.parts.start,
                    parts,
                    parts_of_pixel: endpoint.base.parts_of_pixel,
                    flags: *flags,
                    ..of_band
                };
                let groups = parts.div_ceil(OF_GROUP);
                let buffers =
                    [&*arena.keys, &*arena.values, &*endpoint.parts, starts, &**cursors, &**row_terms];
                steps.push(kernels.scatter.step(gpu, &parameters, &buffers, groups)?);
            }
        }
        let of_rows = Assembly {
            flags: self.sources.iter().fold(0, |all, (_, flags)| all | flags & SYMMETRIC),
            ..of_band
        };
        let buffers = [row_terms, starts, self.estimates, entry_columns, entry_values, classes, self.sums];
        for kernel in &kernels.rows[..1 + usize::from(has_long_rows)] {
            steps.push(kernel.step(gpu, &of_rows, &buffers, count)?);
        }
        let totals = self.words("totals", 2 * u64::from(of_classes.count))?;
        let mut layer_starts = Vec::new();
        for class in 0..of_classes.count {
            let to = self.words("matrix's rows", u64::from(count) + 1)?;
            let parameters = Assembly { own_base: class * count, rows: count, total: 2 * class, ..of_band };
            steps.extend(self.scan(&parameters, [classes, &to, &totals])?);
            layer_starts.push(to);
        }
        gpu.submit("assembly", |encoder| {
            encoder.clear_buffer(cursors, 0, None);
            record(gpu, &steps, encoder);
        })?;
        let found = gpu.read::<u32>(&totals, 2 * of_classes.count as usize)?;
        let mut made = Vec::new();
        let mut packing = Vec::new();
        for (class, starts_of_layer) in (0..of_classes.count).zip(layer_starts) {
            let entries = found[2 * class as usize];
            let columns = self.words("matrix's columns", u64::from(entries))?;
            let weights =
                (0..self.of.channels.count()).map(|_| self.words("matrix's weights", u64::from(entries)));
            let weights: Vec<wgpu::Buffer> = weights.collect::<Result<_>>()?;
            for (channel, weights) in (0..).zip(&weights) {
                let parameters = Assembly { class_number: class, channel, ..of_band };
                let buffers =
                    [entry_columns, entry_values, starts, classes, &starts_of_layer, &columns, weights];
                packing.push(kernels.pack.step(gpu, &parameters, &buffers, count.div_ceil(OF_GROUP))?);
            }
            made.push((
                Band { rows: rows.clone(), starts: starts_of_layer, columns, weights },
                entries as usize,
            ));
        }
        submit(gpu, &packing)?;
        Ok(made)
    }
}

/// The number of terms that an endpoint's `terms` give to the rows: each one to its own row, to the row at its other end, or to both.
fn of_flags(terms: u64, flags: u32) -> u64 {
    terms * u64::from((flags & (HAS_OWN | HAS_MIRRORED)).count_ones())
}
