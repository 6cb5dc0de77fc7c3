//! The program on rig files: the same verbs, other sources of photos.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::common::{root, scene_path};
use crate::program::{self, folder, inside, krylux, labels_of_rooms, summary, text};
use krylux::io::{npy, sparse};
use krylux::journal::Journal;
use krylux::sparse::Csr;
use serde_json::Value;
use tempfile::TempDir;

/// Pixels on a side of the little rig.
const SIDE: usize = 6;

fn rig(folder: &TempDir, more: &str) -> String {
    program::rig(folder, SIDE, more)
}

/// Asserts an error of exit status 2 whose message holds all of `parts`.
#[track_caller]
fn assert_error(arguments: &[&str], parts: &[&str]) {
    program::assert_error(&krylux(arguments), parts);
}

#[test]
fn segmentation_of_a_rig_needs_no_graphics_device_and_records_what_it_cost() {
    let folder = folder();
    let (rig, out) = (rig(&folder, ""), inside(&folder, "run"));
    let arguments = ["segment", &rig, "--photos", "12", "--groups", "2", "--eigenvectors", "3", "-o", &out];
    let output = krylux(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    // Without a calibration it works, and says so.
    assert!(text(&output.stderr).contains("names no calibration"), "{}", text(&output.stderr));
    let out = PathBuf::from(out);
    let labels = npy::read_npy(&out.join("labels-2.npy")).expect("it is written").values;
    assert_eq!(labels, labels_of_rooms(SIDE));
    let record = std::fs::read(out.join("run.json")).expect("a run has a record");
    let record: Value = serde_json::from_slice(&record).expect("it is JSON");
    let cost = &record["rig"];
    let [patterns, shown, taken] = [&cost["patterns"], &cost["effort"]["shown"], &cost["effort"]["taken"]]
        .map(|n| n.as_u64().unwrap_or(0));
    assert!(patterns > 12 && shown >= patterns && taken >= shown, "{cost}");
    assert!(cost["noise"].as_f64().is_some_and(|noise| noise > 0.0 && noise < 0.01), "{cost}");
    assert!(record["scene"]["path"].as_str().is_some_and(|path| path.ends_with("rig.toml")));
    let page = std::fs::read_to_string(out.join("report.html")).expect("a run has a report");
    assert!(page.contains("Patterns") && page.contains("devices taken as ideal"));
}

#[test]
fn a_rigs_matrix_is_photographed_column_by_column() {
    let folder = folder();
    let (rig, file) = (rig(&folder, ""), inside(&folder, "found.npz"));
    let said = summary(&["matrix", &rig, "-o", &file]);
    assert_eq!(said["columns"], SIDE * SIDE);
    assert!(said["rig"]["patterns"].as_u64().is_some_and(|patterns| patterns as usize >= SIDE * SIDE));
    let (found, expected) =
        (sparse::read(Path::new(&file)).expect("it is written"), program::rooms(SIDE, 10.0));
    let dense = |csr: &Csr| {
        let mut dense = vec![0.0; (SIDE * SIDE).pow(2)];
        csr.entries().for_each(|(row, column, weight)| dense[row * SIDE * SIDE + column] = weight);
        dense
    };
    let (found, expected) = (dense(&found), dense(&expected));
    // The units are the camera's.
    let scale = found[0] / expected[0];
    // A bright pixel alone is a tenth of white, which fills half of 65535 counts: one count's rounding is 3e-4 of it, and of the
    // black photo that is subtracted as much.
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found / scale - expected).abs() < 0.02, "{found} {expected}");
    }
    assert_error(&["matrix", &rig, "--photos", "35"], &["--photos", "36 photos", "35"]);
    assert_error(&["matrix", &rig, "--split-bounces"], &["--split-bounces"]);
}

