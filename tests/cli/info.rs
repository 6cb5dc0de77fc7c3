//! `krylux info` on a scene that has no camera: its box, and the camera that is placed.

use std::path::Path;

use crate::program::{assert_error, command, folder, inside, text};
use krylux::io::npy;
use tempfile::TempDir;

/// A sheet of 4 m by 3 m, one metre deep, without a camera.
fn sheet(folder: &TempDir) -> String {
    let path = inside(folder, "sheet.obj");
    let faces = "v -1 0 2\nv 3 0 2\nv 3 3 1\nv -1 3 1\nf 1 2 3 4\n";
    std::fs::write(&path, faces).expect("the folder can be written");
    path
}

/// The output of the program, which must succeed.
#[track_caller]
fn said(arguments: &[&str]) -> String {
    let output = command(arguments).output().expect("the program is built with the tests");
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

#[test]
fn a_scene_without_a_camera_is_shown_with_its_box() {
    let folder = folder();
    let scene = sheet(&folder);
    let shown = said(&["info", &scene]);
    for part in [
        "2 triangles, 4.000 x 3.000 x 1.000 m",
        "box     from [-1.000, 0.000, 1.000] to [3.000, 3.000, 2.000] m",
        "camera  none; --auto-camera places one at [",
        "--write-camera FILE writes it",
    ] {
        assert!(shown.contains(part), "`{part}` is missing in: {shown}");
    }
    let summary: serde_json::Value =
        serde_json::from_str(&said(&["info", &scene, "--json"])).expect("--json prints nothing but JSON");
    assert_eq!(summary["scene"]["bounds"], serde_json::json!([[-1.0, 0.0, 1.0], [3.0, 3.0, 2.0]]));
    assert_eq!(summary["scene"]["camera"], "auto");
}

/// The numbers of a camera file, in its order.
fn numbers(file: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(file).expect("it was written");
    let parts = text.split(|c: char| "[]=, \n".contains(c));
    parts.filter_map(|part| part.parse().ok()).collect()
}

#[test]
fn a_placed_camera_is_written_and_read_back() {
    let folder = folder();
    let scene = sheet(&folder);
    let [file, again, photo] = ["camera.toml", "again.toml", "photo.npy"].map(|name| inside(&folder, name));
    let shown = said(&["info", &scene, "--write-camera", &file]);
    assert!(shown.contains(&format!("wrote     {file}")), "{shown}");

    // Without the file the scene has no camera; with it, it has the one that was written.
    let traced = ["photo", &scene, "--size", "16", "--spp", "4", "-o", &photo];
    let refused = command(&traced).output().expect("the program is built with the tests");
    assert_error(&refused, &["sheet.obj", "--auto-camera"]);
    let shown = said(&["info", &scene, "--camera-file", &file, "--write-camera", &again]);
    assert!(!shown.contains("camera  none"), "{shown}");
    let (written, read) = (numbers(&file), numbers(&again));
    assert_eq!(written.len(), 10, "position, forward, up, field of view: {written:?}");
    // Directions and the field of view are rounded to single precision on the way.
    let close = written.iter().zip(&read).all(|(a, b)| (a - b).abs() <= 1e-5 * a.abs().max(1.0));
    assert!(close && read.len() == written.len(), "{written:?}, then {read:?}");

    said(&[&traced[..], &["--camera-file", &file]].concat());
    let lit = npy::read_image(Path::new(&photo)).expect("it was written");
    let lit = lit.samples().iter().filter(|&&sample| sample > 0.0).count();
    assert!(lit > 64, "the sheet is in view: {lit} of the samples are lit");
}

#[test]
fn what_the_camera_sees_is_drawn_without_a_graphics_adapter() {
    let folder = folder();
    let (scene, picture) = (sheet(&folder), inside(&folder, "seen.png"));
    let output = crate::program::command_without_graphics(&["info", &scene, "--draw", "-o", &picture])
        .output()
        .expect("the program is built with the tests");
    let shown = text(&output.stdout);
    assert!(shown.contains('▀') && shown.contains(&format!("wrote     {picture}")), "{shown}");
    let seen = image::open(&picture).expect("it was written").to_rgb8();
    assert_eq!((seen.width(), seen.height()), (512, 512));
    let lit = |x: u32, y: u32| seen.get_pixel(x, y).0[0] > 100;
    // The sheet is in the middle; the camera that is placed leaves room around it.
    assert!(lit(256, 256) && !lit(5, 5) && !lit(506, 506));

    let plain = said(&["info", &scene]);
    assert!(!plain.contains('\u{1b}'), "a pipe gets no colours: {plain}");
    let refused = command(&["info", &scene, "-o", &inside(&folder, "seen.exr")]).output();
    assert_error(&refused.expect("the program is built with the tests"), &["seen.exr", ".png"]);
}
