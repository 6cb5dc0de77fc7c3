//! Painting, and the photos that follow.

use std::path::Path;

use krylux::io::npy;

use crate::paint::served::{Server, floats};
use crate::program::{command, folder, inside, rig, rooms, text};

const SCENE: [&str; 5] = ["assets/scenes/corner/scene.glb", "--size", "16", "--spp", "8"];

#[test]
fn the_photo_of_strokes_is_that_of_the_verb_photo() {
    let server = Server::start(&SCENE);
    let mut page = server.page();
    assert!(page.photo(0).values.iter().all(|&value| value == 0.0));
    let mut pattern = vec![0.0_f32; 256];
    for step in 0..20_u32 {
        let (pixel, value) = ((step * 37) % 256, (step % 5) as f32 / 4.0);
        pattern[pixel as usize] = value;
        page.change(step + 1, &[(pixel, value)]);
    }
    let strokes = page.photo(20);
    page.send(3, 21, &[]);
    let exact = page.photo(21);
    assert!(exact.is_exact && !strokes.is_exact);

    let folder = folder();
    let [pattern_file, photo_file] = ["pattern.npy", "photo.npy"].map(|name| inside(&folder, name));
    npy::write_npy(Path::new(&pattern_file), &[16, 16], &pattern).expect("it is ours");
    let output = command(
        &[&["photo", "--pattern", &pattern_file, "-o", &photo_file, "--channels", "luma"], &SCENE[..]]
            .concat(),
    );
    let output = { output }.output().expect("the program is built with the tests");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let truth = npy::read_npy(Path::new(&photo_file)).expect("it was written").values;
    let brightest = truth.iter().copied().fold(0.0, f64::max);
    for (name, photo) in [("strokes", &strokes), ("exact", &exact)] {
        for (found, truth) in photo.values.iter().zip(&truth) {
            // Both are rounded to 32 bits; `photo` adds up light paths where this adds up a matrix of 32-bit floats.
            assert!((f64::from(*found) - truth).abs() <= 2e-6 * brightest, "{name}: {found} is not {truth}");
        }
    }
    let (status, notes) = server.end();
    assert_eq!(status, Some(0), "{notes}");
}

#[test]
fn single_pixels_are_rows_and_columns_and_the_light_can_be_chosen() {
    let server = Server::start(&SCENE);
    let mut page = server.page();
    page.photo(0);
    page.send(5, 40, &[]);
    let column = floats(&page.next(3)[8..]);
    page.send(6, 40, &[]);
    let row = floats(&page.next(4)[8..]);
    assert!(column == row && column.iter().any(|&value| value > 0.0));
    // Light 1 is the direct light: a diagonal.
    let direct = [4, 0, 1, 0, 0, 0, 0, 0];
    page.socket.send(tungstenite::Message::Binary(direct.to_vec().into())).expect("the server reads");
    page.photo(0);
    page.send(5, 40, &[]);
    let column = floats(&page.next(3)[8..]);
    assert_eq!(column.iter().filter(|&&value| value != 0.0).count(), 1);
    assert!(column[40] > 0.0);
}

#[test]
fn a_second_page_watches() {
    let server = Server::start(&SCENE);
    let [mut painter, mut watcher] = [server.page(), server.page()];
    painter.photo(0);
    watcher.photo(0);
    painter.change(1, &[(7, 1.0)]);
    let photo = painter.photo(1);
    // The patterns of the greetings come first.
    let pattern = std::iter::repeat_with(|| floats(&watcher.next(2)[8..])).find(|pattern| pattern[7] == 1.0);
    assert_eq!(pattern.map(|pattern| pattern.iter().sum::<f32>()), Some(1.0));
    assert_eq!(watcher.photo(1).values, photo.values);
}

