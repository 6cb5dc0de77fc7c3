//! A process that does not lead.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::assembly::assemble_part;
use super::command::{Command, answer, from_bytes};
use super::product::multiply_part;
use super::retrace::trace_part;
use super::transpose::transpose_part;
use crate::error::Result;
use crate::observer::{Observer, Step};
use crate::render::{AdapterSummary, StartPixels, TraceSettings, Tracer};
use crate::scene::Scene;
use crate::team::{Comm, Worker};
use crate::transport::matrix::{Direction, Product};
use crate::transport::tiles::Interleaved;
use crate::transport::wire;
use crate::transport::{Channels, TransportMatrix, luminance};

/// What a process that does not lead has: the scenes that the leader shares, and its rows of their matrices. [`serve`](crate::team::serve()) lets it work.
pub struct SceneWorker {
    comm: Arc<dyn Comm>,
    /// The name of the machine, for messages.
    host: String,
    /// The number of this process among those on the same machine, which chooses among several equal adapters.
    turn: usize,
    scenes: HashMap<u64, Tracer>,
    matrices: HashMap<u64, Rows>,
}

/// Rows of a matrix, with the pixels of all processes.
struct Rows {
    matrix: TransportMatrix,
    pixels: Vec<StartPixels>,
}

impl SceneWorker {
    /// A process on the machine `host`, the number `turn` there, that has nothing yet.
    pub fn new(comm: Arc<dyn Comm>, host: String, turn: usize) -> Self {
        Self { comm, host, turn, scenes: HashMap::new(), matrices: HashMap::new() }
    }

    fn open(&mut self, id: u64, scene: &Scene, adapter: Option<&str>) -> Result<(String, AdapterSummary)> {
        let tracer = Tracer::open_turn(scene, adapter, self.turn)?;
        let summary = tracer.adapter().clone();
        self.scenes.insert(id, tracer);
        Ok((self.host.clone(), summary))
    }

    fn assemble(
        &mut self,
        scene: u64,
        settings: &TraceSettings,
        (channels, split): (Channels, bool),
        pixels: &[StartPixels],
    ) -> Option<TransportMatrix> {
        let (comm, tracer) = (&*self.comm, self.scenes.get_mut(&scene)?);
        tracer.observe(Arc::new(StopByLeader(Arc::clone(&self.comm))));
        let of = (channels, split);
        let matrix = match channels {
            Channels::Luma => assemble_part(comm, tracer, settings, of, pixels, |rgb| [luminance(rgb)]),
            Channels::Rgb => assemble_part(comm, tracer, settings, of, pixels, |rgb| rgb),
        };
        tracer.observe(Arc::new(()));
        matrix
    }
}

impl Worker for SceneWorker {
    fn command(&mut self, comm: &dyn Comm, id: u64, command: &[u8]) {
        // The leader waits for an answer that cannot be given without the command.
        let command: Command = from_bytes(command).expect("all processes run the same program");
        let about = |matrices: &HashMap<u64, Rows>, tell: &dyn Fn(&Rows)| matrices.get(&id).map(tell);
        match command {
            Command::Open { scene, adapter } => {
                let opened = self.open(id, &scene, adapter.as_deref());
                answer(comm, opened);
            }
            Command::Trace { settings } => trace_part(comm, self.scenes.get_mut(&id), &settings),
            Command::Assemble { scene, settings, channels, split, pixels } => {
                if let Some(matrix) = self.assemble(scene, &settings, (channels, split), &pixels) {
                    self.matrices.insert(id, Rows { matrix, pixels });
                }
            }
            Command::Multiply { product, interleaved } => {
                about(&self.matrices, &|rows| rows.multiply(comm, product, interleaved));
            }
            Command::Transpose => {
                about(&self.matrices, &|rows| transpose_part(comm, &rows.matrix, &rows.pixels));
            }
            Command::Rows { layer } => {
                about(&self.matrices, &|rows| {
                    comm.send(0, &wire::rows_to_bytes(&rows.matrix.layers[layer].to_rows()));
                });
            }
            Command::Squares { layer, channel } => {
                about(&self.matrices, &|rows| {
                    let sum = comm.receive(0).try_into().map(f64::from_le_bytes);
                    let sum = sum.expect("all processes run the same program");
                    comm.send(0, &rows.matrix.layers[layer].squares(channel, sum).to_le_bytes());
                });
            }
        }
    }

    fn release(&mut self, id: u64) {
        self.scenes.remove(&id);
        self.matrices.remove(&id);
    }
}

impl Rows {
    fn multiply(&self, comm: &dyn Comm, product: Product, interleaved: bool) {
        let own = &self.pixels[comm.rank()];
        let transposed = product.direction == Direction::Backward && !self.matrix.is_symmetric();
        let rows = if transposed { &own.projector } else { &own.camera };
        if interleaved {
            multiply_part::<Interleaved>(comm, &self.matrix, product, rows);
        } else {
            multiply_part::<f64>(comm, &self.matrix, product, rows);
        }
    }
}

/// Stops the trace of an assembly when the leader says something: it does so only where it goes on without this trace.
struct StopByLeader(Arc<dyn Comm>);

impl Observer for StopByLeader {
    fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
        if self.0.has_message(0) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::image::Resolution;
    use crate::observer::Estimate;
    use crate::team::threads;
    use crate::transport::RigShape;

    #[test]
    fn a_trace_stops_when_the_leader_goes_on_without_it() {
        let [leader, other]: [_; 2] = threads(2).try_into().ok().expect("there are two");
        let stop = StopByLeader(Arc::new(other));
        let step = Step { stage: "tracing", done: 1, total: 2, estimate: Estimate::None };
        assert!(stop.step(&step).is_continue());
        leader.send(1, &[0]);
        assert!(stop.step(&step).is_break());
    }

    #[test]
    fn rows_that_the_leader_has_dropped_are_not_kept() {
        let comm: Arc<dyn Comm> = Arc::new(threads(1).swap_remove(0));
        let mut worker = SceneWorker::new(comm, "here".into(), 0);
        let size = Resolution::new(1, 1);
        let rig = RigShape { camera: size, projector: size, symmetric: true };
        for id in [3, 4] {
            let matrix = TransportMatrix::new(rig, Channels::Luma, vec![vec![1.0]], Vec::new());
            worker.matrices.insert(id, Rows { matrix, pixels: Vec::new() });
        }
        worker.release(3);
        assert_eq!(worker.matrices.keys().collect::<Vec<_>>(), [&4]);
    }
}
