//! A matrix that is spread over the processes of a team. Each process traces the light paths from some pixels, and holds the rows of these
//! pixels.
//!
//! Every sum is taken in the order of a single process, so the bits do not depend on the number of processes:
//!
//! * A row of the matrix gets contributions from the paths of its own pixel, and from paths of other pixels that end at this pixel. Each
//!   process sends contributions of the second kind to the process that holds the row (`exchange`), which merges them by ascending start
//!   pixel. In a symmetric matrix, one process merges an entry, and the mirror image is a copy.
//! * Sums over rows and over all entries, from which the noise is computed, are exact, so they do not depend on the order (`exchange`).
//! * An entry of a product is the sum over the entries of a row from left to right. The process that holds the row computes this sum, and
//!   the leader collects all rows ([`Spread`]). The transpose of a rig that is not coaxial is spread by projector pixels at first use.
//! * A photo that is traced anew sums contributions to every pixel in the order of the paths. All processes trace, and the leader sums
//!   (`retrace`).
//!
//! The leader sends the others a `Command`; a [`SceneWorker`] carries it out.

mod assembly;
mod exchange;
mod retrace;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::ops::{ControlFlow, Range};
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Serialize};

pub(super) use assembly::{assemble, classes, of_share};
pub(super) use exchange::Steps;
#[cfg(test)]
pub(super) use exchange::{Combined, merge, steps};
pub(super) use retrace::trace;

use super::layer::Layer;
use super::matrix::Product;
use super::tiles::{CompressedRows, Interleaved, Summable};
use super::{Channels, TransportMatrix, wire};
use crate::error::{Error, Result};
use crate::observer::{Observer, Step};
use crate::operator::Direction;
use crate::render::{AdapterSummary, StartPixels, TraceSettings, Tracer};
use crate::scene::Scene;
use crate::team::{Comm, Remote, Team, Told, Turn, answer, serve};

/// The leader's record of the parts of a matrix that other processes hold.
#[derive(Debug)]
pub(super) struct Spread {
    remote: Remote,
    /// The pixels of each process, by rank. The rows of the matrix are camera pixels, and the rows of the transpose are projector pixels.
    pub(super) pixels: Vec<StartPixels>,
    /// The number of entries that other processes hold. `bytes` is the memory that these entries take there.
    pub(super) nonzeros: usize,
    pub(super) bytes: usize,
    /// This is set once each process has its rows of the transpose.
    is_transposed: OnceLock<()>,
}

impl Spread {
    fn command(&self, command: &Command) -> Turn<'_> {
        self.remote.command(command).expect("numbers can be sent")
    }

    /// Computes a product of the matrix. `own` has the rows of this process, the leader.
    pub(super) fn multiply<V: Summable>(
        &self,
        own: &TransportMatrix,
        product: Product,
        from: &[V],
        to: &mut [V],
    ) {
        if is_transposed(own, product) {
            self.is_transposed.get_or_init(|| {
                let turn = self.command(&Command::Transpose);
                transpose_part(turn.comm(), own, &self.pixels);
            });
        }
        let interleaved = size_of::<V>() == size_of::<Interleaved>();
        let turn = self.command(&Command::Multiply { product, interleaved });
        turn.broadcast(bytemuck::cast_slice(from));
        let mut rows = self.pixels.iter().map(|pixels| own_rows(own, product, pixels).clone());
        let first = rows.next().unwrap_or_default();
        own.multiply_own(product, first.start, from, &mut to[first]);
        for (rank, rows) in turn.others().zip(rows) {
            let found = turn.comm().receive(rank);
            bytemuck::cast_slice_mut::<V, u8>(&mut to[rows]).copy_from_slice(&found);
        }
    }

    /// Collects all rows of the layers. `own` has the rows of this process.
    pub(super) fn gathered(&self, own: &[Layer]) -> Result<Vec<Layer>> {
        let layer = |(at, own): (usize, &Layer)| {
            let mut rows = vec![own.to_rows()];
            let channels = rows[0].weights.len();
            for bytes in self.command(&Command::Rows { layer: at }).receive_all() {
                rows.push(wire::take_rows(&bytes, channels).map_err(wire::unread)?);
            }
            Ok(Layer::new(own.bounces(), own.tiles().cols(), rows))
        };
        own.iter().enumerate().map(layer).collect()
    }

    /// The squares of all entries of a layer. They are added row by row to `own`, the sum over the rows of this process.
    pub(super) fn squares(&self, layer: usize, channel: usize, own: f64) -> f64 {
        let turn = self.command(&Command::Squares { layer, channel });
        turn.others().fold(own, |sum, rank| {
            turn.comm().send(rank, &sum.to_le_bytes());
            number(&turn.comm().receive(rank))
        })
    }
}

