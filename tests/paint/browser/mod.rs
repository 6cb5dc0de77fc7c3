//! The page in a real browser, driven by the DevTools protocol.
//!
//! These tests need Chromium, and axe-core in the file that `KRYLUX_AXE` names: `cargo test --release --test commands paint:: -- --ignored`. Where one fails,
//! a screenshot is left in the folder that `KRYLUX_SCREENSHOTS` names, or else in the system's folder for temporary files.

mod devtools;

use std::path::Path;

use krylux::io::npy;
use serde_json::{Value, json};

use crate::paint::served::Server;
use crate::program::{command, folder, inside, text};
use devtools::{Browser, Tab};

const SCENE: [&str; 5] = ["assets/scenes/cornell/scene.glb", "--size", "32", "--spp", "16"];

/// Opens a page and waits until it is ready.
fn open(browser: &Browser, address: &str) -> Tab {
    let mut tab = browser.open();
    tab.go_to(address);
    tab
}

/// A page as one file.
fn file(folder: &tempfile::TempDir) -> String {
    let path = inside(folder, "paint.html");
    let arguments = [&["paint", "-o", &path, "--groups", "2,3", "--eigenvectors", "4"], &SCENE[..]].concat();
    let output = command(&arguments).output().expect("it is built");
    assert!(output.status.success(), "{}", text(&output.stderr));
    format!("file://{path}")
}

fn stroke(tab: &mut Tab, places: &[[f64; 2]]) {
    for (step, &at) in places.iter().enumerate() {
        tab.mouse("mouseMoved", "#pattern", at);
        if step == 0 {
            tab.mouse("mousePressed", "#pattern", at);
        }
        if step + 1 == places.len() {
            tab.mouse("mouseReleased", "#pattern", at);
        }
    }
    tab.evaluate("krylux.whenSettled()");
}

fn values(found: &Value) -> Vec<f64> {
    found.as_array().expect("an array").iter().map(|value| value.as_f64().expect("a number")).collect()
}

/// Asserts that the page shows the photo that `krylux photo` takes of its pattern, in numbers and on the canvas. `tolerance` is relative to
/// the brightest pixel.
fn assert_shows_the_photo(tab: &mut Tab, tolerance: f64) {
    let [pattern, photo] =
        ["krylux.pattern()[0]", "krylux.photo()[0]"].map(|script| values(&tab.evaluate(script)));
    let folder = folder();
    let [pattern_file, photo_file] = ["pattern.npy", "photo.npy"].map(|name| inside(&folder, name));
    let narrow: Vec<f32> = pattern.iter().map(|&value| value as f32).collect();
    npy::write_npy(Path::new(&pattern_file), &[32, 32], &narrow).expect("it is ours");
    let verb = ["photo", "--pattern", &pattern_file, "-o", &photo_file, "--channels", "luma"];
    let output = command(&[&verb, &SCENE[..]].concat()).output().expect("it is built");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let truth = npy::read_npy(Path::new(&photo_file)).expect("it was written").values;
    let brightest = truth.iter().copied().fold(0.0, f64::max);
    assert!(brightest > 0.0, "the pattern is dark");
    for (found, truth) in photo.iter().zip(&truth) {
        assert!((found - truth).abs() <= tolerance * brightest, "{found} is not {truth}");
    }
    let shown = tab.evaluate(
        "(() => { const canvas = document.querySelector('#photo'); \
         const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data; \
         return { levels: Array.from(data).filter((_, at) => at % 4 === 0), \
                  exposure: 2 ** Number(document.querySelector('#exposure').value), \
                  gamma: Number(document.querySelector('#gamma').value) }; })()",
    );
    let number = |name: &str| shown[name].as_f64().expect("a number");
    for (level, value) in values(&shown["levels"]).iter().zip(&photo) {
        let expected = 255.0 * (value * number("exposure")).clamp(0.0, 1.0).powf(1.0 / number("gamma"));
        // One level by rounding, and by steps of 1/4096 what a dark value differs.
        let step =
            255.0 * ((value * number("exposure") + 1.0 / 4096.0).clamp(0.0, 1.0).powf(1.0 / number("gamma")));
        assert!((level - expected).abs() <= 1.0 + (step - expected), "{level} is shown for {expected}");
    }
}

