//! The source of products, as a user chooses it: matrix or tracing, memory, cache, sampler, layers.

use std::path::Path;
use std::process::{Command, Output};

use crate::common::{self, scene_path};
use krylux::io::{npy, sparse};
use krylux::sparse::Csr;
use tempfile::TempDir;

struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        Self { folder: TempDir::new().expect("a temporary folder can be made") }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// The program with a cache of its own.
    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_krylux"));
        command.env("KRYLUX_CACHE", self.path("cache"));
        command.args(arguments).output().expect("the program is built with the tests")
    }

    /// Its output if all is well.
    fn text(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }

    fn json(&self, arguments: &[&str]) -> serde_json::Value {
        let text = self.text(&[arguments, &["--json"]].concat());
        serde_json::from_str(&text).expect("--json prints JSON")
    }

    fn matrix(&self, name: &str) -> Csr {
        sparse::read(&self.folder.path().join(name)).expect("it was written")
    }
}

fn scene(name: &str) -> String {
    scene_path(name).display().to_string()
}

#[test]
fn a_second_run_takes_the_matrix_from_the_cache_bit_by_bit() {
    let bench = Bench::new();
    let zigzag = scene("zigzag");
    let (first, second) = (bench.path("first.npz"), bench.path("second.npz"));
    // A GPU's own matrix would not be kept.
    let matrix = ["matrix", &zigzag, "--size", "16", "--spp", "8", "--products", "cpu", "-o"];
    let text = bench.text(&[matrix.as_slice(), &[&first]].concat());
    assert!(text.contains("rays") && !text.contains("from the cache"), "{text}");
    let text = bench.text(&[matrix.as_slice(), &[&second]].concat());
    assert!(text.contains("from the cache") && text.contains("noise "), "{text}");
    let bytes = |file: &str| std::fs::read(file).expect("it was written");
    assert!(bytes(&first) == bytes(&second));
    // A photo of the same scene, settings and channels needs no tracing either.
    let photo = ["photo", &zigzag, "--size", "16", "--spp", "8", "--channels", "luma", "-o"];
    let file = bench.path("photo.npy");
    bench.text(&[photo.as_slice(), &[&file]].concat());
    let again = bench.text(&[matrix.as_slice(), &[&second, "--no-cache"]].concat());
    assert!(!again.contains("from the cache"), "{again}");

    // Damage is told, and cured.
    let listed = bench.json(&["cache", "list"]);
    assert_eq!(listed["matrices"].as_array().map(Vec::len), Some(1));
    let key = listed["matrices"][0]["key"].as_str().expect("it has a key");
    let file = format!("{}/{key}.luma.npz", bench.path("cache"));
    let mut damaged = bytes(&file);
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0x10;
    std::fs::write(&file, damaged).expect("the folder is writable");
    let output = bench.run(&[matrix.as_slice(), &[&second]].concat());
    let note = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && note.contains("damaged") && note.contains("assembled anew"), "{note}");
    assert!(bytes(&first) == bytes(&second));
    assert!(bench.text(&[matrix.as_slice(), &[&second]].concat()).contains("from the cache"));

    assert!(bench.text(&["cache", "list"]).contains("zigzag"));
    assert_eq!(bench.json(&["cache", "clear"])["removed"], 1);
    assert_eq!(bench.json(&["cache", "list"])["bytes"], 0);
}

#[test]
fn a_cache_that_cannot_be_written_is_no_reason_to_fail() {
    let bench = Bench::new();
    std::fs::write(bench.path("cache"), "a file, where a folder should be").expect("the folder is writable");
    let matrix = ["matrix", &scene("corner"), "--size", "8", "--products", "cpu", "-o"];
    let output = bench.run(&[matrix.as_slice(), &[&bench.path("matrix.npz")]].concat());
    let note = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && note.contains("is not kept"), "{note}");
}