fn number(message: &[u8]) -> f64 {
    message.try_into().map(f64::from_le_bytes).expect("all processes run the same program")
}

/// Computes this process's rows of a product. The leader sends the vector.
fn multiply_part<V: Summable>(comm: &dyn Comm, own: &TransportMatrix, product: Product, rows: &Range<usize>) {
    let from: Vec<V> = bytemuck::pod_collect_to_vec(&comm.broadcast(None));
    let mut to = vec![V::default(); rows.len()];
    own.multiply_own(product, rows.start, &from, &mut to);
    comm.send(0, bytemuck::cast_slice(&to));
}

/// Computes this process's rows of the transpose, one for each of its projector pixels. Every process of the team must call this function.
fn transpose_part(comm: &dyn Comm, own: &TransportMatrix, pixels: &[StartPixels]) {
    for layer in &own.layers {
        let rows = layer.to_rows();
        let message = |to: &StartPixels| wire::rows_to_bytes(&rows.transposed(&to.projector, own.rows.start));
        let received = comm.exchange(pixels.iter().map(message).collect());
        let channels = rows.weights.len();
        // Rows of the matrix arrive by ascending rank, so they are in order.
        let parts: Vec<CompressedRows> = received
            .iter()
            .map(|bytes| wire::take_rows(bytes, channels).expect("all processes run the same program"))
            .collect();
        let count = pixels[comm.rank()].projector.len();
        let mut joined = CompressedRows::with_room(channels, count, 0);
        for row in 0..count {
            parts.iter().for_each(|part| joined.extend(part, part.row(row)));
            joined.end_row();
        }
        layer.keep_transpose(Layer::new(layer.bounces(), own.rig.camera.pixels(), vec![joined]));
    }
}

/// This process's rows of a product. These are its camera pixels or, for the transpose of a matrix that is not symmetric, its projector
/// pixels.
fn own_rows<'a>(matrix: &TransportMatrix, product: Product, pixels: &'a StartPixels) -> &'a Range<usize> {
    if is_transposed(matrix, product) { &pixels.projector } else { &pixels.camera }
}

fn is_transposed(matrix: &TransportMatrix, product: Product) -> bool {
    product.direction == Direction::Adjoint && !matrix.is_symmetric()
}

#[derive(Serialize, Deserialize)]
enum Command {
    /// Moves this scene to the device whose name contains `adapter`. The reply is an [`crate::render::AdapterSummary`].
    Open {
        scene: Box<Scene>,
        adapter: Option<String>,
    },
    /// Traces a scene's paths from each range of pixels that the leader requests.
    Trace {
        settings: TraceSettings,
    },
    /// Assembles rows of the matrix of a scene. `pixels` has the rows of each process, by rank.
    Assemble {
        scene: u64,
        settings: TraceSettings,
        channels: Channels,
        split: bool,
        pixels: Vec<StartPixels>,
    },
    /// Multiplies the worker's rows of a matrix by one vector, or by four interleaved vectors. The vectors are sent next.
    Multiply {
        product: Product,
        interleaved: bool,
    },
    Transpose,
    Rows {
        layer: usize,
    },
    /// Adds the squares of the worker's entries of a layer to a sum. The sum is sent next.
    Squares {
        layer: usize,
        channel: usize,
    },
}

/// Lets the other processes of the team help to trace `scene`, which must be the tracer's scene. This process sends them the scene. They
/// open the adapter whose name contains `adapter`, or the fastest adapter for `None`.
///
/// # Errors
/// [`Error::Team`] if a process has no such adapter, or if its adapter has another driver, because the bits of its light paths would
/// differ.
pub fn share_scene(
    tracer: &mut Tracer,
    scene: &Scene,
    adapter: Option<&str>,
    team: &Arc<Team>,
) -> Result<()> {
    let remote = team.remote();
    let command = Command::Open { scene: Box::new(scene.clone()), adapter: adapter.map(Into::into) };
    let opened = remote.command(&command)?.answers();
    for (rank, opened) in (1..).zip(opened) {
        let (host, theirs): (String, AdapterSummary) = opened?;
        let of = |adapter: &AdapterSummary| {
            format!("{} with the driver {} {}", adapter.name, adapter.driver, adapter.driver_version)
        };
        let (theirs, ours) = (of(&theirs), of(tracer.adapter()));
        if theirs != ours {
            return Err(Error::team(format!(
                "process {rank} on {host} traces on {theirs}, and process 0 on {ours}"
            ))
            .help(
                "use machines with the same adapter and driver, or name a common one by --adapter; \
                       light paths of different drivers have different bits",
            ));
        }
    }
    tracer.share(remote);
    Ok(())
}

