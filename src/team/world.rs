//! Processes that MPI started together.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use mpi::Threading;
use mpi::datatype::Equivalence;
use mpi::environment::Universe;
use mpi::point_to_point::{Destination, Source};
use mpi::topology::{Communicator, SimpleCommunicator};

use super::Comm;
use crate::error::{Error, Result};

/// The maximum size of one MPI message. MPI counts bytes in 31 bits, so longer messages are sent in pieces.
const PIECE: usize = 1 << 30;
/// The tags of messages. `MORE` means that more pieces follow, and `LAST` marks the last piece.
const MORE: i32 = 1;
const LAST: i32 = 0;

/// The number of times that a waiting process checks for a message before it sleeps between checks. Sleeping leaves its core to other
/// processes.
const LOOKS: u32 = 2000;
const LONGEST_SLEEP: Duration = Duration::from_micros(500);

/// The environment variables that the launchers of MPI programs set in each process: Open MPI, PMIx, and MPICH with its relatives.
const LAUNCHERS: [&str; 3] = ["OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK"];

/// All processes that `mpirun` or `srun` started together. Dropping this value ends MPI.
pub struct World {
    rank: usize,
    size: usize,
    /// The connection to MPI; `None` after closing.
    universe: Mutex<Option<Universe>>,
}

impl World {
    /// Connects this process to the others. Returns `None` if no MPI launcher started this process.
    ///
    /// # Errors
    /// [`Error::Team`] if MPI was started before, or if MPI does not allow several threads.
    pub fn join() -> Result<Option<Self>> {
        if !LAUNCHERS.iter().any(|name| std::env::var_os(name).is_some()) {
            return Ok(None);
        }
        let fault = |fault: &str| {
            Error::team(fault)
                .help("start krylux itself by mpirun or srun, with the Open MPI that it was built with")
        };
        let (universe, threading) = mpi::initialize_with_threading(Threading::Serialized)
            .ok_or_else(|| fault("MPI was started before"))?;
        if threading < Threading::Serialized {
            return Err(fault("this MPI cannot be used by a program with several threads"));
        }
        let world = universe.world();
        Ok(Some(Self {
            rank: world.rank() as usize,
            size: world.size() as usize,
            universe: Mutex::new(Some(universe)),
        }))
    }
}

fn world() -> SimpleCommunicator {
    SimpleCommunicator::world()
}

fn pieces(message: &[u8]) -> impl Iterator<Item = (&[u8], i32)> {
    let count = message.len().div_ceil(PIECE).max(1);
    let piece = move |at: usize| &message[at * PIECE..message.len().min((at + 1) * PIECE)];
    (0..count).map(move |at| (piece(at), if at + 1 < count { MORE } else { LAST }))
}

fn wait<T>(mut look: impl FnMut() -> Option<T>) -> T {
    let mut sleep = Duration::from_micros(10);
    for looks in 0_u32.. {
        if let Some(found) = look() {
            return found;
        }
        if looks < LOOKS {
            std::hint::spin_loop();
        } else {
            std::thread::sleep(sleep);
            sleep = (2 * sleep).min(LONGEST_SLEEP);
        }
    }
    unreachable!("a process waits for less than 2³² looks")
}

impl Comm for World {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.size
    }

    fn send(&self, to: usize, message: &[u8]) {
        let world = world();
        let process = world.process_at_rank(to as i32);
        for (piece, tag) in pieces(message) {
            mpi::request::scope(|scope| {
                let mut request = Some(process.immediate_send_with_tag(scope, piece, tag));
                wait(|| match request.take()?.test() {
                    Ok(_) => Some(()),
                    Err(unfinished) => {
                        request = Some(unfinished);
                        None
                    }
                });
            });
        }
    }

    fn receive(&self, from: usize) -> Vec<u8> {
        let world = world();
        let process = world.process_at_rank(from as i32);
        let mut message = Vec::new();
        loop {
            let status = wait(|| process.immediate_probe());
            let at = message.len();
            // MPI's counts are never negative.
            message.resize(at + status.count(u8::equivalent_datatype()) as usize, 0);
            process.receive_into_with_tag(&mut message[at..], status.tag());
            if status.tag() == LAST {
                return message;
            }
        }
    }

    fn has_message(&self, from: usize) -> bool {
        world().process_at_rank(from as i32).immediate_probe().is_some()
    }

    fn close(&self) {
        // Dropping the universe ends MPI.
        drop(self.universe.lock().unwrap_or_else(PoisonError::into_inner).take());
    }

    fn exchange(&self, mut outgoing: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        let own = std::mem::take(&mut outgoing[self.rank]);
        let world = world();
        let mut received = Vec::new();
        mpi::request::scope(|scope| {
            let others = (0..self.size).filter(|rank| *rank != self.rank);
            let sent: Vec<_> = others
                .flat_map(|rank| pieces(&outgoing[rank]).map(move |piece| (rank, piece)))
                .map(|(rank, (piece, tag))| {
                    world.process_at_rank(rank as i32).immediate_send_with_tag(scope, piece, tag)
                })
                .collect();
            received = (0..self.size)
                .map(|rank| if rank == self.rank { Vec::new() } else { self.receive(rank) })
                .collect();
            sent.into_iter().for_each(|request| request.wait_without_status());
        });
        received[self.rank] = own;
        received
    }
}
