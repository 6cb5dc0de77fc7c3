//! Faults of a rig during a run. Accepted photos are right, and none is lost: in the end the results are those of an undisturbed run, to
//! the last bit. The devices have no noise, so that results can be compared bit by bit.

mod camera;
mod projector;
mod refused;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::bench::{QUESTION, SIDE, Stage, devices, labels, rig_file, stage};
use crate::program::{
    assert_error, command_without_graphics, folder, inside, krylux, labels_of_rooms, summary, text,
};

/// The number of frames after which the fault happens, in the middle of a run.
const SOME: u64 = 12;

/// How long to wait on a busy machine for what usually takes a moment.
const PATIENCE: Duration = Duration::from_secs(60);

/// All arrays of a run, by name.
type Results = BTreeMap<String, Vec<u8>>;

/// A run of the program that segments the scene of a stage.
struct Run {
    stage: Stage,
    folder: TempDir,
    rig: String,
}

impl Run {
    /// A run on a new stage.
    fn new(last: u8) -> Self {
        Self::on(stage(last, &devices(Path::new("rooms.npz"))))
    }

    fn on(stage: Stage) -> Self {
        let folder = folder();
        let rig = rig_file(folder.path(), &stage, "");
        Self { stage, folder, rig }
    }

    /// The camera's address.
    fn address(&self) -> String {
        self.stage.address.to_string()
    }

    /// Replaces a part of the rig file.
    fn replace(&self, part: &str, by: &str) {
        let text = std::fs::read_to_string(&self.rig).expect("it was written");
        assert!(text.contains(part), "{part} is not in {text}");
        std::fs::write(&self.rig, text.replacen(part, by, 1)).expect("the folder can be written");
    }

    fn out(&self) -> String {
        inside(&self.folder, "run")
    }

    /// Runs the program, and calls `disturb` with its process number once it has taken some frames.
    fn disturbed(&mut self, disturb: impl FnOnce(&mut Stage, u32)) -> Output {
        let out = self.out();
        let arguments = [&["segment", &self.rig, "-o", &out, "--json"], &QUESTION[..]].concat();
        let mut program = command_without_graphics(&arguments)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program is built with the tests");
        let began = Instant::now();
        while self.stage.camera.frames() < SOME {
            let ended = program.try_wait().expect("it can be asked");
            if ended.is_some() || began.elapsed() > PATIENCE {
                let _ = program.kill();
                let output = program.wait_with_output().expect("it was started");
                panic!("only {} frames: {}", self.stage.camera.frames(), text(&output.stderr));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        disturb(&mut self.stage, program.id());
        program.wait_with_output().expect("it ends")
    }

    /// Runs the program again from the beginning.
    fn again(&self) -> Output {
        let out = self.out();
        krylux(&[&["segment", &self.rig, "-o", &out, "--json", "--overwrite"], &QUESTION[..]].concat())
    }

    /// Resumes the run.
    fn resumed(&self) -> Output {
        let out = self.out();
        krylux(&[&["segment", &self.rig, "-o", &out, "--json", "--resume"], &QUESTION[..]].concat())
    }

    /// Asserts that the disturbed run ended well with the right results; returns its effort.
    #[track_caller]
    fn assert_went_on(&self, output: &Output) -> Value {
        assert!(output.status.success(), "{}", text(&output.stderr));
        let said: Value = serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON");
        self.assert_right();
        said["rig"]["effort"].clone()
    }

    /// Asserts that the run failed with a message that has these parts and names `--resume`, and that resuming gives the right results;
    /// returns the message.
    #[track_caller]
    fn assert_resumes(&self, output: &Output, parts: &[&str]) -> String {
        let message = assert_error(output, &[parts, &["--resume"]].concat());
        let effort = self.assert_went_on(&self.resumed());
        let count = |of: &str| effort[of].as_u64().expect("a number");
        assert!(count("replayed") >= 5 && count("taken") > 0, "no photo is taken twice: {effort}");
        message
    }

    /// Asserts that the run's results equal an undisturbed run's.
    #[track_caller]
    fn assert_right(&self) {
        let (found, expected) = (results(Path::new(&self.out())), undisturbed());
        assert!(found.keys().eq(expected.keys()), "{:?}", found.keys());
        for (name, bytes) in expected {
            assert!(found[name] == *bytes, "{name} differs from the undisturbed run");
        }
    }
}

fn results(run: &Path) -> Results {
    let files = std::fs::read_dir(run).expect("the run left a folder");
    let files = files.map(|file| file.expect("it can be listed").path());
    let arrays = files.filter(|path| path.extension().is_some_and(|extension| extension == "npy"));
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    arrays.map(|path| (name(&path), std::fs::read(&path).expect("it can be read"))).collect()
}

/// The results of an undisturbed run.
fn undisturbed() -> &'static Results {
    static RESULTS: OnceLock<Results> = OnceLock::new();
    RESULTS.get_or_init(|| {
        let run = Run::new(20);
        let out = run.out();
        summary(&[&["segment", &run.rig, "-o", &out], &QUESTION[..]].concat());
        assert_eq!(labels(Path::new(&out)), labels_of_rooms(SIDE));
        let results = results(Path::new(&out));
        assert!(results.contains_key("eigenvectors.npy") && results.contains_key("degree.npy"));
        results
    })
}

/// Two threads that keep two cores busy until this is dropped.
struct Load(std::sync::Arc<std::sync::atomic::AtomicBool>);

impl Load {
    fn new() -> Self {
        use std::sync::atomic::{AtomicBool, Ordering};
        let ends = std::sync::Arc::new(AtomicBool::new(false));
        for _ in 0..2 {
            let ends = std::sync::Arc::clone(&ends);
            std::thread::spawn(move || {
                while !ends.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        Self(ends)
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.0.store(true, std::sync::atomic::Ordering::Relaxed);
    }
}

#[test]
fn every_photo_is_right_when_both_cores_are_busy() {
    let mut run = Run::new(21);
    let _load = Load::new();
    let output = run.disturbed(|_, _| {});
    let effort = run.assert_went_on(&output);
    println!("under load: {effort}");
}
