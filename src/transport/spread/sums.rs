//! The sums over the rows of the matrix, from the contributions of all processes.

use std::ops::Range;

use rayon::prelude::*;

use super::command::{from_bytes, to_bytes, unread};
use crate::error::Result;
use crate::team::Comm;
use crate::transport::chunk::{ByEndpoint, Chunk, Row, Term, at};
use crate::transport::fixed::{FixedSums, RowSums, Scale, add_sums};
use crate::transport::steps::Steps;
use crate::transport::{RigShape, wire};

/// The sums over the rows that this process has. `found` are the own contributions by steps, and `largest` is their largest exponent. Every process of
/// the team must call it.
pub(super) fn row_sums<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    steps: &Steps,
    largest: u32,
    found: &[ByEndpoint<C>],
) -> Result<Vec<RowSums<C>>> {
    let all = comm.exchange(vec![to_bytes(&largest)?; comm.size()]);
    let all: Vec<u32> = all.iter().map(|bytes| from_bytes(bytes)).collect::<Result<_>>()?;
    let scale = Scale::new(all.into_iter().max().unwrap_or(0));
    let mut sums = vec![[[0; C]; 2]; rig.camera.pixels()];
    add_mirrored(rig, scale, found, &mut sums);
    add_own(scale, found, &mut sums);
    // Each process adds what the others found for its rows.
    let message = |rows: Range<usize>| {
        wire::message(|to| wire::put::<i128>(to, sums[rows].as_flattened().as_flattened()))
    };
    let received = comm.exchange(steps.rows().map(message).collect());
    let mine = steps.rows().nth(comm.rank()).unwrap_or_default();
    let mut of_rows = vec![[[0; C]; 2]; mine.len()];
    for bytes in received {
        let part = wire::Reader::new(&bytes).take::<i128>().map_err(unread)?;
        let part = part.as_chunks::<C>().0.as_chunks::<2>().0;
        of_rows.iter_mut().zip(part).for_each(|(sums, part)| add_sums(sums, part));
    }
    Ok(of_rows.iter().map(|sums| scale.sums(sums)).collect())
}

/// Adds the contributions of the paths from each pixel of the camera.
fn add_own<const C: usize>(scale: Scale, found: &[ByEndpoint<C>], sums: &mut [FixedSums<C>]) {
    let of_row = |(row, terms): (Row, &[Term<C>])| {
        let mut sums = [[0; C]; 2];
        terms.iter().for_each(|term| scale.add(&mut sums, term));
        (row.pixel as usize, sums)
    };
    let chunks = found.par_iter().flat_map(|[camera, _]| camera);
    let of_chunk = |chunk: &Chunk<C>| chunk.rows().map(of_row).collect::<Vec<_>>();
    for (pixel, of_row) in chunks.flat_map_iter(of_chunk).collect::<Vec<_>>() {
        add_sums(&mut sums[pixel], &of_row);
    }
}

/// Adds the contributions of the paths that end at each pixel of the camera.
fn add_mirrored<const C: usize>(
    rig: RigShape,
    scale: Scale,
    found: &[ByEndpoint<C>],
    sums: &mut [FixedSums<C>],
) {
    let pixels = sums.len();
    let stripe = pixels.div_ceil(rayon::current_num_threads()).max(1);
    sums.par_chunks_mut(stripe).enumerate().for_each(|(number, sums)| {
        let stripe = number * stripe..number * stripe + sums.len();
        for [camera, projector] in found {
            let chunks = if rig.symmetric { camera } else { projector };
            for (_, terms) in chunks.iter().flat_map(Chunk::rows) {
                let terms = if sums.len() == pixels { terms } else { at(terms, &stripe) };
                for term in terms {
                    scale.add(&mut sums[term.key.other() as usize - stripe.start], term);
                }
            }
        }
    });
}
