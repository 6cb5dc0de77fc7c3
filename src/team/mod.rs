//! A team of processes that compute one result together. One process leads. The other processes hold data that are too large for the
//! leader, and compute with these data.
//!
//! The process of rank 0 is the leader. It runs the program as if it were alone: it prints, writes files and keeps the journal. Each other
//! process waits for commands in [`serve()`]. A command refers to an *object* of which every process holds a part: a scene on its device,
//! or some rows of a matrix. The leader refers to an object by a [`Remote`]. When the leader has dropped the `Remote`, the other processes
//! drop their parts. The caller defines the commands.
//!
//! Processes exchange messages through a [`Comm`]. They are either MPI processes (feature `mpi`) or threads of one process ([`threads()`]).

mod cores;
#[cfg(feature = "mpi")]
mod world;

use std::collections::VecDeque;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

pub use cores::{Placement, keep_cores, share_cores};
#[cfg(feature = "mpi")]
pub use world::World;

use crate::error::{Error, Result};

/// Messages between the processes of a team. Messages from one process to another arrive in the order in which they were sent.
///
/// No method returns an error. If a process ends early, its partners cannot continue, and the system that started them ends all of them.
pub trait Comm: Send + Sync {
    /// The number of this process, starting at 0.
    fn rank(&self) -> usize;

    /// The number of processes.
    fn size(&self) -> usize;

    /// Sends a message to another process. It may wait until the other process receives the message.
    fn send(&self, to: usize, message: &[u8]);

    /// Waits for the next message from another process.
    fn receive(&self, from: usize) -> Vec<u8>;

    /// Whether a message from another process has arrived.
    fn has_message(&self, from: usize) -> bool;

    /// Sends the leader's message to every process, and returns it. `message` is `Some` in the leader, and `None` in the others. Processes
    /// pass the message on, so the leader need not send it to every process itself. Every process of the team must call this method.
    fn broadcast(&self, message: Option<&[u8]>) -> Vec<u8> {
        // The processes form a tree. The rank of a parent is the rank of its child without the lowest set bit.
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

    /// Ends messaging. Afterwards, this process sends and receives nothing. Every process of the team must call this method.
    fn close(&self) {}

    /// Sends `outgoing[rank]` to each process, and returns the messages to this process, by rank. The message of this process to itself is
    /// returned unchanged. Every process of the team must call this method.
    fn exchange(&self, outgoing: Vec<Vec<u8>>) -> Vec<Vec<u8>>;
}

/// Checks that all processes run the program that `program` identifies. `placements` says where they run. Every process must call this
/// function.
///
/// # Errors
/// [`Error::Team`] in every process if the programs differ. The error names the machines whose program differs from the leader's.
pub fn require_same_program(comm: &dyn Comm, placements: &[Placement], program: &str) -> Result<()> {
    let programs = cores::exchange_text(comm, program);
    let host = |rank: usize| placements.get(rank).map_or("", |placement| &placement.host);
    let others = programs.iter().enumerate().filter(|(_, other)| **other != programs[0]);
    let others: Vec<String> =
        others.map(|(rank, other)| format!("process {rank} on {} runs {other}", host(rank))).collect();
    if others.is_empty() {
        return Ok(());
    }
    Err(Error::team(format!("process 0 on {} runs {}, but {}", host(0), programs[0], others.join(", ")))
        .help("start the same program on every machine"))
}

/// The leader's view of a team.
pub struct Team {
    comm: Arc<dyn Comm>,
    placements: Vec<Placement>,
    /// The number of the next object. The thread that holds this lock is the only one that exchanges messages with the other processes.
    next: Mutex<u64>,
    /// Objects that the leader has dropped, and the other processes still hold.
    released: Mutex<Vec<u64>>,
    has_ended: AtomicBool,
}

impl Team {
    /// The team of the process with this `comm`, which must have rank 0. All other processes must be in [`serve()`]. `placements` says
    /// where the processes run, by rank; it is shown in messages to the user.
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

