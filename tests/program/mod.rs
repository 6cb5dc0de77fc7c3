//! The program as a user starts it, and two rooms to start it on.
#![allow(dead_code, reason = "each test binary uses its own part of this")]

use std::process::{Command, Output};

use krylux::io::sparse;
use krylux::sparse::Csr;
use serde_json::Value;
use tempfile::TempDir;

/// The program with these arguments. Every run traces for itself.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_krylux"));
    command.args(arguments).env("KRYLUX_CACHE", "");
    command
}

/// Like [`command`], on a machine without graphics device.
pub fn command_without_graphics(arguments: &[&str]) -> Command {
    let mut command = command(arguments);
    for (variable, nowhere) in [
        ("VK_DRIVER_FILES", "/nonexistent"),
        ("VK_ICD_FILENAMES", "/nonexistent"),
        ("XDG_DATA_DIRS", "/nonexistent"),
        ("XDG_CONFIG_DIRS", "/nonexistent"),
    ] {
        command.env(variable, nowhere);
    }
    command
}

/// The output of the program with these arguments, on a machine without graphics device.
pub fn krylux(arguments: &[&str]) -> Output {
    command_without_graphics(arguments).output().expect("the program is built with the tests")
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The summary that a successful verb prints with `--json`.
#[track_caller]
pub fn summary(arguments: &[&str]) -> Value {
    said(command_without_graphics, arguments, &[0]).0
}

/// Like [`summary`]; the verb may say that its answer is not good enough.
#[track_caller]
pub fn answer(arguments: &[&str]) -> Value {
    verdict(arguments).0
}

/// Like [`answer`], with the exit status.
#[track_caller]
pub fn verdict(arguments: &[&str]) -> (Value, i32) {
    said(command_without_graphics, arguments, &[0, 1])
}

/// Like [`verdict`], for a scene that has to be traced.
#[track_caller]
pub fn verdict_of_traced(arguments: &[&str]) -> (Value, i32) {
    said(command, arguments, &[0, 1])
}

#[track_caller]
fn said(start: fn(&[&str]) -> Command, arguments: &[&str], statuses: &[i32]) -> (Value, i32) {
    // `rig` has actions of its own, which take the option.
    let (verb, rest) = arguments.split_at(if arguments[0] == "rig" { 2 } else { 1 });
    let output =
        start(&[verb, &["--json"], rest].concat()).output().expect("the program is built with the tests");
    let status = output.status.code().unwrap_or(-1);
    assert!(statuses.contains(&status), "{arguments:?}: {}", text(&output.stderr));
    (serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON"), status)
}

/// Asserts an error of exit status 2 whose message holds all of `parts`; the message.
#[track_caller]
pub fn assert_error(output: &Output, parts: &[&str]) -> String {
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
    message
}

pub fn folder() -> TempDir {
    TempDir::new().expect("a temporary folder can be made")
}

pub fn inside(folder: &TempDir, name: &str) -> String {
    folder.path().join(name).display().to_string()
}

/// Two rooms with this number of pixels on a side, left and right: within one each pixel lights every other, between them there is no
/// light. Pixels send back `own` times as much to themselves.
pub fn rooms(side: usize, own: f64) -> Csr {
    let pixels = side * side;
    let (mut row_start, mut columns, mut weights) = (vec![0], Vec::new(), Vec::new());
    for row in 0..pixels {
        for column in (0..pixels).filter(|&column| is_right(column, side) == is_right(row, side)) {
            columns.push(column as u32);
            // Not all alike, so that there is one eigenvector to each eigenvalue.
            let near = (row / side).abs_diff(column / side) as f64;
            weights.push(if row == column { own } else { 1.0 / (1.0 + near) });
        }
        row_start.push(columns.len());
    }
    Csr::new(pixels, row_start, columns, weights).expect("well formed")
}

/// In which room a pixel is.
fn is_right(pixel: usize, side: usize) -> bool {
    pixel % side >= side / 2
}

/// The labels of the rooms.
pub fn labels_of_rooms(side: usize) -> Vec<f64> {
    (0..side * side).map(|pixel| f64::from(u8::from(is_right(pixel, side)))).collect()
}

/// A virtual rig in front of rooms, with little noise; `more` is added to the top of its file.
pub fn rig(folder: &TempDir, side: usize, more: &str) -> String {
    sparse::write(&folder.path().join("rooms.npz"), &rooms(side, 10.0)).expect("the folder can be written");
    let path = folder.path().join("rig.toml");
    let file = format!(
        "kind = \"virtual\"\n{more}\n[scene]\nmatrix = \"rooms.npz\"\nsize = [{side}, {side}]\n\
         [projector]\nbits = 12\n[camera]\nbits = 16\nfull_well = 1e9\n[measurement]\ndirect_square = 1\n"
    );
    std::fs::write(&path, file).expect("the folder can be written");
    path.display().to_string()
}
