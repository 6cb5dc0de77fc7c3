//! Views of a run: images in a viewer while it goes on, every photo on its page, and the same photos asked anew. On a rig in
//! front of a matrix, so that no graphics device is needed.

use std::collections::BTreeMap;
use std::io::Read;
use std::net::TcpListener;
use std::path::Path;

use crate::program::{self, answer, folder, inside, krylux, text};
use krylux::io::npy;
use serde_json::Value;
use tempfile::TempDir;

/// Pixels on a side.
const SIDE: usize = 6;

fn rig(folder: &TempDir) -> String {
    program::rig(folder, SIDE, "")
}

/// A target of a gray disc.
fn target(folder: &TempDir) -> String {
    let path = folder.path().join("target.npy");
    let values: Vec<f32> = (0..SIDE * SIDE).map(|pixel| if pixel % 3 == 0 { 0.8 } else { 0.4 }).collect();
    npy::write_npy(&path, &[SIDE, SIDE], &values).expect("the folder can be written");
    path.display().to_string()
}

/// The arguments of every verb whose photos are seen, by its name.
fn verbs(target: &str) -> Vec<Vec<String>> {
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    vec![
        words("segment --no-check --photos 9 --groups 2 --eigenvectors 4"),
        words(&format!("compensate --no-check --photos 4 --target {target}")),
        words("eigs --no-check --photos 7 --count 2"),
        words("relight --no-check --photos 8 --block 2"),
        words("separate --no-check --by random --photos 11"),
        words("probe --photos 5 --sigma 1"),
    ]
}

/// Runs a verb of the rig into a folder named after it.
fn take(arguments: &[String], source: &str, out: &str, more: &[&str]) -> Value {
    let (verb, rest) = arguments.split_first().expect("there is a verb");
    let rest: Vec<&str> = rest.iter().map(String::as_str).collect();
    answer(&[&[verb.as_str(), source, "-o", out], rest.as_slice(), more].concat())
}

fn page(out: &str) -> String {
    std::fs::read_to_string(Path::new(out).join("report.html")).expect("a run has a report")
}

/// The photos of a page's strip.
fn strip(page: &str) -> usize {
    page.matches("aria-label=\"photo ").count()
}

/// How often each image is updated in what a viewer was sent.
fn updates(mut sent: &[u8]) -> BTreeMap<String, usize> {
    let mut updates = BTreeMap::new();
    while let Some((length, _)) = sent.split_first_chunk::<4>() {
        let (packet, rest) = sent.split_at(u32::from_le_bytes(*length) as usize);
        if packet[4] == 6 {
            let name = packet[6..].split(|&byte| byte == 0).next().unwrap_or_default();
            *updates.entry(text(name)).or_default() += 1;
        }
        sent = rest;
    }
    updates
}

#[test]
fn every_page_shows_all_photos_in_order() {
    let folder = folder();
    let (rig, target) = (rig(&folder), target(&folder));
    for arguments in verbs(&target) {
        let out = inside(&folder, &arguments[0]);
        take(&arguments, &rig, &out, &[]);
        let page = page(&out);
        let photos = strip(&page);
        assert_eq!(photos, page.matches("aria-label=\"pattern ").count(), "{arguments:?}");
        // More than one, and in each verb one for each product.
        let expected = match arguments[0].as_str() {
            "segment" => 9,
            // The photos end where the noise of the rig hides what more would tell.
            "eigs" => photos.clamp(3, 7),
            "relight" => 8,
            // Beside white.
            "separate" => 12,
            // And white, since indirect light is what is left of it.
            "probe" => 6,
            // White, at most four of the method, and two that show the result and the uncompensated target.
            _ => photos.clamp(4, 7),
        };
        assert_eq!(photos, expected, "{arguments:?}");
        assert!(page.contains("stands for in DN/s"), "{arguments:?}: photos have a unit");
        assert!(!page.contains("alt=\"\"") && !page.contains("aria-label=\"\""), "pictures have a text");
        // An eigenvector of norm 1 has no unit; every other scale has.
        let (scales, units) =
            (page.matches("class=\"scale\"").count(), page.matches("</span><small>").count());
        let without = page.matches(": λ = ").count() / 2;
        // A constant eigenvector has a tile without scale.
        let constant = page.matches("the same at every pixel").count();
        assert_eq!(units + without, scales + constant, "{arguments:?}");
    }
}

