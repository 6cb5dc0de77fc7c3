//! The predicted costs of a scene on several machines.

use crate::program::{assert_error, command, verdict_of_traced};

const SCENE: &str = "assets/scenes/corner/scene.glb";

#[test]
fn a_scene_is_planned_for_several_machines() {
    let plan = |side: &str| {
        let arguments = ["plan", SCENE, "--size", side, "--spp", "16", "--ranks", "1,8"];
        verdict_of_traced(&arguments).0["scaling"]["processes"].clone()
    };
    let (small, large) = (plan("24"), plan("2048"));
    let number =
        |plan: &serde_json::Value, rank: usize, name: &str| plan[rank][name].as_f64().expect("a number");
    for name in ["tracing", "merging", "products"] {
        let ratio = number(&large, 0, name) / number(&large, 1, name);
        assert!((ratio - 8.0).abs() < 1e-9, "{name} is divided by eight: {ratio}");
    }
    assert!(number(&large, 0, "entries") > 100.0 * number(&small, 0, "entries"));
    // Each has an eighth of the matrix, and the contributions to it twice while they are exchanged; a process alone gives back
    // contributions while its matrix grows.
    assert!(number(&large, 1, "memory") < 0.6 * number(&large, 0, "memory"));
    assert_eq!(number(&large, 0, "exchange"), 0.0, "one process has nothing to exchange");
    // The matrix that the small plan is about has about as many entries as it says.
    let folder = tempfile::tempdir().expect("a temporary folder can be made");
    let file = folder.path().join("matrix.npz").display().to_string();
    let written = verdict_of_traced(&["matrix", SCENE, "--size", "24", "--spp", "16", "-o", &file]).0;
    let entries = written["nonzeros"][0].as_f64().expect("a count");
    let predicted = number(&small, 0, "entries");
    assert!((predicted / entries - 1.0).abs() < 0.1, "{predicted} predicted, {entries} found");
}

#[test]
fn a_plan_says_what_it_lacks() {
    let error = |arguments: &[&str], parts: &[&str]| {
        assert_error(&command(arguments).output().expect("the program is built"), parts);
    };
    error(&["plan", SCENE, "--size", "8"], &["--ranks", "segment"]);
    error(&["plan", SCENE, "--size", "8", "--ranks", "0"], &["--ranks", "above 0"]);
    error(&["plan", SCENE, "--size", "8", "--ranks", "2", "--network", "0"], &["--network"]);
    error(&["plan", "assets/rigs/ideal.toml", "--ranks", "2"], &["--ranks", "only scenes"]);
}
