//! The server of the page on the loopback interface. It provides one page and one socket, at an address that cannot be guessed.

use std::cell::Cell;
use std::collections::VecDeque;
use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use hyper::body::Bytes;
use tokio::net::TcpListener;
use tokio::sync::Notify;

use super::connection;
use super::connection::Outboxes;
use super::message::Mailbox;
use super::page::served;
use super::session::{Event, Session};
use crate::error::{Error, Result};

/// The maximum number of open connections. A browser needs one or two for each page.
const MOST_CONNECTIONS: usize = 32;

/// The interval at which the server checks whether it must end.
const TICK: Duration = Duration::from_millis(100);

/// Options of a server.
#[derive(Clone, Debug)]
pub struct ServeOptions {
    /// The interface and the port. Port 0 means any free port.
    pub listen: SocketAddr,
    /// The server ends if no page sends a message for this time.
    pub idle: Option<Duration>,
}

/// The reason why a server ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The caller's `go_on` stopped the server.
    Stopped,
    /// No page was used for the time [`ServeOptions::idle`].
    Idle,
}

pub(super) struct ServerState {
    pub(super) mailbox: Mailbox,
    pub(super) outboxes: Outboxes,
    pub(super) guard: Guard,
    pub(super) page: Bytes,
    pub(super) sizes: Sizes,
    pub(super) clients: AtomicU64,
    /// The time of the last message from a page, in milliseconds since the start.
    last_used: AtomicU64,
    pub(super) start: Instant,
}

/// One of the `MOST_CONNECTIONS` slots for connections.
#[derive(Default)]
pub(super) struct Slot {
    pub(super) has_asked: Cell<bool>,
    /// Notified when another connection takes over the slot.
    end: Notify,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub(super) channels: usize,
    pub(super) pixels: usize,
}

impl ServerState {
    pub(super) fn used(&self) {
        self.last_used.store(self.start.elapsed().as_millis() as u64, Ordering::Relaxed);
    }

    fn idle_for(&self) -> Duration {
        self.start.elapsed().saturating_sub(Duration::from_millis(self.last_used.load(Ordering::Relaxed)))
    }
}

