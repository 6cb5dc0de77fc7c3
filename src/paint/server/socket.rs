//! The socket of one page.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use hyper::upgrade::Upgraded;
use hyper_util::rt::TokioIo;
use tokio::time::{Instant, interval, timeout};
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::protocol::{Role, WebSocketConfig};
use tokio_tungstenite::tungstenite::{Error as SocketError, Message};

use super::outbox::Parcel;
use super::{Shared, Sizes};
use crate::paint::message::{self, HEADER, Request};
use crate::paint::session::error_text;

/// How long a page may take to read what it is sent.
const WRITE_TIMEOUT: Duration = Duration::from_secs(10);

/// How often a page is asked whether it is still there, and how long it may be silent.
const PING: Duration = Duration::from_secs(20);
const SILENCE: Duration = Duration::from_secs(60);

/// Serves a page until it goes.
///
/// # Errors
/// Why it was dropped.
pub async fn serve(stream: TokioIo<Upgraded>, shared: &Arc<Shared>) -> Result<(), String> {
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

/// The largest message that a page has reason to send: a pattern, or a target with its weights as JSON.
fn most_bytes(sizes: Sizes) -> usize {
    // A number of a target in JSON takes at most 25 bytes.
    HEADER + 4096 + 25 * (sizes.channels + 1) * sizes.pixels
}

async fn talk(
    socket: &mut WebSocketStream<TokioIo<Upgraded>>,
    shared: &Shared,
    client: u64,
    arrived: &tokio::sync::Notify,
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

/// A page that just went is no fault.
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
    shared: &Shared,
    client: u64,
) -> Result<(), String> {
    let (number, request) = match message {
        Message::Binary(bytes) => message::read(&bytes, shared.sizes.channels, shared.sizes.pixels)?,
        Message::Text(text) => match serde_json::from_str::<message::Asked>(&text) {
            Ok(asked) => (asked.number, Request::Ask(asked)),
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
