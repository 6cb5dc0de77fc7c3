//! The command line from calibration to report, on the real protocols and on a virtual rig with the same devices.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use krylux::io::{npy, sparse};
use serde_json::Value;
use tempfile::TempDir;

use crate::bench::{QUESTION, SIDE, labels, noisy, rig_file, rooms, stage};
use crate::program::{krylux, labels_of_rooms, summary};

/// Writes the rig file of the virtual rig with the same devices.
fn simulated(folder: &Path, more: &str) -> String {
    sparse::write(&folder.join("rooms.npz"), &rooms()).expect("the folder can be written");
    let path = folder.join("simulated.toml");
    let text = format!(
        "kind = \"virtual\"\n{more}\n[scene]\nmatrix = \"rooms.npz\"\nsize = [{SIDE}, {SIDE}]\n\
         [camera]\nwhite_exposure = 0.004\nexposures = [1e-4, 1.0]\n\
         shot_noise = true\nfull_well = 1e7\nread_noise = 100\n[measurement]\ndirect_square = 1\n"
    );
    std::fs::write(&path, text).expect("the folder can be written");
    path.display().to_string()
}

fn segment(rig: &str, run: &Path) -> Value {
    let run = run.display().to_string();
    summary(&[&["segment", rig, "-o", &run], &QUESTION[..]].concat())
}

#[test]
fn results_from_calibration_to_report_equal_those_of_the_virtual_rig() {
    let began = Instant::now();
    let folder = TempDir::new().expect("a temporary folder can be made");
    let stage = stage(10, &noisy(Path::new("rooms.npz")));
    let files = |more: &str| [rig_file(folder.path(), &stage, more), simulated(folder.path(), more)];
    for (name, rig) in ["real", "simulated"].iter().zip(files("")) {
        let out = folder.path().join(format!("{name}-calibration")).display().to_string();
        let said = summary(&["rig", "calibrate", &rig, "-o", &out]);
        let stability = &said["report"]["stability"];
        println!(
            "{name}: settle {}, {} frames, after {:?}",
            stability["settle"]["value"],
            said["effort"]["taken"],
            began.elapsed()
        );
    }
    let [rig, twin] = [
        rig_file(folder.path(), &stage, "calibration = \"real-calibration\""),
        simulated(folder.path(), "calibration = \"simulated-calibration\""),
    ];
    let run = |name: &str| -> PathBuf { folder.path().join(name) };
    let said = segment(&rig, &run("segmented"));
    segment(&twin, &run("simulated"));
    println!("segmented after {:?}: {}", began.elapsed(), said["rig"]["effort"]);
    let found = labels(&run("segmented"));
    assert_eq!(found, labels(&run("simulated")), "the same labels");
    assert_eq!(found, labels_of_rooms(SIDE));
    assert!(run("segmented").join("report.html").is_file());
    let target = folder.path().join("target.npy");
    let wish: Vec<f64> =
        (0..SIDE * SIDE).map(|pixel| 0.8 + 0.2 * f64::from(u8::from(pixel % 2 == 0))).collect();
    npy::write_npy(&target, &[SIDE, SIDE], &wish).expect("the folder can be written");
    let (target, out) = (target.display().to_string(), run("compensated").display().to_string());
    let said =
        summary(&["compensate", &rig, "--target", &target, "--photos", "8", "--rtol", "0.02", "-o", &out]);
    let residual = said["relative_residual"].as_f64().expect("it is told");
    println!("compensated after {:?}: relative residual {residual}", began.elapsed());
    assert!(residual <= 0.02, "{residual}");
    // A finished run needs neither server nor camera.
    drop(stage);
    let again = segment(&run("segmented").display().to_string(), &run("again"));
    assert_eq!(labels(&run("again")), found);
    assert_eq!(again["rig"]["effort"]["taken"], 0);
    println!("the whole: {:?}", began.elapsed());
}

#[test]
fn the_list_names_monitors_and_cameras() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let stage = stage(12, &noisy(Path::new("rooms.npz")));
    let said = summary(&["rig", "list", &rig_file(folder.path(), &stage, "")]);
    let monitors = said["monitors"].as_array().expect("an array");
    let beamer = monitors.iter().find(|monitor| monitor["name"] == "beamer").expect("it is listed");
    assert_eq!((&beamer["resolution"]["width"], &beamer["place"][0]), (&Value::from(200), &Value::from(200)));
    let cameras = said["cameras"].as_array().expect("an array");
    let ours =
        cameras.iter().find(|camera| camera["address"] == stage.address.to_string()).expect("it is listed");
    assert_eq!((&ours["maker"], &ours["model"]), (&Value::from("krylux"), &Value::from("Loopback")));
    assert_eq!(ours["kind"], "gige");
    let abilities = &ours["abilities"];
    assert_eq!(abilities["sensor"], serde_json::json!([SIDE, SIDE]));
    let formats = abilities["pixel_formats"].as_array().expect("a list");
    assert!(
        ["Mono12Packed", "BayerRG12p"].iter().all(|format| formats.contains(&(*format).into())),
        "{abilities}"
    );
    assert_eq!(abilities["exposures"], serde_json::json!([2e-5, 2.0]));
    // A server that cannot be reached is named.
    let output = krylux(&["rig", "list", "--display", ":4094", "--json"]);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains(":4094"), "{message}");
    // Other tests may have simulated cameras on this machine's network.
    let said: Value = serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON");
    let is_empty = |name: &str| said[name].as_array().is_some_and(Vec::is_empty);
    let is_nothing = is_empty("monitors") && is_empty("cameras");
    assert_eq!(output.status.code(), Some(i32::from(is_nothing)), "{said}");
    assert_eq!(message.contains("nothing was found"), is_nothing, "{message}");
}

