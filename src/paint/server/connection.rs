//! One connection: the page, or the socket of a page.

use std::sync::Arc;
use std::time::Duration;

use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{self, HeaderMap, HeaderName, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite::handshake::derive_accept_key;

use super::guard::Place;
use super::{Shared, socket};

/// How long a client may take to send its request.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);

/// How long a client may take to read a page, or to open its socket.
const PAGE_TIMEOUT: Duration = Duration::from_secs(60);

/// The most bytes of a request's headers.
const HEADER_BYTES: usize = 16 * 1024;

/// Tells a client that there is no room.
pub async fn refuse(mut stream: TcpStream) {
    const BUSY: &[u8] =
        b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 1\r\nConnection: close\r\n\r\n";
    // A client that does not listen is none of our business.
    let _ = tokio::time::timeout(Duration::from_secs(1), stream.write_all(BUSY)).await;
}

/// Serves one connection to its end.
///
/// # Errors
/// Why it was dropped, where that is worth a note.
pub(super) async fn serve(
    stream: TcpStream,
    shared: Arc<Shared>,
    place: &super::Place,
) -> Result<(), String> {
    // Small photos should not wait for more.
    let _ = stream.set_nodelay(true);
    let (opened, mut upgraded) = tokio::sync::mpsc::channel::<hyper::upgrade::OnUpgrade>(1);
    let service = hyper::service::service_fn(|mut request: Request<Incoming>| {
        place.has_asked.set(true);
        let answer = respond(&mut request, &shared);
        if answer.status() == StatusCode::SWITCHING_PROTOCOLS {
            // One socket for each connection, so that there is room.
            let _ = opened.try_send(hyper::upgrade::on(&mut request));
        }
        async move { Ok::<_, std::convert::Infallible>(answer) }
    });
    let mut http = hyper::server::conn::http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEADER_TIMEOUT).max_buf_size(HEADER_BYTES);
    let served = http.serve_connection(TokioIo::new(stream), service).with_upgrades();
    let served = tokio::time::timeout(PAGE_TIMEOUT, served).await;
    match upgraded.try_recv() {
        Ok(upgrade) => {
            let stream =
                upgrade.await.map_err(|error| format!("dropped a socket that was not opened: {error}"))?;
            socket::serve(TokioIo::new(stream), &shared).await
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

fn respond(request: &mut Request<Incoming>, shared: &Shared) -> Response<Full<Bytes>> {
    let headers = request.headers();
    let host = text(headers, header::HOST).unwrap_or_default();
    let place = match shared.guard.place(request.uri().path()) {
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
        Place::Page => {
            shared.used();
            page(shared)
        }
        Place::Socket if !shared.guard.knows_origin(text(headers, header::ORIGIN), host) => {
            status(StatusCode::FORBIDDEN, "the socket is for the page of this server only")
        }
        Place::Socket => upgrade(headers),
    }
}

fn page(shared: &Shared) -> Response<Full<Bytes>> {
    let mut answer = Response::new(Full::new(shared.page.html()));
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
