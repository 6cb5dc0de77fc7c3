//! `krylux reproduce`: all figures run, from the program alone, and what the page says follows from the numbers.
#![allow(clippy::unwrap_used, clippy::panic, reason = "in a test a panic is the report")]

use crate::program;
use std::path::Path;
use std::process::Output;

use serde_json::Value;
use tempfile::TempDir;

const FIGURES: [&str; 16] = [
    "fig2",
    "fig4",
    "fig5",
    "fig6",
    "fig8",
    "fig9",
    "fig10",
    "fig11",
    "fig12",
    "fig13",
    "random",
    "conditioning",
    "polynomials",
    "apart",
    "disparity",
    "mixture",
];

/// In an empty folder, so that nothing of the repository lies beside it.
fn krylux(folder: &Path, args: &[&str]) -> Output {
    program::command(args).current_dir(folder).output().unwrap()
}

fn summary(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{error}: {text}"))
}

fn is_met(check: &Value) -> bool {
    let (value, limit) = (check["value"].as_f64(), check["limit"].as_f64());
    let meets = |value: Option<f64>| match check["bound"].as_str() {
        // NaN becomes null, and meets no bound.
        Some("at least") => value.zip(limit).is_some_and(|(value, limit)| value >= limit),
        Some("at most") => value.zip(limit).is_some_and(|(value, limit)| value <= limit),
        Some("stated") => true,
        other => panic!("an unknown bound: {other:?}"),
    };
    meets(value) && (check["bound"] == "stated" || !meets(check["wrong"][1].as_f64()))
}

#[test]
fn all_figures_run_and_their_verdicts_follow_from_the_numbers() {
    let folder = TempDir::new().unwrap();
    let output = krylux(folder.path(), &["reproduce", "all", "--quick", "--json", "-o", "run"]);
    let summary = summary(&output);
    let figures = summary["figures"].as_array().unwrap();
    let names: Vec<&str> = figures.iter().filter_map(|figure| figure["figure"].as_str()).collect();
    assert_eq!(names, FIGURES);

    let run = folder.path().join("run");
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    let table = std::fs::read_to_string(run.join("figures.md")).unwrap();
    assert!(
        table.contains("`krylux reproduce all --quick --json -o run`") && table.contains("quick run"),
        "{table}"
    );
    let mut all_met = true;
    for figure in figures {
        let name = figure["figure"].as_str().unwrap();
        let checks = figure["checks"].as_array().unwrap();
        assert!(checks.iter().any(|check| check["bound"] != "stated"), "{name} is held to nothing");
        for check in checks {
            assert_eq!(check["met"], is_met(check), "{name}: {check}");
            // Every bound is tried on a wrong answer, which must miss it.
            let wrong = check["wrong"][0].as_str();
            assert!(check["bound"] == "stated" || wrong.is_some(), "{name}: {check}");
            let cause = check["cause"].as_str().unwrap();
            assert!(!cause.contains("proves nothing"), "{name}: {check}");
            assert_eq!(cause.is_empty(), is_met(check), "{name}: {check}");
        }
        let named: std::collections::BTreeSet<&str> =
            checks.iter().filter_map(|check| check["what"].as_str()).collect();
        assert_eq!(named.len(), checks.len(), "{name}: two numbers have one name");
        let met = checks.iter().all(is_met);
        assert_eq!(figure["met"], met, "{name}");
        all_met &= met;
        let title = match name.strip_prefix("fig") {
            Some(number) => format!("Figure {number}: "),
            None => krylux::paper::Figure::ALL
                .into_iter()
                .find(|figure| figure.name() == name)
                .unwrap()
                .title()
                .into(),
        };
        let is_title = |line: &&str| line.starts_with("<h2") && line.contains(&format!(">{title}"));
        assert!(page.lines().any(|line| is_title(&line)), "{title}");
        assert!(table.lines().any(|line| line.starts_with("## ") && line.contains(&title)), "{title}");
        assert!(figure["photos"].as_u64().is_some_and(|photos| photos > 0), "{name}");
    }
    // Small pictures may miss bounds that pictures of full size meet. A quick run says so in its numbers, and is none the worse.
    assert_eq!(summary["met"], all_met);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(page.matches("class=\"claim\"").count(), FIGURES.len());
    assert_eq!(page.contains("not met"), !all_met);

    let record: Value = serde_json::from_slice(&std::fs::read(run.join("run.json")).unwrap()).unwrap();
    assert_eq!(record["status"], "done");
    for file in record["outputs"].as_array().unwrap() {
        let path = run.join(file.as_str().unwrap());
        assert!(path.is_file(), "{} is listed and not there", path.display());
    }
}

#[test]
fn a_rig_counts_its_frames_and_the_methods_are_shown_over_them() {
    let folder = TempDir::new().unwrap();
    let output =
        krylux(folder.path(), &["reproduce", "fig11", "--quick", "--rig", "both", "--json", "-o", "run"]);
    let figures = summary(&output)["figures"].as_array().unwrap().clone();
    let of = |rig: &str| figures.iter().find(|figure| figure["rig"] == rig).unwrap();
    let counted = |figure: &Value| -> Vec<f64> {
        let checks = figure["checks"].as_array().unwrap();
        let is_count = |check: &&Value| check["what"].as_str().unwrap().starts_with("frames of ");
        checks.iter().filter(is_count).filter_map(|check| check["value"].as_f64()).collect()
    };
    assert_eq!((of("ideal")["frames"].as_u64(), counted(of("ideal")).len()), (Some(0), 0));
    // Five photos of each of three methods, two takes each at the least; MINRES' patterns are signed, and take two photos each from the second on.
    let frames = counted(of("virtual"));
    assert!(frames.len() == 3 && frames.iter().all(|frames| *frames >= 10.0), "{frames:?}");
    assert!(of("virtual")["frames"].as_f64().unwrap() > frames.iter().sum(), "{frames:?}");
    let page = std::fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    assert!(page.contains("at equal frames") && page.contains(">frames</text>"));
}

#[test]
fn photos_are_strips_in_their_order() {
    let folder = TempDir::new().unwrap();
    krylux(folder.path(), &["reproduce", "fig9", "--quick", "-q", "-o", "run"]);
    let page = std::fs::read_to_string(folder.path().join("run/report.html")).unwrap();
    let at = |number: u32| page.find(&format!("aria-label=\"photo {number}\"")).unwrap();
    assert!((1..50).all(|number| at(number) < at(number + 1)), "50 photos in order");
}

#[test]
fn unknown_figures_are_refused_by_name() {
    let folder = TempDir::new().unwrap();
    let output = krylux(folder.path(), &["reproduce", "fig3"]);
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(text.contains("fig3") && text.contains("fig13"), "{text}");
}
