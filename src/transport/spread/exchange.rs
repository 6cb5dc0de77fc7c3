//! The exchange of contributions between processes, and their merge into the rows of the matrix.
//!
//! Each process has the contributions of the paths that it traced, and needs all contributions to its own rows. Processes exchange and
//! merge contributions [step by step](Steps), from the first rows of every process to the last. Each contribution is needed in one step,
//! and is freed after that step. In a coaxial rig, an entry whose mirror image was merged in an earlier step is copied from the finished
//! rows of the process that merged it. A single process is a team of one, which merges all rows in one step.

use std::ops::Range;

use crate::error::Result;
use crate::render::StartPixels;
use crate::team::{Comm, from_bytes, to_bytes};
use crate::transport::RigShape;
use crate::transport::contributions::{Chunk, Found};
use crate::transport::merging::{Merging, Pairs};
use crate::transport::noise::{EntrySquares, Estimates};
use crate::transport::row_sums::{Scale, add_sums, row_sums, with_direct};
use crate::transport::tiles::{self, Before, Builder, Pieces, Tiles};
use crate::transport::transpose::Sources;
use crate::transport::wire::{self, unread};

/// The steps in which the rows of a matrix are merged. In each step, all processes merge a group of their rows at the same time.
///
/// In a coaxial rig, a contribution counts for two rows: those of the pixels at both ends of its path. In any other rig, it counts only for
/// the row of its camera pixel. If its two rows are merged in different steps, a contribution is needed only in the earlier step. In the
/// later step, its entry is copied from the finished rows, which contain the mirror image.
#[derive(Debug)]
pub(in crate::transport) struct Steps {
    symmetric: bool,
    /// For each process by rank, the groups of its rows. There is one group for each step, and the last groups may be empty.
    groups: Vec<Vec<Range<usize>>>,
    of_pixel: Vec<u8>,
}

impl Steps {
    /// The steps of processes with these groups of rows. The groups must cover all camera rows. Each process may have at most 255 groups.
    pub(in crate::transport) fn new(rig: RigShape, mut groups: Vec<Vec<Range<usize>>>) -> Self {
        let pixels = rig.camera.pixels();
        let count = groups.iter().map(Vec::len).max().unwrap_or(0).max(1);
        let mut of_pixel = vec![0; pixels];
        for groups in &mut groups {
            for (step, group) in groups.iter().enumerate() {
                of_pixel[group.clone()].fill(step as u8);
            }
            let end = groups.last().map_or(0, |last| last.end);
            groups.resize(count, end..end);
        }
        Self { symmetric: rig.symmetric, groups, of_pixel }
    }

    /// A single process merges all rows in one step.
    pub(in crate::transport) fn one(rig: RigShape) -> Self {
        Self::new(rig, vec![vec![0..rig.camera.pixels()]])
    }

    pub(in crate::transport) fn count(&self) -> usize {
        self.groups.first().map_or(1, Vec::len)
    }

    fn groups(&self, step: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        self.groups.iter().map(move |groups| groups[step].clone())
    }

    pub(super) fn rows(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.groups.iter().map(|groups| groups[0].start..groups[groups.len() - 1].end)
    }

    pub(in crate::transport) fn of_pixel(&self, pixel: usize) -> usize {
        usize::from(self.of_pixel[pixel])
    }

    /// The step that needs a contribution of a path from `pixel` to the pixel `other`.
    pub(in crate::transport) fn of(&self, pixel: u32, from_camera: bool, other: u32) -> usize {
        let of_pixel = |pixel: u32| self.of_pixel(pixel as usize);
        match (self.symmetric, from_camera) {
            (true, _) => of_pixel(pixel).min(of_pixel(other)),
            (false, true) => of_pixel(pixel),
            (false, false) => of_pixel(other),
        }
    }
}

/// The steps in which the processes merge the rows of their pixels. Every process of the team must call this function.
pub(in crate::transport) fn steps(comm: &dyn Comm, rig: RigShape, pixels: &[StartPixels]) -> Result<Steps> {
    if comm.size() == 1 {
        return Ok(Steps::one(rig));
    }
    let mine = &pixels[comm.rank()].camera;
    // The groups of a process depend on its number of threads, so the processes tell each other their groups.
    let ends: Vec<usize> = tiles::groups(mine.len()).iter().map(|group| mine.start + group.end).collect();
    let message = to_bytes(&ends)?;
    let all = comm.exchange(vec![message; comm.size()]);
    let groups = all.iter().zip(pixels).map(|(bytes, pixels)| {
        let ends: Vec<usize> = from_bytes(bytes)?;
        let starts = std::iter::once(pixels.camera.start).chain(ends.clone());
        Ok(starts.zip(ends).map(|(start, end)| start..end).collect())
    });
    Ok(Steps::new(rig, groups.collect::<Result<_>>()?))
}

