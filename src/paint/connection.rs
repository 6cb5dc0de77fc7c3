//! One connection of a browser: for the page, or for the page's socket.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
use hyper::upgrade::Upgraded;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio::sync::Notify;
use tokio::time::{Instant, interval, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error as SocketError, Message};

use super::message;
use super::message::{Client, HEADER, MessageKind, PageRequest};
use super::server::{Route, ServerState, Sizes, Slot};
use super::session::{Event, error_text};

/// The time that a client has to send its request.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);

/// The time that a client has to read a page, or to open its socket.
const PAGE_TIMEOUT: Duration = Duration::from_secs(60);

const HEADER_BYTES: usize = 16 * 1024;

/// Answers a client that too many connections are open.
pub async fn refuse(mut stream: TcpStream) {
    const BUSY: &[u8] =
        b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 1\r\nConnection: close\r\n\r\n";
    // It does not matter whether the client reads the answer.
    let _ = timeout(Duration::from_secs(1), stream.write_all(BUSY)).await;
}

pub(super) async fn serve_connection(
    stream: TcpStream,
    shared: Arc<ServerState>,
    place: &Slot,
) -> Result<(), String> {
    // Small photos are sent at once, without waiting for more data.
    let _ = stream.set_nodelay(true);
    let (opened, mut upgraded) = tokio::sync::mpsc::channel::<hyper::upgrade::OnUpgrade>(1);
    let service = hyper::service::service_fn(|mut request: Request<Incoming>| {
        place.has_asked.set(true);
        let answer = respond(&mut request, &shared);
        if answer.status() == StatusCode::SWITCHING_PROTOCOLS {
            // This cannot be full: each connection has one socket.
            let _ = opened.try_send(hyper::upgrade::on(&mut request));
        }
        async move { Ok::<_, std::convert::Infallible>(answer) }
    });
    let mut http = hyper::server::conn::http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEADER_TIMEOUT).max_buf_size(HEADER_BYTES);
    let served = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
    let served = timeout(PAGE_TIMEOUT, served).await;
    match upgraded.try_recv() {
        Ok(upgrade) => {
            let stream =
                upgrade.await.map_err(|error| format!("dropped a socket that was not opened: {error}"))?;
            serve_socket(TokioIo::new(stream), &shared).await
        }
        Err(_) => match served {
            Err(_) => Err(format!("dropped a connection: no request within {} s", PAGE_TIMEOUT.as_secs())),
            Ok(Err(error)) if error.is_timeout() => {
                Err(format!("dropped a connection: no request within {} s", HEADER_TIMEOUT.as_secs()))
            }
            Ok(Err(error)) if error.is_parse() => Err(format!("dropped a connection: {error}")),
            Ok(_) => Ok(()),
        },
    }
}

fn respond(request: &mut Request<Incoming>, shared: &ServerState) -> Response<Full<Bytes>> {
    let headers = request.headers();
    let host = text(headers, header::HOST).unwrap_or_default();
    let place = match shared.guard.route(request.uri().path()) {
        Some(place) if shared.guard.knows_host(host) => place,
        Some(_) => return status(StatusCode::FORBIDDEN, "this server is not asked by that name"),
        None => {
            return status(
                StatusCode::NOT_FOUND,
                "nothing is served here; open the address that krylux printed",
            );
        }
    };
    match place {
        _ if request.method() != Method::GET => {
            status(StatusCode::METHOD_NOT_ALLOWED, "only GET is answered")
        }
        Route::Page => {
            shared.used();
            page(shared)
        }
        Route::Socket if !shared.guard.knows_origin(text(headers, header::ORIGIN), host) => {
            status(StatusCode::FORBIDDEN, "the socket is for the page of this server only")
        }
        Route::Socket => upgrade(headers),
    }
}

fn page(shared: &ServerState) -> Response<Full<Bytes>> {
    let mut answer = Response::new(Full::new(shared.page.clone()));
    let headers = answer.headers_mut();
    headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::X_FRAME_OPTIONS, HeaderValue::from_static("DENY"));
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{0}'; style-src 'nonce-{0}'; img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'",
        shared.guard.nonce()
    );
    if let Ok(policy) = HeaderValue::from_str(&policy) {
        headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    }
    answer
}