#[test]
#[ignore = "needs Chromium"]
fn a_served_page_shows_what_the_verb_photo_takes() {
    let browser = Browser::start();
    let server = Server::start(&SCENE);
    let mut tab = open(&browser, &server.url);
    stroke(&mut tab, &[[0.2, 0.3], [0.5, 0.4], [0.8, 0.7]]);
    tab.key("l", "");
    stroke(&mut tab, &[[0.1, 0.9], [0.9, 0.8]]);
    assert_shows_the_photo(&mut tab, 2e-6);
    // The other light, and back by undo.
    tab.evaluate("(() => { const select = document.querySelector('#light'); select.value = '1'; select.dispatchEvent(new Event('change')); })()");
    tab.wait_for("krylux.photo()[0].filter((value) => value > 0).length > 0");
    tab.evaluate("(() => { const select = document.querySelector('#light'); select.value = '0'; select.dispatchEvent(new Event('change')); })()");
    tab.evaluate("new Promise((done) => setTimeout(done, 300))");
    let before = tab.evaluate("krylux.pattern()[0]");
    tab.evaluate("document.querySelector('#clear').click()");
    tab.evaluate("krylux.whenSettled()");
    assert!(values(&tab.evaluate("krylux.photo()[0]")).iter().all(|&value| value.abs() < 1e-9));
    tab.evaluate("document.querySelector('#undo').click()");
    tab.evaluate("krylux.whenSettled()");
    assert_eq!(tab.evaluate("krylux.pattern()[0]"), before);
    assert_shows_the_photo(&mut tab, 2e-6);
    tab.assert_quiet();
}

#[test]
#[ignore = "needs Chromium"]
fn a_page_from_a_file_shows_what_the_verb_photo_takes_and_answers_questions() {
    let browser = Browser::start();
    let folder = folder();
    let address = file(&folder);
    let mut tab = open(&browser, &address);
    stroke(&mut tab, &[[0.2, 0.3], [0.5, 0.4], [0.8, 0.7]]);
    // The matrix has 11 bits of precision, and many entries make a photo.
    assert_shows_the_photo(&mut tab, 5e-4);
    let state = tab.evaluate("krylux.pattern()[0]");
    for (panel, click) in [("groups", "#groups [data-run]"), ("eigenvectors", "#eigenvectors [data-run]")] {
        tab.evaluate(&format!("document.querySelector('{click}').click()"));
        tab.wait_for(&format!(
            "/photos|Eigenvalue/.test(document.querySelector('#{panel} .answer').textContent)"
        ));
    }
    tab.evaluate("document.querySelector('#groups .swatches button').click()");
    tab.evaluate("krylux.whenSettled()");
    let lit = values(&tab.evaluate("krylux.pattern()[0]"));
    assert!(
        lit.iter().all(|&value| value == 0.0 || value == 1.0) && lit.contains(&0.0) && lit.contains(&1.0)
    );
    // A mask on the photo: the pattern follows by itself.
    tab.evaluate("(() => { document.querySelector('#masks').open = true; document.querySelector('[data-mask=\"1\"]').click(); })()");
    for kind in ["mousePressed", "mouseReleased"] {
        tab.mouse(kind, "#photo", [0.5, 0.5]);
    }
    tab.wait_for("/^relative residual [0-9.]+$/.test(document.querySelector('#masks .answer').textContent)");
    // The state of before, by its link.
    let link = "(async () => { const plane = Float32Array.from(STATE); return await modules['files.js'].encodeState({}, [plane]); })()";
    let saved = tab.evaluate(&link.replace("STATE", &state.to_string()));
    let address = format!("{address}#state={}", saved.as_str().expect("a text"));
    tab.call("Page.navigate", json!({ "url": "about:blank" }));
    tab.go_to(&address);
    assert_eq!(tab.evaluate("krylux.pattern()[0]"), state);
    tab.assert_quiet();
}

#[test]
#[ignore = "needs Chromium"]
fn a_phone_has_both_pictures_without_scrolling_sideways_and_a_finger_paints() {
    let browser = Browser::start();
    let folder = folder();
    let mut tab = browser.open();
    let phone = json!({ "width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": true });
    tab.call("Emulation.setDeviceMetricsOverride", phone);
    tab.call("Emulation.setTouchEmulationEnabled", json!({ "enabled": true }));
    tab.go_to(&file(&folder));
    assert_eq!(tab.evaluate("document.documentElement.scrollWidth <= innerWidth"), json!(true));
    let tops = ["#pattern", "#photo"].map(|id| tab.place(id, [0.0, 0.0]));
    assert!(tops[1][1] > tops[0][1] && (tops[1][0] - tops[0][0]).abs() < 1.0, "one above the other");
    let before = tab.evaluate("krylux.pattern()[0]");
    for (kind, at) in [("touchStart", [0.1, 0.1]), ("touchMove", [0.5, 0.15]), ("touchMove", [0.9, 0.1])] {
        let [x, y] = tab.place("#pattern", at);
        tab.call("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": [{ "x": x, "y": y }] }));
    }
    tab.call("Input.dispatchTouchEvent", json!({ "type": "touchEnd", "touchPoints": [] }));
    tab.evaluate("krylux.whenSettled()");
    assert_ne!(tab.evaluate("krylux.pattern()[0]"), before);
    assert_eq!(tab.evaluate("scrollY"), json!(0), "painting does not scroll");
    tab.assert_quiet();
}