    /// A team that consists of this process alone.
    pub fn alone() -> Arc<Self> {
        Self::lead(Arc::new(threads(1).swap_remove(0)), Vec::new())
    }

    /// The number of processes.
    pub fn size(&self) -> usize {
        self.comm.size()
    }

    /// Ends the team. The other processes leave [`serve()`]. Objects of the team must not be used afterwards.
    pub fn end(&self) {
        if !self.has_ended.swap(true, Ordering::SeqCst) {
            self.turn().tell(&Told::End);
            self.comm.close();
        }
    }

    /// The placement of each process, by rank. The list is empty if placements are unknown.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// A new object. No process holds a part of it yet.
    pub fn remote(self: &Arc<Self>) -> Remote {
        let mut next = lock(&self.next);
        *next += 1;
        Remote { team: Arc::clone(self), id: *next }
    }

    /// Waits until no other thread exchanges messages with the team. Then tells the other processes to drop the released objects.
    fn turn(&self) -> Turn<'_> {
        let turn = Turn { comm: &*self.comm, _alone: lock(&self.next) };
        for id in std::mem::take(&mut *lock(&self.released)) {
            turn.tell(&Told::Release(id));
        }
        turn
    }
}

impl fmt::Debug for Team {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Team").field("size", &self.size()).finish_non_exhaustive()
    }
}

impl Drop for Team {
    fn drop(&mut self) {
        self.end();
    }
}

/// An object of which each process of the team holds a part. When this handle has been dropped, the other processes drop their parts.
#[derive(Debug)]
pub struct Remote {
    team: Arc<Team>,
    id: u64,
}

impl Remote {
    /// The team that holds the object.
    pub fn team(&self) -> &Arc<Team> {
        &self.team
    }

    /// The object's number.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Sends a command about this object to the other processes. The caller and the other processes define the messages that follow. Other
    /// threads wait until the returned turn is dropped. A command that cannot be encoded gives [`Error::Team`].
    pub fn command(&self, command: &impl Serialize) -> Result<Turn<'_>> {
        let message = to_bytes(&Told::Command(self.id, command))?;
        let turn = self.team.turn();
        turn.send_all(&message);
        Ok(turn)
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        // A command may be in progress now, so the other processes learn of the release before the next command.
        lock(&self.team.released).push(self.id);
    }
}

/// The right of one thread of the leader to exchange messages with the other processes.
pub struct Turn<'a> {
    comm: &'a dyn Comm,
    _alone: MutexGuard<'a, u64>,
}

impl Turn<'_> {
    /// The connection to the other processes.
    pub fn comm(&self) -> &dyn Comm {
        self.comm
    }

    /// The ranks of the other processes.
    pub fn others(&self) -> std::ops::Range<usize> {
        1..self.comm.size()
    }

    /// Sends a message to all other processes.
    pub fn send_all(&self, message: &[u8]) {
        self.others().for_each(|rank| self.comm.send(rank, message));
    }

    /// Sends a message to all other processes. They receive it with [`Comm::broadcast`].
    pub fn broadcast(&self, message: &[u8]) {
        self.comm.broadcast(Some(message));
    }

    /// Receives a message from each other process, by rank.
    pub fn receive_all(&self) -> Vec<Vec<u8>> {
        self.others().map(|rank| self.comm.receive(rank)).collect()
    }

    /// The results that the other processes sent with [`answer`], by rank.
    pub fn answers<T: DeserializeOwned>(&self) -> Vec<Result<T>> {
        self.others().zip(self.receive_all()).map(|(rank, bytes)| read_answer(rank, &bytes)).collect()
    }

    fn tell(&self, told: &Told<()>) {
        // Numbers can always be encoded.
        self.send_all(&to_bytes(told).unwrap_or_default());
    }
}

