//! Manners of all verbs: options before and after the verb, errors for machines, and the files that are replaced.

use std::path::Path;

use krylux::image::{Image, Resolution};
use krylux::io::npy;
use serde_json::Value;

use crate::program::{command_without_graphics, folder, inside, krylux, rig, text};

#[test]
fn options_of_all_verbs_stand_before_and_after_the_verb() {
    let folder = folder();
    let one = inside(&folder, "one.npy");
    npy::write_image(Path::new(&one), &Image::filled(Resolution::new(12, 12), 1, 0.5)).expect("it is ours");
    let orders: [&[&str]; 4] = [
        &["--json", "compare", &one, &one],
        &["compare", "--json", &one, &one],
        &["compare", &one, "--json", &one],
        &["compare", &one, &one, "--json"],
    ];
    for arguments in orders {
        let summary: Value = serde_json::from_slice(&krylux(arguments).stdout).expect("one JSON object");
        assert_eq!(summary["rmse"], 0.0, "{arguments:?}");
    }
    for arguments in [["-q", "rig", "list"], ["rig", "-q", "list"], ["rig", "list", "-q"]] {
        assert!(krylux(&arguments).stdout.is_empty(), "{arguments:?}");
    }
}

#[test]
fn with_json_an_error_is_one_object_on_stderr() {
    let folder = folder();
    let text_file = inside(&folder, "one.txt");
    std::fs::write(&text_file, "no image").expect("it is ours");
    let cases: [(&[&str], &str, Option<&str>); 4] = [
        (&["compare", &text_file, &text_file, "--json"], "one.txt", Some("name it .npy")),
        (&["--json", "compare", "none.npy", "none.npy"], "cannot read none.npy", None),
        (&["compare", "--json"], "required arguments", Some("Usage:")),
        (&["--json", "compare", "--max-rmse", "nan", "a", "b"], "`nan` is not a number", Some("--help")),
    ];
    for (arguments, error, help) in cases {
        let output = krylux(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        let said: Value = serde_json::from_slice(&output.stderr)
            .unwrap_or_else(|why| unreachable!("{arguments:?}: {why}: {}", text(&output.stderr)));
        let part = |name: &str| said[name].as_str().unwrap_or_default().to_owned();
        assert!(part("error").contains(error), "{said}");
        assert!(help.is_none_or(|help| part("help").contains(help)), "{said}");
        assert_eq!(said["help"].is_null(), help.is_none(), "{said}");
    }
    assert!(text(&krylux(&["compare"]).stderr).starts_with("error:"), "without --json it is text");
}

#[test]
fn a_file_is_replaced_only_if_it_is_named() {
    let folder = folder();
    let rig = rig(&folder, 8, "");
    let photo = |more: &[&str]| {
        let mut command = command_without_graphics(&[&["photo", &rig, "-q"], more].concat());
        assert!(command.current_dir(folder.path()).status().expect("the program is built").success());
    };
    let is_there = |name: &str| folder.path().join(name).exists();
    let content = |name: &str| std::fs::read(folder.path().join(name)).expect("it is there");
    std::fs::write(folder.path().join("photo.png"), "my holidays").expect("it is ours");
    photo(&[]);
    assert!(content("photo.png") == b"my holidays" && is_there("photo-2.png"));
    photo(&[]);
    assert!(is_there("photo-3.png") && !is_there("photo-4.png"));
    photo(&["-o", "photo.png"]);
    assert_ne!(content("photo.png"), b"my holidays", "it was named");
}
