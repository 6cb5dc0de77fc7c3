//! The exchange of contributions between processes, and their merge into the rows of the matrix.
//!
//! Each process has the contributions of the paths that it traced, and needs those to its own rows. They are exchanged and merged portion by portion: first
//! those to the first rows of every process, in the end those to the last ones. What no later portion needs is given back, so that a process never holds all
//! contributions to its rows, nor its own contributions beside the finished matrix.

use std::ops::Range;

use rayon::prelude::*;

use super::command::{from_bytes, to_bytes, unread};
use crate::error::Result;
use crate::render::StartPixels;
use crate::team::Comm;
use crate::transport::chunk::{CLASSES, Chunk, Row, Term, at, places};
use crate::transport::combine::Combined;
use crate::transport::portions::Portions;
use crate::transport::{RigShape, wire};

/// The number of portions. With more of them a process holds less at a time, and goes through its contributions more often.
pub(in crate::transport) const PORTIONS: usize = 8;

/// Merges the contributions of all processes to the own rows. `chunks` are the own contributions, and `direct` is as for
/// [`combine`](crate::transport::combine::combine). Every process of the team must call it.
pub(super) fn merge<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    pixels: &[StartPixels],
    chunks: Vec<Chunk<C>>,
    classes: usize,
    direct: &[[[f64; 2]; C]],
) -> Result<Combined<C>> {
    let rows: Vec<Range<usize>> = pixels.iter().map(|pixels| pixels.camera.clone()).collect();
    let mine = rows[comm.rank()].clone();
    let mut own = Chunk::by_endpoint(chunks);
    let of_class = count(comm, rig, &rows, &own)?;
    let mut merged = Portions::new(rig, mine.len(), classes, of_class);
    for portion in 0..PORTIONS {
        let wanted: Vec<Range<usize>> = rows.iter().map(|rows| part(rows, portion)).collect();
        let (chunks, places) = exchange(comm, rig, &wanted, own)?;
        let now = &wanted[comm.rank()];
        let direct = direct.get(now.start - mine.start..now.end - mine.start).unwrap_or_default();
        own = taken_back(merged.add(chunks, now, direct), places);
        let done: Vec<Range<usize>> =
            rows.iter().zip(&wanted).map(|(rows, wanted)| rows.start..wanted.end).collect();
        let needed = |row: &Row, terms: &[Term<C>]| needed(rig, &done, now.end, row, terms);
        own.iter_mut().flatten().par_bridge().for_each(|chunk| chunk.retain(needed));
    }
    Ok(merged.finish())
}

/// A portion of these rows.
fn part(rows: &Range<usize>, portion: usize) -> Range<usize> {
    let end = |portions: usize| rows.start + rows.len() * portions / PORTIONS;
    end(portion)..end(portion + 1)
}

/// The places of the own contributions of `row` that are needed after some portions: `done` are the rows of each process that are merged already, in
/// ascending order, and the own ones end before the pixel `next`.
fn needed<const C: usize>(
    rig: RigShape,
    done: &[Range<usize>],
    next: usize,
    row: &Row,
    terms: &[Term<C>],
) -> Vec<Range<usize>> {
    // A contribution counts for the row of the pixel that its path starts from, and for that of the pixel at the other end.
    if (rig.symmetric || row.from_camera) && row.pixel as usize >= next {
        let all = 0..terms.len();
        return vec![all];
    }
    if !rig.symmetric && row.from_camera {
        return Vec::new();
    }
    let mut wanted = Vec::with_capacity(done.len() + 1);
    let mut start = 0;
    for merged in done.iter().map(|done| places(terms, done)) {
        wanted.push(start..merged.start);
        start = merged.end;
    }
    wanted.push(start..terms.len());
    wanted
}

/// The number of contributions of each class to the own rows, from all processes.
fn count<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    rows: &[Range<usize>],
    own: &[Vec<Chunk<C>>; 2],
) -> Result<[usize; CLASSES]> {
    let message = |(rank, rows): (usize, &Range<usize>)| {
        let mut of_class = [0_usize; CLASSES];
        for (row, terms) in own.iter().flatten().flat_map(Chunk::rows) {
            let mut add = |terms: &[Term<C>]| terms.iter().for_each(|term| of_class[term.key.class()] += 1);
            if rank == comm.rank() && (rig.symmetric || row.from_camera) {
                add(terms);
            }
            if rig.symmetric || !row.from_camera {
                add(at(terms, rows));
            }
        }
        to_bytes(&of_class)
    };
    let messages: Vec<Vec<u8>> = rows.iter().enumerate().map(message).collect::<Result<_>>()?;
    let mut all = [0; CLASSES];
    for bytes in comm.exchange(messages) {
        let of_class: [usize; CLASSES] = from_bytes(&bytes)?;
        all.iter_mut().zip(of_class).for_each(|(all, count)| *all += count);
    }
    Ok(all)
}

