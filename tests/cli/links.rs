//! A run's folder from a stranger: links to the user's files, and pipes that nobody writes to, in any place.

use std::ffi::OsStr;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::cli::files::ended;
use crate::program::{command_without_graphics, folder, inside, krylux, rig, text};

/// The places at which a run may have something, or a stranger may put it.
const PLACES: [&str; 22] = [
    "journal",
    "journal/lock",
    "journal/photos.journal",
    "journal/photos.new",
    "journal/calibration",
    "journal/calibration/calibration.toml",
    "journal/calibration/pixels.npy",
    "model",
    "model/model.json",
    "model/ambient.npy",
    "run.json",
    "report.html",
    "white.npy",
    "degree.npy",
    "eigenvalues.npy",
    "eigenvectors.exr",
    "labels-2.npy",
    "labels-2.png",
    ".answer",
    ".answer/report.html",
    "earlier-1",
    "earlier-1.moving",
];

/// Things that a stranger puts at a place.
const THINGS: [&str; 6] =
    ["pipe", "link to a file", "link to a folder", "link to nothing", "link to a device", "folder"];

fn put(thing: &str, path: &Path, outside: &Path) {
    let _ = match fs::symlink_metadata(path) {
        Ok(there) if there.is_dir() => fs::remove_dir_all(path),
        Ok(_) => fs::remove_file(path),
        Err(_) => Ok(()),
    };
    if let Some(above) = path.parent() {
        // Nothing is put below a link or a pipe.
        if fs::symlink_metadata(above).is_ok_and(|it| !it.is_dir()) || fs::create_dir_all(above).is_err() {
            return;
        }
    }
    match thing {
        "pipe" => {
            assert!(Command::new("mkfifo").arg(path).status().expect("every Unix has it").success());
        }
        "link to a file" => symlink(outside.join("thesis"), path).expect("links can be made"),
        "link to a folder" => symlink(outside, path).expect("links can be made"),
        "link to nothing" => symlink(outside.join("new"), path).expect("links can be made"),
        "link to a device" => symlink("/dev/zero", path).expect("links can be made"),
        _ => fs::create_dir(path).expect("it is ours"),
    }
}

/// Names and contents of everything below a folder.
fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("it is ours").flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(content(&path));
        }
        found.push((path.clone(), fs::read(&path).unwrap_or_default()));
    }
    found.sort();
    found
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("the folder is ours");
    for entry in fs::read_dir(from).expect("it is ours").flatten() {
        let (path, place) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &place);
        } else {
            fs::copy(&path, &place).expect("it can be read");
        }
    }
}

/// No question to such a folder changes anything beside it, waits for ever, or shows a panic.
#[test]
fn nothing_outside_a_strangers_run_changes_and_nothing_hangs() {
    let bench = folder();
    let rig = rig(&bench, 8, "");
    let whole = inside(&bench, "whole");
    let start = ["segment", &rig, "--photos", "6", "--groups", "2", "--eigenvectors", "2", "-o"];
    let made = krylux(&[&start[..], &[&whole]].concat());
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let outside = bench.path().join("outside");
    fs::create_dir_all(outside.join("calibration")).expect("the folder is ours");
    for name in ["thesis", "lock", "photos.journal", "run.json", "report.html", "calibration/pixels.npy"] {
        fs::write(outside.join(name), "years of work").expect("the folder is ours");
    }
    let before = content(&outside);

    let mut random = Pcg64::seed_from_u64(39);
    // Every thing at every place, alone or with others.
    let first = PLACES.iter().flat_map(|place| THINGS.iter().map(move |thing| (*place, *thing)));
    for (tried, first) in first.enumerate() {
        let run = bench.path().join(format!("run-{tried}"));
        copy(Path::new(&whole), &run);
        let others = (0..random.random_range(0..3)).map(|_| {
            (PLACES[random.random_range(0..PLACES.len())], THINGS[random.random_range(0..THINGS.len())])
        });
        let put_there: Vec<_> = others.chain([first]).collect();
        put_there.iter().for_each(|(place, thing)| put(thing, &run.join(place), &outside));
        let run = run.display().to_string();
        let again = [&start[..], &[&run]].concat();
        let answer = inside(&bench, &format!("answer-{tried}"));
        let questions: [&[&str]; 5] = [
            &[&again[..], &["--resume"]].concat(),
            &[&again[..], &["--overwrite"]].concat(),
            &["segment", &run, "--groups", "2", "-o", &answer],
            &["eigs", &run, "--photos", "5", "-o", &run],
            &["runs", "prune", &run],
        ];
        for arguments in [questions[random.random_range(0..2)], questions[random.random_range(2..5)]] {
            let what = format!("{arguments:?} with {put_there:?}");
            let mut command = command_without_graphics(arguments);
            let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
            let output = ended(child.expect("the program is built with the tests"), &what);
            let said = text(&output.stderr);
            let is_told = output.status.code().is_some_and(|code| code <= 2) && !said.contains("panicked");
            assert!(is_told, "{what}: {said}");
            assert_eq!(content(&outside), before, "{what}: {said}");
        }
        fs::remove_dir_all(&run).expect("it is ours");
    }
}

/// Entries of the cache are links to files of the user's, or pipes: they are not followed, and the matrix is traced.
#[test]
fn links_and_pipes_in_the_cache_are_not_opened() {
    let folder = folder();
    let cache = folder.path().join("cache");
    let scene = crate::common::scene_path("corner").display().to_string();
    let trace = |name: &str| {
        let file = inside(&folder, name);
        let mut command =
            crate::program::command(&["matrix", &scene, "--size", "6", "--spp", "2", "-o", &file]);
        // A GPU's own matrix would not be kept.
        command.args(["--products", "cpu"]);
        command.env("KRYLUX_CACHE", &cache).stderr(Stdio::piped());
        let output = ended(command.spawn().expect("the program is built with the tests"), name);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        fs::read(file).expect("it was written")
    };
    let expected = trace("first.npz");
    let entries: Vec<PathBuf> =
        fs::read_dir(&cache).expect("it is there").flatten().map(|entry| entry.path()).collect();
    let matrix =
        entries.iter().find(|path| path.extension() == Some(OsStr::new("npz"))).expect("it was kept");
    let victim = folder.path().join("victim");
    for thing in ["pipe", "link to a file", "link to nothing"] {
        fs::remove_file(matrix).expect("it is there");
        match thing {
            "pipe" => {
                assert!(Command::new("mkfifo").arg(matrix).status().expect("every Unix has it").success());
            }
            _ => symlink(&victim, matrix).expect("links can be made"),
        }
        match thing {
            "link to a file" => fs::write(&victim, "precious").expect("the folder is ours"),
            _ => drop(fs::remove_file(&victim)),
        }
        assert!(trace("again.npz") == expected, "{thing}");
        let kept = fs::read_to_string(&victim).ok();
        assert_eq!(kept.as_deref(), (thing == "link to a file").then_some("precious"), "{thing}");
        if fs::symlink_metadata(matrix).is_err() {
            fs::write(matrix, "").expect("the folder is ours");
        }
    }
}
