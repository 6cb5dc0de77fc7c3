//! A device that is lost or has no memory, at any call: a Vulkan layer takes it away from the unchanged program.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use krylux::journal::{Journal, Kind};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tempfile::TempDir;

use crate::common::{root, scene_path};
use crate::program::{self, text};

/// Retraced products submit a dispatch or more each; products on the device submit after the matrix was traced.
const RUNS: [&[&str]; 2] =
    [&["--size", "8", "--operator", "retrace"], &["--size", "8", "--products", "device"]];

/// A folder with the layer, which the compiler that Rust links with has built.
struct Layer(TempDir);

impl Layer {
    fn new() -> Self {
        let layer = Self(tempfile::tempdir().expect("a temporary folder"));
        let library = layer.path("layer.so");
        let source = root().join("tests/cli/lost_device/layer.c");
        let built =
            Command::new("cc").args(["-shared", "-fPIC", "-O1", "-o"]).arg(&library).arg(source).status();
        assert!(built.expect("Rust links with cc").success());
        let manifest = serde_json::json!({ "file_format_version": "1.0.0", "layer": {
            "name": "VK_LAYER_KRYLUX_lost_device", "type": "GLOBAL", "library_path": library,
            "api_version": "1.3.0", "implementation_version": "1", "description": "takes the device away",
        }});
        fs::write(layer.path("layer.json"), manifest.to_string()).expect("there is room");
        layer
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn eigs(&self, more: &[&str], run: &str) -> Command {
        let scene = scene_path("cornell").display().to_string();
        let mut command = program::command(&["eigs", &scene, "--spp", "4", "--count", "2"]);
        command.args(["--photos", "30", "-o"]).arg(self.path(run)).args(more);
        command
    }

    /// A run whose call of this kind and number fails; how many such calls it made.
    fn lose(&self, (kind, at): (&str, u32), more: &[&str], run: &str) -> (Output, u32) {
        let count = self.path("count");
        let mut command = self.eigs(more, run);
        command.env("VK_LAYER_PATH", self.0.path()).env("VK_INSTANCE_LAYERS", "VK_LAYER_KRYLUX_lost_device");
        command.env("KIND", kind).env("LOSE_AT", at.to_string()).env("COUNT_TO", &count);
        let output = command.output().expect("the program is built with the tests");
        let count = fs::read_to_string(count).expect("the layer was loaded");
        (output, count.parse().expect("it is a number"))
    }

    /// The photos of a run; none where it has no journal yet.
    fn photos(&self, run: &str) -> BTreeMap<String, Vec<u8>> {
        let Ok(mut journal) = Journal::read_only(&self.path(run).join("journal")) else {
            return BTreeMap::new();
        };
        assert!(journal.torn().is_none() && journal.damages().is_empty());
        let photos = journal.entries().iter().filter(|entry| entry.kind == Kind::Photo);
        let keys: Vec<_> = photos.map(|entry| entry.key).collect();
        let mut payload = |key| journal.get(key).expect("it can be read").expect("it is whole").payload;
        keys.into_iter().map(|key| (key.to_string(), payload(key))).collect()
    }
}

/// The numbers that a run has written, by file.
fn arrays(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let files =
        fs::read_dir(folder).expect("a run has a folder").map(|entry| entry.expect("an entry").path());
    let arrays = files.filter(|path| path.extension().is_some_and(|ending| ending == "npy"));
    let read = |path: PathBuf| {
        (path.file_name().map(PathBuf::from).unwrap_or_default(), fs::read(path).expect("it can be read"))
    };
    arrays.map(read).collect()
}

#[test]
fn a_lost_device_costs_no_photo_and_changes_no_bit() {
    let layer = Layer::new();
    let mut random = Pcg64::seed_from_u64(1);
    for more in RUNS {
        let (output, calls) = layer.lose(("work", 0), more, "whole");
        assert!(output.status.success() && calls > 50, "{calls} calls: {}", text(&output.stderr));
        let (photos, expected) = (layer.photos("whole"), arrays(&layer.path("whole")));
        assert!(photos.len() > 10 && !expected.is_empty());
        let mut most_kept = 0;
        // The last calls may be those that end the device, or may never come: dispatches follow the speed of the machine.
        for at in (0..5).map(|_| random.random_range(1..calls * 9 / 10)).chain([1, calls * 9 / 10]) {
            let (output, _) = layer.lose(("work", at), more, "lost");
            let message = text(&output.stderr);
            assert_eq!(output.status.code(), Some(2), "call {at} of {calls}: {message}");
            assert!(message.contains("was lost: ") && message.contains("--resume"), "{message}");
            assert!(!message.contains("panicked"), "{message}");
            let kept = layer.photos("lost");
            assert!(kept.iter().all(|(key, counts)| photos.get(key) == Some(counts)), "call {at} of {calls}");
            most_kept = most_kept.max(kept.len());
            let resumed = layer.eigs(&[more, &["--resume"]].concat(), "lost").output().expect("it is built");
            assert!(resumed.status.success(), "call {at} of {calls}: {}", text(&resumed.stderr));
            assert!(arrays(&layer.path("lost")) == expected, "call {at} of {calls} has changed the result");
            assert!(layer.photos("lost") == photos, "call {at} of {calls} has changed photos");
            fs::remove_dir_all(layer.path("lost")).expect("it is ours");
        }
        assert!(most_kept > photos.len() / 2, "a late loss keeps what was taken: {most_kept}");
        fs::remove_dir_all(layer.path("whole")).expect("it is ours");
    }
}

#[test]
fn a_device_without_memory_is_an_error_that_says_what_needs_less() {
    let layer = Layer::new();
    // Smaller ones fit the memory that the device has been opened with. Dispatches follow the speed of the machine, so a run may make
    // fewer allocations than another.
    let run = &["--size", "128", "--products", "device"];
    let lose = |at: u32, least: u32| {
        let made_enough = |_| {
            let (output, made) = layer.lose(("memory", at), run, "short");
            let values = fs::read(layer.path("short").join("eigenvalues.npy")).ok();
            let _ = fs::remove_dir_all(layer.path("short"));
            (made >= least).then_some((output, made, values))
        };
        (0..100).find_map(made_enough).expect("one of the runs makes so many allocations")
    };
    let (output, calls, expected) = lose(0, 2);
    assert!(output.status.success() && calls > 1, "{calls} allocations: {}", text(&output.stderr));
    let expected = two(expected);
    let mut refused = 0;
    for at in 1..=calls {
        let (output, _, values) = lose(at, at);
        // Scratch buffers may make room, vectors may stay on the processor, and on a GPU the processor may assemble the matrix.
        if output.status.success() {
            // Sums in another order change the two eigenvalues by less than their tolerance.
            let apart =
                two(values).into_iter().zip(expected).map(|(found, expected)| (found / expected - 1.0).abs());
            assert!(apart.fold(0.0, f64::max) < 1e-6, "allocation {at} of {calls}");
            continue;
        }
        let message = program::assert_error(&output, &["emory", "--adapter"]);
        // The first allocation opens the device.
        let says_what_helps = message.contains("--size") || message.contains("--products cpu");
        assert!(at == 1 || (message.contains("MiB") && says_what_helps), "{message}");
        refused += 1;
    }
    // There is no room to open the device, for one.
    assert!(refused > 0, "{refused} of {calls}");
}

/// The two numbers at the end of an array's file.
fn two(array: Option<Vec<u8>>) -> [f64; 2] {
    let bytes = array.expect("a run writes its eigenvalues");
    let [.., first, second] = bytes.as_chunks::<8>().0 else { unreachable!("a header and two numbers") };
    [first, second].map(|number| f64::from_le_bytes(*number))
}