#[test]
#[ignore = "needs Chromium"]
fn the_keyboard_alone_paints_and_reaches_everything() {
    let browser = Browser::start();
    let folder = folder();
    let mut tab = open(&browser, &file(&folder));
    let mut reached = Vec::new();
    for _ in 0..60 {
        tab.key("Tab", "");
        let id = tab.evaluate("document.activeElement.id || document.activeElement.name || document.activeElement.closest('details')?.id || ''");
        reached.push(id.as_str().unwrap_or_default().to_owned());
    }
    for id in
        ["tool", "size", "value", "undo", "load", "pattern", "photo", "light", "exposure", "groups", "save"]
    {
        assert!(reached.iter().any(|of| of == id), "{id} is not reached: {reached:?}");
    }
    tab.evaluate("document.querySelector('#clear').click()");
    tab.evaluate("document.querySelector('#pattern').focus()");
    tab.key("b", "");
    tab.key(" ", " ");
    for _ in 0..4 {
        tab.key("ArrowRight", "");
    }
    tab.key(" ", " ");
    tab.evaluate("krylux.whenSettled()");
    let painted = values(&tab.evaluate("krylux.pattern()[0]"));
    assert!(painted.iter().filter(|&&value| value > 0.0).count() > 8);
    tab.key("z", "Control");
    tab.key("z", "Control");
    tab.evaluate("krylux.whenSettled()");
    assert!(values(&tab.evaluate("krylux.pattern()[0]")).iter().all(|&value| value == 0.0));
    tab.assert_quiet();
}

#[test]
#[ignore = "needs Chromium and axe-core"]
fn axe_has_no_serious_finding_light_or_dark_and_motion_is_reduced() {
    let axe = std::env::var("KRYLUX_AXE").expect("KRYLUX_AXE names the file axe.min.js");
    let axe = std::fs::read_to_string(axe).expect("axe-core can be read");
    let browser = Browser::start();
    let server = Server::start(&SCENE);
    let mut tab = open(&browser, &server.url);
    tab.evaluate("document.querySelectorAll('details').forEach((node) => (node.open = true))");
    for scheme in ["light", "dark"] {
        let features = json!({ "features": [
            { "name": "prefers-color-scheme", "value": scheme }, { "name": "prefers-reduced-motion", "value": "reduce" },
        ] });
        tab.call("Emulation.setEmulatedMedia", features);
        tab.evaluate(&format!("{axe}; 0"));
        let found = tab.evaluate(
            "axe.run().then((found) => found.violations.filter((one) => ['serious', 'critical'].includes(one.impact)) \
             .map((one) => `${one.id}: ${one.nodes.map((node) => node.target.join(' ')).join(', ')}`))",
        );
        assert_eq!(found, json!([]), "{scheme}");
        stroke(&mut tab, &[[0.2, 0.3], [0.8, 0.7]]);
    }
    assert_shows_the_photo(&mut tab, 2e-6);
    tab.assert_quiet();
}

#[test]
#[ignore = "needs Chromium"]
fn a_thousand_strokes_leave_no_growth_of_memory() {
    let browser = Browser::start();
    let folder = folder();
    let mut tab = open(&browser, &file(&folder));
    let heap = |tab: &mut Tab| {
        tab.call("HeapProfiler.collectGarbage", json!({}));
        tab.call("Runtime.getHeapUsage", json!({}))["usedSize"].as_f64().expect("a number")
    };
    let strokes = |tab: &mut Tab, count: usize| {
        let script = "(async () => { const canvas = document.querySelector('#pattern'); const box = canvas.getBoundingClientRect(); \
            const send = (type, x, y) => canvas.dispatchEvent(new PointerEvent(type, { clientX: box.left + x * box.width, \
            clientY: box.top + y * box.height, pointerId: 1, bubbles: true, buttons: 1 })); canvas.setPointerCapture = () => {}; \
            for (let stroke = 0; stroke < COUNT; stroke += 1) { const at = (shift) => ((stroke * 0.37 + shift) % 1); \
            send('pointerdown', at(0), at(0.3)); send('pointermove', at(0.1), at(0.5)); send('pointerup', at(0.1), at(0.5)); \
            await krylux.whenSettled(); } })()";
        tab.evaluate(&script.replace("COUNT", &count.to_string()));
    };
    strokes(&mut tab, 300);
    let early = heap(&mut tab);
    strokes(&mut tab, 1000);
    let late = heap(&mut tab);
    // The steps of undo are kept: of a stroke at most some hundred pixels of twelve bytes.
    assert!(late - early < 4e6, "from {early} to {late} bytes");
    tab.assert_quiet();
}
