//! The kernel that computes products, and its dispatches. A layer is divided into bands that fit the device's buffers and one dispatch.

use std::ops::Range;

use wgpu::BufferUsages;

use crate::error::{Error, Result};
use crate::gpu::pipeline::{READ, UNIFORM, WRITE};
use crate::gpu::{Gpu, shader};
use crate::transport::{Bounces, CompressedRows};

#[derive(Clone, Copy)]
pub(super) struct Limits {
    pub(super) entries: usize,
    pub(super) rows: usize,
}

/// The limits of a dispatch on a GPU. 2²⁷ entries take a gigabyte, which even a slow GPU reads in a tenth of a second.
const ON_GPU: Limits = Limits { entries: 1 << 27, rows: 1 << 24 };

/// The limits of a dispatch on software Vulkan. Two cores take some 50 ms for this many entries, or for this many rows (measured).
const ON_PROCESSOR: Limits = Limits { entries: 1 << 22, rows: 1 << 15 };

impl Limits {
    pub(super) fn of(gpu: &Gpu) -> Self {
        let Self { entries, rows } = if gpu.summary.is_processor() { ON_PROCESSOR } else { ON_GPU };
        let room = gpu.summary.max_storage_binding.min(gpu.summary.max_buffer) / 4;
        Self { entries: entries.min(usize::try_from(room).unwrap_or(usize::MAX)), rows }
    }
}

/// The maximum number of entries of a row. 32 lanes share a row, and software Vulkan leaves a loop after 65,535 iterations without an
/// error.
const LONGEST_ROW: usize = 1 << 20;

pub(super) struct DeviceLayer {
    pub(super) bounces: Bounces,
    pub(super) bands: Vec<Band>,
}

pub(super) struct Band {
    pub(super) rows: Range<u32>,
    pub(super) starts: wgpu::Buffer,
    pub(super) columns: wgpu::Buffer,
    pub(super) weights: Vec<wgpu::Buffer>,
}

impl DeviceLayer {
    pub(super) fn upload(gpu: &Gpu, bounces: Bounces, from: &CompressedRows, limits: Limits) -> Result<Self> {
        let CompressedRows { row_start, columns, weights } = from;
        let longest = row_start.windows(2).map(|ends| ends[1] - ends[0]).max().unwrap_or(0);
        if longest > LONGEST_ROW {
            return Err(Error::device(format!(
                "a row of the matrix has {longest} entries, and a GPU can sum at most {LONGEST_ROW}"
            ))
            .help("take the products on the processor: --products cpu"));
        }
        let band = |rows: Range<usize>| {
            let entries = row_start[rows.start]..row_start[rows.end];
            // The entries of a band fit into a buffer, and their number fits into 32 bits.
            let starts: Vec<u32> =
                row_start[rows.start..=rows.end].iter().map(|start| (start - entries.start) as u32).collect();
            let weights =
                weights.iter().map(|plane| gpu.storage("matrix's weights", &plane[entries.clone()]));
            Ok(Band {
                rows: rows.start as u32..rows.end as u32,
                starts: gpu.storage("matrix's rows", &starts)?,
                columns: gpu.storage("matrix's columns", &columns[entries.clone()])?,
                weights: weights.collect::<Result<_>>()?,
            })
        };
        let bands = cut(row_start, limits).into_iter().map(band).collect::<Result<_>>()?;
        Ok(Self { bounces, bands })
    }
}

/// Divides the rows into bands of whole rows. Each band has as many rows as the limits allow, and at least one.
fn cut(row_start: &[usize], limits: Limits) -> Vec<Range<usize>> {
    let rows = row_start.len() - 1;
    let mut bands = Vec::new();
    let mut first = 0;
    while first < rows {
        let next = &row_start[first + 1..=rows.min(first + limits.rows)];
        let fit = next.partition_point(|end| end - row_start[first] <= limits.entries);
        bands.push(first..first + fit.max(1));
        first += fit.max(1);
    }
    bands
}

/// The rows of a workgroup; `ROWS_OF_GROUP` of `shaders/product.wgsl`.
const ROWS_OF_GROUP: u32 = 2;

/// The flag for a band with entries; `HAS_ENTRIES` of `shaders/product.wgsl`.
const HAS_ENTRIES: u32 = 1;

const MOST_GROUPS: u32 = 65_535;

/// The uniform of a dispatch, with the layout of `Band` in `shaders/product.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Parameters {
    first_row: u32,
    rows: u32,
    terms: u32,
    padding: u32,
}

/// The terms that are added to the sum over a row's entries. They are flags of `shaders/product.wgsl`.
#[derive(Clone, Copy)]
pub(super) struct Terms {
    pub(super) diagonal: bool,
    /// Whether to add the sum that earlier bands have written to the photo.
    pub(super) adds: bool,
}

pub(super) struct Kernel {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    /// A placeholder for buffers that a dispatch does not read.
    nothing: wgpu::Buffer,
}

pub(super) struct Step {
    group: wgpu::BindGroup,
    workgroups: [u32; 2],
}

