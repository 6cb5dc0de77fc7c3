//! `rig align`: it says in which direction the camera must be moved, or that it is aligned.

use std::io::Read;
use std::net::TcpListener;

use krylux::bench::align::{ARROW, SHADOW};
use serde_json::Value;

use super::support::{folder, inside, krylux, pixels, rig, summary, text};
use crate::program::verdict_of_traced;

fn figure(of: &Value) -> f64 {
    of.as_f64().unwrap_or(f64::NAN)
}

#[test]
fn the_remedy_for_a_camera_beside_the_projector_is_its_direction() {
    for (aside, place, remedy) in [
        ([2, 0], "to the right of the projector", "left"),
        ([-2, 0], "to the left of the projector", "right"),
        ([0, 2], "below the projector", "up"),
        ([0, -1], "above the projector", "down"),
        ([2, -2], "to the right of the projector and above it", "left and down"),
    ] {
        let folder = folder();
        let (rig, file) = (rig(&folder, aside, &[]), inside(&folder, "align.png"));
        let (said, status) = summary(&["rig", "align", &rig, "--rounds", "1", "-o", &file]);
        let last = &said["last"];
        println!("{aside:?}: {last}");
        assert_eq!((status, said["aligned"].as_bool()), (1, Some(false)));
        assert_eq!((last["place"].as_str(), last["remedy"].as_str()), (Some(place), Some(remedy)));
        let size = f64::from(aside[0]).hypot(f64::from(aside[1]));
        let [found, error] = [&last["stand"]["size"], &last["stand"]["error"]].map(figure);
        // Cells at the object's border see the wall, too; therefore the median of the displaced cells is a little less.
        assert!((found - size).abs() < 0.15 * size + 4.0 * error, "{found} ± {error} for {size}");
        let shadow = 11.0 * 11.0 - (11.0 - f64::from(aside[0]).abs()) * (11.0 - f64::from(aside[1]).abs());
        let share = shadow / 1024.0;
        // Pixels at the border of the shadow are half lit.
        assert!((figure(&last["shadow"]) - share).abs() < 0.4 * share, "{} for {share}", last["shadow"]);
        assert!(figure(&last["symmetry"]["value"]) > 0.1, "{}", last["symmetry"]);
        let (_, picture) = pixels(&file);
        let count = |color: [u8; 3]| picture.iter().filter(|&&pixel| pixel == color).count() as f64;
        assert!((count(SHADOW) / picture.len() as f64 - share).abs() < 0.5 * share);
        assert!(count(ARROW) > 100.0, "displaced parts have arrows");
    }
}

#[test]
fn a_camera_at_the_projectors_centre_is_aligned_within_the_stated_error() {
    let folder = folder();
    // The direction and the rotation of the camera do not matter: the map compensates them.
    let turned =
        [("camera", "shift = [1.3, -0.4]"), ("camera", "rotation = 1.5"), ("camera", "distortion = 0.01")];
    for more in [&[][..], &turned] {
        let (rig, file) = (rig(&folder, [0, 0], more), inside(&folder, "align.png"));
        let (said, status) = summary(&["rig", "align", &rig, "--rounds", "2", "-o", &file]);
        let last = &said["last"];
        println!("{last}");
        assert_eq!(
            (status, said["aligned"].as_bool(), &said["rounds"]),
            (0, Some(true), &2.into()),
            "{last}"
        );
        assert!(last["stand"].is_null() && figure(&last["shadow"]) < 0.01);
        let [median, error] = [&last["disparity"]["median"], &last["disparity"]["error"]].map(figure);
        assert!(median < 2.5 * error && error < 0.1, "{median} ± {error}");
    }
}

#[test]
fn interreflections_and_imperfect_devices_are_not_mistaken_for_a_camera_offset() {
    let folder = folder();
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/rigs/realistic.toml");
    let (said, status) =
        verdict_of_traced(&["rig", "align", rig, "--rounds", "1", "-o", &inside(&folder, "align.png")]);
    println!("{}", said["last"]);
    assert_eq!((status, said["aligned"].as_bool()), (0, Some(true)), "{said}");
}

