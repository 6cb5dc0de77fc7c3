//! Little memory, few processes, full disks, and files that state more pixels than there are: an error that says so, and no crash.

use std::path::Path;
use std::process::{Command, Output};

use krylux::image::{Image, Resolution};
use krylux::io::{exr, npy};
use serde_json::{Value, json};

use crate::program::{assert_error, command, command_without_graphics, folder, inside, rig, text};

/// The program after a shell's `ulimit OPTIONS`.
fn limited(limit: &str, program: &Command) -> Output {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("{limit}; exec \"$@\""), "sh"]).arg(program.get_program());
    command.args(program.get_args());
    for (name, value) in program.get_envs() {
        command.env(name, value.unwrap_or_default());
    }
    command.output().expect("there is a shell")
}

const SCENE: &str = "assets/scenes/corner/scene.glb";

#[test]
fn a_photo_larger_than_the_memory_is_refused_before_it_is_traced() {
    let folder = folder();
    let photo = inside(&folder, "photo.npy");
    let large = ["photo", SCENE, "--size", "16384", "--spp", "1", "-o", &photo];
    // The limits of the user, and of the system.
    let asked =
        command(&[&large[..], &["--memory", "2GiB"]].concat()).output().expect("the program is built");
    let bound = limited("ulimit -v 8388608", &command(&large));
    for output in [asked, bound] {
        let message = assert_error(&output, &["--size", "16384x16384 pixels", "--memory"]);
        assert!(message.contains("40."), "about 40 GiB: {message}");
    }
    // The same option lets a small photo pass.
    let small = ["photo", SCENE, "--size", "8", "--spp", "1", "-o", &photo, "--memory", "2GiB"];
    assert!(command(&small).status().expect("the program is built").success());
}

#[test]
fn a_scene_larger_than_the_memory_is_refused() {
    // A triangle that eight nodes place a million times each, in a file of 12 MB.
    let (count, corners) = (1_usize << 20, [0.0_f32, 0.0, -2.0, 1e-6, 0.0, -2.0, 0.0, 1e-6, -2.0]);
    let places = (0..count).flat_map(|at| [at as f32 * 1e-5, 0.0, 0.0]);
    let binary: Vec<u8> =
        corners.into_iter().chain(places).flat_map(|value: f32| value.to_le_bytes()).collect();
    let instancing = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 1 } } });
    let mut nodes: Vec<Value> = (0..8)
        .map(|row| json!({ "mesh": 0, "translation": [0, row, 0], "extensions": instancing }))
        .collect();
    nodes.push(json!({ "camera": 0 }));
    let document = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 },
            { "bufferView": 1, "componentType": 5126, "type": "VEC3", "count": count },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 12 * count },
        ],
        "buffers": [{ "byteLength": binary.len(), "uri": "places.bin" }],
    });
    let folder = folder();
    let [scene, photo] = ["scene.gltf", "photo.npy"].map(|name| inside(&folder, name));
    std::fs::write(inside(&folder, "places.bin"), binary).expect("the folder can be written");
    std::fs::write(&scene, document.to_string()).expect("the folder can be written");
    let command = command(&["photo", &scene, "--size", "8", "--spp", "1", "-o", &photo]);
    // Too little to load it, and too little for its search tree.
    for (limit, what) in
        [("ulimit -v 2097152", "no memory for"), ("ulimit -v 4194304", "8,388,608 triangles take about")]
    {
        assert_error(&limited(limit, &command), &["scene.gltf", what, "simplify the meshes"]);
    }
}

#[test]
fn too_little_address_space_for_a_driver_is_said() {
    let folder = folder();
    let photo = inside(&folder, "photo.npy");
    let command = command(&["photo", SCENE, "--size", "8", "--spp", "1", "-o", &photo]);
    let output = limited("ulimit -v 409600", &command);
    assert_error(&output, &["graphics device", "400 MiB", "ulimit -v unlimited"]);
}

