//! Several processes by MPI on one machine, against the program alone: every file that a verb leaves has the same bytes.
//!
//! The tests take Open MPI's `mpirun` (Debian: openmpi-bin), and run with `--features mpi`.

mod failure;
#[path = "../program/mod.rs"]
mod program;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// The program with these arguments, `processes` times.
pub fn mpirun(processes: usize, arguments: &[&str]) -> Command {
    let mut command = launcher();
    command.args(["-n", &processes.to_string(), env!("CARGO_BIN_EXE_krylux")]).args(arguments);
    command
}

/// `mpirun`, which starts more processes than there are cores, for any user, and whose processes trace for themselves.
pub fn launcher() -> Command {
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--allow-run-as-root"]).env("KRYLUX_CACHE", "");
    command
}

/// Runs a command that must succeed, or at least say that its answer is not good enough.
#[track_caller]
pub fn run(mut command: Command) -> Output {
    let output = command.output().expect("openmpi-bin is installed");
    let status = output.status.code();
    assert!(matches!(status, Some(0 | 1)), "{command:?}: {status:?}\n{}", program::text(&output.stderr));
    output
}

/// Every file below a folder with its content, by name. What tells of the time and of the process is left out: `lock`, pages, and the
/// times in `run.json`.
pub fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).expect("the verb made it") {
            let path = entry.expect("it can be listed").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            match name.as_str() {
                _ if path.is_dir() => folders.push(path),
                "lock" | "report.html" => {}
                _ => {
                    let bytes = std::fs::read(&path).expect("it can be read");
                    let bytes = if name == "run.json" { answers(&bytes) } else { bytes };
                    found.push((path.strip_prefix(folder).expect("it is below").to_owned(), bytes));
                }
            }
        }
    }
    found.sort();
    assert!(!found.is_empty(), "the verb left files");
    found
}

/// A record without times and the command line.
fn answers(record: &[u8]) -> Vec<u8> {
    let mut record: Value = serde_json::from_slice(record).expect("a record is JSON");
    let parts = record.as_object_mut().expect("a record is an object");
    for part in ["command", "started", "timings"] {
        assert!(parts.remove(part).is_some(), "a record has its {part}");
    }
    serde_json::to_vec(&record).expect("JSON can be written")
}

/// A scene with the options that say how it is traced.
struct Case {
    name: &'static str,
    scene: PathBuf,
    options: &'static [&'static str],
}

/// Coaxial; with mirrors, whose paths are gathered; with a projector of another size than the camera; with a projector beside it.
fn cases() -> [Case; 4] {
    let scene =
        |name: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes").join(name).join("scene.glb");
    [
        Case { name: "coaxial", scene: scene("cornell"), options: &["--size", "12x10", "--spp", "8"] },
        Case { name: "mirrors", scene: scene("mirror"), options: &["--size", "10", "--spp", "8"] },
        Case {
            name: "a projector of another size",
            scene: scene("corner"),
            options: &["--size", "10x12", "--projector-size", "12x10", "--spp", "8"],
        },
        Case {
            name: "a projector beside the camera",
            scene: scene("corner"),
            options: &["--size", "10x12", "--spp", "8", "--camera-file", APART],
        },
    ]
}

/// The places of camera and projector in front of the corner: the projector is farther away and to the right.
const APART: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/mpi/apart.toml");

/// The files of the verbs, from the program alone and from 1 to 4 processes.
#[track_caller]
fn assert_equal_files(case: &Case, verb: &[&str]) {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let arguments = |out: &Path| -> Vec<String> {
        let (verb, rest) = verb.split_at(1);
        let scene = case.scene.to_string_lossy();
        let fixed = [verb, &[&*scene], case.options, rest].concat();
        let out = ["-v".to_owned(), "-o".to_owned(), out.display().to_string()];
        fixed.into_iter().map(str::to_owned).chain(out).collect()
    };
    let left = |name: &str, start: &dyn Fn(&[&str]) -> Command| {
        let inner = folder.path().join(name);
        std::fs::create_dir(&inner).expect("it is new");
        let out = match verb[0] {
            "matrix" => inner.join("matrix.npz"),
            "photo" => inner.join("photo.npy"),
            _ => inner.join("run"),
        };
        let arguments = arguments(&out);
        let output = run(start(&arguments.iter().map(String::as_str).collect::<Vec<_>>()));
        let said = program::text(&output.stderr);
        let together = said.lines().any(|line| line.ends_with("trace the scene together"));
        assert_eq!(together, !["alone", "of1"].contains(&name), "{arguments:?}: {said}");
        (output.status.code(), content(&inner))
    };
    let (status, expected) = left("alone", &program::command);
    for processes in 1..=4 {
        let (found_status, found) =
            left(&format!("of{processes}"), &|arguments| mpirun(processes, arguments));
        assert_eq!(found_status, status, "{} {verb:?} with {processes} processes", case.name);
        let names =
            |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|file| file.0.clone()).collect::<Vec<_>>();
        assert_eq!(names(&found), names(&expected), "{} {verb:?} with {processes} processes", case.name);
        for ((name, found), (_, expected)) in found.iter().zip(&expected) {
            assert!(
                found == expected,
                "{} {verb:?} with {processes} processes: {} differs",
                case.name,
                name.display()
            );
        }
    }
}

