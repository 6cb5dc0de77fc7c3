//! Several processes that work on one question: one of them leads, the others hold what it cannot hold alone, and compute on it.
//!
//! The process of rank 0 leads. It runs the program as if it were alone: it speaks, writes files and keeps the journal. Each other process waits in
//! [`serve()`] for commands, which are about *objects* that every process holds a part of: a scene on its device, or some rows of a matrix. The leader
//! names an object by a [`Remote`]; the others let go of it once that is dropped. What a command says is up to the caller: here are only bytes.
//!
//! Processes exchange messages by a [`Comm`]: by MPI (feature `mpi`), or as threads of one process ([`threads()`]).

mod cores;
mod serve;
mod threads;
#[cfg(feature = "mpi")]
mod world;

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use cores::{Placement, keep_cores, share_cores};
pub use serve::{Worker, serve};
pub use threads::{Threads, threads};
#[cfg(feature = "mpi")]
pub use world::World;

use crate::error::{Error, Result};
use serve::Envelope;

/// Messages among the processes of a team. Messages from one process to another arrive in the order in which they were sent.
///
/// No method returns an error: where a process is gone, its partners cannot go on, and the system that started them ends them all.
pub trait Comm: Send + Sync {
    /// The number of this process, from 0 on.
    fn rank(&self) -> usize;

    /// The number of processes.
    fn size(&self) -> usize;

    /// Sends a message to another process. It may wait until that one receives it.
    fn send(&self, to: usize, message: &[u8]);

    /// Waits for the next message from another process.
    fn receive(&self, from: usize) -> Vec<u8>;

    /// Whether a message from another process has arrived.
    fn has_message(&self, from: usize) -> bool;

    /// Passes a message of the leader on to every process, and returns it: `Some` in the leader, `None` in the others. Each process passes it on to
    /// others, so that the leader alone does not send it to all. Every process of the team must call it.
    fn broadcast(&self, message: Option<&[u8]>) -> Vec<u8> {
        // A tree: the parent's number lacks the lowest bit that is set in a rank.
        let rank = self.rank();
        let message = match message {
            Some(message) => message.to_vec(),
            None => self.receive(rank & rank.saturating_sub(1)),
        };
        let below = if rank == 0 { usize::BITS } else { rank.trailing_zeros() };
        let children = (0..below).rev().map(|bit| rank | 1 << bit).filter(|child| *child < self.size());
        children.for_each(|child| self.send(child, &message));
        message
    }

    /// Ends the messages of this process: none is sent or received afterwards. Every process of the team must call it.
    fn close(&self) {}

    /// Sends `outgoing[rank]` to each other process, and returns what each of them sent to this one; the own message comes back. Every process of
    /// the team must call it.
    fn exchange(&self, outgoing: Vec<Vec<u8>>) -> Vec<Vec<u8>>;
}

/// Checks that all processes run the same program: `program` is what identifies it, and `placements` says where the processes run. Every process of the
/// team must call it.
///
/// # Errors
/// [`Error::Team`] in every process, with the machines that run another program than the leader.
pub fn require_same_program(comm: &dyn Comm, placements: &[Placement], program: &str) -> Result<()> {
    let programs = cores::exchange_text(comm, program);
    let host = |rank: usize| placements.get(rank).map_or("", |placement| &placement.host);
    let others = programs.iter().enumerate().filter(|(_, other)| **other != programs[0]);
    let others: Vec<String> =
        others.map(|(rank, other)| format!("process {rank} on {} runs {other}", host(rank))).collect();
    if others.is_empty() {
        return Ok(());
    }
    Err(Error::Team {
        fault: format!("process 0 on {} runs {}, but {}", host(0), programs[0], others.join(", ")),
        help: "start the same program on every machine".into(),
    })
}

/// The team as its leader sees it.
pub struct Team {
    comm: Arc<dyn Comm>,
    placements: Vec<Placement>,
    /// The number of the next object. The thread that holds the lock talks to the others.
    next: Mutex<u64>,
    /// Objects that the others still hold, and that are no longer needed.
    released: Mutex<Vec<u64>>,
    has_ended: AtomicBool,
}