/// A process that is not the leader, with the scenes that the leader shares, and its rows of their matrices.
pub struct SceneWorker {
    comm: Arc<dyn Comm>,
    host: String,
    /// The number of this process among the processes on the same machine. It selects one of several equal adapters.
    turn: usize,
    scenes: HashMap<u64, Tracer>,
    /// The rows of each matrix, with the pixels of each process.
    matrices: HashMap<u64, (TransportMatrix, Vec<StartPixels>)>,
}

impl SceneWorker {
    /// Process number `turn` on the machine `host`. It has no scenes yet.
    pub fn new(comm: Arc<dyn Comm>, host: String, turn: usize) -> Self {
        Self { comm, host, turn, scenes: HashMap::new(), matrices: HashMap::new() }
    }

    /// Works for the leader until it ends the team.
    pub fn serve(mut self) {
        let comm = Arc::clone(&self.comm);
        serve(&*comm, |told| match told {
            Told::End => {}
            Told::Release(id) => self.release(id),
            Told::Command(id, command) => self.command(id, command),
        });
    }

    fn release(&mut self, id: u64) {
        self.scenes.remove(&id);
        self.matrices.remove(&id);
    }

    fn command(&mut self, id: u64, command: Command) {
        let shared = Arc::clone(&self.comm);
        let comm = &*shared;
        match command {
            Command::Open { scene, adapter } => {
                let opened = self.open(id, &scene, adapter.as_deref());
                return answer(comm, opened);
            }
            Command::Trace { settings } => {
                return retrace::trace_part(&shared, self.scenes.get_mut(&id), &settings);
            }
            Command::Assemble { scene, settings, channels, split, pixels } => {
                if let Some(matrix) = self.assemble(scene, &settings, (channels, split), &pixels) {
                    self.matrices.insert(id, (matrix, pixels));
                }
                return;
            }
            _ => {}
        }
        let Some((matrix, pixels)) = self.matrices.get(&id) else { return };
        match command {
            Command::Multiply { product, interleaved } => {
                let own = own_rows(matrix, product, &pixels[comm.rank()]);
                if interleaved {
                    multiply_part::<Interleaved>(comm, matrix, product, own);
                } else {
                    multiply_part::<f64>(comm, matrix, product, own);
                }
            }
            Command::Transpose => transpose_part(comm, matrix, pixels),
            Command::Rows { layer } => comm.send(0, &wire::rows_to_bytes(&matrix.layers[layer].to_rows())),
            Command::Squares { layer, channel } => {
                let sum = number(&comm.receive(0));
                comm.send(0, &matrix.layers[layer].tiles().squares(channel, sum).to_le_bytes());
            }
            _ => {}
        }
    }

    fn open(&mut self, id: u64, scene: &Scene, adapter: Option<&str>) -> Result<(String, AdapterSummary)> {
        let tracer = Tracer::open_turn(scene, adapter, self.turn)?;
        let summary = tracer.adapter().clone();
        self.scenes.insert(id, tracer);
        Ok((self.host.clone(), summary))
    }

    /// Assembles this process's rows of a matrix. The result is `None` if another process failed, or if the leader was stopped.
    fn assemble(
        &mut self,
        scene: u64,
        settings: &TraceSettings,
        of: (Channels, bool),
        pixels: &[StartPixels],
    ) -> Option<TransportMatrix> {
        let (comm, tracer) = (&*self.comm, self.scenes.get_mut(&scene)?);
        tracer.observe(Arc::new(StopByLeader(Arc::clone(&self.comm))));
        let matrix = match of.0 {
            Channels::Luma => assembly::assemble_part::<1>(comm, tracer, settings, of, pixels),
            Channels::Rgb => assembly::assemble_part::<3>(comm, tracer, settings, of, pixels),
        };
        tracer.observe(Arc::new(()));
        // The leader and the other processes wait for this process, so an unreadable message must end the team.
        matrix.expect("all processes run the same program")
    }
}

/// Stops a trace when a message from the leader arrives. During a trace, the leader sends a message only if it no longer needs the trace.
struct StopByLeader(Arc<dyn Comm>);

impl Observer for StopByLeader {
    fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
        if self.0.has_message(0) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
