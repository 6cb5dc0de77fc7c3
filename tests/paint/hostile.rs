//! Clients that mean no good, and those that are only broken: refused by name, and the server goes on.

use std::io::{Read, Write};
use std::time::{Duration, Instant};

use crate::paint::served::{PATIENCE, Page, Server};

const SCENE: [&str; 5] = ["assets/scenes/zigzag/scene.glb", "--size", "16", "--spp", "4"];

/// The opening handshake of a socket with this origin.
fn handshake(origin: &str) -> String {
    format!(
        "{origin}Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    )
}

#[track_caller]
fn assert_serves(server: &Server) {
    let mut page = server.page();
    page.photo(0);
    page.change(1, &[(3, 1.0)]);
    assert!(page.photo(1).values.iter().sum::<f32>() > 0.0);
}

#[test]
fn nothing_is_served_without_the_token_the_host_and_the_origin() {
    let server = Server::start(&SCENE);
    let (path, host) = (server.path(), server.host().to_owned());
    assert!(server.get(&path, "").contains("200"));
    for wrong in ["/", "/favicon.ico", "/0123456789abcdef0123456789abcdef/", "//", "/../etc/passwd"] {
        assert!(server.get(wrong, "").contains("404"), "{wrong}");
    }
    let elsewhere = format!("GET {path} HTTP/1.1\r\nHost: evil.example\r\n\r\n");
    assert!(server.status_of(&elsewhere).contains("403"));
    assert!(server.status_of(&format!("POST {path} HTTP/1.1\r\nHost: {host}\r\n\r\n")).contains("405"));
    let socket = format!("{path}socket");
    let origins =
        ["", "Origin: http://evil.example\r\n", "Origin: null\r\n", "Origin: https://127.0.0.1\r\n"];
    for origin in origins {
        assert!(server.get(&socket, &handshake(origin)).contains("403"), "{origin}");
    }
    let own = format!("Origin: http://{host}\r\n");
    assert!(server.get("/wrong/socket", &handshake(&own)).contains("404"));
    assert!(server.get(&socket, &own).contains("400"), "no WebSocket");
    assert_serves(&server);
}

#[test]
fn giant_and_broken_messages_are_dropped_by_name() {
    let server = Server::start(&SCENE);
    let mut giant = server.page();
    let _ = giant.socket.send(tungstenite::Message::Binary(vec![2; 64 << 20].into()));
    wait_for_the_end(&mut giant);
    for bytes in [vec![], vec![1, 2, 3], vec![99; 20], vec![1; 11], vec![2; 4000]] {
        let mut page = server.page();
        page.socket.send(tungstenite::Message::Binary(bytes.into())).expect("the server reads");
        wait_for_the_end(&mut page);
    }
    for text in ["", "{}", "{\"number\": 1, \"ask\": \"everything\"}", "\u{0}"] {
        let mut page = server.page();
        page.socket.send(tungstenite::Message::Text(text.into())).expect("the server reads");
        wait_for_the_end(&mut page);
    }
    // Bytes that form no frame.
    let mut page = server.page();
    page.socket.get_mut().write_all(&[0xff; 4096]).expect("the connection is open");
    wait_for_the_end(&mut page);
    let mut stream = server.connect();
    stream.write_all(b"\x16\x03\x01\x02\x00 this is no HTTP\r\n\r\n").expect("the connection is open");
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    assert_serves(&server);
    let (status, notes) = server.end();
    assert_eq!(status, Some(0));
    for named in ["shorter than its header", "unknown kind 99", "multiple of 8", "in place of", "question"] {
        assert!(notes.contains(named), "`{named}` is missing in: {notes}");
    }
}

/// Reads until the server has closed the socket.
#[track_caller]
fn wait_for_the_end(page: &mut Page) {
    let start = Instant::now();
    while page.socket.read().is_ok() {
        assert!(start.elapsed() < PATIENCE, "the socket is still open");
    }
}

#[test]
fn a_hundred_connections_and_half_open_ones_leave_room_again() {
    let server = Server::start(&SCENE);
    let idle: Vec<_> = (0..100).map(|_| server.connect()).collect();
    // One that speaks gets the place of one that is silent. It waits for less than the five seconds that a silent one is borne.
    let mut stream = server.connect();
    stream.set_read_timeout(Some(Duration::from_secs(4))).expect("it can be set");
    let request = format!("GET {} HTTP/1.1\r\nHost: {}\r\n\r\n", server.path(), server.host());
    stream.write_all(request.as_bytes()).expect("the connection is open");
    let mut answer = [0; 12];
    stream.read_exact(&mut answer).expect("silent connections lock nobody out");
    assert_eq!(&answer, b"HTTP/1.1 200");
    // Every silent connection ends: it makes room, or it sent no request within five seconds.
    for mut stream in idle {
        let mut answer = Vec::new();
        let ended = stream.read_to_end(&mut answer);
        assert!(ended.is_ok_and(|_| !String::from_utf8_lossy(&answer).contains("200")));
    }
    assert_serves(&server);
    let (_, notes) = server.end();
    assert!(notes.contains("a silent connection") && notes.contains("no request within 5 s"), "{notes}");
}

#[test]
fn pages_that_are_used_make_no_room() {
    let server = Server::start(&SCENE);
    let mut pages: Vec<_> = (0..32).map(|_| server.page()).collect();
    assert!(server.get(&server.path(), "").contains("503"));
    pages.iter_mut().for_each(|page| drop(page.photo(0)));
    drop(pages);
    let start = Instant::now();
    while !server.get(&server.path(), "").contains("200") {
        assert!(start.elapsed() < PATIENCE, "pages that are gone keep their places");
        std::thread::sleep(Duration::from_millis(50));
    }
    let (_, notes) = server.end();
    assert!(notes.contains("32 are open already"), "{notes}");
}

#[test]
fn a_page_that_does_not_read_gets_fewer_photos_and_takes_no_memory() {
    let server = Server::start(&["assets/scenes/zigzag/scene.glb", "--size", "64", "--spp", "4"]);
    let [mut slow, mut painter] = [server.page(), server.page()];
    slow.photo(0);
    painter.photo(0);
    let mut most = 0;
    let before = server.memory();
    for number in 1..=3000_u32 {
        painter.change(number, &[(number % 4096, 0.5)]);
        painter.photo(number);
        most = most.max(server.memory());
    }
    // Each photo has 16 KiB and each pattern too: all of them would be 96 MB.
    assert!(most < before + 40_000, "from {before} to {most} kB");
    assert_serves_at(&server, 4096);
}

#[track_caller]
fn assert_serves_at(server: &Server, pixels: usize) {
    let mut page = server.page();
    assert_eq!(page.photo(0).values.len(), pixels);
}