#[test]
fn segments_are_the_same_by_either_operator_and_memory_decides() {
    let bench = Bench::new();
    let zigzag = scene("zigzag");
    let segment = |name: &str, more: &[&str]| {
        let out = bench.path(name);
        let mut arguments = vec!["segment", &zigzag, "--size", "16", "--spp", "32", "--photos", "10"];
        arguments.extend(["--groups", "2", "--eigenvectors", "3", "-o", &out]);
        arguments.extend(more);
        let output = bench.run(&arguments);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{errors}");
        let read = |name: &str| npy::read_npy(&Path::new(&out).join(name)).expect("it was written").values;
        let record = std::fs::read(Path::new(&out).join("run.json")).expect("a run has a record");
        let record: serde_json::Value = serde_json::from_slice(&record).expect("it is JSON");
        (read("labels-2.npy"), read("eigenvalues.npy"), record["noise"].clone(), errors)
    };
    let (labels, values, noise, _) = segment("replay", &["--operator", "replay"]);
    assert!(noise["operator"].as_f64().is_some_and(|noise| noise > 0.0 && noise < 1.0), "{noise}");
    for (name, more) in [
        ("retrace", ["--operator", "retrace"]),
        ("small", ["--memory", "20KiB"]),
        ("large", ["--memory", "1GiB"]),
    ] {
        let (other_labels, other_values, noise, errors) = segment(name, &more);
        assert_eq!(labels, other_labels, "{name}");
        for (a, b) in values.iter().zip(&other_values) {
            // Weights are kept as f32 in the matrix; eigenvalues of the normalized graph are at most 1.
            assert!((a - b).abs() < 1e-6, "{name}: {a} and {b}");
        }
        assert_eq!(noise.is_null(), name != "large", "{name}: {noise}");
        assert_eq!(errors.contains("traced anew"), name == "small", "{name}: {errors}");
    }
}

#[test]
fn direct_second_and_rest_add_up_to_the_whole() {
    let bench = Bench::new();
    let cornell = scene("cornell");
    let out = bench.path("cornell.npz");
    let matrix = ["matrix", &cornell, "--size", "12", "--spp", "16", "--channels", "rgb", "-o", &out];
    bench.text(&matrix);
    let summary = bench.json(&[matrix.as_slice(), &["--split-bounces"]].concat());
    assert_eq!(summary["files"].as_array().map(Vec::len), Some(9));
    for channel in ["r", "g", "b"] {
        let dense = |name: &str| {
            let matrix = bench.matrix(name);
            let mut dense = vec![0.0; matrix.rows() * matrix.cols()];
            matrix.entries().for_each(|(row, column, value)| dense[row * matrix.cols() + column] = value);
            dense
        };
        let whole = dense(&format!("cornell.{channel}.npz"));
        let parts = ["direct", "second", "rest"].map(|part| dense(&format!("cornell_{part}.{channel}.npz")));
        assert!(parts.iter().all(|part| part.iter().any(|&value| value > 0.0)), "a part is empty");
        for (index, whole) in whole.iter().enumerate() {
            let sum: f64 = parts.iter().map(|part| part[index]).sum();
            // Each is a rounded sum of what was rounded pixel by pixel, to f32.
            assert!((sum - whole).abs() <= 4.0 * f64::from(f32::EPSILON) * whole, "{sum} for {whole}");
        }
    }
}