/// A message from the leader to the other processes.
#[derive(Serialize, Deserialize)]
pub enum Told<C> {
    /// The team ends.
    End,
    /// The object with this number is no longer needed.
    Release(u64),
    /// A command about the object with this number.
    Command(u64, C),
}

/// Serves the leader, the process of rank 0, until the leader ends the team. `told` receives all other messages, and drops objects or
/// executes commands.
///
/// # Panics
/// If a message cannot be read, because the leader then waits for a reply that this process cannot give.
pub fn serve<C: DeserializeOwned>(comm: &dyn Comm, mut told: impl FnMut(Told<C>)) {
    loop {
        match from_bytes(&comm.receive(0)).expect("all processes run the same program") {
            Told::End => return,
            other => told(other),
        }
    }
}

/// Encodes a value for another process of the same program. A file name that is not UTF-8 gives [`Error::Team`].
pub fn to_bytes<T: Serialize>(value: &T) -> Result<Vec<u8>> {
    postcard::to_allocvec(value).map_err(|error| {
        Error::team(format!("something cannot be sent to the other processes: {error}"))
            .help("give file names in UTF-8")
    })
}

/// Decodes a value. Bytes that do not encode a value of this type give [`Error::Team`].
pub fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T> {
    postcard::from_bytes(bytes).map_err(|error| garbled(&error.to_string()))
}

pub(crate) fn garbled(why: &str) -> Error {
    Error::team(format!("a message of another process cannot be read ({why})"))
        .help("start the same program on every machine; if it is, this is a fault in krylux")
}

/// Sends the leader a value, or the reason why there is no value.
pub fn answer<T: Serialize>(comm: &dyn Comm, answer: std::result::Result<T, impl ToString>) {
    let answer = answer.map_err(|error| error.to_string());
    // An answer contains no file names, so encoding cannot fail here.
    comm.send(0, &to_bytes(&answer).unwrap_or_default());
}

/// Decodes the answer of process `rank`. The result is [`Error::Team`] if the process reports an error, or if the bytes are not an answer.
pub fn read_answer<T: DeserializeOwned>(rank: usize, bytes: &[u8]) -> Result<T> {
    let answer: std::result::Result<T, String> = from_bytes(bytes)?;
    answer.map_err(|why| {
        let (fault, help) =
            why.split_once("\n  help: ").unwrap_or((&why, "look at the machine that it runs on"));
        Error::team(format!("process {rank}: {fault}")).help(help)
    })
}

/// Takes the lock, even if a thread panicked while holding it. This is safe because the content is never left incomplete.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One member of a team of threads.
pub struct Threads {
    rank: usize,
    to: Vec<Sender<Vec<u8>>>,
    from: Vec<Mutex<Inbox>>,
}

/// Messages from one member. [`Comm::has_message`] moves messages to `waiting`, from which they are received later.
struct Inbox {
    receiver: Receiver<Vec<u8>>,
    waiting: VecDeque<Vec<u8>>,
}

/// A team of `count` threads: one [`Comm`] for each, by rank.
pub fn threads(count: usize) -> Vec<Threads> {
    let mut to: Vec<Vec<Sender<Vec<u8>>>> = (0..count).map(|_| Vec::new()).collect();
    let mut from: Vec<Vec<Mutex<Inbox>>> = (0..count).map(|_| Vec::new()).collect();
    for to in &mut to {
        for from in &mut from {
            let (sender, receiver) = channel();
            to.push(sender);
            from.push(Mutex::new(Inbox { receiver, waiting: VecDeque::new() }));
        }
    }
    to.into_iter().zip(from).enumerate().map(|(rank, (to, from))| Threads { rank, to, from }).collect()
}

