//! A matrix that is spread over the processes of a team. Each process traces the light paths from some pixels, and holds the rows of these
//! pixels.
//!
//! Every sum is taken in the order of a single process, so the bits do not depend on the number of processes:
//!
//! * A row of the matrix gets contributions from the paths of its own pixel, and from paths of other pixels that end there. Each process
//!   sends the latter to the process that holds the row (`exchange`), which merges them by ascending start pixel. One process merges an
//!   entry of a symmetric matrix, and its mirror image is a copy.
//! * Sums over rows and over all entries, which determine the noise, are exact, so they do not depend on the order (`exchange`).
//! * A product of a row is the sum over its entries from left to right. The process that holds the row computes it, and the leader puts the
//!   rows together (`product`). The transpose of a rig that is not coaxial is spread by the pixels of the projector when it is first used.
//! * A photo that is traced anew adds up contributions to every pixel in the order of the paths. The processes trace, and the leader adds
//!   up (`retrace`).
//!
//! The leader sends the others a `Command`; a [`SceneWorker`] carries it out.

mod assembly;
mod exchange;
mod product;
mod retrace;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::ops::{ControlFlow, Range};
use std::sync::{Arc, OnceLock};

use serde::{Deserialize, Serialize};

pub(super) use assembly::assemble;
pub(super) use exchange::Steps;
pub(super) use retrace::trace;

use super::matrix::Product;
use super::tiles::Interleaved;
use super::{Channels, TransportMatrix, wire};
use crate::error::{Error, Result};
use crate::observer::{Observer, Step};
use crate::operator::Direction;
use crate::render::{AdapterSummary, StartPixels, TraceSettings, Tracer};
use crate::scene::Scene;
use crate::team::{Comm, Remote, Team, Told, answer, serve};

/// The parts of a matrix that other processes hold, as the leader sees them.
#[derive(Clone, Debug)]
pub(super) struct Spread(Arc<Parts>);

#[derive(Debug)]
struct Parts {
    remote: Remote,
    /// The pixels of each process, by rank. Its rows are the camera pixels, and its columns are the projector pixels.
    pixels: Vec<StartPixels>,
    /// The number of entries that other processes hold, and their size in bytes there.
    nonzeros: usize,
    bytes: usize,
    /// Set once each process has its rows of the transpose.
    is_transposed: OnceLock<()>,
}

impl Spread {
    fn new(remote: Remote, pixels: Vec<StartPixels>, nonzeros: usize, bytes: usize) -> Self {
        Self(Arc::new(Parts { remote, pixels, nonzeros, bytes, is_transposed: OnceLock::new() }))
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.0.nonzeros
    }

    pub(super) fn bytes(&self) -> usize {
        self.0.bytes
    }

    pub(super) fn processes(&self) -> usize {
        self.0.pixels.len()
    }
}

/// A process's rows of a product: its camera pixels, or its projector pixels for the transpose of a matrix that is not symmetric.
fn own_rows<'a>(matrix: &TransportMatrix, product: Product, pixels: &'a StartPixels) -> &'a Range<usize> {
    if is_transposed(matrix, product) { &pixels.projector } else { &pixels.camera }
}

fn is_transposed(matrix: &TransportMatrix, product: Product) -> bool {
    product.direction == Direction::Adjoint && !matrix.is_symmetric()
}

#[derive(Serialize, Deserialize)]
enum Command {
    /// Moves this scene to the device whose name contains `adapter`. The answer is an [`crate::render::AdapterSummary`].
    Open {
        scene: Box<Scene>,
        adapter: Option<String>,
    },
    /// Traces the paths of each range of pixels of a scene that the leader requests.
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
    /// Multiplies the worker's rows of a matrix with one vector, or with four interleaved ones. The vectors follow.
    Multiply {
        product: Product,
        interleaved: bool,
    },
    Transpose,
    Rows {
        layer: usize,
    },
    /// Adds the squares of the worker's entries of a layer to a sum. The sum follows.
    Squares {
        layer: usize,
        channel: usize,
    },
}

/// Lets the other processes of the team help to trace `scene`, which must be the tracer's scene. They get the scene from this process, and
/// open the adapter whose name contains `adapter`, or the fastest one for `None`.
///
/// # Errors
/// [`Error::Team`] if a process has no such adapter, or one with another driver: its light paths would have other bits.
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

/// A process that does not lead, with the scenes that the leader shares, and its rows of their matrices.
pub struct SceneWorker {
    comm: Arc<dyn Comm>,
    host: String,
    /// The number of this process among the processes on the same machine. It selects one of several equal adapters.
    turn: usize,
    scenes: HashMap<u64, Tracer>,
    matrices: HashMap<u64, Rows>,
}

struct Rows {
    matrix: TransportMatrix,
    pixels: Vec<StartPixels>,
}

impl SceneWorker {
    /// Process number `turn` on the machine `host`, without any scenes.
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
                    self.matrices.insert(id, Rows { matrix, pixels });
                }
                return;
            }
            _ => {}
        }
        let Some(Rows { matrix, pixels }) = self.matrices.get(&id) else { return };
        match command {
            Command::Multiply { product, interleaved } => {
                let own = own_rows(matrix, product, &pixels[comm.rank()]);
                if interleaved {
                    product::multiply_part::<Interleaved>(comm, matrix, product, own);
                } else {
                    product::multiply_part::<f64>(comm, matrix, product, own);
                }
            }
            Command::Transpose => product::transpose_part(comm, matrix, pixels),
            Command::Rows { layer } => comm.send(0, &wire::rows_to_bytes(&matrix.layers[layer].to_rows())),
            Command::Squares { layer, channel } => {
                let sum = product::number(&comm.receive(0));
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

    /// This process's rows of a matrix. The result is `None` if another process failed, or if the leader was stopped.
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
        // The leader and the others wait for this process, so a message that it cannot read ends the team.
        matrix.expect("all processes run the same program")
    }
}

/// Stops a trace when a message of the leader arrives. The leader sends one only if it goes on without this trace.
struct StopByLeader(Arc<dyn Comm>);

impl Observer for StopByLeader {
    fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
        if self.0.has_message(0) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
