//! A browser's connection, either for the page or for the page's socket.

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
use tokio_tungstenite::tungstenite::handshake::server::create_response_with_body;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error as SocketError, Message};

use super::message::{self, Client, HEADER, MessageKind, PageRequest};
use super::server::{Route, ServerState, Sizes, Slot};
use super::session::{Event, Recipients, error_text};

/// The time limit for a client to send its request.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);

/// The time limit for a client to read a page, or to open its socket.
const PAGE_TIMEOUT: Duration = Duration::from_secs(60);

const HEADER_BYTES: usize = 16 * 1024;

/// Tells a client that too many connections are open.
pub async fn refuse(mut stream: TcpStream) {
    const BUSY: &[u8] =
        b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 1\r\nConnection: close\r\n\r\n";
    // An error is ignored, since it does not matter whether the client reads this response.
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
        let answer = respond(&request, &shared);
        if answer.status() == StatusCode::SWITCHING_PROTOCOLS {
            // The channel has room for this one message, since each connection has at most one socket.
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

fn respond(request: &Request<Incoming>, shared: &ServerState) -> Response<Full<Bytes>> {
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
        // The opening handshake of a WebSocket (RFC 6455, section 4.2).
        Route::Socket => create_response_with_body(request, Full::default).unwrap_or_else(|_| {
            status(StatusCode::BAD_REQUEST, "a WebSocket of version 13 is expected here")
        }),
    }
}

fn page(shared: &ServerState) -> Response<Full<Bytes>> {
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{0}'; style-src 'nonce-{0}'; img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'",
        shared.guard.nonce()
    );
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::X_FRAME_OPTIONS, "DENY"),
        (header::CONTENT_SECURITY_POLICY, &policy),
    ];
    let mut answer = status(StatusCode::OK, shared.page.clone());
    answer.headers_mut().extend(
        headers.into_iter().filter_map(|(name, value)| Some((name, HeaderValue::from_str(value).ok()?))),
    );
    answer
}

fn status(status: StatusCode, content: impl Into<Bytes>) -> Response<Full<Bytes>> {
    let mut answer = Response::new(Full::new(content.into()));
    *answer.status_mut() = status;
    answer.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
    answer
}

fn text(headers: &HeaderMap, name: HeaderName) -> Option<&str> {
    headers.get(name)?.to_str().ok()
}

/// The time limit for a page to read a message.
const WRITE_TIMEOUT: Duration = Duration::from_secs(10);

/// The interval between pings of a page. A page that is silent for this time is dropped.
const PING: Duration = Duration::from_secs(20);
const SILENCE: Duration = Duration::from_secs(60);

/// Serves a page until it disconnects. `Err` is the reason why the server dropped the page.
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

/// The size of the largest valid message of a page: a pattern, or a target with its weights as JSON.
fn most_bytes(sizes: Sizes) -> usize {
    // A number in JSON takes at most 25 bytes.
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
                while let Some(message) = shared.outboxes.take(client) {
                    write(socket, message).await?;
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
        Err(why) => write(socket, Message::text(error_text(Some(number), &why))).await,
    }
}

async fn write(socket: &mut WebSocketStream<TokioIo<Upgraded>>, message: Message) -> Result<(), String> {
    match timeout(WRITE_TIMEOUT, socket.send(message)).await {
        Err(_) => Err(format!("it did not read for {} s", WRITE_TIMEOUT.as_secs())),
        Ok(Err(error)) => gone(&error),
        Ok(Ok(())) => Ok(()),
    }
}

/// The maximum number of answers and texts that wait for one page. When there are more, the oldest is dropped.
const MOST_WAITING: usize = 16;

/// Kinds of messages of which only the newest is kept. A page receives them in this order.
const NEWEST: [MessageKind; 4] =
    [MessageKind::Pattern, MessageKind::Photo, MessageKind::Column, MessageKind::Row];

#[derive(Debug, Default)]
struct Outbox {
    newest: [Option<Message>; NEWEST.len()],
    others: VecDeque<Message>,
    arrived: Arc<Notify>,
}

/// The messages that wait for each page. Only the newest photo is kept, so a slow page receives fewer photos and needs no more memory.
#[derive(Debug, Default)]
pub struct Outboxes(Mutex<BTreeMap<Client, Outbox>>);

impl Outboxes {
    /// Opens an outbox for a new page. The returned notifier signals each message that arrives.
    pub fn open(&self, client: Client) -> Arc<Notify> {
        let outbox = Outbox::default();
        let arrived = Arc::clone(&outbox.arrived);
        self.lock().insert(client, outbox);
        arrived
    }

    pub fn close(&self, client: Client) {
        self.lock().remove(&client);
    }

    /// Puts an event into the outboxes of its recipients.
    pub fn send(&self, Event { to, kind, message }: Event) {
        let slot = NEWEST.iter().position(|of| *of == kind);
        for (client, outbox) in self.lock().iter_mut() {
            let is_meant = match to {
                Recipients::AllBut(author) => author != Some(*client),
                Recipients::Only(one) => one == *client,
            };
            if !is_meant {
                continue;
            }
            match slot {
                Some(slot) => outbox.newest[slot] = Some(message.clone()),
                None => {
                    if outbox.others.len() == MOST_WAITING {
                        outbox.others.pop_front();
                    }
                    outbox.others.push_back(message.clone());
                }
            }
            outbox.arrived.notify_one();
        }
    }

    pub fn take(&self, client: Client) -> Option<Message> {
        let mut outboxes = self.lock();
        let outbox = outboxes.get_mut(&client)?;
        outbox.newest.iter_mut().find_map(Option::take).or_else(|| outbox.others.pop_front())
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<Client, Outbox>> {
        // The data is valid even if a thread panicked, since every change is complete.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
