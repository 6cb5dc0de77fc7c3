//! The requests of all pages, which wait for the session. Newer ones take the place of older ones, so that nothing queues up while a photo is
//! taken.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

use super::message::{Asked, Request};
use crate::analysis::planes::Planes;

/// Questions of one page that may wait. A page asks one after the other.
const MOST_QUESTIONS: usize = 4;

/// The number of a connection.
pub type Client = u64;

/// What waits.
#[derive(Debug, Default)]
pub struct Pending {
    /// Who changed the pattern last, with its number.
    pub author: Option<(Client, u32)>,
    /// A whole new pattern; the changes come after it.
    pub replace: Option<Planes>,
    /// The newest values of single pixels.
    pub changes: BTreeMap<u32, Vec<f32>>,
    /// Whether a stroke has ended.
    pub is_finished: bool,
    /// Another light.
    pub light: Option<usize>,
    /// The newest pixel that each page looks at, of the camera (`true`) or of the projector.
    pub looks: BTreeMap<(Client, bool), u32>,
    /// Questions in order.
    pub questions: VecDeque<(Client, Asked)>,
    /// Pages that have come and want to see what is there.
    pub newcomers: Vec<Client>,
    /// Whether to end.
    pub is_over: bool,
}

impl Pending {
    fn is_empty(&self) -> bool {
        self.author.is_none()
            && self.light.is_none()
            && self.looks.is_empty()
            && self.questions.is_empty()
            && self.newcomers.is_empty()
            && !self.is_over
    }
}

/// The requests that wait, and those who wait for them.
#[derive(Debug, Default)]
pub struct Mailbox {
    pending: Mutex<Pending>,
    arrived: Condvar,
}

impl Mailbox {
    /// Leaves a request.
    ///
    /// # Errors
    /// A page that has too many open questions is told so.
    pub fn put(&self, client: Client, number: u32, request: Request) -> Result<(), String> {
        let mut pending = self.lock();
        match request {
            Request::Change(changes) => {
                pending.changes.extend(changes);
                pending.author = Some((client, number));
            }
            Request::Replace(planes) => {
                pending.changes.clear();
                pending.replace = Some(planes);
                pending.author = Some((client, number));
            }
            Request::Finish => {
                pending.is_finished = true;
                pending.author = Some((client, number));
            }
            Request::Light(light) => pending.light = Some(light),
            Request::Column(pixel) => _ = pending.looks.insert((client, false), pixel),
            Request::Row(pixel) => _ = pending.looks.insert((client, true), pixel),
            Request::Ask(asked) => {
                let open = pending.questions.iter().filter(|(of, _)| *of == client).count();
                if open >= MOST_QUESTIONS {
                    return Err(format!("{open} questions are open already"));
                }
                pending.questions.push_back((client, asked));
            }
        }
        self.arrived.notify_one();
        Ok(())
    }

    /// Welcomes a page.
    pub fn welcome(&self, client: Client) {
        self.lock().newcomers.push(client);
        self.arrived.notify_one();
    }

    /// Forgets the requests that a page that has gone made for itself.
    pub fn forget(&self, client: Client) {
        let mut pending = self.lock();
        pending.looks.retain(|(of, _), _| *of != client);
        pending.questions.retain(|(of, _)| *of != client);
        pending.newcomers.retain(|of| *of != client);
    }

    /// Lets the session end.
    pub fn end(&self) {
        self.lock().is_over = true;
        self.arrived.notify_one();
    }

    /// Waits for requests and takes them. One question is taken at a time, so that strokes come in between.
    pub fn take(&self) -> Pending {
        let mut pending = self.lock();
        while pending.is_empty() {
            pending = self.arrived.wait(pending).unwrap_or_else(PoisonError::into_inner);
        }
        let first = pending.questions.len().min(1);
        let waiting = pending.questions.split_off(first);
        let taken = std::mem::take(&mut *pending);
        pending.questions = waiting;
        taken
    }

    fn lock(&self) -> MutexGuard<'_, Pending> {
        // Every change is whole: what a thread that panicked left is valid.
        self.pending.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