#[cfg(unix)]
#[test]
fn without_threads_the_work_is_done_by_one() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::os::unix::process::CommandExt;
    let folder = folder();
    let one = inside(&folder, "one.npy");
    npy::write_image(Path::new(&one), &Image::filled(Resolution::new(64, 64), 1, 0.5)).expect("it is ours");
    let open = |path: &Path| std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755));
    open(folder.path()).and_then(|()| open(Path::new(&one))).expect("it is ours");
    // Root may start any number of processes, and so becomes somebody else. One shell calls the option -u, another -p.
    let limit = "ulimit -u 1 2>/dev/null || ulimit -p 1";
    let is_root = std::fs::metadata("/proc/self").is_ok_and(|about| about.uid() == 0);
    let program = command_without_graphics(&["compare", &one, &one, "--max-rmse", "0.1"]);
    let mut command = Command::new("sh");
    if is_root {
        command.uid(65_534);
    }
    command.args(["-c", &format!("{limit}; exec \"$@\""), "sh"]).arg(program.get_program());
    let output = command.args(program.get_args()).output().expect("there is a shell");
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("Ctrl-C cannot be handled"), "the limit has no effect: {said}");
}

/// The program as another user with this limit of processes and threads, after `before`; `None` if the system does not allow that.
#[cfg(target_os = "linux")]
fn as_another(processes: usize, before: &[&str]) -> Option<Command> {
    // A user whose processes nobody else counts: of this test alone.
    let user = (70_000 + std::process::id() % 50_000).to_string();
    let limit = format!("--nproc={processes}");
    let words = ["setpriv", "--reuid", &user, "--clear-groups", "prlimit", &limit];
    let works = Command::new(words[0]).args(&words[1..]).arg("true").output();
    if !works.is_ok_and(|output| output.status.success()) {
        eprintln!("not run: only root can become another user, by setpriv and prlimit");
        return None;
    }
    let all = [before, &words].concat();
    let mut command = Command::new(all[0]);
    command.args(&all[1..]);
    Some(command)
}

/// Runs an example at every limit of processes from 1 to 8. Returns the statuses.
#[cfg(target_os = "linux")]
fn at_every_limit(before: &[&str], files: &[(&str, &[u8])], arguments: &[&str]) -> Vec<i32> {
    use std::os::unix::fs::PermissionsExt;
    let folder = folder();
    let open = |path: &Path| std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o777));
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).expect("it is ours");
    }
    let program = folder.path().join("krylux");
    std::fs::copy(command(&[]).get_program(), &program).expect("the program is built");
    open(folder.path()).and_then(|()| open(&program)).expect("it is ours");
    let mut statuses = Vec::new();
    for processes in 1..=8 {
        let Some(mut limited) = as_another(processes, before) else { break };
        limited.current_dir(&folder).env("XDG_CACHE_HOME", folder.path()).env("TERM", "xterm");
        limited.arg(&program).args(arguments).args(["-o", &format!("run-{processes}")]);
        let output = limited.output().expect("there is prlimit");
        // A terminal of `script` has one stream for both.
        let said = text(&[output.stdout, output.stderr].concat());
        let status = output.status.code().expect("no signal ends it");
        assert!(matches!(status, 0..=2) && !said.contains("panicked"), "{processes}: {status}: {said}");
        let is_said = said.contains("help:") && said.contains("limit of processes (`ulimit -u`)");
        assert!(status < 2 || is_said, "{processes}: {said}");
        statuses.push(status);
    }
    statuses
}

#[cfg(target_os = "linux")]
const MATRIX: (&str, &[u8]) =
    ("a.mtx", b"%%MatrixMarket matrix coordinate real symmetric\n4 4 4\n1 1 1\n2 2 2\n3 3 3\n4 4 4\n");

