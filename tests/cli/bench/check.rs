//! `rig check`: each fault is named, and nothing else.

use std::time::Instant;

use serde_json::Value;
use tempfile::TempDir;

use super::support::{folder, inside, krylux, rig, summary, text};

/// Writes a rig file and calibrates the rig.
fn calibrated(folder: &TempDir) -> String {
    let plain = rig(folder, [0, 0], &[]);
    let out = inside(folder, "known");
    let output = krylux(&["rig", "calibrate", &plain, "-o", &out, "-q"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    rig(folder, [0, 0], &[("", "calibration = \"known\"")])
}

/// The findings of a check (name, grade, text), and whether it passed.
#[track_caller]
fn check(rig: &str, folder: &TempDir) -> (Vec<(String, String, String)>, bool) {
    let (said, status) = summary(&["rig", "check", rig, "-o", &inside(folder, "out")]);
    let of = |finding: &Value, key: &str| finding[key].as_str().unwrap_or_default().to_owned();
    let findings: Vec<(String, String, String)> = said["findings"]
        .as_array()
        .expect("a list")
        .iter()
        .map(|finding| {
            (
                of(finding, "name"),
                of(finding, "grade"),
                format!("{} → {}", of(finding, "found"), of(finding, "help")),
            )
        })
        .collect();
    findings.iter().for_each(|(name, grade, found)| println!("{name:<14}{grade:<9}{found}"));
    assert_eq!(said["passed"].as_bool(), Some(status == 0));
    (findings, status == 0)
}

/// The names and grades of the findings that are not as they should be. What depends on these may not be measured.
fn named(findings: &[(String, String, String)]) -> Vec<(&str, &str)> {
    let wrong = findings.iter().filter(|(_, grade, _)| !["ok", "unmeasured"].contains(&grade.as_str()));
    wrong.map(|(name, grade, _)| (name.as_str(), grade.as_str())).collect()
}

#[test]
fn a_rig_in_order_passes_every_check_and_a_moved_camera_does_not() {
    let folder = folder();
    let rig = calibrated(&folder);
    let began = Instant::now();
    let (findings, passed) = check(&rig, &folder);
    println!("{:?}", began.elapsed());
    assert!(passed && named(&findings).is_empty(), "{findings:?}");
    let names: Vec<&str> = findings.iter().map(|(name, ..)| name.as_str()).collect();
    let expected = [
        "file",
        "disk",
        "projector",
        "camera",
        "calibration",
        "exposure",
        "saturation",
        "light",
        "ambient",
        "frames",
        "settling",
        "repeatability",
        "noise",
        "pixel map",
        "iris",
        "stray light",
        "levels",
        "pulses",
        "shutter",
        "border",
        "sharpness",
        "ghost",
    ];
    assert_eq!(names, expected);
    let output = krylux(&["rig", "check", &rig]);
    let said = text(&output.stdout);
    assert!(said.contains("pixel map     ok ") && said.contains("The bench is ready."), "{said}");

    let moved = |by: &str| {
        super::support::rig(
            &folder,
            [0, 0],
            &[("", "calibration = \"known\""), ("camera", &format!("shift = [{by}, 0.0]"))],
        )
    };
    for (by, grade) in [("0.5", "fails"), ("-3.0", "fails"), ("0.2", "warning")] {
        let (findings, passed) = check(&moved(by), &folder);
        assert_eq!((named(&findings), passed), (vec![("pixel map", grade)], grade == "warning"));
    }
}

#[test]
fn more_noise_than_calibration_predicts_is_named() {
    let folder = folder();
    let rig = calibrated(&folder);
    let text = std::fs::read_to_string(&rig).expect("it was written");
    // Read noise of 150 electrons instead of 6; the shot noise of white is about 150 electrons.
    std::fs::write(&rig, text.replace("read_noise = 6", "read_noise = 150"))
        .expect("the folder can be written");
    let (findings, passed) = check(&rig, &folder);
    assert!(passed);
    assert_eq!(named(&findings), [("noise", "warning")]);
}

#[test]
fn an_iris_fails_where_the_cameras_response_is_known_and_other_imperfections_warn() {
    let folder = folder();
    calibrated(&folder);
    for (table, line, expected, part) in [
        ("projector", "iris = { dimming = 0.06 }", ("iris", "fails"), "switch off the automatic iris"),
        ("projector", "overscan = 0.08", ("border", "warning"), "overscan and keystone"),
        ("projector", "limited_range = true", ("levels", "warning"), "full range"),
    ] {
        // The calibration is older than the imperfection. Its map does not fit a stretched picture.
        let rig = rig(&folder, [0, 0], &[("", "calibration = \"known\""), (table, line)]);
        let (findings, _) = check(&rig, &folder);
        let named = named(&findings);
        assert!(named.iter().all(|found| *found == expected || found.0 == "pixel map"), "{line}: {named:?}");
        let found = findings.iter().find(|(name, ..)| name == expected.0).expect("it is examined");
        assert!(found.1 == expected.1 && found.2.contains(part), "{line}: {found:?}");
    }
}

#[test]
fn an_audit_names_the_faults_of_the_devices_too() {
    let folder = folder();
    calibrated(&folder);
    for (line, expected) in
        [("", None), ("overscan = 0.08", Some("border")), ("limited_range = true", Some("levels"))]
    {
        let rig = rig(&folder, [0, 0], &[("", "calibration = \"known\""), ("projector", line)]);
        let (said, _) = summary(&["audit", &rig, "--overwrite", "-o", &inside(&folder, "audit")]);
        let devices = said["devices"].as_array().expect("a list");
        let wrong: Vec<&str> = devices
            .iter()
            .filter(|finding| finding["grade"] != "ok")
            .filter_map(|finding| finding["name"].as_str())
            .collect();
        assert_eq!(wrong, expected.into_iter().collect::<Vec<_>>(), "{line}: {devices:?}");
        assert!(devices.iter().any(|finding| finding["name"] == "iris"), "{devices:?}");
    }
}

#[test]
fn each_fault_of_light_and_time_is_named_with_advice() {
    let folder = folder();
    let uncalibrated = ("calibration", "warning");
    for (more, expected, part) in [
        (vec![], vec![uncalibrated], "rig calibrate"),
        // The light appears 50 ms after its frame, but photos are taken after 10 ms.
        (
            vec![("projector", "latency = 0.05"), ("measurement", "settle = 0.01")],
            vec![uncalibrated, ("settling", "fails")],
            "longer settle",
        ),
        (vec![("projector", "latency = 0.05")], vec![uncalibrated], "rig calibrate"),
        (
            vec![("faults", "late_frames = [9]"), ("faults", "dropped_frames = [12]")],
            vec![uncalibrated, ("frames", "warning")],
            "1 were exposed too early",
        ),
        (
            vec![("measurement", "exposures = [1.0]")],
            vec![uncalibrated, ("saturation", "fails")],
            "shorter exposure",
        ),
        (
            vec![("measurement", "exposures = [0.01]")],
            vec![uncalibrated, ("exposure", "warning")],
            "expose longer",
        ),
        (
            vec![("measurement", "exposures = [0.1]"), ("projector", "frame_time = 0.03")],
            vec![("file", "warning"), uncalibrated],
            "whole multiples",
        ),
    ] {
        let rig = rig(&folder, [0, 0], &more);
        let (findings, passed) = check(&rig, &folder);
        assert_eq!(named(&findings), expected, "{more:?}");
        assert_eq!(passed, expected.iter().all(|(_, grade)| *grade != "fails"), "{more:?}");
        let said = krylux(&["rig", "check", &rig, "-o", &inside(&folder, "out")]);
        assert!(text(&said.stdout).contains(part), "`{part}` is missing in: {}", text(&said.stdout));
    }
}

#[test]
fn a_camera_without_frames_and_a_faulty_file_are_findings_and_not_errors() {
    let folder = folder();
    let rig = rig(&folder, [0, 0], &[("faults", "dropped = 1.0")]);
    let (findings, passed) = check(&rig, &folder);
    assert!(!passed);
    let last = findings.last().expect("there are some");
    assert!(last.0 == "frames" && last.2.contains("no good frame"), "{last:?}");
    let wrong = inside(&folder, "wrong.toml");
    std::fs::write(&wrong, "kind = \"virtual\"\nsede = 1\n").expect("the folder can be written");
    let (findings, passed) = check(&wrong, &folder);
    assert!(!passed && findings.len() == 1 && findings[0].2.contains("seed"), "{findings:?}");
    let missing = super::support::rig(&folder, [0, 0], &[("", "calibration = \"nowhere\"")]);
    let (findings, passed) = check(&missing, &folder);
    assert_eq!((named(&findings), passed), (vec![("calibration", "fails")], false));
}

#[test]
fn the_list_shows_what_virtual_devices_can_do() {
    let folder = folder();
    let rig = rig(&folder, [0, 0], &[]);
    let (said, _) = summary(&["rig", "list", &rig]);
    assert_eq!(said["virtual"]["camera"]["resolution"]["width"], 64);
    assert_eq!(said["virtual"]["projector"]["bits"], 8);
}
