//! Every verb on every kind of source: the table in the guide, and a matrix that answers as its scene does.

use std::fmt::Write as _;
use std::path::Path;

use krylux::image::{Image, Resolution};
use krylux::io::{npy, picture};
use tempfile::TempDir;

use crate::common::{root, scene_path};
use crate::program::{command, folder, inside, rig, text};

/// Columns of the table.
const SOURCES: [&str; 8] = [
    "scene",
    "scene, two sizes",
    "rig",
    "run",
    "matrix",
    "matrix, two sizes",
    "matrix without sizes",
    "captures",
];

/// Rows of the table: the verb, and its options. `TARGET` and `RHS` stand for files of the source's size.
const VERBS: [(&str, &[&str]); 15] = [
    ("photo", &["photo", "SOURCE"]),
    ("segment", &["segment", "SOURCE", "--groups", "2", "--photos", "8", "--eigenvectors", "3"]),
    ("compensate", &["compensate", "SOURCE", "--target", "TARGET", "--photos", "6"]),
    (
        "compensate --method krylov-box",
        &["compensate", "SOURCE", "--target", "TARGET", "--method", "krylov-box", "--photos", "6"],
    ),
    ("separate", &["separate", "SOURCE", "--probes", "4"]),
    ("relight", &["relight", "SOURCE"]),
    ("relight --dual", &["relight", "SOURCE", "--dual"]),
    ("probe", &["probe", "SOURCE", "--photos", "4"]),
    ("eigs", &["eigs", "SOURCE", "--count", "2", "--photos", "8"]),
    (
        "eigs --method arnoldi",
        &["eigs", "SOURCE", "--count", "2", "--photos", "8", "--method", "arnoldi", "--which", "lm"],
    ),
    ("eigs --singular", &["eigs", "SOURCE", "--count", "2", "--photos", "8", "--singular"]),
    ("audit", &["audit", "SOURCE"]),
    ("solve --method lsmr", &["solve", "SOURCE", "RHS", "--method", "lsmr", "--photos", "4"]),
    ("matrix", &["matrix", "SOURCE"]),
    ("paint", &["paint", "SOURCE"]),
];

/// Camera and projector stand apart, and have different sizes.
const APART: &str = "[camera]\nposition = [0.0, 0.2, 1.5]\nlook_at = [0.0, 0.0, 0.0]\nvertical_fov_degrees = 40.0\n\
    [projector]\nposition = [0.3, 0.2, 1.5]\nlook_at = [0.0, 0.0, 0.0]\nvertical_fov_degrees = 30.0\nresolution = [6, 4]\n";

/// Sources of 8×8 photos, each with its options.
fn sources(folder: &TempDir) -> Vec<Vec<String>> {
    let at = |name: &str| inside(folder, name);
    let scene = scene_path("corner").display().to_string();
    std::fs::write(at("apart.toml"), APART).expect("the folder can be written");
    let words = |words: &[&str]| words.iter().map(|&word| word.to_owned()).collect::<Vec<_>>();
    let plain = words(&[&scene, "--size", "8", "--spp", "16"]);
    let apart = words(&[&scene, "--size", "8", "--spp", "16", "--camera-file", &at("apart.toml")]);
    let bench = words(&[&rig(folder, 8, "")]);
    for (source, name) in [(&plain, "A.npz"), (&apart, "B.npz")] {
        run(&["matrix"], source, &["-o", &at(name)], &[0]);
    }
    run(&["segment"], &bench, &["--groups", "2", "--photos", "8", "-o", &at("run")], &[0, 1]);
    let bare: Vec<f64> = (0..64 * 64).map(|at| f64::from(at % 65 == 0) + f64::from(at % 7)).collect();
    npy::write_npy(&folder.path().join("N.npy"), &[64, 64], &bare).expect("the folder can be written");
    std::fs::create_dir(at("captures")).expect("the folder can be written");
    // A scene of direct light and even global light, under patterns that do not repeat along the rows.
    let patterns: Vec<f64> = (0..12 * 64).map(|at| f64::from(at * at % 97 % 5) / 4.0).collect();
    let photo = |x: &[f64]| x.iter().map(|v| 0.5 * v + 0.002 * x.iter().sum::<f64>()).collect::<Vec<_>>();
    let photos: Vec<f64> = patterns.chunks(64).flat_map(photo).collect();
    for (name, values) in [("captures/x.npy", &patterns), ("captures/y.npy", &photos)] {
        npy::write_npy(Path::new(&at(name)), &[12, 8, 8], values).expect("the folder can be written");
    }
    let described = "map = \"coaxial\"\n[patterns]\nfiles = \"x.npy\"\n[photos]\nfiles = \"y.npy\"\n";
    std::fs::write(at("captures/captures.toml"), described).expect("the folder can be written");
    vec![
        plain,
        apart,
        bench,
        words(&[&at("run")]),
        words(&[&at("A.npz")]),
        words(&[&at("B.npz")]),
        words(&[&at("N.npy")]),
        words(&[&at("captures")]),
    ]
}

