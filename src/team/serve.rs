//! The other processes of a team: they wait for commands of the leader.

use super::Comm;

/// What the leader tells the others.
pub(super) enum Envelope<'a> {
    /// The team's work is done.
    End,
    /// The object of this number is no longer needed.
    Release(u64),
    /// A command about the object of this number.
    Command(u64, &'a [u8]),
}

/// Kinds of envelopes, their first byte.
const END: u8 = 0;
const RELEASE: u8 = 1;
const COMMAND: u8 = 2;

impl<'a> Envelope<'a> {
    /// A byte for the kind, eight for the number of the object, and the command.
    pub(super) fn to_bytes(&self) -> Vec<u8> {
        let (kind, id, command): (u8, u64, &[u8]) = match *self {
            Self::End => (END, 0, &[]),
            Self::Release(id) => (RELEASE, id, &[]),
            Self::Command(id, command) => (COMMAND, id, command),
        };
        [&[kind][..], &id.to_le_bytes(), command].concat()
    }

    /// `None` for bytes that are no envelope.
    fn read(bytes: &'a [u8]) -> Option<Self> {
        let (&kind, rest) = bytes.split_first()?;
        let (id, command) = rest.split_first_chunk()?;
        let id = u64::from_le_bytes(*id);
        match kind {
            END => Some(Self::End),
            RELEASE => Some(Self::Release(id)),
            COMMAND => Some(Self::Command(id, command)),
            _ => None,
        }
    }
}

/// What a process does for the leader.
pub trait Worker {
    /// Does what `command` says of the object of number `id`. It may ask the leader and the others by `comm`, as the command has it.
    fn command(&mut self, comm: &dyn Comm, id: u64, command: &[u8]);

    /// Lets go of an object, if it has it.
    fn release(&mut self, id: u64);
}

/// Serves the leader, rank 0, until it ends the team.
pub fn serve(comm: &dyn Comm, worker: &mut dyn Worker) {
    loop {
        let message = comm.receive(0);
        match Envelope::read(&message) {
            // Something else is a fault that leaves nothing to be done.
            Some(Envelope::End) | None => return,
            Some(Envelope::Release(id)) => worker.release(id),
            Some(Envelope::Command(id, command)) => worker.command(comm, id, command),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::{Team, threads};
    use super::*;

    /// It notes what it was told, and returns a command's bytes with its rank.
    #[derive(Default)]
    struct Notes(Vec<String>);

    impl Worker for Notes {
        fn command(&mut self, comm: &dyn Comm, id: u64, command: &[u8]) {
            self.0.push(format!("{id} {}", String::from_utf8_lossy(command)));
            comm.send(0, &[command, &[comm.rank() as u8]].concat());
        }

        fn release(&mut self, id: u64) {
            self.0.push(format!("release {id}"));
        }
    }

    #[test]
    fn the_others_do_what_the_leader_says_and_let_go_of_what_it_dropped() {
        let mut all = threads(3).into_iter();
        let leader = all.next().unwrap_or_else(|| unreachable!("there are three"));
        let others: Vec<_> = all
            .map(|comm| {
                std::thread::spawn(move || {
                    let mut notes = Notes::default();
                    serve(&comm, &mut notes);
                    notes.0
                })
            })
            .collect();
        let team = Team::lead(Arc::new(leader), Vec::new());
        let first = team.remote();
        let second = team.remote();
        assert_eq!(first.command(b"a").receive_all(), [vec![b'a', 1], vec![b'a', 2]]);
        drop(first);
        assert_eq!(second.command(b"").receive_all(), [vec![1], vec![2]]);
        drop(second);
        assert_eq!(Arc::strong_count(&team), 1);
        drop(team);
        for other in others {
            let notes = other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            assert_eq!(notes, ["1 a", "release 1", "2 ", "release 2"]);
        }
    }
}
