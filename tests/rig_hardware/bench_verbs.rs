//! The verbs of `rig` on real protocols: `rig preview`, `rig align`, `rig check` and `rig list`.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use krylux::rig::Helper;
use serde_json::Value;
use tempfile::TempDir;

use crate::bench::{MAGNIFY, SIDE, Stage, noisy, stage};
use crate::program::{krylux, verdict as summary};

/// The devices and the folder of one test.
struct Session {
    folder: TempDir,
    stage: Stage,
}

impl Session {
    fn new(last: u8) -> Self {
        let folder = TempDir::new().expect("a temporary folder can be made");
        Self { folder, stage: stage(last, &noisy(Path::new("rooms.npz"))) }
    }

    fn inside(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// Writes the rig file; `more` are lines before its tables, `of_projector` lines in `[projector]`.
    fn rig(&self, more: &str, of_projector: &str) -> String {
        let projector = &self.stage.hardware.projector;
        let display = projector.display.as_deref().unwrap_or_default();
        let text = format!(
            "kind = \"hardware\"\n{more}\n[projector]\nkind = \"x11\"\ndisplay = \"{display}\"\nmonitor = \"beamer\"\n\
             size = [{SIDE}, {SIDE}]\nmagnify = {MAGNIFY}\n{of_projector}\n\
             [camera]\nkind = \"gige\"\naddress = \"{}\"\nsize = [{SIDE}, {SIDE}]\npixel_format = \"mono16\"\n\
             exposures = [1e-4, 1.0]\n",
            self.stage.address
        );
        let path = self.inside("rig.toml");
        std::fs::write(&path, text).expect("the folder can be written");
        path
    }
}

/// The name and the text of each finding of a check that is not ok.
#[track_caller]
fn wrong(said: &Value) -> Vec<(String, String)> {
    let findings = said["findings"].as_array().expect("a list");
    let text = |finding: &Value, key: &str| finding[key].as_str().unwrap_or_default().to_owned();
    findings.iter().for_each(|finding| {
        println!("{:<14}{:<9}{}", text(finding, "name"), text(finding, "grade"), text(finding, "found"));
    });
    let not_ok = findings.iter().filter(|finding| finding["grade"] != "ok");
    not_ok
        .map(|finding| (text(finding, "name"), text(finding, "found") + " " + &text(finding, "help")))
        .collect()
}

#[test]
fn a_rig_is_previewed_aligned_calibrated_and_checked() {
    let session = Session::new(201);
    let rig = session.rig("", "monitor_size = [200, 200]");
    let picture = session.inside("preview.png");
    let (said, _) = summary(&["rig", "preview", &rig, "--frames", "3", "-o", &picture]);
    println!("{}", said["figures"]);
    assert_eq!(said["figures"]["frame"], 3);
    assert!(said["figures"]["focus"].is_number() && Path::new(&picture).is_file());

    let picture = session.inside("align.png");
    let (said, status) = summary(&["rig", "align", &rig, "--rounds", "2", "-o", &picture]);
    println!("{}", said["last"]);
    assert_eq!((status, said["aligned"].as_bool()), (0, Some(true)), "camera pixels see their own: {said}");
    assert!(Path::new(&picture).is_file());

    let known = session.inside("known");
    // The curves of these devices are smooth: 33 levels tell them as well as 256, and take an eighth of the time.
    let output = krylux(&["rig", "calibrate", &rig, "--levels", "33", "-o", &known, "-q"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let rig = session.rig("calibration = \"known\"", "monitor_size = [200, 200]");
    let began = Instant::now();
    let (said, status) = summary(&["rig", "check", &rig, "-o", &session.inside("out")]);
    println!("checked in {:?}", began.elapsed());
    let wrong = wrong(&said);
    // A busy machine may lose frames or take them late, which is reported; nothing else may be wrong.
    assert!(status == 0 && wrong.iter().all(|(name, _)| name == "frames"), "{wrong:?}");
    let text = said.to_string();
    for part in [
        "all 256 levels read back as drawn",
        "\\\"beamer\\\": 200x200 pixels at (200, 0)",
        "Mono16 12x12+0+0: 12x12 pixels",
    ] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}

#[test]
fn a_faulty_device_is_named_and_the_other_one_is_checked_too() {
    let session = Session::new(202);
    let out = session.inside("out");
    let rig = session.rig("", "monitor_size = [1920, 1080]");
    let (said, status) = summary(&["rig", "check", &rig, "-o", &out]);
    let found = wrong(&said);
    assert!(status == 1 && found.len() == 1 && found[0].0 == "monitor", "{found:?}");
    assert!(found[0].1.contains("200x200 pixels, but the rig file says 1920x1080"), "{found:?}");
    assert_eq!((&said["whole"], said.to_string().contains("Mono16")), (&Value::from(false), true));

    let rig = session.rig("", "monitor_size = [200, 200]");
    // Another program holds the camera.
    let held =
        session.stage.hardware.open_camera(&Helper::at(env!("CARGO_BIN_EXE_krylux"))).expect("it is free");
    let (said, status) = summary(&["rig", "check", &rig, "-o", &out]);
    drop(held);
    let found = wrong(&said);
    assert!(
        status == 1
            && found
                .iter()
                .any(|(name, text)| name == "camera" && text.contains("in use by another program")),
        "{found:?}"
    );
}

#[test]
fn ctrl_c_releases_both_devices() {
    let session = Session::new(203);
    let (rig, picture) = (session.rig("", ""), session.inside("preview.png"));
    let mut program = Command::new(env!("CARGO_BIN_EXE_krylux"))
        .args(["rig", "preview", &rig, "-o", &picture])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program is built with the tests");
    let mut said = BufReader::new(program.stdout.take().expect("it is piped"));
    let mut first = String::new();
    said.read_line(&mut first).expect("it says its first frame");
    assert!(first.starts_with("frame "), "{first}");
    let killed = Command::new("kill").args(["-INT", &program.id().to_string()]).status();
    assert!(killed.expect("there is a kill").success());
    let began = Instant::now();
    let status = loop {
        if let Some(status) = program.try_wait().expect("it is ours") {
            break status;
        }
        assert!(began.elapsed() < Duration::from_secs(60), "it goes on");
        std::thread::sleep(Duration::from_millis(5));
    };
    assert_eq!(status.code(), Some(0));
    assert!(session.stage.server.windows().is_empty(), "the projector's window is gone");
    // The camera was released; otherwise it would stay held until its heartbeat runs out.
    let (said, _) = summary(&["rig", "preview", &rig, "--frames", "1", "-o", &picture]);
    assert_eq!(said["figures"]["frame"], 1);
    image::open(&picture).expect("it is a whole picture");
}

#[test]
fn the_list_shows_what_a_camera_can_do_even_while_it_is_held() {
    let session = Session::new(204);
    let rig = session.rig("", "");
    let held =
        session.stage.hardware.open_camera(&Helper::at(env!("CARGO_BIN_EXE_krylux"))).expect("it is free");
    let (said, _) = summary(&["rig", "list", &rig]);
    drop(held);
    let cameras = said["cameras"].as_array().expect("an array");
    let ours = cameras
        .iter()
        .find(|camera| camera["address"] == session.stage.address.to_string())
        .expect("it is listed");
    println!("{ours}");
    let abilities = &ours["abilities"];
    assert_eq!(abilities["sensor"], serde_json::json!([SIDE, SIDE]));
    let formats = abilities["pixel_formats"].as_array().expect("a list");
    assert!(
        ["Mono8", "Mono12", "Mono16"].iter().all(|format| formats.contains(&Value::from(*format))),
        "{abilities}"
    );
    let [shortest, longest] =
        [0, 1].map(|end| abilities["exposures"][end].as_f64().expect("a number of seconds"));
    assert!((shortest - 2e-5).abs() < 1e-9 && (longest - 2.0).abs() < 1e-9, "{abilities}");
}