/// Runs the program. The exit status must be one of `statuses`.
#[track_caller]
fn run(before: &[&str], source: &[String], after: &[&str], statuses: &[i32]) -> (i32, String) {
    let source: Vec<&str> = source.iter().map(String::as_str).collect();
    let arguments = [before, &source, after].concat();
    let output = command(&arguments).output().expect("the program is built with the tests");
    let (status, message) = (output.status.code().unwrap_or(-1), text(&output.stderr));
    assert!(statuses.contains(&status), "{arguments:?}: {status}: {message}");
    (status, message)
}

/// The cell of the table: `yes`, or the reason of the refusal.
fn cell(folder: &TempDir, (row, verb): (usize, &[&str]), (column, source): (usize, &[String])) -> String {
    let file = |name: &str, size: Resolution| {
        let path = inside(folder, &format!("{name}-{size}.npy"));
        picture::write(Path::new(&path), &Image::filled(size, 1, 0.5)).expect("the folder can be written");
        path
    };
    // Photos have 8×8 pixels, or as many rows.
    let size = if SOURCES[column] == "matrix without sizes" {
        Resolution::new(64, 1)
    } else {
        Resolution::new(8, 8)
    };
    let out = inside(folder, &format!("out-{row}-{column}"));
    let suffix = match verb[0] {
        "photo" => ".npy",
        "matrix" => ".npz",
        "paint" => ".html",
        _ => "",
    };
    let words: Vec<String> = verb
        .iter()
        .map(|&word| match word {
            "TARGET" => file("target", size),
            "RHS" => file("rhs", size),
            word => word.to_owned(),
        })
        .collect();
    let at = words.iter().position(|word| word == "SOURCE").unwrap_or(1);
    let before: Vec<&str> = words[..at].iter().map(String::as_str).collect();
    let after: Vec<&str> = words[at + 1..].iter().map(String::as_str).collect();
    let out = format!("{out}{suffix}");
    let (status, message) = run(&before, source, &[&after[..], &["-o", &out]].concat(), &[0, 1, 2]);
    if status < 2 {
        return "yes".into();
    }
    let first = message.lines().find(|line| line.starts_with("krylux: error: ")).unwrap_or_default();
    assert!(
        !first.contains("expected, but"),
        "{verb:?} on {}: a bare error of dimensions: {message}",
        SOURCES[column]
    );
    assert!(message.contains("help: "), "{verb:?} on {}: no remedy: {message}", SOURCES[column]);
    "no".into()
}

/// The table between its marks on the guide's page. If this test fails, it prints the table as it is now.
#[test]
fn the_table_of_verbs_and_sources_is_what_the_program_does() {
    let folder = folder();
    let sources = sources(&folder);
    let mut table = format!("| verb | {} |\n|---|{}\n", SOURCES.join(" | "), "---|".repeat(SOURCES.len()));
    for (row, (name, verb)) in VERBS.iter().enumerate() {
        let cells: Vec<String> = sources
            .iter()
            .enumerate()
            .map(|source| cell(&folder, (row, verb), (source.0, source.1)))
            .collect();
        writeln!(table, "| `{name}` | {} |", cells.join(" | ")).expect("a string can be written");
    }
    let page =
        std::fs::read_to_string(root().join("guide/src/reference/sources.md")).expect("the guide is here");
    let shown = page.split("<!-- table -->\n").nth(1).and_then(|rest| rest.split("<!-- end -->").next());
    assert_eq!(shown.unwrap_or_default().trim(), table.trim(), "the guide's table should be:\n{table}");
}

/// The export holds all light and the direct light in single precision, and the sizes of the pictures.
#[test]
fn a_matrix_answers_as_its_scene_does() {
    let folder = folder();
    let at = |name: &str| inside(&folder, name);
    let all = sources(&folder);
    for (scene, matrix) in [(&all[0], &all[4]), (&all[1], &all[5])] {
        let values = |source: &[String], verb: &[&str], name: &str, file: &str| {
            let out = at(name);
            run(&verb[..1], source, &[&verb[1..], &["-o", &out, "--overwrite"]].concat(), &[0, 1]);
            npy::read_npy(&Path::new(&out).join(file)).expect("it is written").values
        };
        for (verb, file) in [
            (&["separate", "--probes", "0"][..], "global.npy"),
            (&["probe", "--photos", "4"], "probed.npy"),
            (&["eigs", "--singular", "--count", "2", "--photos", "30"], "singular-values.npy"),
            (&["relight", "--photos", "5"], "relit-1.npy"),
        ] {
            let [found, expected] =
                [(matrix, "m"), (scene, "s")].map(|(source, name)| values(source, verb, name, file));
            let size = expected.iter().map(|value| value * value).sum::<f64>().sqrt();
            let off = found.iter().zip(&expected).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
            // Entries are rounded to single precision (6e-8), and photos as well.
            assert!(found.len() == expected.len() && off <= 2e-6 * size, "{verb:?}: {off} of {size}");
        }
    }
    let (_, message) = run(&["photo"], &all[6], &["--pattern", "left", "-o", &at("left.npy")], &[2]);
    assert!(message.contains("--size") && message.contains("does not say which pictures"), "{message}");
}
