//! How soon a stroke's photo is on the canvas: `cargo bench --bench paint`, in the Chromium of the system.
//!
//! The page paints strokes of ten steps by events of a mouse, at 128x128 pixels of the scene cornell with 64 light paths a pixel; once served, and once from
//! a file. `cargo bench --bench paint -- --screenshot FILE.png` makes the guide's picture of the page instead. Each latency is the page's own: from the first pointer event that has no photo yet to the photo on the canvas.

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/paint/browser/devtools.rs"]
mod devtools;
#[path = "arguments/record.rs"]
mod record;

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use devtools::{Browser, Tab};
use record::Record;
use serde_json::json;

const SCENE: &str = "assets/scenes/cornell/scene.glb";

/// Strokes of a measurement, and the steps of each.
const STROKES: usize = 100;
const STEPS: usize = 10;

fn main() {
    // `cargo test --benches` passes `--test`; there is nothing to test here.
    if std::env::args().any(|text| text == "--test") {
        return;
    }
    let browser = Browser::start();
    let mut arguments = std::env::args().skip_while(|text| text != "--screenshot").skip(1);
    if let Some(picture) = arguments.next() {
        screenshot(&browser, std::path::Path::new(&picture));
        return;
    }
    let folder = tempfile::TempDir::new().expect("a temporary folder can be made");
    let file = folder.path().join("paint.html");
    write(&file, &[]);
    let first = format!("latency in ms from pointer to photo, {STROKES} strokes of {STEPS} steps");
    let mut record = Record::new("paint", &first);
    record.columns(&["page", "median", "95 % are below", "largest"]);
    record.row(&row("file", &mut opened(&browser, &format!("file://{}", file.display()))));

    let mut server = Command::new(env!("CARGO_BIN_EXE_krylux"))
        .args(["paint", SCENE, "--no-browser"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program is built with the benchmarks");
    let lines = BufReader::new(server.stdout.take().expect("it is piped")).lines().map_while(Result::ok);
    let url = lines.filter_map(|line| line.find("http://").map(|at| line[at..].trim().to_owned())).next();
    record.row(&row("served", &mut opened(&browser, &url.expect("the server says its address"))));
    record.finish().expect("the guide can be written");
    server.kill().expect("it is ours");
    server.wait().expect("it is ours");
}

/// Writes the page as one file.
fn write(file: &std::path::Path, more: &[&str]) {
    let program = Command::new(env!("CARGO_BIN_EXE_krylux"))
        .args(["paint", SCENE])
        .args(more)
        .arg("-o")
        .arg(file)
        .status();
    assert!(program.is_ok_and(|status| status.success()), "the page is written");
}

/// The page with a few strokes in three colours.
fn screenshot(browser: &Browser, picture: &std::path::Path) {
    let folder = tempfile::TempDir::new().expect("a temporary folder can be made");
    let file = folder.path().join("paint.html");
    write(&file, &["--channels", "rgb", "--groups", "2,4", "--eigenvectors", "8"]);
    let mut tab = browser.open();
    let size = json!({ "width": 1280, "height": 720, "deviceScaleFactor": 1, "mobile": false });
    tab.call("Emulation.setDeviceMetricsOverride", size);
    tab.go_to(&format!("file://{}", file.display()));
    tab.evaluate("document.querySelector('#clear').click()");
    let strokes = [
        ("#ffd9a0", [[0.12, 0.15], [0.5, 0.12], [0.88, 0.2]]),
        ("#5fa8ff", [[0.25, 0.45], [0.35, 0.6], [0.3, 0.85]]),
        ("#ff7a5c", [[0.62, 0.75], [0.75, 0.85], [0.8, 0.72]]),
    ];
    tab.evaluate("document.querySelector('#size').value = 22");
    for (color, places) in strokes {
        tab.evaluate(&format!("document.querySelector('#color').value = '{color}'"));
        let last = places.len() - 1;
        for (step, [x, y]) in places.into_iter().enumerate() {
            let kinds: &[&str] = match step {
                0 => &["mouseMoved", "mousePressed"],
                step if step == last => &["mouseMoved", "mouseReleased"],
                _ => &["mouseMoved"],
            };
            kinds.iter().for_each(|kind| tab.mouse(kind, "#pattern", [x, y]));
        }
    }
    tab.evaluate("krylux.whenSettled()");
    tab.screenshot(picture);
}

fn opened(browser: &Browser, address: &str) -> Tab {
    let mut tab = browser.open();
    tab.go_to(address);
    tab
}

/// Paints; the page's name and its latencies.
fn row(name: &str, tab: &mut Tab) -> [String; 4] {
    for stroke in 0..STROKES {
        for step in 0..STEPS {
            // Places that follow no grid: multiples of the golden ratio.
            let at = |factor: f64| (((stroke * STEPS + step) as f64) * factor).fract();
            let place = [at(0.618_034), at(0.754_878)];
            tab.mouse("mouseMoved", "#pattern", place);
            if step == 0 {
                tab.mouse("mousePressed", "#pattern", place);
            }
            if step + 1 == STEPS {
                tab.mouse("mouseReleased", "#pattern", place);
            }
        }
    }
    tab.evaluate("krylux.whenSettled()");
    let found = tab.evaluate("krylux.latencies()");
    let mut latencies: Vec<f64> =
        found.as_array().expect("an array").iter().filter_map(|of| of.as_f64()).collect();
    latencies.sort_by(f64::total_cmp);
    let quantile = |share: f64| latencies[((latencies.len() - 1) as f64 * share) as usize];
    let [median, most, largest] = [0.5, 0.95, 1.0].map(|share| format!("{:.1}", quantile(share)));
    [name.to_owned(), median, most, largest]
}
