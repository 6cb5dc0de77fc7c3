//! Streams that nobody reads: a closed standard output, and a standard error that cannot be written.

use std::fs::OpenOptions;
use std::path::Path;
use std::process::{Command, Stdio};

use krylux::image::{Image, Resolution};
use krylux::io::npy;

use crate::program::{command_without_graphics, folder, inside, rig};

/// The exit status of a verb whose standard output and standard error have no reader.
fn unread(mut command: Command) -> Option<i32> {
    let closed = || {
        let (reader, writer) = std::io::pipe().expect("the system has pipes");
        drop(reader);
        Stdio::from(writer)
    };
    command.stdout(closed()).stderr(closed()).status().expect("the program is built with the tests").code()
}

/// The exit status of a verb whose standard error is on a full disk.
fn noted_on_a_full_disk(mut command: Command) -> Option<i32> {
    let full = OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
    command.stdout(Stdio::null()).stderr(full).status().expect("the program is built with the tests").code()
}

#[test]
fn streams_without_a_reader_change_no_verdict() {
    let folder = folder();
    let [one, other] = [("one.npy", 0.5), ("other.npy", 0.25)].map(|(name, value)| {
        let path = inside(&folder, name);
        npy::write_image(Path::new(&path), &Image::filled(Resolution::new(12, 12), 1, value))
            .expect("it is ours");
        path
    });
    let rig = rig(&folder, 8, "");
    let run = inside(&folder, "run");
    let cases: [(&[&str], i32); 6] = [
        (&["compare", &one, &one, "--max-rmse", "0.1"], 0),
        (&["compare", &one, &other, "--max-rmse", "0.1"], 1),
        (&["compare", &one, &other, "--max-rmse", "0.1", "--json"], 1),
        (
            &[
                "eigs",
                &rig,
                "--photos",
                "3",
                "--count",
                "3",
                "--tolerance",
                "1e-15",
                "-o",
                &run,
                "--overwrite",
            ],
            1,
        ),
        (&["compare", &one, "none.npy"], 2),
        (&["compare"], 2),
    ];
    for (arguments, expected) in cases {
        assert_eq!(unread(command_without_graphics(arguments)), Some(expected), "unread: {arguments:?}");
        let found = noted_on_a_full_disk(command_without_graphics(arguments));
        assert_eq!(found, Some(expected), "on a full disk: {arguments:?}");
    }
}

#[test]
fn a_run_without_a_reader_is_done_to_the_end() {
    let folder = folder();
    let (rig, run) = (rig(&folder, 8, ""), inside(&folder, "run"));
    let segment = ["segment", &rig, "--photos", "6", "--groups", "2", "--eigenvectors", "2", "-o", &run];
    assert_eq!(unread(command_without_graphics(&segment)), Some(0));
    assert!(Path::new(&run).join("report.html").is_file());
}
