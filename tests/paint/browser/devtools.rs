//! A browser without window, driven by the Chrome DevTools protocol.

use std::cell::RefCell;
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::rc::Rc;
use std::time::{Duration, Instant};

use base64::Engine;
use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

/// How long a step may take.
const PATIENCE: Duration = Duration::from_secs(60);

/// A browser with an empty profile, ended with the test.
pub struct Browser {
    child: Child,
    connection: Rc<RefCell<Connection>>,
    /// Removed with the test.
    _profile: tempfile::TempDir,
}

struct Connection {
    socket: WebSocket<TcpStream>,
    next: u64,
    /// Events that came while an answer was waited for.
    events: Vec<Value>,
}

/// A page in the browser.
pub struct Tab {
    connection: Rc<RefCell<Connection>>,
    session: String,
}

impl Browser {
    /// Starts the Chromium that `KRYLUX_BROWSER` names, or that of the system.
    pub fn start() -> Self {
        let program = std::env::var("KRYLUX_BROWSER").unwrap_or_else(|_| "chromium".into());
        let profile = tempfile::TempDir::new().expect("a temporary folder can be made");
        let child = Command::new(&program)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-quic"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--disable-dev-shm-usage", "--remote-debugging-port=0", "--window-size=1400,900"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("Chromium starts; install it, or name one by KRYLUX_BROWSER");
        let file = profile.path().join("DevToolsActivePort");
        let address = wait(|| {
            let text = std::fs::read_to_string(&file).ok()?;
            let (port, path) = text.split_once('\n')?;
            (!path.is_empty()).then(|| (format!("127.0.0.1:{port}"), path.trim().to_owned()))
        });
        let stream = TcpStream::connect(&address.0).expect("the browser listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("it can be set");
        let url = format!("ws://{}{}", address.0, address.1);
        let (socket, _) = tungstenite::client(url, stream).expect("the browser answers");
        let connection = Rc::new(RefCell::new(Connection { socket, next: 0, events: Vec::new() }));
        Self { child, connection, _profile: profile }
    }

    /// An empty page.
    pub fn open(&self) -> Tab {
        let mut connection = self.connection.borrow_mut();
        let target = connection.call(None, "Target.createTarget", json!({ "url": "about:blank" }));
        let attached = connection.call(
            None,
            "Target.attachToTarget",
            json!({ "targetId": target["targetId"], "flatten": true }),
        );
        drop(connection);
        let session = attached["sessionId"].as_str().expect("a text").to_owned();
        let mut tab = Tab { connection: Rc::clone(&self.connection), session };
        for domain in ["Page", "Runtime", "Log"] {
            tab.call(&format!("{domain}.enable"), json!({}));
        }
        tab
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Waits until something is there.
fn wait<T>(mut there: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = there() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "nothing has come");
        std::thread::sleep(Duration::from_millis(20));
    }
}

impl Connection {
    fn call(&mut self, session: Option<&str>, method: &str, params: Value) -> Value {
        self.next += 1;
        let mut request = json!({ "id": self.next, "method": method, "params": params });
        if let Some(session) = session {
            request["sessionId"] = json!(session);
        }
        self.socket.send(Message::Text(request.to_string().into())).expect("the browser reads");
        loop {
            let Message::Text(text) = self.socket.read().expect("the browser answers") else { continue };
            let said: Value = serde_json::from_str(&text).expect("it is JSON");
            if said["id"] == request["id"] {
                assert!(said["error"].is_null(), "{method}: {}", said["error"]);
                return said["result"].clone();
            }
            self.events.push(said);
        }
    }
}

impl Tab {
    /// Calls a method of the protocol.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.connection.borrow_mut().call(Some(&self.session), method, params)
    }

    /// The value of an expression; of a promise, what it resolves to.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let params = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let found = self.call("Runtime.evaluate", params);
        assert!(found["exceptionDetails"].is_null(), "{}", found["exceptionDetails"]);
        found["result"]["value"].clone()
    }

    /// Waits until an expression is true.
    pub fn wait_for(&mut self, expression: &str) {
        let start = Instant::now();
        while self.evaluate(expression) != json!(true) {
            assert!(start.elapsed() < PATIENCE, "it never became true: {expression}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Goes to a painting page and waits until it is ready.
    pub fn go_to(&mut self, address: &str) {
        self.call("Page.navigate", json!({ "url": address }));
        self.wait_for("document.body?.dataset.ready === 'true'");
    }

    /// The place in the window of a point of an element. The point is given in shares of the element from its left upper corner.
    pub fn place(&mut self, selector: &str, [x, y]: [f64; 2]) -> [f64; 2] {
        let found = self.evaluate(&format!(
            "(() => {{ const box = document.querySelector('{selector}').getBoundingClientRect(); return [box.left, box.top, box.width, box.height]; }})()"
        ));
        let number = |index: usize| found[index].as_f64().expect("a number");
        [number(0) + x * number(2), number(1) + y * number(3)]
    }

    /// An event of the mouse's left button, at a place of an element as [`Tab::place`] takes it.
    pub fn mouse(&mut self, kind: &str, selector: &str, at: [f64; 2]) {
        let [x, y] = self.place(selector, at);
        let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", event);
    }

    /// Presses and releases a key, with `Control` or `Shift` held or none.
    pub fn key(&mut self, key: &str, with: &str) {
        let modifiers = match with {
            "Control" => 2,
            "Shift" => 8,
            _ => 0,
        };
        let code = match key {
            "Tab" => 9,
            " " => 32,
            "ArrowLeft" => 37,
            "ArrowUp" => 38,
            "ArrowRight" => 39,
            "ArrowDown" => 40,
            letter => u32::from(letter.to_ascii_uppercase().as_bytes()[0]),
        };
        for kind in ["keyDown", "keyUp"] {
            let mut event =
                json!({ "type": kind, "key": key, "windowsVirtualKeyCode": code, "modifiers": modifiers });
            if key.len() == 1 && modifiers == 0 {
                event["text"] = json!(key);
            }
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Asserts that the page has put no error or warning on its console.
    pub fn assert_quiet(&mut self) {
        // Events that are under way come before the next answer.
        self.evaluate("0");
        let connection = self.connection.borrow();
        let is_bad = |event: &&Value| match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => true,
            Some("Runtime.consoleAPICalled") => {
                event["params"]["type"] == "error" || event["params"]["type"] == "warning"
            }
            Some("Log.entryAdded") => event["params"]["entry"]["level"] == "error",
            _ => false,
        };
        let bad: Vec<&Value> = connection.events.iter().filter(is_bad).collect();
        assert!(bad.is_empty(), "{bad:?}");
    }

    /// Writes a picture of the page.
    pub fn screenshot(&mut self, path: &std::path::Path) {
        let found = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        let bytes = base64::engine::general_purpose::STANDARD.decode(found["data"].as_str().expect("a text"));
        std::fs::write(path, bytes.expect("it is base64")).expect("the folder can be written");
    }
}

impl Drop for Tab {
    /// A failed test keeps its page as a picture.
    fn drop(&mut self) {
        if std::thread::panicking() {
            let folder =
                std::env::var_os("KRYLUX_SCREENSHOTS").map_or_else(std::env::temp_dir, PathBuf::from);
            let name = std::thread::current().name().unwrap_or("test").replace("::", "-");
            let path = folder.join(format!("{name}.png"));
            // The browser may be what failed.
            let picture = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| self.screenshot(&path)));
            if picture.is_ok() {
                eprintln!("the page is in {}", path.display());
            }
        }
    }
}
