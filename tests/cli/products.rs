//! The place of products, as a user chooses it.

use std::path::Path;
use std::process::{Command, Output};

use crate::common::{root, scene_path};
use krylux::io::npy;
use serde_json::Value;
use tempfile::TempDir;

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_krylux"));
    command.env("KRYLUX_CACHE", "").args(arguments).output().expect("the program is built with the tests")
}

/// The summary and the record of a run that succeeds.
fn run_in(folder: &str, arguments: &[&str]) -> (Value, Value) {
    let output = run(&[arguments, &["-o", folder, "--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let record = std::fs::read(Path::new(folder).join("run.json")).expect("a run has a record");
    let read = |bytes: &[u8]| serde_json::from_slice(bytes).expect("it is JSON");
    (read(&output.stdout), read(&record))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
}

#[test]
fn eigenvalues_are_the_same_wherever_products_are_taken() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let scene = scene_path("cornell").display().to_string();
    let eigs = ["eigs", &scene, "--size", "24", "--spp", "16", "--count", "4", "--photos", "100"];
    let (mut found, mut is_gpu) = (Vec::new(), false);
    for (place, on) in [("cpu", "cpu"), ("auto", "cpu"), ("device", "device"), ("device", "device")] {
        let run = folder.path().join(found.len().to_string()).display().to_string();
        let (summary, record) = run_in(&run, &[eigs.as_slice(), &["--products", place]].concat());
        // A GPU would not gain by so small a matrix.
        assert_eq!(record["products"], on, "{place}");
        assert_eq!(numbers(&summary["eigenvalues"]).len(), 4);
        // The summary has no digits beyond the errors.
        let values = npy::read_npy(&Path::new(&run).join("eigenvalues.npy")).expect("it is written");
        found.push(values.values);
        is_gpu = !record["adapter"]["name"].as_str().is_some_and(|name| name.contains("llvmpipe"));
    }
    assert!(found[0].len() == 4 && found[0][3] > 0.0, "{found:?}");
    assert!((is_gpu || found[0] == found[1]) && found[2] == found[3], "{found:?}");
    // Converged eigenvalues of a symmetric matrix move by no more than it does. Sums are rounded at 1e-16 of their magnitude, and the entries
    // of a matrix that a GPU has assembled to single precision.
    let bound = if is_gpu { 1e-6 } else { 1e-10 };
    for others in &found[1..] {
        for (cpu, other) in found[0].iter().zip(others) {
            assert!((cpu - other).abs() <= bound * cpu.abs(), "{cpu} and {other}");
        }
    }
}

#[test]
fn products_are_taken_on_the_device_for_bounces_and_colours_too() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let scene = scene_path("corner").display().to_string();
    let separate = ["separate", &scene, "--size", "16", "--spp", "16", "--bounces", "--channels", "rgb"];
    let more = ["--by", "checkerboards", "--products"];
    let errors = ["cpu", "device"].map(|place| {
        let run = folder.path().join(place).display().to_string();
        let (summary, record) = run_in(&run, &[separate.as_slice(), &more, &[place]].concat());
        assert_eq!(record["products"], place);
        summary["relative_error"].as_f64().expect("the exact bounces are known")
    });
    // The error of the method; products differ by 1e-16 of the light.
    assert!(errors[0] > 1e-3 && (errors[0] - errors[1]).abs() < 1e-9, "{errors:?}");
}

#[test]
fn what_is_no_product_is_refused_by_name() {
    let scene = scene_path("corner").display().to_string();
    let rig = root().join("assets/rigs/ideal.toml").display().to_string();
    for arguments in [["eigs", &scene, "--operator", "retrace"].as_slice(), &["eigs", &rig], &["audit", &rig]]
    {
        let folder = TempDir::new().expect("a temporary folder can be made");
        let out = folder.path().join("run").display().to_string();
        let output = run(&[arguments, &["--products", "device", "-o", &out]].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && message.contains("--products: "), "{message}");
    }
}