#[test]
fn the_console_names_the_direction_and_the_picture() {
    let folder = folder();
    let (rig, file) = (rig(&folder, [2, 0], &[]), inside(&folder, "align.png"));
    let output = krylux(&["rig", "align", &rig, "--rounds", "1", "--patterns", "0", "-o", &file]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}{}", text(&output.stderr));
    for part in ["round     1: disparity median", "shadow", "move it left", "align.png"] {
        assert!(said.contains(part), "`{part}` is missing in: {said}");
    }
    assert!(!said.contains("asymmetry"), "it was not asked for: {said}");
}

#[test]
fn a_round_without_a_visible_pattern_reports_its_fault() {
    let folder = folder();
    // The projector is so much out of focus that no stripe is visible.
    let (rig, file) = (rig(&folder, [0, 0], &[("projector", "blur = 40.0")]), inside(&folder, "align.png"));
    let (said, status) = summary(&["rig", "align", &rig, "--rounds", "1", "-o", &file]);
    assert_eq!(status, 1);
    let fault = said["last"]["fault"].as_str().unwrap_or_default();
    assert!(fault.contains("no map can be fitted"), "{said}");
    let output = krylux(&["rig", "align", &rig, "-o", "align.jpg"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains(".png"));
}

#[test]
fn the_picture_is_shown_in_a_viewer_that_listens() {
    let folder = folder();
    let (rig, file) = (rig(&folder, [2, 0], &[]), inside(&folder, "align.png"));
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port is free");
    let address = listener.local_addr().expect("it has one").to_string();
    let viewer = std::thread::spawn(move || {
        let mut sent = Vec::new();
        let (mut stream, _) = listener.accept().expect("the program connects");
        // The program may end before everything is sent.
        let _ = stream.read_to_end(&mut sent);
        sent
    });
    let output =
        krylux(&["rig", "align", &rig, "--rounds", "1", "--patterns", "0", "-o", &file, "--tev", &address]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let sent = viewer.join().expect("it reads to the end");
    assert!(text(&sent).contains("rig align"), "{} bytes", sent.len());
}

/// A wall and a plate in front of it, in metres, as rays see them: right is +x, up is +y, and the camera
/// looks along −z.
const SCENE: &str = "v -2 -2 -1.5\nv 2 -2 -1.5\nv 2 2 -1.5\nv -2 2 -1.5\nf 1 2 3 4\n\
    v -0.15 -0.15 -1.0\nv 0.15 -0.15 -1.0\nv 0.15 0.15 -1.0\nv -0.15 0.15 -1.0\nf 5 6 7 8\n";

#[test]
fn the_direction_is_that_of_the_scenes_geometry() {
    for (camera, remedy) in
        [([0.08, 0.0], "left"), ([-0.08, 0.0], "right"), ([0.0, 0.08], "down"), ([0.0, -0.08], "up")]
    {
        let folder = folder();
        let write = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).expect("the folder can be written");
        };
        write("scene.obj", SCENE);
        let view = |name: &str, [x, y]: [f64; 2]| {
            format!("[{name}]\nposition = [{x}, {y}, 0]\nforward = [0, 0, -1]\nvertical_fov_degrees = 40\n")
        };
        write("poses.toml", &(view("camera", camera) + &view("projector", [0.0, 0.0])));
        write(
            "rig.toml",
            "kind = \"virtual\"\n[scene]\nfile = \"scene.obj\"\ncamera_file = \"poses.toml\"\nsize = [48, 48]\n\
             samples = 64\nmax_bounces = 2\n[camera]\nbits = 14\nshot_noise = true\n",
        );
        let (rig, file) = (inside(&folder, "rig.toml"), inside(&folder, "align.png"));
        let (said, _) =
            verdict_of_traced(&["rig", "align", &rig, "--rounds", "1", "--patterns", "0", "-o", &file]);
        let last = &said["last"];
        println!("{camera:?}: {last}");
        assert_eq!(last["remedy"].as_str(), Some(remedy), "{last}");
        // The displacement against the wall is f c (1/z − 1/z'), with f = 24 / tan 20° pixels.
        let expected = 24.0 / 20.0_f64.to_radians().tan() * 0.08 * (1.0 - 1.0 / 1.5);
        let found = figure(&last["stand"]["size"]);
        assert!((found - expected).abs() < 0.25 * expected, "{found} for {expected}");
    }
}