impl Team {
    /// The team that the process with this `comm` leads; its rank is 0. All other processes must be in [`serve()`]. `placements` says where the
    /// processes run, by rank, for the user.
    pub fn lead(comm: Arc<dyn Comm>, placements: Vec<Placement>) -> Arc<Self> {
        debug_assert_eq!(comm.rank(), 0, "the process of rank 0 leads");
        Arc::new(Self {
            comm,
            placements,
            next: Mutex::new(0),
            released: Mutex::default(),
            has_ended: AtomicBool::new(false),
        })
    }

    /// The number of processes.
    pub fn size(&self) -> usize {
        self.comm.size()
    }

    /// Ends the work of the team: the other processes leave [`serve()`]. Nothing that they hold may be used afterwards.
    pub fn end(&self) {
        if !self.has_ended.swap(true, Ordering::SeqCst) {
            self.turn().tell(&Envelope::End);
            self.comm.close();
        }
    }

    /// Where each process runs, by rank; empty where it is not known.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// A new object, which no process holds yet.
    pub fn remote(self: &Arc<Self>) -> Remote {
        let mut next = lock(&self.next);
        *next += 1;
        Remote { team: Arc::clone(self), id: *next }
    }

    /// Waits until no other thread talks to the team. The other processes first let go of what is no longer needed.
    fn turn(&self) -> Turn<'_> {
        let turn = Turn { comm: &*self.comm, _alone: lock(&self.next) };
        for id in std::mem::take(&mut *lock(&self.released)) {
            turn.tell(&Envelope::Release(id));
        }
        turn
    }
}

impl fmt::Debug for Team {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Team").field("size", &self.size()).finish_non_exhaustive()
    }
}

/// The other processes leave [`serve()`].
impl Drop for Team {
    fn drop(&mut self) {
        self.end();
    }
}

/// An object of which each process of the team holds a part. The others let go of theirs after it is dropped.
#[derive(Debug)]
pub struct Remote {
    team: Arc<Team>,
    id: u64,
}

impl Remote {
    /// The team that holds it.
    pub fn team(&self) -> &Arc<Team> {
        &self.team
    }

    /// Its number.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Gives the others a command about this object; [`Worker::command`] says what they make of it. What follows, question by question, is between
    /// the caller and the worker. No other thread talks to the team before the returned turn is dropped.
    pub fn command(&self, command: &[u8]) -> Turn<'_> {
        let turn = self.team.turn();
        turn.tell(&Envelope::Command(self.id, command));
        turn
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        // They are told with the next command, since a command may be under way now.
        lock(&self.team.released).push(self.id);
    }
}

/// The leader talks to the others: no other thread does.
pub struct Turn<'a> {
    comm: &'a dyn Comm,
    _alone: MutexGuard<'a, u64>,
}

impl Turn<'_> {
    /// The messages of the team.
    pub fn comm(&self) -> &dyn Comm {
        self.comm
    }

    /// The ranks of the other processes.
    pub fn others(&self) -> std::ops::Range<usize> {
        1..self.comm.size()
    }

    /// Sends a message to all others.
    pub fn send_all(&self, message: &[u8]) {
        self.others().for_each(|rank| self.comm.send(rank, message));
    }

    /// Passes a message on to all others, who take it by [`Comm::broadcast`].
    pub fn broadcast(&self, message: &[u8]) {
        self.comm.broadcast(Some(message));
    }

    /// Receives a message from each of the others, by rank.
    pub fn receive_all(&self) -> Vec<Vec<u8>> {
        self.others().map(|rank| self.comm.receive(rank)).collect()
    }

    fn tell(&self, envelope: &Envelope<'_>) {
        self.send_all(&envelope.to_bytes());
    }
}

/// What a mutex holds is whole even if a thread panicked.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