#[test]
fn eigenvalues_and_photos_of_a_rig_are_those_of_its_matrix() {
    let folder = folder();
    let (rig, out) = (rig(&folder, ""), inside(&folder, "run"));
    let arguments = ["eigs", &rig, "--count", "3", "--photos", "20", "--tolerance", "1e-2", "-o", &out];
    // The two rooms are alike: one start sees one copy of each of their eigenvalues, and a rig takes photos only to confirm what it is asked to.
    let found = summary(&[&arguments[..], &["--confirm", "0.1"]].concat());
    assert_eq!(found["completeness"]["claim"], "confirmed");
    let matrix = inside(&folder, "rooms.npz");
    let out = inside(&folder, "exact");
    let exact =
        summary(&["eigs", &matrix, "--count", "3", "--photos", "30", "--tolerance", "1e-6", "-o", &out]);
    let values = |summary: &Value| -> Vec<f64> {
        let values = summary["eigenvalues"].as_array().expect("there are some");
        values.iter().map(|value| value.as_f64().expect("a number")).collect()
    };
    let (found, exact) = (values(&found), values(&exact));
    // Ratios are free of the camera's units.
    for index in 1..3 {
        assert!((found[index] / found[0] - exact[index] / exact[0]).abs() < 1e-2, "{found:?} {exact:?}");
    }
    let file = inside(&folder, "photo.npy");
    let photo = summary(&["photo", &rig, "--pattern", "left", "-o", &file]);
    assert_eq!(photo["unit"], "DN/s");
    let photo = npy::read_npy(Path::new(&file)).expect("it is written").values;
    // The right room is dark but for noise.
    let rooms = |left: bool| -> f64 {
        let of = |pixel: &usize| (pixel % SIDE < SIDE / 2) == left;
        (0..photo.len()).filter(of).map(|pixel| photo[pixel]).sum()
    };
    assert!(rooms(false).abs() < 1e-3 * rooms(true), "{photo:?}");
}

#[test]
fn compensation_on_a_rig_takes_no_photos_for_comparison() {
    let folder = folder();
    let (rig, target, out) = (rig(&folder, ""), folder.path().join("target.npy"), inside(&folder, "run"));
    let striped: Vec<f64> =
        (0..SIDE * SIDE).map(|pixel| 0.8 + 0.2 * f64::from(u8::from(pixel % 2 == 0))).collect();
    npy::write_npy(&target, &[SIDE, SIDE], &striped).expect("the folder can be written");
    let target = target.display().to_string();
    let said =
        summary(&["compensate", &rig, "--target", &target, "--photos", "8", "--rtol", "0.02", "-o", &out]);
    assert!(said["relative_residual"].as_f64().is_some_and(|residual| residual <= 0.02), "{said}");
    assert!(said["relative_residual_jacobi"].is_null(), "{said}");
    // Its photos, those that show target and result, black and white.
    let [patterns, photos] = [&said["rig"]["patterns"], &said["photos"]].map(|n| n.as_u64().unwrap_or(0));
    assert!(patterns <= 2 * photos + 4, "{said}");
}

#[test]
fn methods_on_a_rig_are_compared_by_their_frames_too() {
    let folder = folder();
    let (rig, target, out) = (rig(&folder, ""), folder.path().join("target.npy"), inside(&folder, "run"));
    let striped: Vec<f64> = (0..SIDE * SIDE).map(|pixel| 0.6 + 0.2 * (pixel % 3) as f64).collect();
    npy::write_npy(&target, &[SIDE, SIDE], &striped).expect("the folder can be written");
    let target = target.display().to_string();
    let said =
        summary(&["compensate", &rig, "--target", &target, "--photos", "4", "--compare-methods", "-o", &out]);
    let methods = said["methods"].as_array().expect("methods were compared");
    for method in methods {
        let frames: Vec<u64> =
            method["frames"].as_array().into_iter().flatten().filter_map(Value::as_u64).collect();
        // Each photo is one frame at the least, but for that of an even pattern: it is the white photo's.
        assert!(!frames.is_empty() && frames.is_sorted(), "{method}");
        assert!(frames.last().is_some_and(|&last| last + 1 >= frames.len() as u64), "{method}");
    }
    let read = |name: &str| std::fs::read_to_string(Path::new(&out).join(name)).unwrap_or_default();
    assert!(read("methods.csv").starts_with("method,photo,frames,relative_residual_displayed\n"));
    assert!(read("report.html").contains("Relative residual over frames"));
}