/// A description whose features are these elements.
fn description(elements: &str) -> String {
    let shipped = include_str!("../gige_camera/camera.xml");
    let head = &shipped[..shipped.find("<Category").expect("it has features")];
    format!("{head}{elements}</RegisterDescription>")
}

#[test]
fn a_hostile_camera_ends_neither_the_list_nor_a_session() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let stage = stage(14, &noisy(Path::new("rooms.npz")));
    let rig = rig_file(folder.path(), &stage, "");
    let deep = 40_000;
    let chain: String = (0..deep)
        .map(|at| format!("<Integer Name=\"N{at}\"><pValue>N{}</pValue></Integer>", at + 1))
        .collect();
    let brackets = format!("{}1{}", "(".repeat(200_000), ")".repeat(200_000));
    let hostile = [
        (
            description(
                "<Integer Name=\"WidthMax\"><pValue>A</pValue></Integer><Integer Name=\"A\"><pValue>WidthMax</pValue></Integer>",
            ),
            None,
        ),
        (
            description(&format!(
                "<Integer Name=\"WidthMax\"><pValue>N0</pValue></Integer>{chain}<Integer Name=\"N{deep}\"><Value>7</Value></Integer>"
            )),
            None,
        ),
        (
            description(&format!(
                "<IntSwissKnife Name=\"WidthMax\"><Formula>{brackets}</Formula></IntSwissKnife>"
            )),
            None,
        ),
        (description(""), Some("Local:c.xml;ffffffffffffffff;ffffffffffffffff")),
        (description(""), Some("Local:c.xml;0;ffffffff")),
        ("<a>".repeat(50_000), None),
    ];
    for (number, (xml, url)) in hostile.iter().enumerate() {
        stage.camera.describe(xml, *url);
        let began = Instant::now();
        let said = summary(&["rig", "list", &rig]);
        let cameras = said["cameras"].as_array().expect("an array");
        let is_listed = |camera: &Value| camera["address"] == stage.address.to_string();
        assert!(cameras.iter().any(is_listed), "camera {number} is not listed");
        assert!(began.elapsed() < Duration::from_secs(60), "camera {number} takes {:?}", began.elapsed());
        println!("camera {number}: {:?}", began.elapsed());
        // Nor does it end a session, which is refused or fails by name.
        let (began, photo) = (Instant::now(), folder.path().join("photo.npy").display().to_string());
        let output = krylux(&["photo", &rig, "-o", &photo]);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "camera {number}: {message}");
        assert!(message.contains(&stage.address.to_string()), "camera {number}: {message}");
        assert!(began.elapsed() < Duration::from_secs(60), "camera {number} takes {:?}", began.elapsed());
        println!("its session: {:?}: {}", began.elapsed(), message.lines().next().unwrap_or_default());
    }
}

#[test]
fn verbs_that_need_a_scene_refuse_real_devices() {
    let folder = TempDir::new().expect("a temporary folder can be made");
    let path = folder.path().join("rig.toml");
    let text = "kind = \"hardware\"\n[projector]\nkind = \"x11\"\nsize = [8, 8]\n\
                [camera]\nkind = \"gige\"\naddress = \"127.0.8.250\"\nsize = [8, 8]\n";
    std::fs::write(&path, text).expect("the folder can be written");
    let rig = path.display().to_string();
    for (arguments, parts) in [
        (vec!["plan", &rig, "segment"], vec!["rig.toml", "virtual"]),
        (vec!["photo", &rig, "--spp", "8"], vec!["--spp", "nothing is traced"]),
        (vec!["labels", &rig], vec!["rig.toml", "scene"]),
    ] {
        let output = krylux(&arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{arguments:?}: {message}");
    }
    let said = summary(&["info", &rig]);
    assert_eq!(said["rig"]["kind"], "hardware");
    assert_eq!(said["rig"]["camera"]["name"], "gige 127.0.8.250 Mono12 8x8+0+0");
}
