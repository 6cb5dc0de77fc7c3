//! Benches that see nothing, too much or something else, or whose lamp fails: no verb ends with status 0 or leaves a green page.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde_json::Value;
use tempfile::TempDir;

use super::support::{folder, inside, krylux, text};
use crate::program::rooms;
use krylux::io::{npy, sparse};
use krylux::sparse::Csr;

/// Pixels of the projector on a side.
const SIDE: usize = 12;

/// The questions to every bench; `FOLDER` is the folder of the test.
const QUESTIONS: [&str; 7] = [
    "segment RIG --photos 16 --groups 2",
    "eigs RIG --photos 10",
    "eigs RIG --photos 10 --part global",
    "compensate RIG --target FOLDER/target.npy --photos 10",
    "separate RIG",
    "relight RIG --photos 10 --block 4",
    "probe RIG --photos 10",
];

/// A rig before two rooms with a camera of two by two pixels for each of the projector's; `more` are lines of its file, by table, and take
/// the place of its own.
fn rig(folder: &TempDir, seed: u64, more: &[(&str, String)]) -> String {
    let path = folder.path().join("rig.toml");
    let mut text = format!("kind = \"virtual\"\nseed = {seed}\n");
    let own = [
        ("scene", "matrix = \"rooms.npz\""),
        ("scene", "size = [12, 12]"),
        ("projector", "bits = 10"),
        ("camera", "size = [24, 24]"),
        ("camera", "bits = 12"),
        ("camera", "black_level = 64"),
        ("camera", "full_well = 30000"),
        ("camera", "shot_noise = true"),
        ("camera", "read_noise = 6"),
        ("camera", "exposures = [1e-4, 1.0]"),
    ];
    for table in ["scene", "projector", "camera", "ambient", "drift", "measurement"] {
        text += &format!("[{table}]\n");
        let key = |line: &str| line.split('=').next().unwrap_or_default().trim().to_owned();
        let replaced = |line: &str| more.iter().any(|(of, other)| *of == table && key(other) == key(line));
        own.iter()
            .filter(|(of, line)| *of == table && !replaced(line))
            .for_each(|(_, line)| text += &format!("{line}\n"));
        more.iter().filter(|(of, _)| *of == table).for_each(|(_, line)| text += &format!("{line}\n"));
    }
    std::fs::write(&path, text).expect("the folder can be written");
    path.display().to_string()
}

fn scene(folder: &TempDir) {
    sparse::write(&folder.path().join("rooms.npz"), &rooms(SIDE, 40.0)).expect("the folder can be written");
    let striped: Vec<f64> =
        (0..SIDE * SIDE).map(|pixel| 0.4 + 0.2 * f64::from(u8::from(pixel % 3 == 0))).collect();
    npy::write_npy(&folder.path().join("target.npy"), &[SIDE, SIDE], &striped)
        .expect("the folder can be written");
}

/// The exit status, what was printed on both streams, and the class of the page's verdict, where there is a page.
fn asked(question: &str, rig: &str, folder: &TempDir) -> (i32, String, Option<String>) {
    let out = inside(folder, "out");
    let question = question.replace("RIG", rig).replace("FOLDER", &folder.path().display().to_string());
    let words: Vec<&str> = question.split(' ').chain(["--overwrite", "-o", &out]).collect();
    let output = krylux(&words);
    let status = output.status.code().unwrap_or(-1);
    let page = std::fs::read_to_string(Path::new(&out).join("report.html")).ok().filter(|_| status < 2);
    let class =
        page.and_then(|page| Some(page.split("class=\"verdict ").nth(1)?.split('"').next()?.to_owned()));
    (status, text(&output.stdout) + &text(&output.stderr), class)
}