/// Serves the page until `go_on` breaks. When the page can be opened, `ready` is called with its address. The server survives any message
/// of a client, and reports to `note` which messages it refuses.
///
/// # Errors
/// [`Error::Option`] naming `--listen` when the server cannot listen on the address.
pub fn serve(
    session: &mut Session<'_>,
    options: &ServeOptions,
    ready: impl FnOnce(&str),
    go_on: impl FnMut() -> ControlFlow<()>,
    note: Arc<dyn Fn(&str) + Send + Sync>,
) -> Result<Ended> {
    let no_listener = |reason: std::io::Error| {
        Error::option("--listen", format!("{} cannot be listened on: {reason}", options.listen))
            .help("give another port, or port 0 for any free one")
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(no_listener)?;
    let listener = runtime.block_on(TcpListener::bind(options.listen)).map_err(no_listener)?;
    let address = listener.local_addr().map_err(no_listener)?;
    let guard = Guard::new(address)?;
    let url = guard.url();
    let canvas = session.canvas();
    let shared = Arc::new(ServerState {
        mailbox: Mailbox::default(),
        outboxes: Outboxes::default(),
        page: Bytes::from(served(canvas, guard.nonce())?),
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

fn run_session(session: &mut Session<'_>, shared: &ServerState) {
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
    shared: Arc<ServerState>,
    idle: Option<Duration>,
    mut go_on: impl FnMut() -> ControlFlow<()>,
    note: Arc<dyn Fn(&str) + Send + Sync>,
) -> Ended {
    let mut places: VecDeque<Rc<Slot>> = VecDeque::new();
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
                            // A new connection takes over the slot of the oldest connection that has sent no request.
                            let Some(silent) = places.iter().position(|place| !place.has_asked.get()) else {
                                note(&format!("refused a connection: {MOST_CONNECTIONS} are open already"));
                                tokio::task::spawn_local(connection::refuse(stream));
                                continue;
                            };
                            places.remove(silent).into_iter().for_each(|place| place.end.notify_one());
                        }
                        let (shared, note, place) = (Arc::clone(&shared), Arc::clone(&note), Rc::new(Slot::default()));
                        places.push_back(Rc::clone(&place));
                        tokio::task::spawn_local(async move {
                            let ended = tokio::select! {
                                ended = connection::serve_connection(stream, shared, &place) => ended,
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

/// The length of a token in bytes. It is long enough that the token cannot be guessed.
const TOKEN_BYTES: usize = 16;

/// The secret address of the page.
#[derive(Clone, Debug)]
pub struct Guard {
    address: SocketAddr,
    token: String,
    nonce: String,
}

/// The two paths of the server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Route {
    Page,
    Socket,
}

impl Guard {
    /// A new token for a server at this address.
    ///
    /// # Errors
    /// [`Error::Numerical`] when the system has no random numbers.
    pub fn new(address: SocketAddr) -> Result<Self> {
        Ok(Self { address, token: random()?, nonce: random()? })
    }

    /// The URL to open.
    pub fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// The nonce of the scripts that the page may run.
    pub fn nonce(&self) -> &str {
        &self.nonce
    }

    /// The route of a path; `None` for a wrong token.
    pub fn route(&self, path: &str) -> Option<Route> {
        let (token, rest) = path.strip_prefix('/')?.split_once('/')?;
        // The comparison always includes all bytes, so its time reveals nothing about the token.
        let differs = token.bytes().zip(self.token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
        if token.len() != self.token.len() || differs != 0 {
            return None;
        }
        match rest {
            "" => Some(Route::Page),
            "socket" => Some(Route::Socket),
            _ => None,
        }
    }

    /// Whether a request names this machine or the listening address as its host. Otherwise, a foreign page may have made the name of its
    /// host resolve to this machine.
    pub fn knows_host(&self, host: &str) -> bool {
        let name =
            host.rsplit_once(':').map_or(host, |(name, port)| if port.ends_with(']') { host } else { name });
        let name = name.trim_start_matches('[').trim_end_matches(']');
        let is_here = name.parse::<std::net::IpAddr>().is_ok_and(|ip| {
            ip.is_loopback() || ip == self.address.ip() || self.address.ip().is_unspecified()
        });
        is_here || name.eq_ignore_ascii_case("localhost")
    }

    /// Whether a page of this server opened the socket. In this case, the origin equals the requested host.
    pub fn knows_origin(&self, origin: Option<&str>, host: &str) -> bool {
        origin
            .and_then(|origin| origin.strip_prefix("http://"))
            .is_some_and(|from| from.eq_ignore_ascii_case(host))
    }
}

fn random() -> Result<String> {
    let mut bytes = [0; TOKEN_BYTES];
    getrandom::fill(&mut bytes).map_err(|error| {
        Error::Numerical(format!("the system has no random numbers for a token: {error}"))
    })?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_token_opens_the_page_and_only_its_own_page_the_socket() -> Result<()> {
        let guard = Guard::new(SocketAddr::from(([127, 0, 0, 1], 8123)))?;
        let url = guard.url();
        let path = url.strip_prefix("http://127.0.0.1:8123").unwrap_or_default();
        assert_eq!(guard.route(path), Some(Route::Page));
        assert_eq!(guard.route(&format!("{path}socket")), Some(Route::Socket));
        for wrong in ["/", "", "/token/", "/0123/socket", &path[..path.len() - 2], &format!("{path}run.json")]
        {
            assert_eq!(guard.route(wrong), None, "{wrong}");
        }
        let hosts = ["127.0.0.1:8123", "localhost:9000", "[::1]:9000", "localhost"];
        assert!(hosts.iter().all(|host| guard.knows_host(host)));
        assert!(!guard.knows_host("evil.example:8123") && !guard.knows_host("192.168.1.7:8123"));
        assert!(guard.knows_origin(Some("http://localhost:9000"), "localhost:9000"));
        for origin in [None, Some("null"), Some("http://evil.example"), Some("https://localhost:9000")] {
            assert!(!guard.knows_origin(origin, "localhost:9000"), "{origin:?}");
        }
        assert_ne!(guard.token, Guard::new(guard.address)?.token);
        Ok(())
    }
}
