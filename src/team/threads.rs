//! A team of threads of one process, for several devices of one machine, and for tests.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};

use super::Comm;

/// One member of a team of threads.
pub struct Threads {
    rank: usize,
    /// To each member.
    to: Vec<Sender<Vec<u8>>>,
    /// From each member.
    from: Vec<Mutex<Inbox>>,
}

/// Messages from one member, with those that were looked at and not taken yet.
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
        // A member that has ended needs no messages.
        let _ = self.to[to].send(message.to_vec());
    }

    /// # Panics
    /// Where the other member has ended without an answer, so that it panicked itself.
    fn receive(&self, from: usize) -> Vec<u8> {
        let mut inbox = self.from[from].lock().unwrap_or_else(PoisonError::into_inner);
        match inbox.waiting.pop_front() {
            Some(message) => message,
            None => inbox.receiver.recv().expect("the threads of a team end together"),
        }
    }

    fn has_message(&self, from: usize) -> bool {
        let mut inbox = self.from[from].lock().unwrap_or_else(PoisonError::into_inner);
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

    #[test]
    fn each_member_gets_what_every_other_one_sent_to_it() {
        let members: Vec<_> = threads(3)
            .into_iter()
            .map(|comm| {
                std::thread::spawn(move || {
                    let mine = comm.rank() as u8;
                    comm.exchange((0..3).map(|to| vec![mine, to]).collect())
                })
            })
            .collect();
        for (rank, member) in members.into_iter().enumerate() {
            let found = member.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            assert_eq!(found, (0..3).map(|from| vec![from, rank as u8]).collect::<Vec<_>>());
        }
    }

    #[test]
    fn a_broadcast_reaches_every_member_of_a_team_of_any_size() {
        for size in 1..10 {
            let members: Vec<_> = threads(size)
                .into_iter()
                .map(|comm| {
                    std::thread::spawn(move || {
                        let message = (comm.rank() == 0).then_some(&b"all"[..]);
                        comm.broadcast(message)
                    })
                })
                .collect();
            for member in members {
                let found = member.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                assert_eq!(found, b"all", "{size}");
            }
        }
    }

    #[test]
    fn a_message_that_was_looked_for_is_received_afterwards() {
        let mut both = threads(2);
        let other = both.pop().unwrap_or_else(|| unreachable!("there are two"));
        assert!(!both[0].has_message(1));
        other.send(0, b"one");
        other.send(0, b"two");
        assert!(both[0].has_message(1));
        assert_eq!([both[0].receive(1), both[0].receive(1)], [b"one", b"two"]);
        assert!(!both[0].has_message(1));
    }
}