impl Kernel {
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        let source = shader::compose("product")?;
        let nothing = gpu.storage("nothing", &[0.0_f32])?;
        gpu.guarded("product", || {
            let layout = gpu.layout("product", &[UNIFORM, READ, READ, READ, READ, READ, WRITE]);
            let source = wgpu::ShaderSource::Wgsl(source.into());
            let [pipeline] = gpu.pipelines("product", source, &[&layout], ["product"]);
            Self { pipeline, layout, nothing }
        })
    }

    /// The dispatch that writes the sums of these rows to the photo. A sum adds the products of a band's entries in one channel, if `band`
    /// is given, and the terms that `terms` selects. The last argument consists of the diagonal, the pattern and the photo.
    pub(super) fn step(
        &self,
        gpu: &Gpu,
        rows: Range<u32>,
        band: Option<(&Band, usize)>,
        terms: Terms,
        [diagonal, from, to]: [&wgpu::Buffer; 3],
    ) -> Result<Step> {
        let (of_band, entries) = match band {
            Some((band, channel)) => ([&band.starts, &band.columns, &band.weights[channel]], HAS_ENTRIES),
            None => ([&self.nothing; 3], 0),
        };
        let terms = entries | bits(terms);
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let parameters = gpu.buffer("band", size_of::<Parameters>() as u64, uniform)?;
        let count = rows.end - rows.start;
        let values = Parameters { first_row: rows.start, rows: count, terms, padding: 0 };
        let [starts, columns, weights] = of_band;
        let buffers = [&parameters, starts, columns, weights, diagonal, from, to];
        let group = gpu.guarded("bindings", || {
            gpu.queue.write_buffer(&parameters, 0, bytemuck::bytes_of(&values));
            gpu.bind("product", &self.layout, buffers.map(wgpu::Buffer::as_entire_binding))
        })?;
        Ok(Step { group, workgroups: workgroups(count) })
    }

    pub(super) fn encode(&self, encoder: &mut wgpu::CommandEncoder, steps: &[Step]) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline);
        for Step { group, workgroups: [across, down] } in steps {
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(*across, *down, 1);
        }
    }
}

fn bits(terms: Terms) -> u32 {
    u32::from(terms.diagonal) << 1 | u32::from(terms.adds) << 2
}

/// The numbers of workgroups in two dimensions that cover `rows` rows. The second number is as small as possible.
fn workgroups(rows: u32) -> [u32; 2] {
    let groups = rows.div_ceil(ROWS_OF_GROUP);
    let down = groups.div_ceil(MOST_GROUPS).max(1);
    [groups.div_ceil(down), down]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_constant, assert_layout, offsets};

    #[test]
    fn bands_lie_as_the_shader_reads_them() {
        let members = offsets!(Parameters: first_row, rows, terms, padding);
        assert_layout("product", "Band", members, size_of::<Parameters>());
        assert_constant("product", "ROWS_OF_GROUP", ROWS_OF_GROUP);
        let (diagonal, adds) = (Terms { diagonal: true, adds: false }, Terms { diagonal: false, adds: true });
        assert_constant("product", "HAS_ENTRIES", HAS_ENTRIES);
        assert_constant("product", "HAS_DIAGONAL", bits(diagonal));
        assert_constant("product", "ADDS", bits(adds));
    }

    #[test]
    fn workgroups_are_enough_and_within_the_limits() {
        for rows in [0, 1, 2, 3, 131_070, 131_071, 1 << 20, 268_435_456] {
            let [across, down] = workgroups(rows);
            assert!(across <= MOST_GROUPS && down <= MOST_GROUPS, "{rows}");
            assert!(ROWS_OF_GROUP * across * down >= rows, "{rows}");
            assert!(
                across * down < rows.div_ceil(ROWS_OF_GROUP) + down.max(1),
                "{rows}: nearly none for nothing"
            );
        }
    }

    #[test]
    fn bands_have_as_many_whole_rows_as_fit() {
        let row_start = [0, 2, 2, 5, 14, 15, 16];
        let cut = |entries, rows| cut(&row_start, Limits { entries, rows });
        assert_eq!(cut(5, 9), [0..3, 3..4, 4..6]);
        assert_eq!(cut(1, 9), [0..1, 1..2, 2..3, 3..4, 4..5, 5..6]);
        assert_eq!(cut(100, 9), vec![0..6]);
        assert_eq!(cut(100, 4), [0..4, 4..6]);
        assert_eq!(cut(5, 2), [0..2, 2..3, 3..4, 4..6], "rows without entries count");
    }

    #[test]
    fn buffers_of_a_device_limit_the_entries_of_a_band() {
        let gpu = super::super::tests::gpu();
        let limits = |kind: &str, max_buffer, max_storage_binding| {
            let mut gpu = gpu.clone();
            (gpu.summary.kind, gpu.summary.max_buffer) = (kind.into(), max_buffer);
            gpu.summary.max_storage_binding = max_storage_binding;
            let Limits { entries, rows } = Limits::of(&gpu);
            [entries, rows]
        };
        let (many, card) = (u64::from(u32::MAX), "discrete GPU");
        // The limit is the buffer size; an entry takes four bytes in a buffer.
        assert_eq!(limits(card, 4004, many)[0], 1001);
        assert_eq!(limits(card, many, 4004)[0], 1001);
        assert_eq!(limits(card, many, many), [1 << 27, 1 << 24]);
        assert_eq!(
            limits(&gpu.summary.kind, many, many),
            [1 << 22, 1 << 15],
            "software Vulkan has smaller dispatches"
        );
    }

    #[test]
    fn a_row_has_as_many_entries_as_a_device_can_sum() {
        let gpu = super::super::tests::gpu();
        let upload = |entries: usize| {
            let columns = (0..entries as u32).collect();
            let rows =
                CompressedRows { row_start: vec![0, 1, entries], columns, weights: vec![vec![1.0; entries]] };
            DeviceLayer::upload(&gpu, Bounces::Global, &rows, ON_PROCESSOR).map(|layer| layer.bands.len())
        };
        assert_eq!(upload(LONGEST_ROW + 1).expect("the longest row fits"), 1);
        let error = upload(LONGEST_ROW + 2).expect_err("the row is too long").to_string();
        assert!(error.contains("1048577 entries") && error.contains("--products cpu"), "{error}");
    }
}
