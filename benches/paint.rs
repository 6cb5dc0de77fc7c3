//! How soon a stroke's photo is on the canvas: `cargo bench --bench paint`, in the Chromium of the system.
//!
//! The page paints strokes of ten steps by events of a mouse, at 128x128 pixels of the scene cornell with 64 light paths a pixel; once served, and once from
//! a file. Each latency is the page's own: from the first pointer event that has no photo yet to the photo on the canvas.

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/paint/browser/devtools.rs"]
mod devtools;

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use devtools::{Browser, Tab};
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
    let folder = tempfile::TempDir::new().expect("a temporary folder can be made");
    let file = folder.path().join("paint.html");
    let written = Command::new(env!("CARGO_BIN_EXE_krylux")).args(["paint", SCENE, "-o"]).arg(&file).status();
    assert!(written.is_ok_and(|status| status.success()), "the page is written");
    println!("latency in ms from pointer to photo, {STROKES} strokes of {STEPS} steps");
    println!("{:10} {:>8} {:>8} {:>8} {:>8}", "page", "median", "95 %", "largest", "photos");
    report("file", &mut opened(&browser, &format!("file://{}", file.display())));

    let mut server = Command::new(env!("CARGO_BIN_EXE_krylux"))
        .args(["paint", SCENE, "--no-browser"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program is built with the benchmarks");
    let lines = BufReader::new(server.stdout.take().expect("it is piped")).lines().map_while(Result::ok);
    let url = lines.filter_map(|line| line.find("http://").map(|at| line[at..].trim().to_owned())).next();
    report("served", &mut opened(&browser, &url.expect("the server says its address")));
    server.kill().expect("it is ours");
}

fn opened(browser: &Browser, address: &str) -> Tab {
    let mut tab = browser.open();
    tab.call("Page.navigate", json!({ "url": address }));
    tab.wait_for("document.body?.dataset.ready === 'true'");
    tab
}

/// Paints, and prints the latencies.
fn report(name: &str, tab: &mut Tab) {
    let found = tab.evaluate(
        "(() => { const box = document.querySelector('#pattern').getBoundingClientRect(); return [box.left, box.top, box.width, box.height]; })()",
    );
    let number = |index: usize| found[index].as_f64().expect("a number");
    for stroke in 0..STROKES {
        for step in 0..STEPS {
            // Places that follow no grid: multiples of the golden ratio.
            let at = |factor: f64| (((stroke * STEPS + step) as f64) * factor).fract();
            let (x, y) = (number(0) + number(2) * at(0.618_034), number(1) + number(3) * at(0.754_878));
            let mouse = |kind: &str| json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1 });
            tab.call("Input.dispatchMouseEvent", mouse("mouseMoved"));
            if step == 0 {
                tab.call("Input.dispatchMouseEvent", mouse("mousePressed"));
            }
            if step + 1 == STEPS {
                tab.call("Input.dispatchMouseEvent", mouse("mouseReleased"));
            }
        }
    }
    tab.evaluate("krylux.whenSettled()");
    let found = tab.evaluate("krylux.latencies()");
    let mut latencies: Vec<f64> =
        found.as_array().expect("an array").iter().filter_map(|of| of.as_f64()).collect();
    latencies.sort_by(f64::total_cmp);
    let quantile = |share: f64| latencies[((latencies.len() - 1) as f64 * share) as usize];
    let count = latencies.len();
    println!("{name:10} {:8.1} {:8.1} {:8.1} {count:8}", quantile(0.5), quantile(0.95), quantile(1.0));
}