#[test]
fn options_of_the_tracer_are_refused_where_nothing_is_traced() {
    let folder = folder();
    let rig = rig(&folder, "");
    for (option, value) in [("--spp", "8"), ("--size", "8"), ("--adapter", "gpu"), ("--camera", "left")] {
        assert_error(&["photo", &rig, option, value], &[option, "rig.toml"]);
    }
    assert_error(&["photo", &rig, "--operator", "retrace"], &["--operator", "rig"]);
    assert_error(&["segment", &rig, "--memory", "1GiB"], &["--memory", "rig"]);
    assert_error(&["photo", &rig, "--channels", "rgb"], &["--channels", "rig.toml", "luma"]);
    assert_error(&["labels", &rig], &["rig.toml", "scene"]);
}

#[test]
fn a_rig_file_with_a_fault_is_named() {
    let folder = folder();
    assert_error(&["segment", "missing.toml"], &["missing.toml"]);
    let misspelt = rig(&folder, "sede = 1");
    assert_error(&["segment", &misspelt], &["rig.toml", "sede", "seed"]);
    let uncalibrated = rig(&folder, "calibration = \"nowhere\"");
    assert_error(&["segment", &uncalibrated], &["nowhere"]);
    let path = scene_path("zigzag").display().to_string();
    assert_error(&["plan", &path, "segment"], &["SOURCE", ".toml"]);
}

#[test]
fn info_describes_a_rig_file_without_opening_it() {
    let path = root().join("assets/rigs/realistic.toml").display().to_string();
    let said = summary(&["info", &path]);
    assert_eq!(said["rig"]["projector"]["bits"], 8);
    assert_eq!(said["rig"]["camera"]["resolution"]["width"], 160);
    assert!(said["rig"]["scene"].as_str().is_some_and(|scene| scene.contains("zigzag")));
}

#[test]
fn a_plan_predicts_cost_and_error_from_the_twin() {
    let folder = folder();
    let rig = rig(&folder, "");
    let question = ["--trials", "2", "segment", "--photos", "12", "--groups", "2", "--eigenvectors", "3"];
    let said = summary(&[&["plan", rig.as_str()], &question[..]].concat()[..]);
    assert_eq!(said["trials"].as_array().map(Vec::len), Some(2));
    // A run takes the predicted photos: its noise is another, but changes no choice here.
    let out = inside(&folder, "run");
    let run =
        summary(&["segment", &rig, "--photos", "12", "--groups", "2", "--eigenvectors", "3", "-o", &out]);
    let predicted = said["patterns"]["mean"].as_f64().expect("it is predicted");
    let taken = run["rig"]["patterns"].as_f64().expect("it is recorded");
    assert!((predicted - taken).abs() <= 0.1 * taken, "{predicted} predicted, {taken} taken");
    assert_eq!(said["figures"]["2 groups against those without noise"]["mean"], 1.0);
    let target = folder.path().join("target.npy");
    npy::write_npy(&target, &[SIDE, SIDE], &[0.9; SIDE * SIDE]).expect("the folder can be written");
    let target = target.display().to_string();
    let said = summary(&["plan", &rig, "compensate", "--target", &target]);
    assert!(said["figures"]["residual"]["mean"].as_f64().is_some_and(|residual| residual < 0.05), "{said}");
}

