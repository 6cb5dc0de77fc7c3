//! The server of the page, on the loopback interface: one page and one socket, behind an address that cannot be guessed.

mod connection;
mod guard;
mod outbox;
mod socket;

use std::cell::Cell;
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tokio::net::TcpListener;
use tokio::sync::Notify;

use super::mailbox::Mailbox;
use super::session::{Event, Session};
use crate::error::{Error, Result};
pub(super) use guard::Guard;
use outbox::Outboxes;

/// Connections at a time. A browser needs one or two for each page.
const MOST_CONNECTIONS: usize = 32;

/// How often the server looks whether to end.
const TICK: Duration = Duration::from_millis(100);

/// How a server is started.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// The interface and the port; port 0 is any free one.
    pub listen: SocketAddr,
    /// Without a message of any page for so long, the server ends.
    pub idle: Option<Duration>,
}

/// Why a server ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// It was told to.
    Stopped,
    /// No page was used for as long as [`ServeOptions::idle`] says.
    Idle,
}

/// What all connections share.
struct Shared {
    mailbox: Mailbox,
    outboxes: Outboxes,
    guard: Guard,
    page: super::page::Served,
    sizes: Sizes,
    clients: AtomicU64,
    /// Milliseconds from the start to the last message of a page.
    last_used: AtomicU64,
    start: Instant,
}

/// The place of a connection among those that are served at a time.
#[derive(Default)]
struct Place {
    /// Whether it has sent a request.
    has_asked: Cell<bool>,
    /// Notified when another connection takes the place.
    end: Notify,
}

/// Planes and pixels of patterns.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    channels: usize,
    pixels: usize,
}

impl Shared {
    fn used(&self) {
        self.last_used.store(self.start.elapsed().as_millis() as u64, Ordering::Relaxed);
    }

    fn idle_for(&self) -> Duration {
        self.start.elapsed().saturating_sub(Duration::from_millis(self.last_used.load(Ordering::Relaxed)))
    }
}

/// Serves the page until `go_on` says otherwise. `ready` is called with the page's address once it can be opened. Whatever a client sends,
/// the server goes on; what it refused is told to `note`.
///
/// # Errors
/// [`Error::Option`] naming `--listen` where the address cannot be had.
pub fn serve(
    session: &mut Session<'_>,
    options: &ServeOptions,
    ready: impl FnOnce(&str),
    go_on: impl FnMut() -> ControlFlow<()>,
    note: Arc<dyn Fn(&str) + Send + Sync>,
) -> Result<Ended> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|reason| no_listener(options.listen, &reason))?;
    let listener = runtime.block_on(TcpListener::bind(options.listen));
    let listener = listener.map_err(|reason| no_listener(options.listen, &reason))?;
    let address = listener.local_addr().map_err(|reason| no_listener(options.listen, &reason))?;
    let guard = Guard::new(address)?;
    let url = guard.url();
    let canvas = session.canvas();
    let shared = Arc::new(Shared {
        mailbox: Mailbox::default(),
        outboxes: Outboxes::default(),
        page: super::page::Served::new(canvas, guard.nonce())?,
        sizes: Sizes { channels: canvas.channels(), pixels: canvas.projector().pixels() },
        guard,
        clients: AtomicU64::new(0),
        last_used: AtomicU64::new(0),
        start: Instant::now(),
    });
    std::thread::scope(|scope| {
        let worker = std::thread::Builder::new().spawn_scoped(scope, || run_session(session, &shared));
        let no_thread = "the page needs a thread\n  help: raise the limit of processes (`ulimit -u`)";
        let worker = worker.map_err(|_| Error::Numerical(no_thread.into()))?;
        ready(&url);
        let ended = runtime.block_on(accept(listener, Arc::clone(&shared), options.idle, go_on, note));
        shared.mailbox.end();
        let joined = worker.join().map(|()| ended);
        joined.map_err(|_| Error::Numerical("the session of the page ended by a fault of the program".into()))
    })
}

/// Answers requests until the server ends.
fn run_session(session: &mut Session<'_>, shared: &Shared) {
    loop {
        let pending = shared.mailbox.take();
        if pending.is_over {
            return;
        }
        session.work(pending, &mut |event: Event| shared.outboxes.send(event));
    }
}

async fn accept(
    listener: TcpListener,
    shared: Arc<Shared>,
    idle: Option<Duration>,
    mut go_on: impl FnMut() -> ControlFlow<()>,
    note: Arc<dyn Fn(&str) + Send + Sync>,
) -> Ended {
    let mut places: VecDeque<Rc<Place>> = VecDeque::new();
    let local = tokio::task::LocalSet::new();
    local
        .run_until(async {
            let mut tick = tokio::time::interval(TICK);
            loop {
                tokio::select! {
                    accepted = listener.accept() => {
                        let Ok((stream, _)) = accepted else { continue };
                        places.retain(|place| Rc::strong_count(place) > 1);
                        if places.len() >= MOST_CONNECTIONS {
                            // The oldest connection without a request makes room.
                            let Some(silent) = places.iter().position(|place| !place.has_asked.get()) else {
                                note(&format!("refused a connection: {MOST_CONNECTIONS} are open already"));
                                tokio::task::spawn_local(connection::refuse(stream));
                                continue;
                            };
                            places.remove(silent).into_iter().for_each(|place| place.end.notify_one());
                        }
                        let (shared, note, place) = (Arc::clone(&shared), Arc::clone(&note), Rc::new(Place::default()));
                        places.push_back(Rc::clone(&place));
                        tokio::task::spawn_local(async move {
                            let ended = tokio::select! {
                                ended = connection::serve(stream, shared, &place) => ended,
                                () = place.end.notified() => Err("dropped a silent connection for another one".into()),
                            };
                            if let Err(why) = ended {
                                note(&why);
                            }
                        });
                    }
                    _ = tick.tick() => {
                        if go_on().is_break() {
                            return Ended::Stopped;
                        }
                        if idle.is_some_and(|idle| shared.idle_for() > idle) {
                            return Ended::Idle;
                        }
                    }
                }
            }
        })
        .await
}

fn no_listener(address: SocketAddr, reason: &std::io::Error) -> Error {
    Error::Option {
        option: "--listen".into(),
        fault: format!("{address} cannot be listened on: {reason}"),
        help: "give another port, or port 0 for any free one".into(),
    }
}
