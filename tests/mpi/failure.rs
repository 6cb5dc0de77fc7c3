//! Processes that die, lack a driver, or run another program.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::program::{self, text};
use crate::{content, launcher, mpirun, run};

fn scene(name: &str) -> String {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    scenes.join(name).join("scene.glb").display().to_string()
}

/// The process of this rank among those whose command line has `word`.
fn process_of(rank: usize, word: &str) -> Option<u32> {
    let wanted = format!("OMPI_COMM_WORLD_RANK={rank}");
    let has = |file: PathBuf, wanted: &str| {
        let bytes = std::fs::read(file).unwrap_or_default();
        bytes.split(|&byte| byte == 0).any(|part| String::from_utf8_lossy(part).contains(wanted))
    };
    let processes = std::fs::read_dir("/proc").expect("Linux has it").flatten();
    let mut numbers = processes.filter_map(|entry| entry.file_name().to_string_lossy().parse::<u32>().ok());
    numbers.find(|number| {
        let folder = Path::new("/proc").join(number.to_string());
        has(folder.join("environ"), &wanted) && has(folder.join("cmdline"), word)
    })
}

/// Waits until `done`, for two minutes at most.
#[track_caller]
fn wait_until(what: &str, mut done: impl FnMut() -> bool) {
    let start = Instant::now();
    while !done() {
        assert!(start.elapsed() < Duration::from_secs(120), "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Starts a run whose photos take a while: each is traced anew.
fn started(processes: usize, folder: &Path) -> Child {
    let folder = folder.display().to_string();
    let mut command = mpirun(processes, &slow(&scene("cornell"), &folder, &[]));
    command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("openmpi-bin is installed")
}

fn slow<'a>(scene: &'a str, folder: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let fixed = [
        "segment",
        scene,
        "--size",
        "24",
        "--spp",
        "1024",
        "--operator",
        "retrace",
        "--photos",
        "12",
        "--groups",
        "2",
        "--no-check",
        "-o",
        folder,
    ];
    [&fixed[..], more].concat()
}

#[test]
fn a_run_whose_process_was_killed_goes_on_with_another_number_of_processes() {
    let temporary = TempDir::new().expect("a temporary folder can be made");
    let (alone, folder) = (temporary.path().join("alone"), temporary.path().join("killed"));
    let (scene, alone_name, name) =
        (scene("cornell"), alone.display().to_string(), folder.display().to_string());
    run(program::command(&slow(&scene, &alone_name, &[])));
    let child = started(2, &folder);
    let journal = folder.join("journal/photos.journal");
    // Some photos, and not all of them: white, and a few of the method's.
    let photo = 8 * 24 * 24;
    let size = || std::fs::metadata(&journal).map_or(0, |about| about.len());
    wait_until("the first photos are in the journal", || size() > 4 * photo);
    let victim = process_of(1, &name).expect("the second process runs");
    let killed = Command::new("kill").args(["-KILL", &victim.to_string()]).status();
    assert!(killed.is_ok_and(|status| status.success()));
    let start = Instant::now();
    let output = child.wait_with_output().expect("it ends");
    assert!(start.elapsed() < Duration::from_secs(20), "the others end within seconds");
    assert!(!output.status.success(), "a run without its process is no success");
    let said = text(&output.stderr);
    assert!(said.contains("signal 9") || said.contains("Killed"), "the reason is said: {said}");
    let taken = size();
    assert!(taken > 4 * photo, "photos are kept");
    // With three processes, and from the photos that are there.
    let resumed = run(mpirun(3, &slow(&scene, &name, &["--resume", "-v"])));
    assert!(text(&resumed.stderr).contains("journal"), "{}", text(&resumed.stderr));
    assert!(content(&folder) == content(&alone), "the resumed run has the bytes of an undisturbed one");
}

#[test]
fn a_process_without_a_driver_is_named() {
    let mut command = launcher();
    let program = env!("CARGO_BIN_EXE_krylux");
    let folder = TempDir::new().expect("a temporary folder can be made");
    let file = folder.path().join("matrix.npz").display().to_string();
    let scene = scene("corner");
    let verb = ["matrix", &scene, "--size", "8", "--spp", "4", "-o", &file];
    command.args(["-n", "1", program]).args(verb).arg(":").args(["-n", "1"]);
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "XDG_DATA_DIRS", "XDG_CONFIG_DIRS"] {
        command.args(["-x", &format!("{variable}=/nonexistent")]);
    }
    let output = command.arg(program).args(verb).output().expect("openmpi-bin is installed");
    let said = text(&output.stderr);
    assert!(
        !output.status.success() && said.contains("process 1") && said.contains("no Vulkan adapter"),
        "{said}"
    );
    assert!(!Path::new(&file).exists(), "nothing is written");
}

#[test]
fn another_program_is_refused_by_name() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let other = folder.path().join("krylux");
    let program = env!("CARGO_BIN_EXE_krylux");
    // The same program with another digest, as another build has it.
    let mut bytes = std::fs::read(program).expect("it is built with the tests");
    bytes.push(0);
    std::fs::write(&other, bytes).expect("it can be written");
    std::fs::set_permissions(&other, std::fs::metadata(program).expect("it is there").permissions())
        .expect("own file");
    let mut command = launcher();
    command.args(["-n", "1", program, "info", ":", "-n", "1"]).arg(&other).arg("info");
    let output = command.output().expect("openmpi-bin is installed");
    let said = text(&output.stderr);
    assert!(
        !output.status.success() && said.contains("process 1 on") && said.contains("the same program"),
        "{said}"
    );
    assert_eq!(said.matches("krylux: error").count(), 1, "one process says it: {said}");
}

#[test]
fn wrong_arguments_are_said_once() {
    let output = mpirun(3, &["segment", "--photoos"]).output().expect("openmpi-bin is installed");
    assert!(!output.status.success());
    assert_eq!(text(&output.stderr).matches("unexpected argument").count(), 1, "{}", text(&output.stderr));
}
