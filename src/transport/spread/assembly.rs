//! The assembly of a matrix by all processes of a team: each traces its pixels, and merges the contributions of all others to its rows.

use std::ops::Range;

use super::Spread;
use super::balance::balanced;
use super::command::{Command, answer, from_bytes, garbled, read_answer, to_bytes, unread};
use super::exchange;
use crate::error::Result;
use crate::render::{StartPixels, TraceSettings, TraceSummary, Tracer};
use crate::team::{Comm, Turn};
use crate::transport::assemble::{classes, finish, of_classes, planes, shape};
use crate::transport::combine::Combined;
use crate::transport::fixed::RowSums;
use crate::transport::layer::{Bounces, Layer};
use crate::transport::share::Share;
use crate::transport::squares::EntrySquares;
use crate::transport::steps::Steps;
use crate::transport::{Assembled, Channels, TransportMatrix, wire};

/// What the leader says after the trace: the processes go on, or they drop what they have.
const GO_ON: u8 = 1;
const STOP: u8 = 0;

/// What one process has of a matrix.
pub(super) struct Own<const C: usize> {
    matrix: TransportMatrix,
    /// Of its pixels.
    direct: Vec<[[f64; 2]; C]>,
    ambient: Vec<[[f64; 2]; C]>,
    /// Of its rows.
    sums: Vec<RowSums<C>>,
    /// Of the entries that it merged.
    squares: EntrySquares,
    has_halves: bool,
    summary: TraceSummary,
}

/// Traces the scene and assembles its matrix, which is then spread over the team of the tracer. As
/// [`assemble_layers`](crate::transport::assemble_layers), with the same bits.
///
/// # Errors
/// As [`Tracer::trace`]; [`Error::Team`](crate::Error::Team) where another process failed.
pub(in crate::transport) fn assemble<const C: usize>(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    channels: Channels,
    split: bool,
    project: impl Fn([f32; 3]) -> [f32; C] + Sync,
) -> Result<Assembled> {
    settings.check()?;
    let Some((scene, team)) = tracer.remote().map(|remote| (remote.id(), remote.team().clone())) else {
        return Err(garbled("no process shares the scene"));
    };
    let pixels = balanced(tracer, settings, team.size())?;
    let remote = team.remote();
    let command = Command::Assemble { scene, settings: *settings, channels, split, pixels: pixels.clone() }
        .to_bytes()?;
    let turn = remote.command(&command);
    let steps = exchange::steps(turn.comm(), shape(tracer, settings), &pixels)?;
    let share = Share::trace(tracer, settings, &pixels[0], (split, Some(&steps)), &project);
    let share = agree(&turn, share)?;
    let mut own = merge(turn.comm(), tracer, settings, (channels, split), &steps, share)?;
    let parts = turn.receive_all();
    let (mut nonzeros, mut bytes) = (vec![0_u64; own.matrix.layers.len()], 0);
    for part in &parts {
        let (of_layers, of_part) = own.add_part(part)?;
        bytes += of_part;
        nonzeros.iter_mut().zip(of_layers).for_each(|(all, more)| *all += more);
    }
    // A coaxial pinhole rig has no layer of one bounce: its direct light is the diagonal. All processes keep the same layers.
    let keeps = |(layer, &elsewhere): (&Layer, &u64)| {
        layer.bounces() != Bounces::One || layer.nonzeros() > 0 || elsewhere > 0
    };
    let keep: Vec<u8> = own.matrix.layers.iter().zip(&nonzeros).map(keeps).map(u8::from).collect();
    turn.send_all(&keep);
    drop(turn);
    retain(&mut own.matrix.layers, &keep);
    let Own { mut matrix, direct, ambient, sums, squares, has_halves, summary } = own;
    matrix.direct = planes(&direct);
    // Entries of layers that were dropped are none.
    let elsewhere = nonzeros.iter().sum::<u64>() as usize;
    matrix.spread = Some(Spread::new(remote, pixels, elsewhere, bytes as usize));
    finish(matrix, &ambient, has_halves.then_some((&sums, &squares)), summary)
}