/// Answers the opening handshake of a WebSocket (RFC 6455, section 4.2).
fn upgrade(headers: &HeaderMap) -> Response<Full<Bytes>> {
    let has = |name: HeaderName, token: &str| {
        text(headers, name)
            .is_some_and(|value| value.split(',').any(|part| part.trim().eq_ignore_ascii_case(token)))
    };
    let key = headers.get(header::SEC_WEBSOCKET_KEY);
    let is_socket = has(header::UPGRADE, "websocket")
        && has(header::CONNECTION, "upgrade")
        && text(headers, header::SEC_WEBSOCKET_VERSION) == Some("13");
    let (true, Some(key)) = (is_socket, key) else {
        return status(StatusCode::BAD_REQUEST, "a WebSocket of version 13 is expected here");
    };
    let mut answer = Response::new(Full::default());
    *answer.status_mut() = StatusCode::SWITCHING_PROTOCOLS;
    let headers = answer.headers_mut();
    headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
    headers.insert(header::CONNECTION, HeaderValue::from_static("upgrade"));
    if let Ok(accept) = HeaderValue::from_str(&derive_accept_key(key.as_bytes())) {
        headers.insert(header::SEC_WEBSOCKET_ACCEPT, accept);
    }
    answer
}

fn status(status: StatusCode, why: &'static str) -> Response<Full<Bytes>> {
    let mut answer = Response::new(Full::from(why));
    *answer.status_mut() = status;
    answer.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    answer
}