#[test]
fn a_projector_of_another_size_lights_the_same_scene() {
    let bench = Bench::new();
    let corner = scene("corner");
    let sizes = ["--size", "12x10", "--projector-size", "8x6", "--spp", "32", "--channels", "luma"];
    let matrix =
        bench.json(&[&["matrix", &corner, "-o", &bench.path("matrix.npz")], sizes.as_slice()].concat());
    assert_eq!((&matrix["rows"], &matrix["columns"]), (&120.into(), &48.into()));
    let matrix = bench.matrix("matrix.npz");
    assert_eq!((matrix.rows(), matrix.cols()), (120, 48));
    // A photo under a pattern of the projector's size, either way.
    let photo = |operator: &str| {
        let file = bench.path(&format!("{operator}.npy"));
        let arguments = ["photo", &corner, "--pattern", "pixel:7,5", "--operator", operator, "-o", &file];
        bench.text(&[arguments.as_slice(), &sizes].concat());
        npy::read_npy(Path::new(&file)).expect("it was written")
    };
    let (replayed, retraced) = (photo("replay"), photo("retrace"));
    assert_eq!(replayed.shape, [10, 12]);
    let mut column = vec![0.0; 120];
    matrix.entries().filter(|entry| entry.1 == 47).for_each(|(row, _, value)| column[row] = value);
    for ((a, b), exact) in replayed.values.iter().zip(&retraced.values).zip(&column) {
        // f32, pixel by pixel, where rows meet columns, and in the file.
        let bound = 3.0 * f64::from(f32::EPSILON) * exact;
        assert!((a - exact).abs() <= bound && (b - exact).abs() <= bound, "{a} and {b} for {exact}");
    }
    assert!(column.iter().filter(|&&value| value > 0.0).count() > 1);
}

#[test]
fn samplers_differ_and_wrong_options_are_named() {
    let bench = Bench::new();
    let corner = scene("corner");
    let photo = |sampler: &str| {
        let file = bench.path(&format!("{sampler}.npy"));
        let arguments = ["photo", &corner, "--size", "8", "--spp", "16", "--sampler", sampler, "-o", &file];
        let noise = bench.json(&arguments)["noise"].as_f64();
        assert!(noise.is_some_and(|noise| noise > 0.0 && noise < 0.5), "{noise:?}");
        std::fs::read(file).expect("it was written")
    };
    assert!(photo("sobol") != photo("independent"));
    for (wrong, named) in [
        (vec!["segment", corner.as_str(), "--memory", "lots"], "--memory"),
        (vec!["photo", corner.as_str(), "--sampler", "dice"], "--sampler"),
        (vec!["eigs", corner.as_str(), "--operator", "guess"], "--operator"),
        (vec!["cache", "list", "--no-cache"], "--cache"),
    ] {
        let output = bench.run(&wrong);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && message.contains(named), "{wrong:?}: {message}");
    }
}

/// A rig apart has no symmetric matrix, but its transpose is there.
#[test]
fn a_rig_apart_is_compensated_by_its_transpose_and_refused_where_symmetry_is_needed() {
    let bench = Bench::new();
    let scene = common::root().join("tests/reference/peer/separated.glb").display().to_string();
    let target = bench.path("target.npy");
    let resolution = krylux::image::Resolution::new(24, 24);
    // The pixels at which the projector's light arrives.
    let lit: Vec<f32> = (0..24 * 24).map(|pixel| if pixel % 24 > 8 { 0.5 } else { 0.0 }).collect();
    let lit = krylux::image::Image::new(resolution, 1, lit).expect("one sample a pixel");
    npy::write_image(Path::new(&target), &lit).expect("the folder is there");
    for operator in ["replay", "retrace"] {
        let folder = bench.path(operator);
        let command = [
            "compensate",
            &scene,
            "--target",
            &target,
            "--size",
            "24",
            "--spp",
            "32",
            "--method",
            "lsqr",
            "--photos",
            "16",
            "--operator",
            operator,
            "--rtol",
            "0.9",
            "-o",
            &folder,
            "--json",
        ];
        let output = bench.run(&command);
        let summary: serde_json::Value = serde_json::from_slice(&output.stdout).expect("--json prints JSON");
        // Projected as it is, the target misses its place by the distance between the lenses.
        let [found, plain] = ["relative_residual_unclipped", "relative_residual_uncompensated"]
            .map(|residual| summary[residual].as_f64().expect("a number"));
        assert!(found < plain, "{summary}");
    }
    let output = bench.run(&["eigs", &scene, "--size", "8", "--spp", "1", "-o", &bench.path("eigs")]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("coaxial"), "{message}");
}
