//! The exchange of contributions between processes, and their merge into the rows of the matrix.
//!
//! Each process has the contributions of the paths that it traced, and needs those to its own rows. They are exchanged and merged [step by
//! step](Steps): first those to the first rows of every process, in the end those to the last ones. Each contribution is needed in one step, and given
//! back after it. In a coaxial rig, the entries whose mirror images were merged in earlier steps come from the finished rows of all processes.

use std::ops::Range;

use super::command::{from_bytes, to_bytes, unread};
use super::sums::row_sums;
use crate::error::Result;
use crate::render::StartPixels;
use crate::team::Comm;
use crate::transport::chunk::{ByEndpoint, Chunk};
use crate::transport::combine::{Combined, builders};
use crate::transport::found::Found;
use crate::transport::merging::{Merging, Pairs};
use crate::transport::squares::EntrySquares;
use crate::transport::steps::Steps;
use crate::transport::tiles::{self, Before, Builder, Pieces};
use crate::transport::transpose::Sources;
use crate::transport::{RigShape, wire};

/// The steps in which the processes merge the rows of their pixels. Every process of the team must call it.
pub(super) fn steps(comm: &dyn Comm, rig: RigShape, pixels: &[StartPixels]) -> Result<Steps> {
    let mine = &pixels[comm.rank()].camera;
    // They depend on the number of threads of a process.
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

/// Merges the contributions of all processes to the own rows. `found` are the own contributions by their steps, and `direct` is as for
/// [`combine`](crate::transport::combine::combine). The squares are those of the entries that this process merged. Every process of the team must
/// call it.
pub(super) fn merge<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    steps: &Steps,
    found: Found<C>,
    classes: usize,
    direct: &[[[f64; 2]; C]],
) -> Result<Combined<C>> {
    let Found { steps: found, about } = found;
    let found: Vec<ByEndpoint<C>> = found.into_iter().map(Chunk::by_endpoint).collect();
    let mine = steps.rows().nth(comm.rank()).unwrap_or_default();
    let mut sums = row_sums(comm, rig, steps, about.largest, &found)?;
    sums.iter_mut().zip(direct).for_each(|(sums, direct)| sums.add_direct(direct));
    // In a coaxial rig, about as many paths of other pixels end at these.
    let of_class = about.of_class.map(|count| if rig.symmetric { 2 * count } else { count });
    let mut layers = builders::<C>(of_class, rig, mine.len(), classes, false);
    let mut squares = EntrySquares::default();
    for (step, own) in found.into_iter().enumerate() {
        let wanted: Vec<Range<usize>> = steps.groups(step).collect();
        let now = wanted[comm.rank()].clone();
        let chunks = exchange(comm, rig, &wanted, own)?;
        let direct = direct.get(now.start - mine.start..now.end - mine.start).unwrap_or_default();
        let pairs = if rig.symmetric { Pairs::Step(steps, step) } else { Pairs::Apart };
        let sources = Sources::new(chunks, rig, &now, false);
        let counts = sources.counts(now.start);
        let mut merging = Merging::new(sources, pairs, now.start, counts, direct);
        let pieces = merging.pieces(&(0..now.len()), classes);
        squares.add_all(&merging.squares);
        drop(merging);
        let mirrored = mirrored(comm, rig, steps, step, &layers)?;
        for ((layer, pieces), before) in layers.iter_mut().zip(pieces).zip(mirrored) {
            layer.push_joined(Pieces::new(now.start - mine.start, pieces), before);
        }
    }
    Ok(Combined { layers: layers.into_iter().map(Builder::finish).collect(), rows: sums, squares })
}

/// Sends the contributions to the wanted rows of each process, and returns all contributions to the own ones: those of the camera's paths first, by
/// ascending rank. `own` are the own ones of this step.
fn exchange<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    wanted: &[Range<usize>],
    own: ByEndpoint<C>,
) -> Result<Vec<Chunk<C>>> {
    let [camera, projector] = &own;
    let message = |(rank, rows): (usize, &Range<usize>)| {
        // The rows of the camera's pixels are here; in a coaxial rig their paths count for the pixels at their ends as well.
        let mirrored = if rig.symmetric { camera } else { projector };
        if rank == comm.rank() { Vec::new() } else { wire::terms_to_bytes(mirrored, rows) }
    };
    let received = comm.exchange(wanted.iter().enumerate().map(message).collect());
    let [camera, projector] = own;
    let (mut all, mut mirrored) = if rig.symmetric { (Vec::new(), camera) } else { (camera, projector) };
    for (rank, bytes) in received.into_iter().enumerate() {
        if rank == comm.rank() {
            all.append(&mut mirrored);
        } else {
            let mut from = wire::Reader::new(&bytes);
            all.push(wire::take_terms(&mut from, rig.symmetric).map_err(unread)?);
        }
    }
    Ok(all)
}

/// The entries of each layer in the own rows of a step whose mirror images were merged in earlier steps, before the columns of which process they come.
fn mirrored(
    comm: &dyn Comm,
    rig: RigShape,
    steps: &Steps,
    step: usize,
    layers: &[Builder],
) -> Result<Vec<Vec<Before>>> {
    if !rig.symmetric || step == 0 {
        let all = || vec![Before { fragments: Vec::new(), columns_before: rig.projector.pixels() }];
        return Ok(layers.iter().map(|_| all()).collect());
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
