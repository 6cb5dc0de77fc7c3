//! What waits to be sent to each page. Of photos only the newest is kept, so that a slow page gets fewer photos and needs no more memory.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

use crate::paint::mailbox::Client;
use crate::paint::message::Kind;
use crate::paint::session::Event;

/// Answers and texts that may wait for one page; the oldest are dropped.
const MOST_WAITING: usize = 16;

/// Something to send.
#[derive(Clone, Debug)]
pub enum Parcel {
    /// Bytes, which several pages share.
    Bytes(Arc<Vec<u8>>),
    /// JSON.
    Text(String),
}

/// What waits for one page.
#[derive(Debug, Default)]
struct Outbox {
    pattern: Option<Parcel>,
    photo: Option<Parcel>,
    column: Option<Parcel>,
    row: Option<Parcel>,
    others: VecDeque<Parcel>,
    arrived: Arc<Notify>,
}

/// What waits for all pages.
#[derive(Debug, Default)]
pub struct Outboxes(Mutex<BTreeMap<Client, Outbox>>);

impl Outboxes {
    /// Opens one for a new page; it is told when something has come.
    pub fn open(&self, client: Client) -> Arc<Notify> {
        let outbox = Outbox::default();
        let arrived = Arc::clone(&outbox.arrived);
        self.lock().insert(client, outbox);
        arrived
    }

    /// Closes that of a page that has gone.
    pub fn close(&self, client: Client) {
        self.lock().remove(&client);
    }

    /// Leaves an event for whom it is.
    pub fn send(&self, event: Event) {
        let mut outboxes = self.lock();
        match event {
            Event::Photo(bytes) => {
                let parcel = Parcel::Bytes(Arc::new(bytes));
                outboxes.values_mut().for_each(|outbox| outbox.photo = Some(parcel.clone()));
            }
            Event::Pattern(author, bytes) => {
                let parcel = Parcel::Bytes(Arc::new(bytes));
                let others = outboxes.iter_mut().filter(|(client, _)| Some(**client) != author);
                others.for_each(|(_, outbox)| outbox.pattern = Some(parcel.clone()));
            }
            Event::Look(client, kind, bytes) => {
                if let Some(outbox) = outboxes.get_mut(&client) {
                    let slot = if kind == Kind::Row { &mut outbox.row } else { &mut outbox.column };
                    *slot = Some(Parcel::Bytes(Arc::new(bytes)));
                }
            }
            Event::Answer(client, bytes) => queue(&mut outboxes, client, Parcel::Bytes(Arc::new(bytes))),
            Event::Text(client, text) => queue(&mut outboxes, client, Parcel::Text(text)),
        }
        outboxes.values().for_each(|outbox| outbox.arrived.notify_one());
    }

    /// Takes the next parcel of a page.
    pub fn take(&self, client: Client) -> Option<Parcel> {
        let mut outboxes = self.lock();
        let outbox = outboxes.get_mut(&client)?;
        let newest = [&mut outbox.pattern, &mut outbox.photo, &mut outbox.column, &mut outbox.row];
        let newest = newest.into_iter().find_map(Option::take);
        newest.or_else(|| outbox.others.pop_front())
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Client, Outbox>> {
        // Every change is whole: what a thread that panicked left is valid.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn queue(outboxes: &mut BTreeMap<Client, Outbox>, client: Client, parcel: Parcel) {
    let Some(outbox) = outboxes.get_mut(&client) else { return };
    if outbox.others.len() == MOST_WAITING {
        outbox.others.pop_front();
    }
    outbox.others.push_back(parcel);
}