impl Comm for Threads {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.to.len()
    }

    fn send(&self, to: usize, message: &[u8]) {
        // Sending fails only if the other member has ended. That member then needs no messages.
        let _ = self.to[to].send(message.to_vec());
    }

    /// # Panics
    /// If the other member has ended without sending a message, which means that it panicked.
    fn receive(&self, from: usize) -> Vec<u8> {
        let mut inbox = lock(&self.from[from]);
        match inbox.waiting.pop_front() {
            Some(message) => message,
            None => inbox.receiver.recv().expect("the threads of a team end together"),
        }
    }

    fn has_message(&self, from: usize) -> bool {
        let mut inbox = lock(&self.from[from]);
        let arrived: Vec<_> = inbox.receiver.try_iter().collect();
        inbox.waiting.extend(arrived);
        !inbox.waiting.is_empty()
    }

    fn exchange(&self, mut outgoing: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
        let own = std::mem::take(&mut outgoing[self.rank]);
        for (rank, message) in outgoing.into_iter().enumerate().filter(|(rank, _)| *rank != self.rank) {
            let _ = self.to[rank].send(message);
        }
        let receive = |rank| if rank == self.rank { Vec::new() } else { self.receive(rank) };
        let mut received: Vec<_> = (0..self.size()).map(receive).collect();
        received[self.rank] = own;
        received
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn each<T: Send + 'static>(size: usize, work: fn(&Threads) -> T) -> Vec<T> {
        let start = |comm| std::thread::spawn(move || work(&comm));
        let members: Vec<_> = threads(size).into_iter().map(start).collect();
        members.into_iter().map(|member| member.join().expect("no member panics")).collect()
    }

    #[test]
    fn each_member_gets_what_every_other_one_sent_to_it() {
        let sent = |comm: &Threads| comm.exchange((0..3).map(|to| vec![comm.rank() as u8, to]).collect());
        for (rank, found) in each(3, sent).into_iter().enumerate() {
            assert_eq!(found, (0..3).map(|from| vec![from, rank as u8]).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_broadcast_reaches_every_member_of_a_team_of_any_size() {
        for size in 1..10 {
            let all = each(size, |comm| comm.broadcast((comm.rank() == 0).then_some(&b"all"[..])));
            assert!(all.len() == size && all.iter().all(|found| found == b"all"), "{size}");
        }
    }

    #[test]
    fn a_message_that_was_looked_for_is_received_afterwards() {
        let mut both = threads(2);
        let other = both.pop().expect("there are two");
        assert!(!both[0].has_message(1));
        other.send(0, b"one");
        other.send(0, b"two");
        assert!(both[0].has_message(1));
        assert_eq!([both[0].receive(1), both[0].receive(1)], [b"one", b"two"]);
        assert!(!both[0].has_message(1));
    }

    #[test]
    fn the_others_do_what_the_leader_says_and_let_go_of_what_it_dropped() -> Result<()> {
        let mut all = threads(3).into_iter();
        let leader = all.next().expect("there are three");
        // Each member records the messages that it receives, and replies to a command with its rank.
        let work = |comm: Threads| {
            let mut notes = Vec::new();
            serve(&comm, |told: Told<String>| match told {
                Told::Command(id, command) => {
                    notes.push(format!("{id} {command}"));
                    comm.send(0, format!("{command}{}", comm.rank()).as_bytes());
                }
                Told::Release(id) => notes.push(format!("release {id}")),
                Told::End => {}
            });
            notes
        };
        let others: Vec<_> = all.map(|comm| std::thread::spawn(move || work(comm))).collect();
        let team = Team::lead(Arc::new(leader), Vec::new());
        let (first, second) = (team.remote(), team.remote());
        assert_eq!(first.command(&"a")?.receive_all(), [b"a1", b"a2"]);
        drop(first);
        assert_eq!(second.command(&"")?.receive_all(), [b"1", b"2"]);
        drop(second);
        assert_eq!(Arc::strong_count(&team), 1);
        drop(team);
        for other in others {
            let notes = other.join().expect("no member panics");
            assert_eq!(notes, ["1 a", "release 1", "2 ", "release 2"]);
        }
        Ok(())
    }
}