#[test]
fn questions_are_answered_and_those_that_cannot_be_are_refused_by_name() {
    let folder = folder();
    let matrix = inside(&folder, "rooms.npz");
    krylux::io::sparse::write(Path::new(&matrix), &rooms(8, 10.0)).expect("it is ours");
    let server = Server::start(&[&matrix, "--size", "8"]);
    let mut page = server.page();
    page.photo(0);
    let mut ask = |question: &str| {
        page.socket.send(tungstenite::Message::Text(question.into())).expect("the server reads");
        loop {
            match page.socket.read().expect("the server answers") {
                tungstenite::Message::Binary(bytes) if bytes[0] == 5 => {
                    let length = u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]) as usize;
                    let said: serde_json::Value =
                        serde_json::from_slice(&bytes[12..12 + length]).expect("it is JSON");
                    return (said, floats(&bytes[12 + length..]));
                }
                tungstenite::Message::Text(text) => {
                    return (serde_json::from_str(&text).expect("it is JSON"), Vec::new());
                }
                _ => {}
            }
        }
    };
    let (said, labels) = ask(r#"{"number": 1, "ask": "groups", "groups": [2]}"#);
    assert_eq!(said["groups"][0], 2);
    let expected: Vec<f32> = crate::program::labels_of_rooms(8).iter().map(|&label| label as f32).collect();
    assert_eq!(labels, expected);
    let (said, vectors) = ask(r#"{"number": 2, "ask": "eigenvectors", "light": "all", "count": 3}"#);
    assert_eq!((said["values"].as_array().map(Vec::len), vectors.len()), (Some(3), 3 * 64));
    // The left room bright, the right one dark.
    let of_room = |label: f32, value: f32| {
        expected.iter().map(|&of| if of == label { value } else { 0.0 }).collect::<Vec<f32>>()
    };
    let question = serde_json::json!({
        "number": 3, "ask": "pattern", "target": [of_room(0.0, 5.0)], "weights": vec![1.0; 64],
    });
    let (said, pattern) = ask(&question.to_string());
    assert!(said["values"][0].as_f64().is_some_and(|residual| residual < 0.01), "{said}");
    assert!(pattern.iter().all(|value| (0.0..=1.0).contains(value)));
    let lit = |label: f32| {
        pattern.iter().zip(&expected).filter(|(_, of)| **of == label).map(|(v, _)| v).sum::<f32>()
    };
    assert!(lit(0.0) > 1.0 && lit(1.0) < 0.01);
    let (said, _) = ask(r#"{"number": 4, "ask": "pattern", "target": [[1]], "weights": [1]}"#);
    assert_eq!(said["number"], 4);
    assert!(said["error"].as_str().is_some_and(|error| error.contains("photo's pixels")), "{said}");
    let (said, _) = ask(r#"{"number": 5, "ask": "eigenvectors", "light": "second", "count": 3}"#);
    assert!(said["error"].as_str().is_some_and(|error| error.contains("single bounces")), "{said}");
}

#[test]
fn a_rig_shows_the_newest_pattern_and_keeps_its_photos_where_it_is_told_to() {
    let folder = folder();
    let rig = rig(&folder, 8, "");
    let journal = inside(&folder, "kept");
    let server = Server::start(&[&rig, "--journal", &journal]);
    let mut page = server.page();
    page.photo(0);
    // A change by itself has a photo. After many changes at once the photos are of the newest.
    page.change(1, &[(1, 1.0)]);
    page.photo(1);
    for number in 2..=40 {
        page.change(number, &[(number % 64, 1.0)]);
    }
    let last = page.photo(40);
    page.send(3, 41, &[]);
    let exact = page.photo(41);
    assert!(last.values.iter().sum::<f32>() > 0.0 && exact.is_exact);
    let (status, notes) = server.end();
    assert_eq!(status, Some(0), "{notes}");
    let record: serde_json::Value = serde_json::from_slice(
        &std::fs::read(Path::new(&journal).join("run.json")).expect("the run was recorded"),
    )
    .expect("it is JSON");
    let photos = record["photos"].as_u64().expect("they were counted");
    assert!((3..=42).contains(&photos), "{photos} photos");
    assert_eq!(record["status"], "done");
}

#[test]
fn a_server_that_nobody_uses_ends_by_itself() {
    let server = Server::start(&[&SCENE[..], &["--idle", "0.01"]].concat());
    assert_eq!(server.wait(), Some(0));
}

#[test]
fn a_page_as_one_file_says_its_size_and_refuses_what_has_no_matrix() {
    let folder = folder();
    let file = inside(&folder, "paint.html");
    let arguments =
        [&["paint", "--json", "-o", &file, "--groups", "2", "--eigenvectors", "4"], &SCENE[..]].concat();
    let output = command(&arguments).output().expect("it is built");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("it is JSON");
    let page = std::fs::read_to_string(&file).expect("it was written");
    assert_eq!(said["bytes"].as_u64(), Some(page.len() as u64));
    assert!(said["relative_error"].as_f64().is_some_and(|error| error < 5e-4));
    for outside in ["src=\"http", "href=\"http", "@import", "url(http"] {
        assert!(!page.contains(outside), "the page loads something from outside: {outside}");
    }
    let plain = command(&[&["paint", "-o", &file], &SCENE[..]].concat()).output().expect("it is built");
    let page = std::fs::read_to_string(&file).expect("it was written again");
    // The page without options shows groups and eigenvectors as well.
    assert!(
        plain.status.success() && page.contains("\"groups\":{\"") && page.contains("\"eigenvectors\":{\"")
    );
    let rig = rig(&folder, 8, "");
    let output = command(&["paint", &rig, "-o", &file]).output().expect("it is built");
    crate::program::assert_error(&output, &["-o", "matrix"]);
}
