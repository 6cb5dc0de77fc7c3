//! `rig preview`: its figures, the focus score, the overlay, and the end by Ctrl-C.

use std::io::{BufRead, BufReader};
use std::process::Stdio;
use std::time::{Duration, Instant};

use krylux::bench::preview::{CRUSHED, SATURATED};
use serde_json::Value;

use super::support::{command, folder, inside, krylux, pixels, rig, summary, text};

fn preview(rig: &str, file: &str, more: &[&str]) -> Value {
    let (said, status) = summary(&[&["rig", "preview", rig, "--frames", "4", "-o", file], more].concat());
    assert_eq!(status, 0);
    said["figures"].clone()
}

fn figure(of: &Value) -> f64 {
    of.as_f64().unwrap_or(f64::NAN)
}

#[test]
fn an_exposure_is_chosen_that_fills_the_range_without_saturating() {
    let folder = folder();
    let (rig, file) = (rig(&folder, [0, 0], &[]), inside(&folder, "preview.png"));
    let figures = preview(&rig, &file, &[]);
    println!("{figures}");
    assert_eq!((&figures["frame"], &figures["saturated"]), (&4.into(), &0.0.into()));
    // The exposure brings the 98th percentile of white to about 70 % of the range.
    let brightest = figure(&figures["brightest"]);
    assert!((0.55 * 4095.0..0.95 * 4095.0).contains(&brightest), "{figures}");
    let mean = figure(&figures["mean"]);
    assert!((0.3..0.7).contains(&mean) && figure(&figures["per_second"]) > 0.0, "{figures}");
    let (width, picture) = pixels(&file);
    assert_eq!((width, picture.len()), (64, 64 * 64));
    assert!(!picture.contains(&SATURATED) && picture.iter().any(|&[red, ..]| red > 100));
}

#[test]
fn saturated_pixels_are_red_and_dark_pixels_blue() {
    let folder = folder();
    let file = inside(&folder, "preview.png");
    let rig = rig(&folder, [0, 0], &[]);
    let figures = preview(&rig, &file, &["--exposure", "1"]);
    let (_, picture) = pixels(&file);
    let red = picture.iter().filter(|&&pixel| pixel == SATURATED).count() as f64 / picture.len() as f64;
    assert!(red > 0.9 && (figure(&figures["saturated"]) - red).abs() < 1e-9, "{red} {figures}");
    let black = super::support::rig(&folder, [0, 0], &[]);
    let text = std::fs::read_to_string(&black).expect("it was written");
    std::fs::write(
        &black,
        text.replace("black_level = 40", "black_level = 0").replace("read_noise = 6", "read_noise = 0"),
    )
    .expect("the folder can be written");
    let figures = preview(&black, &file, &["--pattern", "black", "--exposure", "0.1"]);
    let (_, picture) = pixels(&file);
    assert!(picture.iter().all(|&pixel| pixel == CRUSHED) && figure(&figures["black"]) == 1.0, "{figures}");
}

#[test]
fn the_focus_score_increases_with_the_projectors_sharpness() {
    let folder = folder();
    let file = inside(&folder, "preview.png");
    let scores = ["0.0", "0.8", "2.0"].map(|blur| {
        let rig = rig(&folder, [0, 0], &[("projector", &format!("blur = {blur}"))]);
        let figures = preview(&rig, &file, &["--pattern", "checker:4"]);
        assert!(figure(&figures["best_focus"]) >= figure(&figures["focus"]), "{figures}");
        figure(&figures["focus"])
    });
    println!("{scores:?}");
    // The bounds are far above the few per cent that noise causes.
    assert!(scores[0] > 1.2 * scores[1] && scores[1] > 1.5 * scores[2], "{scores:?}");
}

#[test]
fn figures_are_printed_without_a_terminal_and_wrong_options_are_named() {
    let folder = folder();
    let (rig, file) = (rig(&folder, [0, 0], &[]), inside(&folder, "preview.png"));
    let output = krylux(&["rig", "preview", &rig, "--frames", "2", "-o", &file]);
    let said = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    for part in ["frame     2: focus", "best", "saturated 0.0 %", "brightest", "a second of", "preview.png"] {
        assert!(said.contains(part), "`{part}` is missing in: {said}");
    }
    let missing = inside(&folder, "missing/p.png");
    for (arguments, part) in [
        (vec!["rig", "preview", &rig, "-o", "a.exr"], ".png"),
        (vec!["rig", "preview", &rig, "--exposure", "0"], "more than 0"),
        (vec!["rig", "preview", &rig, "--exposure", "1e9", "--frames", "1", "-o", &file], "cannot be set"),
        (vec!["rig", "preview", "scene.glb"], "is no rig"),
        (vec!["rig", "preview", &rig, "-o", &missing], missing.as_str()),
    ] {
        let output = krylux(&arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(text(&output.stderr).contains(part), "{arguments:?}: {}", text(&output.stderr));
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_preview_and_leaves_a_complete_picture() {
    let folder = folder();
    let (rig, file) = (rig(&folder, [0, 0], &[]), inside(&folder, "preview.png"));
    let mut program = command(&["rig", "preview", &rig, "-o", &file])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is built with the tests");
    let mut said = BufReader::new(program.stdout.take().expect("it is piped"));
    let mut first = String::new();
    said.read_line(&mut first).expect("it says its first frame");
    let id = program.id().to_string();
    let sent = std::process::Command::new("kill").args(["-INT", &id]).status().expect("there is a kill");
    assert!(sent.success());
    let began = Instant::now();
    let status = loop {
        if let Some(status) = program.try_wait().expect("it is ours") {
            break status;
        }
        assert!(began.elapsed() < Duration::from_secs(60), "it goes on");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert!(first.starts_with("frame "), "{first}");
    assert_eq!(status.code(), Some(0), "Ctrl-C is how a preview ends");
    assert_eq!(pixels(&file).1.len(), 64 * 64);
}
