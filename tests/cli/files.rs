//! Files that never end, or that are none: each is named and refused, and Ctrl-C acts while a file is read.

use std::fs;
use std::io::Write;
use std::os::unix::fs::symlink;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::common::scene_path;
use crate::program::{command_without_graphics, folder, inside, rig, text};

/// Waits for the end of a program, which must come soon.
#[track_caller]
pub fn ended(mut child: Child, what: &str) -> std::process::Output {
    let start = Instant::now();
    while child.try_wait().expect("it was started").is_none() {
        if start.elapsed() > Duration::from_secs(20) {
            child.kill().expect("it was started");
            assert!(start.elapsed().is_zero(), "{what} goes on and on");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child.wait_with_output().expect("it has ended")
}

#[test]
fn pipes_and_devices_are_named_and_refused() {
    let folder = folder();
    let rig = rig(&folder, 8, "");
    let run = inside(&folder, "run");
    let whole = ["segment", &rig, "--photos", "6", "--groups", "2", "--eigenvectors", "2", "-o", &run];
    assert!(
        command_without_graphics(&whole).status().expect("the program is built with the tests").success()
    );
    let journal = format!("{run}/journal/photos.journal");
    let out = inside(&folder, "out.npy");
    let scene = scene_path("corner").display().to_string();
    let again = [&whole[..], &["--resume"]].concat();
    type Make<'a> = &'a dyn Fn(&str);
    let make: [(&str, Make<'_>); 3] = [
        ("a device or a pipe", &|path| {
            assert!(Command::new("mkfifo").arg(path).status().expect("every Unix has it").success());
        }),
        ("a device or a pipe", &|path| symlink("/dev/zero", path).expect("links can be made")),
        ("made up by the system", &|path| symlink("/proc/self/pagemap", path).expect("links can be made")),
    ];
    for (what, make) in make {
        for name in
            ["x.glb", "x.gltf", "x.obj", "x.toml", "x.npz", "x.mtx", "x.npy", "x.png", "x.exr", "x.rig"]
        {
            let path = inside(&folder, name);
            make(&path);
            let arguments: &[&str] = match &name[2..] {
                "glb" | "gltf" | "obj" => &["info", &path],
                "toml" => &["photo", &path, "-o", &out],
                "npz" | "mtx" | "npy" => &["eigs", &path, "-o", &out],
                "rig" => &["info", &scene, "--camera-file", &path],
                _ => &["compare", &path, &path],
            };
            refused(arguments, name, what);
            fs::remove_file(&path).expect("the folder is ours");
        }
        fs::remove_file(&journal).expect("the folder is ours");
        make(&journal);
        // In the folder of a run, links are refused whatever they lead to.
        let what =
            if fs::symlink_metadata(&journal).is_ok_and(|it| it.is_symlink()) { "a link" } else { what };
        refused(&["segment", &run, "--groups", "2", "-o", &out], "photos.journal", what);
        refused(&again, "photos.journal", what);
    }
}

#[track_caller]
fn refused(arguments: &[&str], name: &str, what: &str) {
    let mut command = command_without_graphics(arguments);
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let output = ended(child.expect("the program is built with the tests"), &format!("{arguments:?}"));
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
    assert!(said.contains(name) && said.contains(what), "{arguments:?}: {said}");
}

#[test]
fn ctrl_c_stops_the_reading_of_a_file_at_once() {
    let folder = folder();
    let path = folder.path().join("large.obj");
    let mut file = std::io::BufWriter::new(fs::File::create(&path).expect("the folder is ours"));
    write!(file, "v 0 0 0\nv 1 0 0\nv 0 1 0\n").expect("there is room");
    for _ in 0..4_000_000 {
        file.write_all(b"f 1 2 3\n").expect("there is room");
    }
    drop(file);
    let camera = "[camera]\nposition = [0, 0, 2]\nlook_at = [0, 0, 0]\nvertical_fov_degrees = 40\n";
    fs::write(folder.path().join("large.rig.toml"), camera).expect("the folder is ours");
    let path = path.display().to_string();
    let child =
        command_without_graphics(&["info", &path]).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let child = child.expect("the program is built with the tests");
    // Reading takes some seconds; the program starts in some milliseconds.
    std::thread::sleep(Duration::from_millis(400));
    let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(signal.expect("every Unix has kill").success());
    assert_eq!(ended(child, "info").status.code(), Some(130));
}