/// As [`assemble`], in a process that does not lead. `None` where another process failed, or the leader was stopped.
pub(super) fn assemble_part<const C: usize>(
    comm: &dyn Comm,
    tracer: &mut Tracer,
    settings: &TraceSettings,
    of: (Channels, bool),
    pixels: &[StartPixels],
    project: impl Fn([f32; 3]) -> [f32; C] + Sync,
) -> Option<TransportMatrix> {
    // The leader and the others wait for this process: a message that it cannot read ends the team.
    let steps =
        exchange::steps(comm, shape(tracer, settings), pixels).expect("all processes run the same program");
    let share = Share::trace(tracer, settings, &pixels[comm.rank()], (of.1, Some(&steps)), &project);
    // The leader hears how it went, and says how it goes on.
    answer(comm, share.as_ref().map(|share| share.summary));
    let goes_on = comm.receive(0) == [GO_ON];
    let share = share.ok().filter(|_| goes_on)?;
    let own = merge(comm, tracer, settings, of, &steps, share).expect("all processes run the same program");
    comm.send(0, &own.to_bytes());
    let Own { mut matrix, direct, .. } = own;
    retain(&mut matrix.layers, &comm.receive(0));
    if matrix.is_symmetric() {
        // Rows that other processes have are not asked for.
        let rows = matrix.rows.clone();
        let whole = matrix.rig.camera.pixels();
        matrix.direct = planes(&direct).into_iter().map(|own| padded(own, &rows, whole)).collect();
    }
    Some(matrix)
}

/// The share of the leader with the costs of all, once every process has traced its own.
fn agree<const C: usize>(turn: &Turn<'_>, share: Result<Share<C>>) -> Result<Share<C>> {
    if share.is_err() {
        // The others stop tracing when they see it.
        turn.send_all(&[STOP]);
    }
    let answers: Vec<Result<TraceSummary>> =
        turn.others().zip(turn.receive_all()).map(|(rank, bytes)| read_answer(rank, &bytes)).collect();
    let mut share = share?;
    let all: Result<Vec<TraceSummary>> = answers.into_iter().collect();
    turn.send_all(&[if all.is_ok() { GO_ON } else { STOP }]);
    for other in all? {
        share.summary.add_parallel(&other);
    }
    Ok(share)
}

/// Exchanges the contributions, and merges those to the own rows.
fn merge<const C: usize>(
    comm: &dyn Comm,
    tracer: &Tracer,
    settings: &TraceSettings,
    (channels, split): (Channels, bool),
    steps: &Steps,
    share: Share<C>,
) -> Result<Own<C>> {
    let rig = shape(tracer, settings);
    let Share { found, direct, ambient, has_halves, summary } = share;
    let Combined { layers, rows: sums, squares } =
        exchange::merge(comm, rig, steps, found, classes(split).len(), &direct)?;
    let layers = of_classes(layers, split);
    let planes = vec![Vec::new(); C];
    let rows = steps.rows().nth(comm.rank()).unwrap_or_default();
    let matrix = TransportMatrix { rig, channels, direct: planes, layers, rows, spread: None };
    Ok(Own { matrix, direct, ambient, sums, squares, has_halves, summary })
}

/// Keeps the layers that the leader keeps.
fn retain(layers: &mut Vec<Layer>, keep: &[u8]) {
    let mut keep = keep.iter();
    layers.retain(|_| keep.next() == Some(&1));
}

/// The values of these rows, and zeros for all others.
fn padded(own: Vec<f32>, rows: &Range<usize>, whole: usize) -> Vec<f32> {
    let mut plane = vec![0.0; whole];
    plane[rows.clone()].copy_from_slice(&own);
    plane
}

impl<const C: usize> Own<C> {
    /// What the leader has to know of it: the number of entries of each layer, the bytes of all, and what belongs to pixels and rows.
    fn to_bytes(&self) -> Vec<u8> {
        let nonzeros: Vec<u64> = self.matrix.layers.iter().map(|layer| layer.nonzeros() as u64).collect();
        // Numbers can be sent.
        let head = to_bytes(&(nonzeros, self.matrix.bytes() as u64, self.has_halves)).unwrap_or_default();
        wire::message(|to| {
            wire::put(to, &head)?;
            wire::put_estimates(to, &self.direct)?;
            wire::put_estimates(to, &self.ambient)?;
            wire::put_sums(to, &self.sums)?;
            wire::put(to, &self.squares.to_words())
        })
    }

    /// Adds what the process of the next pixels sent. Returns its number of entries of each layer, and their bytes.
    fn add_part(&mut self, bytes: &[u8]) -> Result<(Vec<u64>, u64)> {
        let mut from = wire::Reader::new(bytes);
        let (nonzeros, size, has_halves): (Vec<u64>, u64, bool) =
            from_bytes(&from.take::<u8>().map_err(unread)?)?;
        self.has_halves &= has_halves;
        self.direct.extend(wire::take_estimates::<C>(&mut from).map_err(unread)?);
        self.ambient.extend(wire::take_estimates::<C>(&mut from).map_err(unread)?);
        self.sums.extend(wire::take_sums::<C>(&mut from).map_err(unread)?);
        let squares = EntrySquares::from_words(&from.take::<u64>().map_err(unread)?);
        self.squares.add_all(&squares.ok_or_else(|| garbled("its sums of squares have another length"))?);
        Ok((nonzeros, size))
    }
}