/// A rig that can be calibrated: it looks at a wall with a little light from each pixel to its neighbour. The file and its text.
fn wall(folder: &TempDir) -> (String, String) {
    const SIDE: usize = 16;
    let pixels = SIDE * SIDE;
    let (mut row_start, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for row in 0..pixels {
        for column in [row.saturating_sub(1), row] {
            columns.push(column as u32);
            weights.push(if row == column { 10.0 } else { 0.5 });
        }
        if row == 0 {
            columns.pop();
            weights.pop();
        }
        row_start.push(columns.len());
    }
    let matrix = Csr::new(pixels, row_start, columns, weights).expect("well formed");
    sparse::write(&folder.path().join("wall.npz"), &matrix).expect("the folder can be written");
    let rig = inside(folder, "rig.toml");
    let file = format!(
        "kind = \"virtual\"\n[scene]\nmatrix = \"wall.npz\"\nsize = [{SIDE}, {SIDE}]\n\
         [projector]\nbits = 6\ngamma = 2.2\nlatency = 0.02\n[camera]\nsize = [40, 40]\nbits = 14\n"
    );
    std::fs::write(&rig, &file).expect("the folder can be written");
    (rig, file)
}

#[test]
fn a_calibration_that_was_cut_off_goes_on_without_taking_a_photo_twice() {
    let folder = folder();
    let (rig, file) = wall(&folder);
    let [whole, cut] = ["whole", "cut"].map(|name| inside(&folder, name));
    let calibrate = |output: &str, more: &[&str]| {
        let mut arguments = vec!["rig", "calibrate", "--json", &rig, "-o", output];
        arguments.extend(more);
        let output = krylux(&arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let said: Value = serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON");
        ["taken", "replayed"].map(|kind| said["effort"][kind].as_u64().expect("a number"))
    };
    let [taken, replayed] = calibrate(&whole, &[]);
    assert!(taken > 100 && replayed == 0, "{taken} {replayed}");
    assert_error(&["rig", "calibrate", &rig, "-o", &whole], &["already holds a run", "--resume"]);

    // The journal of a killed program ends in the middle of a photo.
    std::fs::create_dir_all(Path::new(&cut).join("journal")).expect("the folder can be written");
    let journal = |of: &str| Path::new(of).join("journal/photos.journal");
    let bytes = std::fs::read(journal(&whole)).expect("it was written");
    std::fs::write(journal(&cut), &bytes[..bytes.len() * 2 / 3]).expect("the folder can be written");
    let [again, kept] = calibrate(&cut, &["--resume"]);
    assert!(again > 0 && kept > 0 && again + kept == taken, "{again} {kept} of {taken}");
    for name in ["calibration.toml", "projector-curve.npy", "registration-weights.npy"] {
        let [one, other] =
            [&whole, &cut].map(|of| std::fs::read(Path::new(of).join(name)).expect("it is there"));
        assert_eq!(one, other, "{name}");
    }

    // Nothing but --use changes the rig file, and then by one line.
    assert_eq!(std::fs::read_to_string(&rig).expect("it is there"), file);
    let used = krylux(&["rig", "calibrate", &rig, "-o", &whole, "--resume", "--use"]);
    assert!(used.status.success(), "{}", text(&used.stderr));
    let named = std::fs::read_to_string(&rig).expect("it is there");
    assert_eq!(named.replace("calibration = \"whole\"\n", ""), file);
    let info = krylux(&["info", &rig]);
    assert!(text(&info.stdout).contains("whole"), "{}", text(&info.stdout));
}

/// The bytes of every file below a folder.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).expect("it is a folder") {
        let path = entry.expect("an entry").path();
        match path.is_dir() {
            true => all.extend(files(&path)),
            false => drop(all.insert(path.clone(), std::fs::read(&path).expect("it can be read"))),
        }
    }
    all
}