#[cfg(target_os = "linux")]
#[test]
fn under_every_limit_of_processes_a_matrix_is_asked_with_the_threads_there_are() {
    let arguments = ["eigs", MATRIX.0, "--count", "2"];
    assert!(at_every_limit(&[], &[MATRIX], &arguments).iter().all(|&status| status == 0));
    // On a terminal, where bars are drawn, which have a clock.
    let terminal = "import os, pty, sys; sys.exit(os.waitstatus_to_exitcode(pty.spawn(sys.argv[1:])))";
    if Command::new("python3").arg("--version").output().is_ok() {
        let statuses = at_every_limit(&["python3", "-c", terminal], &[MATRIX], &arguments);
        assert!(statuses.iter().all(|&status| status == 0), "{statuses:?}");
    } else {
        eprintln!("not run on a terminal: there is no Python to make one");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn under_every_limit_of_processes_a_scene_is_traced_or_one_error_says_why() {
    let scene = std::fs::read(SCENE).expect("it is shipped");
    let arguments = ["segment", "scene.glb", "--size", "8", "--spp", "1", "--photos", "4", "--groups", "2"];
    at_every_limit(&[], &[("scene.glb", &scene)], &arguments);
}

/// An EXR file of 8×8 pixels that claims to have 8192×8192.
fn forged(path: &Path) {
    exr::write_exr(path, &[("", &Image::filled(Resolution::new(8, 8), 3, 0.5))]).expect("it is ours");
    let mut bytes = std::fs::read(path).expect("it was written");
    for window in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        let at =
            bytes.windows(window.len()).position(|at| at == window.as_bytes()).expect("a header has both");
        let largest = at + window.len() + 4 + 8;
        for side in 0..2 {
            bytes[largest + 4 * side..][..4].copy_from_slice(&8191_i32.to_le_bytes());
        }
    }
    std::fs::write(path, bytes).expect("it is ours");
}

#[test]
fn an_exr_file_is_as_large_as_is_wanted_before_it_is_decoded() {
    let folder = folder();
    let [forgery, small] = ["forged.exr", "small.exr"].map(|name| inside(&folder, name));
    forged(Path::new(&forgery));
    exr::write_exr(Path::new(&small), &[("", &Image::filled(Resolution::new(8, 8), 3, 0.5))])
        .expect("it is ours");
    let rig = rig(&folder, 8, "");
    let photo = inside(&folder, "photo.npy");
    // Three planes of 256 MiB each do not fit.
    let limit = "ulimit -v 1048576";
    let pattern = command_without_graphics(&["photo", &rig, "--pattern", &forgery, "-o", &photo]);
    assert_error(&limited(limit, &pattern), &["forged.exr", "8192x8192 pixels", "8x8"]);
    let compared = command_without_graphics(&["compare", &forgery, &small]);
    assert_error(&limited(limit, &compared), &["forged.exr", "8192x8192 pixels", "8x8"]);
    let alone = command_without_graphics(&["compare", &forgery, &forgery]);
    assert_error(&limited(limit, &alone), &["forged.exr", "half of the memory"]);
}

#[test]
fn a_file_larger_than_the_memory_is_not_read() {
    let folder = folder();
    let path = inside(&folder, "hole.npy");
    let file = std::fs::File::create(&path).expect("the folder is writable");
    file.set_len(1 << 40).expect("a hole takes no room");
    let output = command_without_graphics(&["compare", &path, &path]).output().expect("the program is built");
    assert_error(&output, &["hole.npy", "half of the memory"]);
}

#[cfg(unix)]
#[test]
fn a_full_disk_is_one_error() {
    let folder = folder();
    let (rig, matrix) = (rig(&folder, 8, ""), inside(&folder, "matrix.npz"));
    std::os::unix::fs::symlink("/dev/full", &matrix).expect("the folder is writable");
    let output = command_without_graphics(&["matrix", &rig, "-o", &matrix]).output();
    let message = assert_error(&output.expect("the program is built"), &["cannot write", "matrix.npz"]);
    assert!(!message.contains("ZipWriter"), "{message}");
}

#[test]
fn several_processes_without_mpi_are_refused() {
    // Each of them would do everything, and write the same files.
    if cfg!(feature = "mpi") {
        return;
    }
    for launcher in ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"] {
        let output =
            command_without_graphics(&["info"]).env(launcher, "2").output().expect("the program is built");
        assert_error(&output, &["2 processes", "--features mpi"]);
        let one = command(&["info"]).env(launcher, "1").output().expect("the program is built");
        assert!(one.status.success(), "{}", text(&one.stderr));
    }
}
