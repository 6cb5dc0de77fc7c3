//! The size of runs on the disk; nothing is removed that cannot be computed again.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use tempfile::TempDir;

use crate::program::{assert_error, command, folder, inside, rig, text};

/// Runs of a scene and of a rig, side by side.
struct Runs {
    folder: TempDir,
    scene: PathBuf,
}

impl Runs {
    fn new() -> Self {
        let folder = folder();
        let scene = folder.path().join("scene.glb");
        fs::copy("assets/scenes/zigzag/scene.glb", &scene).expect("the scene is shipped");
        let runs = Self { scene, folder };
        let rig = rig(&runs.folder, 6, "");
        let scene = runs.scene.display().to_string();
        for (source, name) in [(&scene, "out/of-scene"), (&rig, "out/of-rig")] {
            let out = inside(&runs.folder, name);
            let arguments = ["eigs", source, "--photos", "6", "--count", "1", "--no-check", "-o", &out];
            let traced = ["--size", "8", "--spp", "4"];
            let more: &[&str] = if name.ends_with("scene") { &traced } else { &[] };
            assert_done(&run(&[&arguments[..], more].concat()));
        }
        runs
    }

    fn journal(&self, name: &str) -> PathBuf {
        self.folder.path().join("out").join(name).join("journal/photos.journal")
    }

    /// The output of `krylux runs prune`.
    #[track_caller]
    fn prune(&self, more: &[&str]) -> serde_json::Value {
        let out = inside(&self.folder, "out");
        let output = run(&[&["runs", "prune", out.as_str(), "--json"], more].concat());
        assert_done(&output);
        serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON")
    }

    /// The names of the runs that would lose their photos.
    #[track_caller]
    fn prunable(&self) -> Vec<String> {
        let said = self.prune(&[]);
        assert_eq!(said["deleted"], false);
        let pruned = said["pruned"].as_array().expect("a list").iter();
        let paths = pruned.map(|run| PathBuf::from(run["path"].as_str().expect("a path")));
        paths.map(|path| path.file_name().expect("a name").to_string_lossy().into_owned()).collect()
    }
}

fn run(arguments: &[&str]) -> Output {
    command(arguments).output().expect("the program is built with the tests")
}

#[track_caller]
fn assert_done(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn only_photos_that_a_scene_gives_again_are_removed() {
    let runs = Runs::new();
    let out = inside(&runs.folder, "out");
    let listed = run(&["runs", "list", &out]);
    assert_done(&listed);
    let listed = text(&listed.stdout);
    for part in
        ["of-scene, photos can be computed again", "of-rig, photos are kept: they are of a rig", "2 runs"]
    {
        assert!(listed.contains(part), "{listed}");
    }

    let size = fs::metadata(runs.journal("of-scene")).expect("it is there").len();
    assert_eq!(runs.prunable(), ["of-scene"]);
    assert!(runs.journal("of-scene").exists(), "nothing is removed without --delete");

    let said = runs.prune(&["--delete"]);
    // A lock file beside the photos is removed, too.
    assert!(said["bytes"].as_u64().is_some_and(|bytes| bytes >= size && bytes < size + 1000), "{said}");
    assert!(!runs.journal("of-scene").exists() && runs.journal("of-rig").exists());
    let page = Path::new(&out).join("of-scene/report.html");
    assert!(page.exists() && page.with_file_name("eigenvectors.npy").exists(), "results stay");
    let again = run(&["photo", &inside(&runs.folder, "out/of-scene"), "-o", &inside(&runs.folder, "p.npy")]);
    assert_error(&again, &["it holds no run whose photos were kept", "give a scene"]);
    assert!(runs.prunable().is_empty());
}

#[test]
fn photos_of_a_changed_scene_or_an_unfinished_run_are_kept() {
    let runs = Runs::new();
    let scene = fs::read(&runs.scene).expect("it is there");
    fs::remove_file(&runs.scene).expect("it is there");
    assert!(runs.prunable().is_empty(), "the scene is gone");
    fs::copy("assets/scenes/corner/scene.glb", &runs.scene).expect("the scene is shipped");
    assert!(runs.prunable().is_empty(), "the scene is another");
    fs::write(&runs.scene, scene).expect("the folder can be written");
    assert_eq!(runs.prunable(), ["of-scene"]);

    let record = runs.folder.path().join("out/of-scene/run.json");
    let text = fs::read_to_string(&record).expect("it is there");
    fs::write(&record, text.replace("\"status\": \"done\"", "\"status\": \"running\""))
        .expect("it can be written");
    assert!(runs.prunable().is_empty(), "--resume needs them");
}