fn text(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// The time that a page has to read a message.
const WRITE_TIMEOUT: Duration = Duration::from_secs(10);

/// The interval at which a page is asked whether it is still there, and the longest time that it may be silent.
const PING: Duration = Duration::from_secs(20);
const SILENCE: Duration = Duration::from_secs(60);

/// Serves a page until it leaves. `Err` is the reason why the page was dropped.
pub async fn serve_socket(stream: TokioIo<Upgraded>, shared: &Arc<ServerState>) -> Result<(), String> {
    let most = most_bytes(shared.sizes);
    let limits = WebSocketConfig::default()
        .max_message_size(Some(most))
        .max_frame_size(Some(most))
        .max_write_buffer_size(16 * most + (1 << 20));
    let mut socket = WebSocketStream::from_raw_socket(stream, Role::Server, Some(limits)).await;
    let client = shared.clients.fetch_add(1, Ordering::Relaxed) + 1;
    let arrived = shared.outboxes.open(client);
    shared.mailbox.welcome(client);
    let ended = talk(&mut socket, shared, client, &arrived).await;
    shared.outboxes.close(client);
    shared.mailbox.forget(client);
    let _ = timeout(Duration::from_secs(1), socket.close(None)).await;
    ended.map_err(|why| format!("dropped page {client}: {why}"))
}

/// The largest valid message of a page: a pattern, or a target with its weights as JSON.
fn most_bytes(sizes: Sizes) -> usize {
    // A number of a target in JSON takes at most 25 bytes.
    HEADER + 4096 + 25 * (sizes.channels + 1) * sizes.pixels
}

async fn talk(
    socket: &mut WebSocketStream<TokioIo<Upgraded>>,
    shared: &ServerState,
    client: u64,
    arrived: &Notify,
) -> Result<(), String> {
    let mut ping = interval(PING);
    let mut heard = Instant::now();
    loop {
        tokio::select! {
            message = socket.next() => {
                heard = Instant::now();
                match message {
                    None | Some(Ok(Message::Close(_))) => return Ok(()),
                    Some(Ok(message)) => hear(message, socket, shared, client).await?,
                    Some(Err(error)) => return gone(&error),
                }
            }
            () = arrived.notified() => {
                while let Some(parcel) = shared.outboxes.take(client) {
                    send(socket, parcel).await?;
                }
            }
            _ = ping.tick() => {
                if heard.elapsed() > SILENCE {
                    return Err(format!("nothing was heard for {} s", SILENCE.as_secs()));
                }
                write(socket, Message::Ping(Vec::new().into())).await?;
            }
        }
    }
}

fn gone(error: &SocketError) -> Result<(), String> {
    use tokio_tungstenite::tungstenite::error::ProtocolError;
    match error {
        SocketError::ConnectionClosed
        | SocketError::AlreadyClosed
        | SocketError::Io(_)
        | SocketError::Protocol(ProtocolError::ResetWithoutClosingHandshake) => Ok(()),
        error => Err(error.to_string()),
    }
}

async fn hear(
    message: Message,
    socket: &mut WebSocketStream<TokioIo<Upgraded>>,
    shared: &ServerState,
    client: u64,
) -> Result<(), String> {
    let (number, request) = match message {
        Message::Binary(bytes) => message::read(&bytes, shared.sizes.channels, shared.sizes.pixels)?,
        Message::Text(text) => match serde_json::from_str::<message::NumberedQuestion>(&text) {
            Ok(asked) => (asked.number, PageRequest::Ask(asked)),
            Err(error) => return Err(format!("a question that cannot be read: {error}")),
        },
        _ => return Ok(()),
    };
    shared.used();
    match shared.mailbox.put(client, number, request) {
        Ok(()) => Ok(()),
        Err(why) => send(socket, Parcel::Text(error_text(Some(number), &why))).await,
    }
}

async fn send(socket: &mut WebSocketStream<TokioIo<Upgraded>>, parcel: Parcel) -> Result<(), String> {
    let message = match parcel {
        Parcel::Bytes(bytes) => Message::Binary(bytes.to_vec().into()),
        Parcel::Text(text) => Message::Text(text.into()),
    };
    write(socket, message).await
}

async fn write(socket: &mut WebSocketStream<TokioIo<Upgraded>>, message: Message) -> Result<(), String> {
    match timeout(WRITE_TIMEOUT, socket.send(message)).await {
        Err(_) => Err(format!("it did not read for {} s", WRITE_TIMEOUT.as_secs())),
        Ok(Err(error)) => gone(&error),
        Ok(Ok(())) => Ok(()),
    }
}

/// The number of answers and texts that may wait for one page. The oldest are dropped.
const MOST_WAITING: usize = 16;

#[derive(Clone, Debug)]
pub enum Parcel {
    /// Bytes, which several pages share.
    Bytes(Arc<Vec<u8>>),
    Text(String),
}

#[derive(Debug, Default)]
struct Outbox {
    pattern: Option<Parcel>,
    photo: Option<Parcel>,
    column: Option<Parcel>,
    row: Option<Parcel>,
    others: VecDeque<Parcel>,
    arrived: Arc<Notify>,
}

/// The parcels that wait for each page. Only the newest photo is kept, so a slow page gets fewer photos and needs no more memory.
#[derive(Debug, Default)]
pub struct Outboxes(Mutex<BTreeMap<Client, Outbox>>);

impl Outboxes {
    /// Opens an outbox for a new page. The result is notified when a parcel has arrived.
    pub fn open(&self, client: Client) -> Arc<Notify> {
        let outbox = Outbox::default();
        let arrived = Arc::clone(&outbox.arrived);
        self.lock().insert(client, outbox);
        arrived
    }

    pub fn close(&self, client: Client) {
        self.lock().remove(&client);
    }

    /// Puts an event into the outboxes of the pages that should get it.
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
                    let slot = if kind == MessageKind::Row { &mut outbox.row } else { &mut outbox.column };
                    *slot = Some(Parcel::Bytes(Arc::new(bytes)));
                }
            }
            Event::Answer(client, bytes) => queue(&mut outboxes, client, Parcel::Bytes(Arc::new(bytes))),
            Event::Text(client, text) => queue(&mut outboxes, client, Parcel::Text(text)),
        }
        outboxes.values().for_each(|outbox| outbox.arrived.notify_one());
    }

    pub fn take(&self, client: Client) -> Option<Parcel> {
        let mut outboxes = self.lock();
        let outbox = outboxes.get_mut(&client)?;
        let newest = [&mut outbox.pattern, &mut outbox.photo, &mut outbox.column, &mut outbox.row];
        let newest = newest.into_iter().find_map(Option::take);
        newest.or_else(|| outbox.others.pop_front())
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Client, Outbox>> {
        // Every change is complete, so the data is valid even if a thread panicked.
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