#[test]
fn the_matrix_has_the_same_bytes() {
    for case in cases() {
        assert_equal_files(&case, &["matrix"]);
    }
    assert_equal_files(&cases()[0], &["matrix", "--split-bounces", "--channels", "rgb"]);
    // So many rows that each process merges them in several steps.
    for options in [
        &["--size", "80x64", "--spp", "4"][..],
        &["--size", "80x64", "--projector-size", "64x80", "--spp", "4"],
    ] {
        let [coaxial, ..] = cases();
        assert_equal_files(&Case { options, ..coaxial }, &["matrix", "--channels", "rgb"]);
    }
}

#[test]
fn eigenvectors_have_the_same_bytes() {
    let [coaxial, mirrors, _, beside] = cases();
    assert_equal_files(&coaxial, &["eigs", "--photos", "12", "--count", "3"]);
    // A rig whose matrix is not symmetric.
    assert_equal_files(&beside, &["eigs", "--photos", "12", "--count", "3", "--method", "arnoldi"]);
    // In blocks.
    assert_equal_files(&mirrors, &["eigs", "--photos", "12", "--count", "3", "--method", "block-lanczos"]);
}

#[test]
fn groups_have_the_same_bytes() {
    for case in &cases()[..2] {
        assert_equal_files(case, &["segment", "--photos", "12", "--groups", "2"]);
    }
}

#[test]
fn compensation_and_separation_have_the_same_bytes() {
    for case in cases() {
        assert_equal_files(&case, &["separate"]);
    }
    let [coaxial, _, other_size, beside] = cases();
    let folder = TempDir::new().expect("a temporary folder can be made");
    // The other two take products with the transpose.
    for (case, [height, width]) in [(coaxial, [10, 12]), (other_size, [12, 10]), (beside, [12, 10])] {
        let target = folder.path().join(format!("{width}.npy"));
        let values: Vec<f64> = (0..120).map(|pixel| 0.2 + 0.05 * f64::from(pixel % 12)).collect();
        krylux::io::npy::write_npy(&target, &[height, width], &values).expect("the folder can be written");
        let target = target.display().to_string();
        assert_equal_files(&case, &["compensate", "--target", &target, "--photos", "8", "--channels", "rgb"]);
    }
}

#[test]
fn relighting_has_the_same_bytes() {
    for case in cases() {
        assert_equal_files(&case, &["relight", "--photos", "8", "--pattern", "left", "--channels", "rgb"]);
    }
}

#[test]
fn photos_that_are_traced_anew_have_the_same_bytes() {
    for case in cases() {
        assert_equal_files(&case, &["photo", "--operator", "retrace"]);
    }
    for case in &cases()[..2] {
        assert_equal_files(case, &["segment", "--operator", "retrace", "--photos", "6", "--groups", "2"]);
    }
}

#[test]
fn one_process_speaks_and_info_says_where_each_one_runs() {
    let output = run(mpirun(3, &["info", "--json"]));
    let about: Value = serde_json::from_slice(&output.stdout).expect("one JSON object, from one process");
    let processes = about["processes"].as_array().expect("a list");
    assert_eq!(processes.len(), 3);
    for (rank, process) in processes.iter().enumerate() {
        assert_eq!((&process["local_rank"], &process["local_size"]), (&rank.into(), &3.into()), "{process}");
        let cores = process["cores"].as_array().expect("a list").len();
        let all = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        assert!(cores >= 1 && cores <= all.div_ceil(3).max(1) + 1, "a share of {all} cores: {process}");
    }
    let alone: Value =
        serde_json::from_slice(&run(program::command(&["info", "--json"])).stdout).expect("JSON");
    assert_eq!(alone["processes"], Value::Array(Vec::new()));
}