/// The layers of the matrix that one process holds, with the sums from which the noise is computed.
#[derive(Debug, PartialEq)]
pub(in crate::transport) struct Combined<const C: usize> {
    /// One layer for each class of bounces. The first layer has one bounce.
    pub(in crate::transport) layers: Vec<Tiles>,
    pub(in crate::transport) rows: Vec<Estimates<C>>,
    /// The squares of the entries that this process merged.
    pub(in crate::transport) squares: EntrySquares,
}

/// Merges the contributions of all processes to this process's rows, in `classes` layers. `found` has the contributions that this process
/// traced, ordered by step. Within a step, camera pixels come before projector pixels, and start pixels ascend. `direct` is the diagonal of
/// this process's rows, with mean and error for each channel, or empty. Every process of the team must call this function.
///
/// A single process merges all rows of a coaxial rig in one step, but only the entries on and above the diagonal. The entries below it are
/// copied. In a team, each process merges one group of its rows in each step.
pub(in crate::transport) fn merge<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    steps: &Steps,
    found: Found<C>,
    classes: usize,
    direct: &[Estimates<C>],
) -> Result<Combined<C>> {
    let mine = steps.rows().nth(comm.rank()).unwrap_or_default();
    let is_alone = comm.size() == 1;
    let triangle = is_alone && rig.symmetric;
    let rows = sums_of_rows(comm, rig, steps, &found, direct)?;
    let Found { steps: found, about } = found;
    let builder = |&entries: &usize| {
        // In a coaxial rig, about as many entries come from the paths of other pixels that end at these pixels.
        let entries = if rig.symmetric { 2 * entries } else { entries };
        Builder::new([mine.len(), rig.projector.pixels()], C, entries, triangle)
    };
    let mut layers: Vec<Builder> = about.of_class[..classes].iter().map(builder).collect();
    let mut squares = EntrySquares::default();
    for (step, own) in found.into_iter().enumerate() {
        let wanted: Vec<Range<usize>> = steps.groups(step).collect();
        let now = wanted[comm.rank()].clone();
        let chunks = exchange(comm, rig, &wanted, own)?;
        let direct = direct.get(now.start - mine.start..now.end - mine.start).unwrap_or_default();
        let pairs = if rig.symmetric { Pairs::Step(steps, step) } else { Pairs::Apart };
        let mut merging = Merging::new(Sources::new(chunks, rig, &now, triangle), pairs, now.start, direct);
        let groups =
            if is_alone { tiles::groups(now.len()) } else { std::iter::once(0..now.len()).collect() };
        for group in groups {
            let pieces = merging.pieces(&group, classes);
            let is_last = group.end == now.len();
            let done = if triangle { group.end } else { 0 };
            merging.sources.release_before(if is_last { usize::MAX } else { done });
            let mut mirrored = mirrored(comm, rig, steps, step, &layers)?.into_iter();
            for (layer, pieces) in layers.iter_mut().zip(pieces) {
                let pieces = Pieces::new(now.start - mine.start + group.start, pieces);
                match mirrored.next() {
                    Some(before) => layer.push_joined(pieces, before),
                    None => layer.push(pieces),
                }
            }
        }
        squares.add_all(&merging.squares);
    }
    Ok(Combined { layers: layers.into_iter().map(Builder::finish).collect(), rows, squares })
}

/// Sends to each process the contributions to its rows in `wanted`. Returns all contributions to this process's rows, by ascending rank of
/// the sender. `own` are the contributions of this step that this process traced.
fn exchange<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    wanted: &[Range<usize>],
    own: Vec<Chunk<C>>,
) -> Result<Vec<Chunk<C>>> {
    // This process already has the contributions of its camera pixels to their own rows. In a coaxial rig, they also count for the rows of
    // the pixels at the other end of each path.
    let chunks: Vec<&Chunk<C>> = own.iter().collect();
    let message = |(rank, rows): (usize, &Range<usize>)| {
        if rank == comm.rank() { Vec::new() } else { wire::chunks_to_bytes(&chunks, rig.symmetric, rows) }
    };
    let received = comm.exchange(wanted.iter().enumerate().map(message).collect());
    let (mut all, mut own) = (Vec::new(), own);
    for (rank, bytes) in received.into_iter().enumerate() {
        if rank == comm.rank() {
            all.append(&mut own);
        } else {
            all.push(wire::take_chunk(&mut wire::Reader::new(&bytes), rig.symmetric).map_err(unread)?);
        }
    }
    Ok(all)
}

