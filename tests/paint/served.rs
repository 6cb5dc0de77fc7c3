//! A running server, and a page that talks to it as the real one does.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, ChildStdout, Stdio};
use std::time::{Duration, Instant};

use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

use crate::program::command;

/// How long a test waits for anything.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// `krylux paint`, ended with the test.
pub struct Server {
    child: Child,
    stdout: BufReader<ChildStdout>,
    /// The address of the page.
    pub url: String,
}

impl Server {
    /// Starts the program on a source and waits for its address.
    pub fn start(arguments: &[&str]) -> Self {
        let all = [&["paint", "--json", "--no-browser"], arguments].concat();
        let mut child = command(&all)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program is built with the tests");
        let mut stdout = BufReader::new(child.stdout.take().expect("it is piped"));
        let mut said = String::new();
        while !said.trim_end().ends_with('}') {
            let read = stdout.read_line(&mut said).expect("it is text");
            if read == 0 {
                let mut why = String::new();
                child.stderr.take().map(|mut stderr| stderr.read_to_string(&mut why));
                panic!("the server did not start: {why}");
            }
        }
        let said: serde_json::Value = serde_json::from_str(&said).expect("it is JSON");
        let url = said["url"].as_str().expect("the address is text").to_owned();
        Self { child, stdout, url }
    }

    /// `HOST:PORT`.
    pub fn host(&self) -> &str {
        self.url.trim_start_matches("http://").split('/').next().expect("an address has a host")
    }

    /// The path with the token.
    pub fn path(&self) -> String {
        format!("/{}/", self.url.trim_end_matches('/').rsplit('/').next().expect("an address has a path"))
    }

    /// A plain connection.
    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.host()).expect("the server listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
        stream
    }

    /// The first line of what a request is answered, or nothing where the connection is closed.
    pub fn status_of(&self, request: &str) -> String {
        let mut stream = self.connect();
        let mut answer = Vec::new();
        // A server that refuses may close before it has read everything.
        let _ = stream.write_all(request.as_bytes());
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).lines().next().unwrap_or_default().to_owned()
    }

    /// The status of a GET with these headers.
    pub fn get(&self, path: &str, headers: &str) -> String {
        self.status_of(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\n{headers}\r\n", self.host()))
    }

    /// A page's socket.
    pub fn page(&self) -> Page {
        let address = format!("ws://{}{}socket", self.host(), self.path());
        let mut request = address.into_client_request().expect("it is an address");
        let origin = format!("http://{}", self.host());
        request.headers_mut().insert("Origin", origin.parse().expect("it is plain text"));
        let (socket, _) = tungstenite::client(request, self.connect()).expect("the page's own socket opens");
        Page { socket }
    }

    /// Kilobytes of memory that the program has now.
    pub fn memory(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).expect("it runs");
        let line = status.lines().find(|line| line.starts_with("VmRSS")).expect("Linux says it");
        line.split_whitespace().nth(1).and_then(|number| number.parse().ok()).expect("it is a number")
    }

    /// Ends the program as Ctrl-C does; its exit status and what it noted.
    pub fn end(mut self) -> (Option<i32>, String) {
        let id = self.child.id().to_string();
        std::process::Command::new("kill").args(["-INT", &id]).status().expect("Unix has it");
        let start = Instant::now();
        while self.child.try_wait().expect("it is ours").is_none() {
            assert!(start.elapsed() < PATIENCE, "the server does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
        let mut notes = String::new();
        self.child.stderr.take().map(|mut stderr| stderr.read_to_string(&mut notes));
        (self.child.wait().expect("it is ours").code(), notes)
    }

    /// Waits until the program ends by itself; its exit status.
    pub fn wait(mut self) -> Option<i32> {
        let mut rest = String::new();
        let _ = self.stdout.read_to_string(&mut rest);
        self.child.wait().expect("it is ours").code()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A page that is open.
pub struct Page {
    pub socket: WebSocket<TcpStream>,
}

/// A photo as it came.
pub struct Photo {
    pub is_exact: bool,
    pub values: Vec<f32>,
}

impl Page {
    /// Sends a message of this kind.
    pub fn send(&mut self, kind: u8, number: u32, content: &[u8]) {
        let mut bytes = vec![kind, 0, 0, 0];
        bytes.extend(number.to_le_bytes());
        bytes.extend(content);
        self.socket.send(Message::Binary(bytes.into())).expect("the server reads");
    }

    /// Changes pixels of a gray pattern.
    pub fn change(&mut self, number: u32, pixels: &[(u32, f32)]) {
        let bytes = |(pixel, value): &(u32, f32)| [pixel.to_le_bytes(), value.to_le_bytes()].concat();
        self.send(1, number, &pixels.iter().flat_map(bytes).collect::<Vec<u8>>());
    }

    /// The next message of a kind, others left out.
    pub fn next(&mut self, kind: u8) -> Vec<u8> {
        loop {
            match self.socket.read().expect("the server answers") {
                Message::Binary(bytes) if bytes[0] == kind => return bytes.to_vec(),
                Message::Text(text) => panic!("{text}"),
                _ => {}
            }
        }
    }

    /// The photo that has the request of this number; that before any request has number 0.
    pub fn photo(&mut self, number: u32) -> Photo {
        loop {
            let bytes = self.next(1);
            let found = u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]);
            if found >= number {
                return Photo { is_exact: bytes[1] == 1, values: floats(&bytes[8..]) };
            }
        }
    }
}

pub fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|&word| f32::from_le_bytes(word)).collect()
}