/// A bench of this kind, by chance.
fn bad(kind: usize, random: &mut Pcg64) -> (&'static str, Vec<(&'static str, String)>) {
    let mut between = |low: f64, high: f64| random.random_range(low..high);
    let capped = |by: f64| ("camera", format!("white_exposure = {:e}", 10_f64.powf(by)));
    let sign = if between(-1.0, 1.0) > 0.0 { 1.0 } else { -1.0 };
    match kind {
        0 => (
            "lens cap",
            vec![capped(between(4.5, 7.0)), ("camera", format!("read_noise = {}", between(0.0, 30.0)))],
        ),
        1 => (
            "lens cap on a camera of 8 bits",
            vec![
                capped(between(5.0, 7.0)),
                ("camera", "bits = 8".into()),
                ("camera", "black_level = 3".into()),
            ],
        ),
        2 => (
            "projector off in a lit room",
            vec![capped(6.0), ("ambient", format!("level = {:e}", between(1e5, 3e6)))],
        ),
        3 => (
            "projector off and a lamp that flickers",
            vec![
                capped(6.0),
                ("ambient", format!("level = {:e}", between(3e5, 3e6))),
                ("ambient", format!("variation = {}", between(0.05, 0.9))),
                ("ambient", format!("period = {}", 10_f64.powf(between(-2.0, 0.5)))),
            ],
        ),
        4 => ("saturated", vec![("measurement", format!("exposures = [{}]", between(0.5, 0.99)))]),
        5 => ("a camera that looks past", {
            let by = [sign * between(0.4, 0.9) * SIDE as f64, between(-2.0, 2.0)];
            vec![("camera", format!("shift = [{}, {}]", by[0], by[1]))]
        }),
        6 => ("a camera that is turned", vec![("camera", format!("rotation = {}", between(60.0, 300.0)))]),
        7 => ("a camera that sees a part, or far more", {
            let scale = if sign > 0.0 { between(0.2, 0.5) } else { between(2.0, 4.0) };
            vec![("camera", format!("scale = {scale}"))]
        }),
        8 => ("a lamp that dies", vec![("drift", format!("per_hour = {}", between(-990.0, -400.0)))]),
        _ => ("noise", vec![("camera", format!("read_noise = {}", between(4000.0, 9000.0)))]),
    }
}