#[test]
fn a_rig_is_calibrated_again_beside_its_earlier_calibration() {
    let folder = folder();
    let (rig, file) = wall(&folder);
    let calibrate =
        |more: &[&'static str]| [&["rig", "calibrate", rig.as_str(), "--use", "--takes", "1"], more].concat();
    let read = || std::fs::read_to_string(&rig).expect("it is there");
    let use_of = |name: &str| format!("calibration = \"{name}\"\n");
    let home = folder.path().canonicalize().expect("it is there");
    let mut earlier = BTreeMap::new();
    for name in ["rig-calibration", "rig-calibration-2"] {
        let said = krylux(&calibrate(&[]));
        assert!(said.status.success(), "{}", text(&said.stderr));
        assert_eq!(read().replace(&use_of(name), ""), file, "{name}");
        assert!(
            earlier.iter().all(|(path, bytes)| std::fs::read(path).ok().as_ref() == Some(bytes)),
            "{name}"
        );
        earlier = files(&home.join("rig-calibration"));
        assert!(earlier.len() > 5);
    }

    // A third one is killed as soon as it has a photo: the file stays, and it is neither started anew nor forgotten.
    let (before, third) = (read(), home.join("rig-calibration-3"));
    let mut killed =
        program::command_without_graphics(&calibrate(&[])).spawn().expect("the program is built");
    while !Journal::read_only(&third.join("journal")).is_ok_and(|journal| journal.photos() > 0) {
        assert!(killed.try_wait().expect("it is ours").is_none(), "it takes a photo before it ends");
    }
    killed.kill().and_then(|()| killed.wait()).expect("it is ours");
    assert_error(&calibrate(&[]), &["rig-calibration-3 already holds a run", "--resume"]);
    assert_eq!(read(), before);
    let said = krylux(&calibrate(&["--resume"]));
    assert!(said.status.success(), "{}", text(&said.stderr));
    assert_eq!(read().replace(&use_of("rig-calibration-3"), ""), file);

    // One that fails changes nothing either: it has no room for its photos.
    let (before, kept) = (read(), files(&home));
    std::fs::write(home.join("rig-calibration-4"), "").expect("the folder can be written");
    let taken = inside(&folder, "rig-calibration-4");
    assert!(!krylux(&[&calibrate(&["-o"])[..], &[&taken]].concat()).status.success());
    std::fs::remove_file(home.join("rig-calibration-4")).expect("it is ours");
    assert!(read() == before && files(&home) == kept);
}

#[test]
fn a_camera_with_too_few_pixels_is_called_that_and_not_out_of_focus() {
    let folder = folder();
    let (rig, file) = wall(&folder);
    std::fs::write(&rig, file.replace("size = [40, 40]", "size = [8, 40]")).expect("it is ours");
    let checked = krylux(&["rig", "check", &rig]);
    let said = text(&checked.stdout);
    assert_eq!(checked.status.code(), Some(1), "{said}");
    let line = said.lines().find(|line| line.starts_with("pixels")).unwrap_or_default();
    for part in ["FAILS", "0.50 x 2.50 pixels for each", "8x40 for 16x16", "at most 8x16 pixels"] {
        assert!(line.contains(part), "{part}: {line}");
    }
    let out = inside(&folder, "calibration");
    let calibrated = krylux(&["rig", "calibrate", &rig, "-o", &out]);
    let message = program::assert_error(&calibrated, &["0.50 x 2.50 pixels", "at most 8x16 pixels"]);
    assert!(!message.contains("into focus"), "{message}");
    std::fs::write(&rig, file).expect("it is ours");
    let said = krylux(&["rig", "check", &rig]);
    assert!(!text(&said.stdout).contains("pixels for each"), "{}", text(&said.stdout));
}

#[test]
fn a_wide_camera_is_told_to_be_cropped_at_the_default_size() {
    let folder = folder();
    let bytes = std::fs::read(scene_path("cornell")).expect("it is shipped");
    let length = u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
    let mut document: Value = serde_json::from_slice(&bytes[20..20 + length]).expect("it is JSON");
    document["cameras"][0]["perspective"]["aspectRatio"] = Value::from(16.0 / 9.0);
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let rest = &bytes[20 + length..];
    let total = (20 + json.len() + rest.len()) as u32;
    let sizes = [&total.to_le_bytes()[..], &(json.len() as u32).to_le_bytes(), &bytes[16..20]].concat();
    let scene = inside(&folder, "wide.glb");
    std::fs::write(&scene, [&bytes[..8], &sizes, &json, rest].concat()).expect("there is room");
    let photo = |source: &str, more: &[&str]| {
        let out = inside(&folder, "photo.npy");
        let arguments = [&["photo", source, "--spp", "1", "-o", &out], more].concat();
        let output = program::command(&arguments).output().expect("the program is built");
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stderr)
    };
    let note = photo(&scene, &[]);
    for part in ["note: the camera", "128x128", "44 % of its picture is cut off", "--size 128x72 or 228x128"]
    {
        assert!(note.contains(part), "{part}: {note}");
    }
    for size in ["128x72", "228x128"] {
        assert!(!photo(&scene, &["--size", size]).contains("cut off"), "{size}");
    }
    let square = scene_path("cornell").display().to_string();
    assert!(!photo(&square, &["--size", "16"]).contains("cut off"));
}
