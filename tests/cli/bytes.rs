//! Names of any bytes but slash and zero, as every argument.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::Output;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::common::scene_path;
use crate::program::{command, command_without_graphics, folder, rig, rooms, text};

/// A name of random bytes that is no UTF-8.
fn bytes(random: &mut Pcg64) -> OsString {
    let mut name: Vec<u8> =
        (0..random.random_range(1..12)).map(|_| random.random_range(1..=255_u8)).collect();
    name.retain(|byte| *byte != b'/');
    name.insert(0, b'n');
    name.push(random.random_range(0x80..=0xff));
    name.push(b'.');
    OsString::from_vec(name)
}

#[track_caller]
fn told(output: &Output, what: &[OsString]) -> String {
    let said = text(&output.stderr);
    assert!(
        output.status.code().is_some_and(|code| code <= 2) && !said.contains("panicked"),
        "{what:?}: {said}"
    );
    said
}

/// Every verb with such bytes in place of each argument: a word about it, and no panic.
#[test]
fn every_argument_may_be_any_bytes() {
    let mut random = Pcg64::seed_from_u64(3);
    let mut verbs: Vec<(Vec<String>, clap::Command)> = vec![(Vec::new(), krylux::cli::command())];
    let mut tried = 0;
    while let Some((words, verb)) = verbs.pop() {
        for inner in verb.get_subcommands().filter(|inner| inner.get_name() != "help") {
            verbs.push(([&words[..], &[inner.get_name().to_owned()]].concat(), inner.clone()));
        }
        if words.is_empty() {
            continue;
        }
        let sources = verb.get_positionals().filter(|argument| argument.is_required_set()).count();
        let options = verb.get_opts().filter_map(|option| option.get_long()).map(|long| format!("--{long}"));
        for option in options.map(Some).chain([None]) {
            let mut arguments: Vec<OsString> = words.iter().map(OsString::from).collect();
            arguments.extend((0..sources).map(|_| bytes(&mut random)));
            arguments.extend(
                option.map(OsString::from).into_iter().flat_map(|option| [option, bytes(&mut random)]),
            );
            arguments.push("--json".into());
            let mut command = command_without_graphics(&[]);
            // Answers without a folder go to `out/`.
            let folder = folder();
            let output = command
                .args(&arguments)
                .current_dir(folder.path())
                .stdin(std::process::Stdio::null())
                .output();
            told(&output.expect("the program is built with the tests"), &arguments);
            tried += 1;
        }
    }
    assert!(tried > 300, "{tried} arguments");
}

/// A whole piece of work in folders and files of such names: it is done, and the records keep the bytes.
#[test]
fn work_is_done_under_any_name_and_its_records_keep_the_bytes() {
    for seed in 0..3 {
        let mut random = Pcg64::seed_from_u64(seed);
        let top = folder();
        let work = top.path().join(bytes(&mut random));
        fs::create_dir(&work).expect("the system takes any name");
        let name = |random: &mut Pcg64, extension: &str| -> PathBuf {
            let mut name = bytes(random);
            name.push(extension);
            work.join(name)
        };
        let [scene, matrix, run, model, photo, difference, calibration] =
            ["glb", "npz", "run", "model", "npy", "png", "calibration"].map(|of| name(&mut random, of));
        fs::copy(scene_path("corner"), &scene).expect("the folder is ours");
        krylux::io::sparse::write(&matrix, &rooms(6, 4.0)).expect("the folder is ours");
        let file = name(&mut random, "toml");
        fs::rename(rig(&top, 8, ""), &file).expect("the folder is ours");
        fs::rename(top.path().join("rooms.npz"), work.join("rooms.npz")).expect("the folder is ours");
        let ask = |words: &[&dyn AsRef<OsStr>]| {
            let arguments: Vec<OsString> = words.iter().map(|word| word.as_ref().to_owned()).collect();
            let output = command(&[]).args(&arguments).arg("--json").current_dir(&work).output();
            let output = output.expect("the program is built with the tests");
            let said = told(&output, &arguments);
            assert!(matches!(output.status.code(), Some(0 | 1)), "{arguments:?}: {said}");
            serde_json::from_slice::<serde_json::Value>(&output.stdout).expect("one object of JSON")
        };
        let segment: [&dyn AsRef<OsStr>; 8] =
            [&"segment", &file, &"--photos", &"6", &"--groups", &"2", &"-o", &run];
        ask(&segment);
        let record: serde_json::Value =
            serde_json::from_slice(&fs::read(run.join("run.json")).expect("it was written"))
                .expect("it is JSON");
        assert_eq!(recorded(&record["scene"]["path"]), file.as_os_str(), "{record}");
        let words = record["command"].as_array().expect("it has the words");
        assert!(words.iter().any(|word| recorded(word) == run.as_os_str()), "{record}");
        ask(&[&segment[..], &[&"--resume"]].concat());
        ask(&[&segment[..], &[&"--overwrite"]].concat());
        ask(&[&"segment", &run, &"--groups", &"2", &"-o", &run]);
        ask(&[&"eigs", &matrix, &"--count", &"2", &"-o", &name(&mut random, "eigs")]);
        ask(&[&"photo", &scene, &"--size", &"6", &"--spp", &"2", &"-o", &photo]);
        ask(&[&"compare", &photo, &photo, &"-o", &difference]);
        ask(&[&"relight", &scene, &"--size", &"6", &"--spp", &"2", &"--photos", &"4", &"-o", &model]);
        ask(&[&"relight", &model, &"--pattern", &"left", &"-o", &name(&mut random, "relit")]);
        ask(&[&"matrix", &scene, &"--size", &"6", &"--spp", &"2", &"-o", &name(&mut random, "mtx")]);
        ask(&[&"labels", &scene, &"--size", &"6", &"-o", &name(&mut random, "png")]);
        ask(&[&"info", &scene]);
        ask(&[&"info", &file]);
        ask(&[&"rig", &"calibrate", &file, &"-o", &calibration]);
        ask(&[&"runs", &"list", &work]);
        ask(&[&"index", &work]);
        assert!(Path::new(&difference).exists());
    }
}

/// The bytes of a path in a record.
fn recorded(value: &serde_json::Value) -> OsString {
    match value {
        serde_json::Value::String(text) => text.into(),
        other => {
            let bytes = other["Unix"].as_array().expect("text or bytes").iter();
            let bytes: Vec<u8> = bytes
                .map(|byte| byte.as_u64().and_then(|byte| byte.try_into().ok()).expect("a byte"))
                .collect();
            OsStr::from_bytes(&bytes).to_owned()
        }
    }
}