/// The sums over this process's rows. `found` has the contributions that this process traced, and `direct` is the diagonal of its rows.
fn sums_of_rows<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    steps: &Steps,
    found: &Found<C>,
    direct: &[Estimates<C>],
) -> Result<Vec<Estimates<C>>> {
    let all = comm.exchange(vec![to_bytes(&found.about.largest)?; comm.size()]);
    let all: Vec<u32> = all.iter().map(|bytes| from_bytes(bytes)).collect::<Result<_>>()?;
    let scale = Scale::new(all.into_iter().max().unwrap_or(0));
    let chunks: Vec<&Chunk<C>> = found.chunks().collect();
    let mut sums = row_sums(&chunks, rig, scale);
    // Each process adds the other processes' sums to its own sums, for its own rows.
    let message = |(rank, rows): (usize, Range<usize>)| {
        let others = if rank == comm.rank() { &[] } else { &sums[rows] };
        wire::message(|to| wire::put::<i128>(to, others.as_flattened().as_flattened()))
    };
    let received = comm.exchange(steps.rows().enumerate().map(message).collect());
    let mine = steps.rows().nth(comm.rank()).unwrap_or_default();
    for bytes in received {
        let part = wire::Reader::new(&bytes).take::<i128>().map_err(unread)?;
        let part = part.as_chunks::<C>().0.as_chunks::<2>().0;
        sums[mine.clone()].iter_mut().zip(part).for_each(|(sums, part)| add_sums(sums, part));
    }
    Ok(with_direct(scale, &sums[mine], direct))
}

/// For each layer, the entries in this step's rows of this process whose mirror images were merged in earlier steps. Each part comes from
/// one process, together with the end of that process's range of columns. The list is empty in the first step.
fn mirrored(
    comm: &dyn Comm,
    rig: RigShape,
    steps: &Steps,
    step: usize,
    layers: &[Builder],
) -> Result<Vec<Vec<Before>>> {
    if !rig.symmetric || step == 0 {
        return Ok(Vec::new());
    }
    let first = steps.rows().nth(comm.rank()).unwrap_or_default().start;
    let mut messages = Vec::with_capacity(comm.size());
    for wanted in steps.groups(step) {
        let write = |to: &mut Vec<u8>| {
            layers.iter().try_for_each(|layer| wire::put_fragments(to, &layer.transposed(&wanted, first)))
        };
        messages.push(wire::message(write));
    }
    let mut of_layers: Vec<Vec<Before>> = layers.iter().map(|_| Vec::new()).collect();
    for (bytes, rows) in comm.exchange(messages).into_iter().zip(steps.rows()) {
        let mut from = wire::Reader::new(&bytes);
        for (before, layer) in of_layers.iter_mut().zip(layers) {
            let fragments = wire::take_fragments(&mut from, layer.channels(), first).map_err(unread)?;
            before.push(Before { fragments, columns_before: rows.end });
        }
    }
    Ok(of_layers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;

    #[test]
    fn a_contribution_is_needed_in_the_first_step_of_its_rows() {
        let size = Resolution::new(8, 1);
        // The second process has fewer rows, and the third has none.
        let groups = vec![vec![0..2, 2..4, 4..5], vec![5..7, 7..8], Vec::new()];
        let steps = |symmetric: bool| {
            let rig = RigShape { camera: size, projector: size, symmetric };
            Steps::new(rig, groups.clone())
        };
        let coaxial = steps(true);
        assert_eq!(coaxial.count(), 3);
        assert_eq!(coaxial.groups(1).collect::<Vec<_>>(), [2..4, 7..8, 0..0]);
        assert_eq!(coaxial.rows().collect::<Vec<_>>(), [0..5, 5..8, 0..0]);
        assert_eq!((0..8).map(|pixel| coaxial.of_pixel(pixel)).collect::<Vec<_>>(), [0, 0, 1, 1, 2, 0, 0, 1]);
        assert_eq!([(4, 7), (7, 4), (3, 6)].map(|(pixel, other)| coaxial.of(pixel, true, other)), [1, 1, 0]);
        let apart = steps(false);
        assert_eq!([(4, true, 0), (0, true, 4), (0, false, 4)].map(|(p, c, o)| apart.of(p, c, o)), [2, 0, 2]);
    }
}