#[test]
fn no_bad_bench_ends_with_status_0_or_a_green_page() {
    let folder = folder();
    scene(&folder);
    let mut wrong = Vec::new();
    for bench in 0..30 {
        let mut random = Pcg64::seed_from_u64(bench);
        let (what, more) = bad(bench as usize % 10, &mut random);
        let rig = rig(&folder, bench, &more);
        for question in QUESTIONS {
            let (status, said, class) = asked(question, &rig, &folder);
            if !matches!(status, 1 | 2) || class.as_deref() == Some("good") || said.contains("NaN") {
                wrong.push(format!("{what} {more:?}: {question}: status {status}, page {class:?}\n{said}"));
            }
        }
        let output = krylux(&["rig", "check", &rig, "-o", &inside(&folder, "checked")]);
        let said = text(&output.stdout);
        let is_number = !["inf", "NaN", "-1"].iter().any(|not| said.contains(not));
        if output.status.code() != Some(1) || said.contains("can be used") || !is_number {
            wrong.push(format!("{what} {more:?}: rig check: {:?}\n{said}", output.status.code()));
        }
    }
    assert!(wrong.is_empty(), "{}:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn good_benches_are_still_answered_and_green() {
    let folder = folder();
    scene(&folder);
    let ambient = |level: f64| ("ambient", format!("level = {level}"));
    let benches: [Vec<(&str, String)>; 6] = [
        vec![],
        vec![ambient(0.5)],
        vec![("camera", "size = [12, 12]".into()), ("measurement", "black_takes = 1".into())],
        vec![
            ("camera", "bits = 8".into()),
            ("camera", "black_level = 5".into()),
            ("camera", "read_noise = 60".into()),
        ],
        vec![
            ("measurement", "ambient = false".into()),
            ("measurement", "response = false".into()),
            ("camera", "black_level = 0".into()),
        ],
        vec![("drift", "per_hour = 0.3".into()), ambient(0.05)],
    ];
    for (bench, more) in benches.iter().enumerate() {
        for seed in 0..3 {
            let rig = rig(&folder, 10 * bench as u64 + seed, more);
            for question in QUESTIONS {
                let (status, said, class) = asked(question, &rig, &folder);
                // Eigenpairs of so few photos are not all converged, which is status 1; nothing of the bench is at fault.
                let is_eigs = question.starts_with("eigs");
                let is_good = class.as_deref() == Some("good") && status == 0;
                let is_short = is_eigs && status == 1 && said.contains("finding   eigenpairs    FAILS");
                assert!(is_good || is_short, "{more:?} {seed}: {question}: {status} {class:?}\n{said}");
            }
            let output = krylux(&["rig", "check", &rig, "-o", &inside(&folder, "checked")]);
            assert_eq!(output.status.code(), Some(0), "{more:?} {seed}: {}", text(&output.stdout));
        }
    }
}

/// The photos of a failed bench fail again when they are asked anew.
#[test]
fn a_replay_has_the_findings_of_its_run() {
    let folder = folder();
    scene(&folder);
    let run = inside(&folder, "run");
    let ask = |source: &str, out: &str| {
        let output = krylux(&[
            "segment",
            source,
            "--photos",
            "16",
            "--groups",
            "2",
            "--json",
            "--overwrite",
            "-o",
            out,
        ]);
        let found: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let fails = |finding: &&Value| finding["grade"] == "fails";
        let failing =
            found["findings"].as_array().map(|all| all.iter().filter(fails).cloned().collect::<Vec<_>>());
        let names = failing
            .unwrap_or_default()
            .iter()
            .map(|of| of["name"].as_str().unwrap_or_default().to_owned())
            .collect::<Vec<_>>();
        (output.status.code(), names, text(&output.stderr))
    };
    let dying = rig(&folder, 1, &[("drift", "per_hour = -500".into())]);
    let (status, first, said) = ask(&dying, &run);
    assert!(status == Some(1) && first.iter().any(|name| name == "drift"), "{first:?} {said}");
    let (status, again, said) = ask(&run, &inside(&folder, "again"));
    assert!(status == Some(1) && again.iter().any(|name| name == "drift"), "{again:?} {said}");
    // A blind bench has photos of black and white, and never shows the pattern.
    let blind = rig(&folder, 1, &[("camera", "white_exposure = 1e5".into())]);
    for source in [blind, run.clone()] {
        let (status, _, said) = ask(&source, &run);
        assert!(status == Some(2) && said.contains("lens cap"), "{status:?} {said}");
    }
}

/// Everybody's first test: a wall sends no light to itself.
#[test]
fn a_flat_wall_needs_no_compensation_and_has_no_number_that_is_none() {
    let folder = folder();
    scene(&folder);
    let pixels = SIDE * SIDE;
    let wall = Csr::new(pixels, (0..=pixels).collect(), (0..pixels as u32).collect(), vec![1.0; pixels]);
    sparse::write(&folder.path().join("rooms.npz"), &wall.expect("well formed"))
        .expect("the folder can be written");
    npy::write_npy(&folder.path().join("target.npy"), &[SIDE, SIDE], &vec![0.5; pixels])
        .expect("the folder can be written");
    for seed in 0..3 {
        let rig = rig(&folder, seed, &[]);
        // The steps of projector and camera may leave more than the noise of the photos.
        for question in [QUESTIONS[4], QUESTIONS[6]] {
            let (status, said, _) = asked(question, &rig, &folder);
            assert!(
                status == 0 && !said.contains("NaN") && !said.contains("inf "),
                "{seed}: {status} {said}"
            );
        }
        for method in ["krylov-box", "minres", "gmres", "fista", "jacobi"] {
            let question = format!(
                "compensate RIG --target FOLDER/target.npy --photos 12 --rtol 0.02 --method {method}"
            );
            let (status, said, class) = asked(&question, &rig, &folder);
            assert!(
                status == 0 && class.as_deref() == Some("good"),
                "{seed} {method}: {status} {class:?} {said}"
            );
            assert!(!said.contains("use --method") && !said.contains("worse"), "{method}: {said}");
        }
    }
}
