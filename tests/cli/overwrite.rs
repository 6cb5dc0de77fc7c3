//! A run that replaces another leaves nothing of it, whatever happens in between.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::program::{command_without_graphics, folder, inside, krylux, rig, text};

fn names(folder: &str) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).expect("the run has a folder").flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// Content of all files of numbers, by name.
fn arrays(folder: &str) -> Vec<(String, Vec<u8>)> {
    let is_array = |name: &String| Path::new(name).extension().is_some_and(|it| it == "npy");
    let arrays = names(folder).into_iter().filter(is_array);
    arrays.map(|name| (name.clone(), fs::read(Path::new(folder).join(name)).unwrap_or_default())).collect()
}

#[track_caller]
fn done(arguments: &[&str]) {
    let output = krylux(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", text(&output.stderr));
}

#[test]
fn no_array_of_another_question_stays() {
    let bench = folder();
    let small = rig(&bench, 8, "");
    let run = inside(&bench, "run");
    let segment = ["segment", &small, "--photos", "8", "--eigenvectors", "2", "-o", &run, "--groups"];
    done(&[&segment[..], &["2,4"]].concat());
    assert!(names(&run).contains("labels-4.npy"));
    // A file of the user's is none of the run's.
    fs::write(Path::new(&run).join("notes.txt"), "mine").expect("the folder is ours");
    done(&[&segment[..], &["2", "--overwrite"]].concat());
    assert!(
        !names(&run).contains("labels-4.npy") && names(&run).contains("labels-2.npy"),
        "{:?}",
        names(&run)
    );
    // Another question in the same folder is asked of the same photos; what replaces both knows the arrays of both.
    done(&["segment", &run, "--groups", "3", "--eigenvectors", "2", "-o", &run]);
    assert!(names(&run).contains("labels-3.npy") && names(&run).contains("labels-2.npy"));
    // The earlier answer goes when the run is asked another question, and goes on, in its own folder.
    done(&[&segment[..], &["4", "--overwrite"]].concat());
    done(&[&segment[..], &["2", "--resume"]].concat());
    assert!(
        !names(&run).contains("labels-4.npy") && names(&run).contains("labels-2.npy"),
        "{:?}",
        names(&run)
    );
    let eigs = krylux(&["eigs", &small, "--photos", "8", "-o", &run, "--overwrite"]);
    assert!(matches!(eigs.status.code(), Some(0 | 1)), "{}", text(&eigs.stderr));
    let left: Vec<String> = names(&run).into_iter().filter(|name| name.starts_with("labels")).collect();
    assert!(left.is_empty() && names(&run).contains("notes.txt"), "{left:?}");
}

/// A record may list any path: only names in its own folder are moved.
#[test]
fn a_strangers_record_reaches_nothing_outside() {
    let bench = folder();
    let small = rig(&bench, 8, "");
    let run = inside(&bench, "run");
    let segment = ["segment", &small, "--photos", "8", "--groups", "2", "--eigenvectors", "2", "-o", &run];
    done(&segment);
    let victim = inside(&bench, "victim");
    fs::write(&victim, "precious").expect("the folder is ours");
    let path = Path::new(&run).join("run.json");
    let mut record: serde_json::Value =
        serde_json::from_slice(&fs::read(&path).expect("it is there")).expect("it is JSON");
    let notes = Path::new(&run).join("notes");
    fs::create_dir(&notes).expect("the folder is ours");
    fs::write(notes.join("mine"), "precious").expect("the folder is ours");
    record["outputs"] = serde_json::json!([
        "../victim",
        victim,
        "/etc/hostname",
        ".",
        "..",
        "",
        "journal/../../victim",
        "notes/other",
        "notes/../x"
    ]);
    record["replaces"] = serde_json::json!(["..", "../victim", "earlier-", "earlier-1/../../victim"]);
    fs::write(&path, record.to_string()).expect("the folder is ours");
    done(&[&segment[..], &["--overwrite"]].concat());
    assert_eq!(fs::read_to_string(&victim).ok().as_deref(), Some("precious"));
    assert_eq!(
        fs::read_to_string(notes.join("mine")).ok().as_deref(),
        Some("precious"),
        "no file of the run's"
    );
}

/// A run without photos cannot go on, and its answer is not replaced by that to another question.
#[test]
fn resume_replaces_no_answer_to_another_question() {
    let bench = folder();
    let (small, model, run) = (rig(&bench, 8, ""), inside(&bench, "model"), inside(&bench, "run"));
    done(&["relight", &small, "--photos", "4", "-o", &model]);
    // A question to the model alone keeps no photos.
    done(&["relight", &model, "--pattern", "left", "-o", &run]);
    let before = (names(&run), arrays(&run));
    let other = krylux(&["segment", &small, "--photos", "8", "--groups", "2", "-o", &run, "--resume"]);
    crate::program::assert_error(&other, &["answer to another question", "--overwrite"]);
    assert!((names(&run), arrays(&run)) == before);
}

/// Kills at random moments while one run replaces another. When a run is whole in the end, the folder holds what it holds without a kill.
#[test]
fn after_kills_the_folder_holds_one_whole_run() {
    let bench = folder();
    let small = rig(&bench, 8, "");
    let whole = inside(&bench, "whole");
    let ask = |run: &str, groups: &str, more: &[&str]| -> Vec<String> {
        let words =
            ["segment", &small, "--photos", "8", "--eigenvectors", "2", "-q", "-o", run, "--groups", groups];
        words.iter().chain(more).map(|word| (*word).to_owned()).collect()
    };
    let start = |words: &[String]| {
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let child = command_without_graphics(&words).stderr(Stdio::piped()).spawn();
        child.expect("the program is built with the tests")
    };
    let end = |words: &[String]| {
        let output = start(words).wait_with_output().expect("it is our child");
        assert_eq!(output.status.code(), Some(0), "{words:?}: {}", text(&output.stderr));
    };
    end(&ask(&whole, "2", &["--seed", "7"]));
    let begun = Instant::now();
    end(&ask(&whole, "2", &["--seed", "7", "--overwrite"]));
    let long = begun.elapsed();
    let expected = (names(&whole), arrays(&whole));

    let mut random = Pcg64::seed_from_u64(39);
    let mut kills = 0;
    for tried in 0..60 {
        let run = inside(&bench, &format!("run-{tried}"));
        end(&ask(&run, "2,4", &[]));
        let replace = ask(&run, "2", &["--seed", "7", "--overwrite"]);
        for _ in 0..random.random_range(1..3) {
            let mut child = start(&replace);
            std::thread::sleep(random.random_range(Duration::ZERO..long));
            let _ = child.kill();
            let output = child.wait_with_output().expect("it is our child");
            kills += usize::from(output.status.code().is_none());
        }
        // The new run goes on, or, where the kill came before its record, the earlier one with the new question.
        end(&ask(&run, "2", &["--seed", "7", "--resume"]));
        assert_eq!(names(&run), expected.0, "run {tried}");
        assert!(arrays(&run) == expected.1, "run {tried}: other arrays");
        fs::remove_dir_all(&run).expect("nobody uses it any more");
    }
    assert!(kills > 30, "{kills} kills");
}
