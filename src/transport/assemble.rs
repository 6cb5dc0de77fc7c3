//! From connections to the matrix: bucket by row, merge duplicates, mirror.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{Channels, TransportMatrix, from_planes, luminance};
use crate::error::Result;
use crate::image::Image;
use crate::render::{Batch, Progress, TraceSettings, TraceSummary, Tracer};

/// A traced scene.
#[derive(Debug)]
pub struct Assembled {
    /// The light transport matrix.
    pub matrix: TransportMatrix,
    /// The photo without projector, in W/(m² sr): the scene's own light.
    pub ambient: Image,
    /// What the tracing took.
    pub summary: TraceSummary,
}

/// Traces the scene and assembles its light transport matrix. Equal settings on equal devices give equal bits.
///
/// # Errors
/// As [`Tracer::trace`].
pub fn assemble(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Assembled> {
    match channels {
        Channels::Luma => run(tracer, settings, channels, progress, |rgb| [luminance(rgb)]),
        Channels::Rgb => run(tracer, settings, channels, progress, |rgb| rgb),
    }
}

/// One contribution to the upper triangle, `row ≤ column`.
#[derive(Clone, Copy)]
struct Entry<const C: usize> {
    row: u32,
    column: u32,
    value: [f32; C],
}

fn run<const C: usize>(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    project: impl Fn([f32; 3]) -> [f32; C] + Sync,
) -> Result<Assembled> {
    let pixels = settings.resolution.pixels();
    let mut entries: Vec<Entry<C>> = Vec::new();
    let mut direct = PixelSums::<C>::new(pixels);
    let mut ambient = PixelSums::<C>::new(pixels);
    let summary = tracer.trace(settings, progress, &mut |batch| {
        collect_entries(batch, &project, &mut entries);
        direct.add(batch, |index| Some(project(batch.direct(index))));
        ambient.add(batch, |index| batch.ambient(index).map(&project));
        Ok(())
    })?;

    let samples = f64::from(settings.samples);
    let upper = UpperRows::merge(entries, pixels, samples);
    let (row_start, columns, weights) = upper.mirror(pixels);
    let matrix = TransportMatrix {
        resolution: settings.resolution,
        channels,
        row_start,
        columns,
        weights,
        direct: direct
            .means(samples)
            .iter()
            .map(|plane| plane.iter().map(|&mean| mean as f32).collect())
            .collect(),
    };
    let ambient = from_planes(settings.resolution, &ambient.means(samples))?;
    Ok(Assembled { matrix, ambient, summary })
}

/// Appends the batch's connections in path order.
fn collect_entries<const C: usize>(
    batch: &Batch<'_>,
    project: &(impl Fn([f32; 3]) -> [f32; C] + Sync),
    entries: &mut Vec<Entry<C>>,
) {
    const PATHS_PER_TASK: usize = 4096;
    let found: Vec<Vec<Entry<C>>> = (0..batch.len().div_ceil(PATHS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            let paths = task * PATHS_PER_TASK..((task + 1) * PATHS_PER_TASK).min(batch.len());
            let of_path = |index| {
                let camera = batch.pixel(index);
                batch.connections(index).map(move |connection| {
                    let (row, column) = (camera.min(connection.projector), camera.max(connection.projector));
                    Entry { row, column, value: project(connection.value) }
                })
            };
            paths.flat_map(of_path).filter(|entry| entry.value.iter().any(|&v| v != 0.0)).collect()
        })
        .collect();
    for found in &found {
        entries.extend_from_slice(found);
    }
}

/// Sums per pixel, always in path order: the same bits however the paths were batched.
struct PixelSums<const C: usize>(Vec<[f64; C]>);

impl<const C: usize> PixelSums<C> {
    fn new(pixels: usize) -> Self {
        Self(vec![[0.0; C]; pixels])
    }

    fn add(&mut self, batch: &Batch<'_>, sample: impl Fn(usize) -> Option<[f32; C]>) {
        for index in 0..batch.len() {
            let Some(value) = sample(index) else { return };
            let sum = &mut self.0[batch.pixel(index) as usize];
            for channel in 0..C {
                sum[channel] += f64::from(value[channel]);
            }
        }
    }

    /// `[channel][pixel]`
    fn means(&self, samples: f64) -> Vec<Vec<f64>> {
        (0..C).map(|channel| self.0.iter().map(|sum| sum[channel] / samples).collect()).collect()
    }
}

/// The upper triangle, rows one after the other, columns ascending and distinct within each.
struct UpperRows<const C: usize> {
    /// Merged entries of each row.
    rows: Vec<Vec<(u32, [f32; C])>>,
}

impl<const C: usize> UpperRows<C> {
    /// Sorts contributions into rows (stably: they stay in path order) and adds up those that meet, in f64.
    fn merge(entries: Vec<Entry<C>>, pixels: usize, samples: f64) -> Self {
        let mut start = vec![0_usize; pixels + 1];
        for entry in &entries {
            start[entry.row as usize + 1] += 1;
        }
        for row in 0..pixels {
            start[row + 1] += start[row];
        }
        let mut sorted = vec![(0_u32, [0.0_f32; C]); entries.len()];
        let mut next = start.clone();
        for entry in &entries {
            let position = &mut next[entry.row as usize];
            sorted[*position] = (entry.column, entry.value);
            *position += 1;
        }
        drop(entries);

        let mut slices = Vec::with_capacity(pixels);
        let mut rest = sorted.as_mut_slice();
        for row in 0..pixels {
            let (slice, tail) = rest.split_at_mut(start[row + 1] - start[row]);
            slices.push(slice);
            rest = tail;
        }
        let rows = slices
            .into_par_iter()
            .enumerate()
            .map(|(row, slice)| merge_row(row as u32, slice, samples))
            .collect();
        Self { rows }
    }

    /// The whole symmetric matrix in compressed sparse rows.
    fn mirror(self, pixels: usize) -> (Vec<usize>, Vec<u32>, Vec<Vec<f32>>) {
        // Row r holds first the mirror images from rows above, then its own entries.
        let mut mirrored = vec![0_usize; pixels];
        for (row, entries) in self.rows.iter().enumerate() {
            for &(column, _) in entries.iter().filter(|&&(column, _)| column as usize != row) {
                mirrored[column as usize] += 1;
            }
        }
        let mut row_start = vec![0_usize; pixels + 1];
        for row in 0..pixels {
            row_start[row + 1] = row_start[row] + mirrored[row] + self.rows[row].len();
        }
        let mut columns = vec![0_u32; row_start[pixels]];
        let mut weights = vec![vec![0.0_f32; row_start[pixels]]; C];
        let mut next = row_start.clone();
        let mut put = |row: usize, column: u32, value: [f32; C]| {
            let position = next[row];
            next[row] += 1;
            columns[position] = column;
            for channel in 0..C {
                weights[channel][position] = value[channel];
            }
        };
        // By ascending row, each row's mirror images have all arrived before its own entries follow.
        for (row, entries) in self.rows.into_iter().enumerate() {
            for (column, value) in entries {
                put(row, column, value);
                if column as usize != row {
                    put(column as usize, row as u32, value);
                }
            }
        }
        (row_start, columns, weights)
    }
}

fn merge_row<const C: usize>(
    row: u32,
    entries: &mut [(u32, [f32; C])],
    samples: f64,
) -> Vec<(u32, [f32; C])> {
    entries.sort_by_key(|&(column, _)| column);
    entries
        .chunk_by(|a, b| a.0 == b.0)
        .map(|run| {
            let column = run[0].0;
            // A path from a pixel to itself and its mirror image land on the same spot.
            let scale = if column == row { 2.0 } else { 1.0 } / samples;
            let mut sum = [0.0_f64; C];
            for (_, value) in run {
                for channel in 0..C {
                    sum[channel] += f64::from(value[channel]);
                }
            }
            (column, sum.map(|s| (s * scale) as f32))
        })
        .collect()
}