/// Sends the contributions to the wanted rows of each process, and returns all contributions to the own ones: those of the camera's paths first, by
/// ascending rank. `own` are the chunks of the camera's paths and of the projector's; where they are in the result is returned with it.
fn exchange<const C: usize>(
    comm: &dyn Comm,
    rig: RigShape,
    wanted: &[Range<usize>],
    mut own: [Vec<Chunk<C>>; 2],
) -> Result<(Vec<Chunk<C>>, [Range<usize>; 2])> {
    let [camera, projector] = &own;
    let message = |(rank, rows): (usize, &Range<usize>)| {
        wire::message(|to| {
            if rank == comm.rank() {
                return Ok(());
            }
            // The rows of the camera's pixels are here; in a coaxial rig their paths count for the pixels at their ends as well.
            let camera: &[Chunk<C>] = if rig.symmetric { camera } else { &[] };
            wire::put_chunks(to, camera, true, rows)?;
            wire::put_chunks(to, projector, false, rows)
        })
    };
    let received = comm.exchange(wanted.iter().enumerate().map(message).collect());
    let mut chunks = [Vec::new(), Vec::new()];
    let mut places = [0..0, 0..0];
    for (rank, bytes) in received.into_iter().enumerate() {
        if rank == comm.rank() {
            for ((chunks, own), place) in chunks.iter_mut().zip(&mut own).zip(&mut places) {
                *place = chunks.len()..chunks.len() + own.len();
                chunks.append(own);
            }
        } else {
            let mut from = wire::Reader::new(&bytes);
            chunks[0].push(wire::take_chunk(&mut from, true).map_err(unread)?);
            chunks[1].push(wire::take_chunk(&mut from, false).map_err(unread)?);
        }
    }
    let [mut all, projector] = chunks;
    places[1] = all.len() + places[1].start..all.len() + places[1].end;
    all.extend(projector);
    Ok((all, places))
}

/// The own chunks among all of [`exchange`].
fn taken_back<const C: usize>(mut chunks: Vec<Chunk<C>>, places: [Range<usize>; 2]) -> [Vec<Chunk<C>>; 2] {
    places.map(|place| chunks[place].iter_mut().map(|chunk| std::mem::replace(chunk, Chunk::new())).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Resolution;
    use crate::transport::chunk::Key;

    #[test]
    fn contributions_are_kept_as_long_as_a_row_needs_them() {
        let size = Resolution::new(8, 1);
        let rows = [0..4, 4..8];
        for symmetric in [true, false] {
            let rig = RigShape { camera: size, projector: size, symmetric };
            for from_camera in [true, false] {
                let kept = |pixel: u32, other: u32, portion: usize| {
                    let done: Vec<Range<usize>> =
                        rows.iter().map(|rows| rows.start..part(rows, portion).end).collect();
                    let row = Row { pixel, from_camera, end: 1 };
                    let terms = [Term::<1>::none(Key::new(other, 1))];
                    needed(rig, &done, done[0].end, &row, &terms)
                        .into_iter()
                        .map(|places| places.len())
                        .sum::<usize>()
                        == 1
                };
                for (pixel, other) in [(0, 1), (0, 7), (1, 4), (3, 0)] {
                    // The first portion after which a row is merged.
                    let merged = |pixel: u32| {
                        let rows = &rows[usize::from(pixel >= 4)];
                        (0..PORTIONS).find(|&at| part(rows, at).end > pixel as usize).unwrap_or(PORTIONS)
                    };
                    let starts = if symmetric || from_camera { merged(pixel) } else { 0 };
                    let ends = if symmetric || !from_camera { merged(other) } else { 0 };
                    for portion in 0..PORTIONS {
                        assert_eq!(
                            kept(pixel, other, portion),
                            portion < starts.max(ends),
                            "{pixel} {other}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn a_chunk_keeps_what_is_wanted_of_each_row() {
        let term = |other: u32| Term::<1>::none(Key::new(other, 1));
        let row = |pixel: u32, end: usize| Row { pixel, from_camera: true, end };
        let mut chunk =
            Chunk { rows: vec![row(0, 3), row(1, 3), row(2, 5)], terms: [0, 1, 2, 1, 3].map(term).into() };
        let second = 1..2;
        chunk.retain(|row, terms| match row.pixel {
            0 => vec![second.clone()],
            2 => vec![0..1, 1..terms.len()],
            _ => Vec::new(),
        });
        let left: Vec<(u32, Vec<u32>)> = chunk
            .rows()
            .map(|(row, terms)| (row.pixel, terms.iter().map(|term| term.key.other()).collect()))
            .collect();
        assert_eq!(left, [(0, vec![1]), (1, vec![]), (2, vec![1, 3])]);
    }
}