#[test]
fn a_viewer_sees_every_pattern_and_photo_or_the_newest_of_them() {
    let folder = folder();
    let (rig, target) = (rig(&folder), target(&folder));
    for arguments in verbs(&target) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("some port is free");
        let address = listener.local_addr().expect("it is bound").to_string();
        let reader = std::thread::spawn(move || {
            let mut sent = Vec::new();
            let (mut stream, _) = listener.accept().expect("it calls");
            stream.read_to_end(&mut sent).map(|_| sent).expect("it can be read")
        });
        let out = inside(&folder, &arguments[0]);
        take(&arguments, &rig, &out, &["--tev", &address]);
        let updates = updates(&reader.join().expect("it reads"));
        let names: Vec<&str> = updates.keys().map(String::as_str).collect();
        assert_eq!(names, ["rig pattern", "rig photo"], "{arguments:?}");
        let photos = strip(&page(&out));
        assert!(updates.values().all(|&count| (1..=photos).contains(&count)), "{updates:?} of {photos}");
    }
}

#[test]
fn without_a_viewer_there_is_one_warning_and_the_same_answer() {
    let folder = folder();
    let rig = rig(&folder);
    let listener = TcpListener::bind("127.0.0.1:0").expect("some port is free");
    let address = listener.local_addr().expect("it is bound").to_string();
    drop(listener);
    let run = |name: &str, more: &[&str]| {
        let out = inside(&folder, name);
        let arguments =
            ["segment", &rig, "--photos", "9", "--groups", "2", "--eigenvectors", "4", "-o", &out];
        let output = krylux(&[&arguments, more].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let vectors = std::fs::read(Path::new(&out).join("eigenvectors.npy")).expect("it is written");
        (vectors, text(&output.stderr))
    };
    let (plain, _) = run("plain", &[]);
    let (seen, said) = run("seen", &["--tev", &address]);
    assert_eq!(said.matches("warning: --tev").count(), 1, "{said}");
    assert!(said.contains(&address), "{said}");
    assert!(plain == seen, "looking on changes nothing");
    let output = krylux(&["segment", &rig, "--tev", "nowhere"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("localhost:14158"), "{}", text(&output.stderr));
}

#[test]
fn a_run_asked_anew_takes_as_many_photos_as_it_holds() {
    let folder = folder();
    let (rig, target) = (rig(&folder), target(&folder));
    for arguments in verbs(&target) {
        let [out, again] = ["", "-again"].map(|end| inside(&folder, &format!("{}{end}", arguments[0])));
        let first = take(&arguments, &rig, &out, &[]);
        let at = arguments.iter().position(|word| word == "--photos").expect("each says how many");
        let unsaid = [&arguments[..at], &arguments[at + 2..]].concat();
        if arguments[0] == "relight" {
            // Its folder holds a model, which answers without any photo.
            continue;
        }
        let second = take(&unsaid, &out, &again, &[]);
        assert_eq!(first["photos"], second["photos"], "{arguments:?}");
        assert_eq!(strip(&page(&out)), strip(&page(&again)), "{arguments:?}: a replay shows the same photos");
    }
}

#[test]
fn photo_and_matrix_keep_their_photos_in_a_journal_too() {
    let folder = folder();
    let rig = rig(&folder);
    for (verb, file) in [("photo", "photo.npy"), ("matrix", "matrix.npz")] {
        let (journal, file) = (inside(&folder, verb), inside(&folder, file));
        let taken =
            |said: &Value| said["rig"]["effort"]["taken"].as_u64().expect("the rig counts its frames");
        let first = answer(&[verb, &rig, "-o", &file, "--journal", &journal]);
        let bytes = std::fs::read(&file).expect("it is written");
        assert!(taken(&first) > 0);
        let resumed = answer(&[verb, &rig, "-o", &file, "--journal", &journal, "--resume"]);
        assert_eq!(taken(&resumed), 0, "no photo is taken twice");
        assert!(bytes == std::fs::read(&file).expect("it is written"), "{verb}: to the same bits");
        let replayed = answer(&[verb, &journal, "-o", &file]);
        assert_eq!(taken(&replayed), 0, "nothing is attached");
        assert!(bytes == std::fs::read(&file).expect("it is written"), "{verb}: to the same bits");
        let refused = krylux(&[verb, &rig, "-o", &file, "--journal", &journal]);
        assert_eq!(refused.status.code(), Some(2), "what is there is not thrown away unasked");
    }
}
