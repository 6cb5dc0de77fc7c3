//! Separation, relighting, probing and comparison as a user meets them: outputs, messages, exit status.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::{root, scene_path};
use krylux::image::{Image, Resolution};
use krylux::io::{npy, picture};
use tempfile::TempDir;

/// A folder, and the program at work in it.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        Self { folder: TempDir::new().expect("a temporary folder can be made") }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn name(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_krylux"));
        // A test's runs on one scene share one trace.
        command.env("KRYLUX_CACHE", self.path("cache")).args(arguments);
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program is built with the tests")
    }

    /// Its machine summary, when all is well.
    fn json(&self, arguments: &[&str]) -> serde_json::Value {
        let output = self.run(&[arguments, &["--json"]].concat());
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
        serde_json::from_slice(&output.stdout).expect("--json prints JSON")
    }

    /// An error of exit status 2 whose message holds all of `parts`.
    fn assert_error(&self, arguments: &[&str], parts: &[&str]) {
        let output = self.run(arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        for part in parts {
            assert!(message.contains(part), "{arguments:?}: `{part}` is missing in: {message}");
        }
    }

    fn plane(&self, name: &str) -> Vec<f64> {
        picture::read(&self.path(name)).expect("it is written").plane(0)
    }
}

fn scene(name: &str) -> String {
    scene_path(name).display().to_string()
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().expect("it is a number")
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|value| value * value).sum::<f64>().sqrt()
}

fn relative(found: &[f64], truth: &[f64]) -> f64 {
    norm(found.iter().zip(truth).map(|(found, truth)| found - truth)) / norm(truth.iter().copied())
}

#[test]
fn light_is_separated_exactly_where_a_simulator_knows_it() {
    let bench = Bench::new();
    let (out, white) = (bench.name("run"), bench.name("white.npy"));
    let traced = ["--size", "32", "--spp", "32"];
    let cornell = scene("cornell");
    let arguments = ["separate", &cornell, "--bounces", "--sigma", "3", "--probes", "60", "-o", &out];
    let found = bench.json(&[&arguments[..], &traced].concat());
    assert_eq!((&found["method"], &found["photos"]), (&"exact".into(), &0.into()));
    bench.json(&[&["photo", &cornell, "--channels", "luma", "-o", &white], &traced[..]].concat());
    let white = bench.plane("white.npy");
    let image = |name: &str| bench.plane(&format!("run/{name}.npy"));
    let total = |parts: &[&str]| -> Vec<f64> {
        let parts: Vec<Vec<f64>> = parts.iter().map(|name| image(name)).collect();
        (0..white.len()).map(|i| parts.iter().map(|part| part[i]).sum()).collect()
    };
    // Every split adds up to the white photo; files and matrix are of 32-bit floats.
    for parts in [
        &["direct", "global"][..],
        &["direct", "second", "rest"],
        &["direct", "near-indirect", "far-indirect"],
    ] {
        assert!(relative(&total(parts), &white) < 1e-5, "{parts:?}");
    }
    // Probing is as far from what the matrix says as it tells; wide patterns leave some tens of independent values.
    let [error, noise] = ["near_indirect_error", "near_indirect_noise"].map(|name| number(&found[name]));
    assert!((0.6..1.6).contains(&(error / noise)), "{error} {noise}");
    for name in ["direct.exr", "global.png", "near-indirect.png", "report.html", "run.json"] {
        assert!(bench.path("run").join(name).exists(), "{name}");
    }
}

#[test]
fn a_separation_by_photos_tells_its_error_and_can_miss_a_threshold() {
    let bench = Bench::new();
    let (corner, out) = (scene("corner"), bench.name("run"));
    let traced = ["--size", "32", "--spp", "32", "--probes", "0"];
    let arguments = ["separate", &corner, "--by", "checkerboards", "--channels", "rgb", "-o", &out];
    let found = bench.json(&[&arguments[..], &traced].concat());
    assert_eq!((&found["photos"], &found["photos_near_far"]), (&16.into(), &0.into()));
    let error = number(&found["relative_error"]);
    let [direct, exact] = ["direct", "exact"].map(|name| bench.plane(&format!("run/{name}.npy")));
    // White paper: all channels are alike, so one has the error of all three.
    assert!((relative(&direct, &exact) - error).abs() < 1e-4, "{error}");
    let strict = [&["separate", &corner, "--by", "sinusoids", "--max-error", "1e-9", "-o"], &traced[..]];
    let out = bench.name("strict");
    let arguments = [&strict[0][..6], &["-o", &out], strict[1]].concat();
    let output = bench.run(&arguments);
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    bench.assert_error(
        &[
            &[
                "separate",
                &corner,
                "--by",
                "checkerboards",
                "--square",
                "1",
                "--shifts",
                "3",
                "-o",
                &bench.name("e"),
            ],
            &traced[..],
        ]
        .concat(),
        &["--square", "3 places"],
    );
}

#[test]
fn every_method_is_compared_with_the_first_bounce_and_fails_on_a_mirror_ball_as_known() {
    let bench = Bench::new();
    let compared = |name: &str| {
        let (scene, out) = (scene(name), bench.name(name));
        let traced = ["--size", "32", "--spp", "32", "--probes", "0"];
        bench.json(&[&["separate", &scene, "--compare", "-o", &out], &traced[..]].concat())["comparison"]
            .clone()
    };
    let error = |rows: &serde_json::Value, method: &str, photos: u64| {
        let mut rows = rows.as_array().expect("rows").iter();
        let row =
            rows.find(|row| row["method"] == method && row["photos"] == photos).expect("it is compared");
        number(&row["error"])
    };
    let room = compared("cornell");
    let ball = compared("mirror-ball");
    // A matte room: a few per cent. The ball throws the squares about as sharp as the projector does.
    assert!(error(&room, "checkerboards", 16) < 0.06, "{room}");
    assert!(error(&ball, "checkerboards", 16) > 2.0 * error(&room, "checkerboards", 16), "{ball}");
    // The variance of random patterns falls as one over the photos, beyond the bias that stays: light that returns to its own
    // pixel. From 4 to 32 of them that is to a tenth of what 128 do not take away; chance leaves it below a quarter.
    let excess = |photos| error(&ball, "random", photos).powi(2) - error(&ball, "random", 129).powi(2);
    assert!(excess(33) < 0.25 * excess(5), "{ball}");
    let csv = std::fs::read_to_string(bench.path("mirror-ball/errors.csv")).expect("it is written");
    assert_eq!(csv.lines().count(), 1 + ball.as_array().expect("rows").len());
    let page = std::fs::read_to_string(bench.path("mirror-ball/report.html")).expect("it is written");
    assert!(page.contains("Every method at several photo counts") && page.contains("<svg"));
}

/// A photo of the program's own.
fn photograph(bench: &Bench, scene: &str, pattern: &str, traced: &[&str], file: &str) -> Vec<f64> {
    let path = bench.name(file);
    let arguments =
        ["photo", scene, "--pattern", pattern, "--channels", "luma", "--operator", "replay", "-o", &path];
    bench.json(&[&arguments[..], traced].concat());
    bench.plane(file)
}

#[test]
fn a_captured_scene_is_relit_later_without_a_photo_and_without_a_device() {
    let bench = Bench::new();
    let (cornell, out, later) = (scene("cornell"), bench.name("run"), bench.name("later"));
    let traced = ["--size", "32", "--spp", "64"];
    let truth = photograph(&bench, &cornell, "checker:8", &traced, "true.npy");
    let arguments =
        ["relight", &cornell, "--photos", "30", "--pattern", "checker:8", "-o", &out, "--max-error", "0.05"];
    let found = bench.json(&[&arguments[..], &traced].concat());
    let error = number(&found["relit"][0]["relative_error"]);
    let relit = bench.plane("run/relit-1.npy");
    // The truth of the same light paths has the noise that is in the model; its error is by others.
    let of_same_light = relative(&relit, &truth);
    assert!(error > of_same_light && error < of_same_light + 0.05, "{error} {of_same_light}");
    assert!(number(&found["relit"][0]["stated_error"]) > 0.2 * error, "{found}");
    // W Qᵀ has this rank, so that the best matrix of this rank is at least as good; symmetry can only add knowledge.
    let row = &found["matrix"];
    assert!(number(&row["one_sided"]) >= number(&row["optimal"]), "{row}");
    assert!(number(&row["error"]) <= number(&row["one_sided"]), "{row}");

    let photo = bench.name("true.npy");
    let arguments = [
        "relight",
        &out,
        "--pattern",
        "checker:8",
        "--pattern",
        "left",
        "--dual",
        "--inverse",
        &photo,
        "-o",
        &later,
        "--json",
    ];
    // The loader finds no driver, and so no graphics device.
    let output = bench
        .command(&arguments)
        .env("VK_ICD_FILENAMES", "/nowhere")
        .env("VK_DRIVER_FILES", "/nowhere")
        .output();
    let output = output.expect("the program is built with the tests");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let again: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&again["photos"], &again["rank"]), (&0.into(), &30.into()));
    assert_eq!(bench.plane("later/relit-1.npy"), relit, "equal questions have equal answers");
    // A coaxial rig sees what its projector would see.
    assert_eq!(bench.plane("later/dual-1.npy"), relit);
    // The photo under the checkerboard, reduced to direct light, is the direct image on the lit squares, and black on the others.
    let direct = npy::read_npy(&bench.path("run/model/direct-0.npy")).expect("it is written").values;
    let lit = |i: usize| f64::from(u8::from((i % 32 / 8 + i / 32 / 8).is_multiple_of(2)));
    let expected: Vec<f64> = direct.iter().enumerate().map(|(i, direct)| lit(i) * direct).collect();
    let error = relative(&bench.plane("later/direct-only-1.npy"), &expected);
    // The model's own error, of a few per cent of the photo, and no interreflections: without them the photo itself is off by 0.2.
    assert!(error < 0.05 && relative(&truth, &expected) > 2.0 * error, "{error}");
    bench.assert_error(&["relight", &out, "--spp", "3", "-o", &bench.name("x")], &["--spp", "taken already"]);
    bench.assert_error(&["relight", &out, "--photos", "3", "-o", &bench.name("x")], &["--photos"]);
}

#[test]
fn a_run_of_another_verb_is_relit_from_its_journal_alone() {
    let bench = Bench::new();
    let cornell = scene("cornell");
    let traced = ["--size", "32", "--spp", "64"];
    let truth = photograph(&bench, &cornell, "left", &traced, "true.npy");
    // A segmentation begins with white, as a relighting does; eigenvectors begin with random signs, which costs accuracy for pictures (3
    // and 7 % were measured). Eigenvectors of all the light spend their photos on direct light: from these it is 18 %.
    for (verb, most) in [("segment", 0.05), ("eigs", 0.1)] {
        let (out, later) = (bench.name(verb), bench.name(&format!("{verb}-relit")));
        let captured = ["--photos", "30", "-o", &out];
        let given: &[&str] = if verb == "eigs" {
            &["--method", "lanczos", "--count", "10", "--part", "global"]
        } else {
            &["--groups", "2"]
        };
        // Whether eigenpairs are resolved or groups found does not matter here.
        bench.run(&[&[verb, &cornell], &captured[..], given, &traced].concat());
        let arguments = ["relight", &out, "--pattern", "left", "-o", &later, "--json"];
        let command = &mut bench.command(&arguments);
        let output = command.env("VK_ICD_FILENAMES", "/nowhere").env("VK_DRIVER_FILES", "/nowhere").output();
        let output = output.expect("the program is built with the tests");
        assert_eq!(output.status.code(), Some(0), "{verb}: {}", String::from_utf8_lossy(&output.stderr));
        let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        assert_eq!(found["photos"], 0, "nothing is photographed");
        let rank = found["rank"].as_u64().expect("a number");
        assert!(
            (20..=31).contains(&rank),
            "{verb}: one direction a photo, and what was known before: {rank}"
        );
        let error = relative(&bench.plane(&format!("{verb}-relit/relit-1.npy")), &truth);
        println!("{verb}: relit within {error:.4} at rank {rank}");
        assert!(error < most, "{verb}: {error}");
    }
}

#[test]
fn crosstalk_of_a_colour_rig_is_measured_by_three_photos_and_taken_out() {
    let bench = Bench::new();
    let (rig, out) = (bench.name("rig.toml"), bench.name("with"));
    let text = format!(
        "kind = \"virtual\"\n[scene]\nfile = {:?}\nsize = [16, 16]\nsamples = 64\n[projector]\nchannels = 3\nbits = 12\n\
         [camera]\nchannels = 3\ncrosstalk = [[1, 0.3, 0.05], [0.1, 1, 0.25], [0.02, 0.15, 1]]\n",
        scene("corner")
    );
    std::fs::write(&rig, text).expect("the folder is writable");
    // Colours that hardly differ from gray can be had although they are mixed.
    let samples: Vec<f32> =
        (0..256).flat_map(|i| [0.5 + 0.01 * (i % 16) as f32, 0.5, 0.7 - 0.01 * (i / 16) as f32]).collect();
    let target = bench.name("target.npy");
    npy::write_npy::<f32>(Path::new(&target), &[16, 16, 3], &samples).expect("the folder is writable");
    let asked = ["--target", &target, "--channels", "rgb", "--photos", "8"];
    let seen = |name: &str, crosstalk: &[&str]| {
        let folder = bench.name(name);
        // Whether the target is reached is for the photo to say.
        let output =
            bench.run(&[&["compensate", &rig, "-o", &folder, "--json"], &asked[..], crosstalk].concat());
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code().is_some_and(|code| code < 2), "{errors}");
        let said: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let pattern = bench.name(&format!("{name}/compensation.npy"));
        let photo = bench.name(&format!("{name}.npy"));
        bench.json(&["photo", &rig, "--channels", "rgb", "--pattern", &pattern, "-o", &photo]);
        let read = |path: &str| npy::read_npy(Path::new(path)).expect("it is written").values;
        (said, relative(&read(&photo), &read(&bench.name(&format!("{name}/target.npy")))))
    };
    let ((said, with), (_, without)) = (seen("with", &["--crosstalk", "measure"]), seen("without", &[]));
    println!("crosstalk: {with:.4} of the target with, {without:.4} without");
    assert_eq!(said["photos_before"], 4, "white, red, green and blue");
    assert!(with < 0.25 * without && with < 0.03, "{with} {without}");
    let found = bench.run(&["audit", &rig, "-o", &bench.name("audit"), "--json"]);
    let found: serde_json::Value = serde_json::from_slice(&found.stdout).expect("JSON");
    let checks = found["checks"].as_array().expect("a list");
    let crosstalk = checks.iter().find(|check| check["name"] == "crosstalk").expect("it is there");
    assert!((number(&crosstalk["value"]) - 0.3).abs() < 0.01, "12 and 16 bits, no noise: {crosstalk}");
    bench.assert_error(
        &[&["compensate", &rig, "--crosstalk", "1,2,3", "-o", &out], &asked[..]].concat(),
        &["--crosstalk", "3 numbers"],
    );
}

#[test]
fn colours_and_separated_rigs_are_captured_too() {
    let bench = Bench::new();
    let cornell = scene("cornell");
    let traced = ["--size", "24", "--spp", "32"];
    let arguments = [
        "relight",
        &cornell,
        "--channels",
        "rgb",
        "--photos",
        "20",
        "--pattern",
        "left",
        "-o",
        &bench.name("rgb"),
    ];
    let found = bench.json(&[&arguments[..], &traced].concat());
    // The truth is traced by other light paths: the noise of the model's own is 3 % of white.
    assert!(number(&found["relit"][0]["relative_error"]) < 0.07, "{found}");
    assert_eq!(npy::read_npy(&bench.path("rgb/relit-1.npy")).expect("it is written").shape, [24, 24, 3]);
    let separated = root().join("tests/reference/peer/separated.glb").display().to_string();
    let arguments =
        ["relight", &separated, "--photos", "20", "--pattern", "left", "--dual", "-o", &bench.name("apart")];
    let found = bench.json(&[&arguments[..], &traced].concat());
    assert!(number(&found["relit"][0]["relative_error"]) < 0.1, "{found}");
    assert!(bench.path("apart/model/direct-0.npz").exists(), "its direct light is no diagonal");
    // Dual photography between two sizes: lit from the camera, and seen from the projector.
    let uneven = ["relight", &separated, "--projector-size", "20", "--dual", "-o", &bench.name("x")];
    let found = bench.json(&[&uneven[..], &traced].concat());
    assert!(number(&found["relit"][0]["relative_error"]) < 0.1, "{found}");
    assert_eq!(npy::read_npy(&bench.path("x/dual-1.npy")).expect("it is written").shape, [20, 20]);
    // The folder's model answers again, for another target as well.
    let again = bench.json(&["relight", &bench.name("x"), "--pattern", "left", "-o", &bench.name("y")]);
    assert_eq!(again["photos"], 0, "{again}");
    assert_eq!(npy::read_npy(&bench.path("y/relit-1.npy")).expect("it is written").shape, [24, 24]);
    let target = bench.name("target.npy");
    npy::write_npy::<f32>(Path::new(&target), &[24, 24], &[0.5; 576]).expect("the folder is writable");
    let output = bench.run(&["compensate", &bench.name("x"), "--target", &target, "-o", &bench.name("z")]);
    assert!(
        output.status.code().is_some_and(|status| status < 2),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let shape = npy::read_npy(&bench.path("z/compensation.npy")).expect("it is written").shape;
    assert_eq!(shape, [20, 20]);
}

#[test]
fn a_new_target_on_a_captured_scene_takes_no_photo_or_a_few() {
    let bench = Bench::new();
    let (corner, out) = (scene("corner"), bench.name("run"));
    let traced = ["--size", "24", "--spp", "64"];
    bench.json(&[&["relight", &corner, "--photos", "20", "-o", &out], &traced[..]].concat());
    let value = |i: usize| if (i % 24 / 6 + i / 24 / 6).is_multiple_of(2) { 0.8 } else { 0.3 };
    let target = bench.name("target.npy");
    npy::write_npy::<f32>(Path::new(&target), &[24, 24], &(0..576).map(value).collect::<Vec<_>>())
        .expect("the folder is writable");
    let arguments = ["compensate", &out, "--target", &target, "--photos", "0", "-o", &bench.name("none")];
    let none = bench.json(&arguments);
    assert_eq!(none["photos"], 0);
    // The model's promise holds on the scene itself, within the model's error: some per cent of a photo.
    let seen = photograph(&bench, &corner, &bench.name("none/compensation.npy"), &traced, "seen.npy");
    let wanted = bench.plane("none/target.npy");
    let error = relative(&seen, &wanted);
    assert!((error - number(&none["relative_residual"])).abs() < 0.04, "{error} {none}");
    assert!(error < number(&none["relative_residual_uncompensated"]), "{none}");
    // Photos correct what the model does not know.
    let arguments = [
        "compensate",
        &corner,
        "--model",
        &out,
        "--target",
        &target,
        "--photos",
        "3",
        "-o",
        &bench.name("few"),
    ];
    let few = bench.json(&[&arguments[..], &traced].concat());
    assert!((1..=3).contains(&few["photos"].as_u64().expect("a number")), "{few}");
    let seen = photograph(&bench, &corner, &bench.name("few/compensation.npy"), &traced, "seen.npy");
    let corrected = relative(&seen, &wanted);
    assert!(corrected <= error * 1.001, "{corrected} after {error}");
    assert!((corrected - number(&few["relative_residual"])).abs() < 2e-3, "{corrected} {few}");
    let wrong =
        ["compensate", &corner, "--model", &bench.name("none"), "--target", &target, "-o", &bench.name("x")];
    bench.assert_error(&[&wrong[..], &traced].concat(), &["no model in this folder"]);
}

#[test]
fn a_probed_photo_is_within_the_error_that_it_tells() {
    let bench = Bench::new();
    let cornell = scene("cornell");
    for (paths, photos) in [("near-indirect", 120), ("far", 61)] {
        let out = bench.name(paths);
        let arguments = ["probe", &cornell, "--paths", paths, "--sigma", "3", "--photos", "60", "-o", &out];
        let found = bench.json(&[&arguments[..], &["--size", "32", "--spp", "32"]].concat());
        assert_eq!(found["photos"], photos);
        let [error, standard] =
            ["relative_error", "relative_standard_error"].map(|name| number(&found[name]));
        // Wide patterns leave a dozen independent values: a quarter either way.
        assert!((0.6..1.6).contains(&(error / standard)), "{paths}: {error} {standard}");
        for name in ["probed.npy", "standard-error.npy", "exact.png", "report.html"] {
            assert!(Path::new(&out).join(name).exists(), "{name}");
        }
    }
    bench.assert_error(
        &["probe", &cornell, "--paths", "near", "--sigma", "0", "-o", &bench.name("x")],
        &["--sigma"],
    );
}

#[test]
fn a_rig_is_separated_relit_and_probed_by_its_own_photos() {
    let bench = Bench::new();
    let rig = root().join("assets/rigs/ideal.toml").display().to_string();
    let traced = ["--size", "24", "--spp", "32"];
    let found = bench.json(&[&["separate", &rig, "-o", &bench.name("separate")], &traced[..]].concat());
    assert_eq!((&found["method"], &found["photos"]), (&"checkerboards".into(), &16.into()));
    assert!(found["relative_error"].is_null(), "a rig does not know the truth");
    let out = bench.name("relight");
    let found = bench.json(&[&["relight", &rig, "--photos", "10", "-o", &out], &traced[..]].concat());
    assert_eq!(found["rank"], 10);
    let page = std::fs::read_to_string(bench.path("relight/report.html")).expect("it is written");
    assert!(page.contains("Frames"), "the page says what the rig did");
    bench.json(&[&["probe", &rig, "--photos", "6", "-o", &bench.name("probe")], &traced[..]].concat());
    for option in ["--bounces", "--compare"] {
        bench.assert_error(&["separate", &rig, option, "-o", &bench.name("x")], &[option, "rig"]);
    }
}

#[test]
fn images_are_compared_with_thresholds() {
    let bench = Bench::new();
    let image = |name: &str, offset: f32| {
        let value = |i: usize| 0.25 + 0.5 * ((i % 16) as f32 / 16.0) + offset * ((i % 3) as f32 - 1.0);
        let image =
            Image::new(Resolution::new(16, 16), 1, (0..256).map(value).collect()).expect("256 pixels");
        picture::write(&bench.path(name), &image).expect("the folder is writable");
        bench.name(name)
    };
    let (a, b) = (image("a.npy", 0.01), image("b.exr", 0.0));
    let diff = bench.name("diff.npy");
    let found = bench.json(&["compare", &a, &b, "--range", "1", "-o", &diff, "-o", &bench.name("diff.png")]);
    // Two pixels of three differ by 0.01; f32.
    let rmse = (2.0_f64 / 3.0 * 170.67 / 170.67).sqrt() * 0.01;
    assert!((number(&found["rmse"]) - rmse).abs() < 2e-5, "{found}");
    assert!((number(&found["psnr"]) + 20.0 * number(&found["rmse"]).log10()).abs() < 1e-9);
    assert!(number(&found["ssim"]) > 0.9 && found["alike"] == true);
    assert!((bench.plane("diff.npy")[0] + 0.01).abs() < 1e-6 && bench.path("diff.png").exists());
    let status = |arguments: &[&str]| bench.run(&[&["compare"], arguments].concat()).status.code();
    assert_eq!(status(&[&a, &a, "--max-rmse", "0", "--min-psnr", "1000"]), Some(0));
    for threshold in [
        ["--max-relative-rmse", "0.001"],
        ["--max-rmse", "0.001"],
        ["--min-psnr", "60"],
        ["--min-ssim", "0.99999"],
    ] {
        assert_eq!(status(&[&a, &b, threshold[0], threshold[1]]), Some(1), "{threshold:?}");
    }
    let other = bench.name("other.npy");
    npy::write_npy(Path::new(&other), &[8, 8], &[0.5_f32; 64]).expect("the folder is writable");
    bench.assert_error(&["compare", &a, &other], &["a.npy", "16x16", "8x8"]);
    bench.assert_error(&["compare", &other, &other, "--min-ssim", "0.5"], &["--min-ssim", "11x11"]);
}

/// The zigzag, which the projector lights from 10 cm to the right of the camera.
fn apart(bench: &Bench) -> Vec<String> {
    let poses = "[camera]\nposition = [0.0, 0.0, 0.0]\nforward = [0.0, 0.0, -1.0]\nvertical_fov_degrees = 50.0\n\
                 [projector]\nposition = [0.1, 0.0, 0.0]\nforward = [0.0, 0.0, -1.0]\nvertical_fov_degrees = 50.0\n";
    std::fs::write(bench.path("poses.toml"), poses).expect("the folder is writable");
    let more = ["--camera-file", &bench.name("poses.toml"), "--size", "32", "--spp", "64"].map(str::to_owned);
    [scene("zigzag")].into_iter().chain(more).collect()
}

#[test]
fn a_rig_apart_is_segmented_there_and_back_and_has_singular_values() {
    let bench = Bench::new();
    let apart = apart(&bench);
    let source: Vec<&str> = apart.iter().map(String::as_str).collect();
    let arguments = ["--photos", "50", "--groups", "2", "-o", &bench.name("groups")];
    let found = bench.json(&[&["segment"], &source[..], &arguments].concat());
    let photos = found["photos"].as_u64().expect("a number");
    assert!(found["there_and_back"] == true && photos <= 50 && photos.is_multiple_of(2), "{found}");
    // The sheets exchange no light. A pixel in a hundred, at their border, sees both of them.
    assert!(number(&found["adjusted_rand_index"]["2"]) > 0.9, "{found}");
    for what in [&["--evidence"][..], &["--direct", "patterns"]] {
        let elsewhere = bench.name(what[0]);
        let asked = [&["segment"], &source[..], what, &["--groups", "2", "-o", &elsewhere]].concat();
        bench.assert_error(&asked, &[what[0], "stand"]);
    }

    let arguments = ["--singular", "--count", "3", "--photos", "60", "-o", &bench.name("singular")];
    let found = bench.json(&[&["eigs"], &source[..], &arguments].concat());
    let values: Vec<f64> = found["singular_values"].as_array().expect("a list").iter().map(number).collect();
    assert!(values.len() == 3 && values.is_sorted_by(|a, b| a >= b) && values[2] > 0.0, "{found}");
    // The transpose of a matrix in memory is exact.
    assert!(number(&found["disagreement"]) < 1e-12, "{found}");
    for name in ["left-vectors", "right-vectors"] {
        let vectors = npy::read_npy(&bench.path(&format!("singular/{name}.npy"))).expect("it is written");
        assert_eq!(vectors.shape, [3, 32, 32]);
    }
    assert!(bench.path("singular/right-01.png").exists() && bench.path("singular/report.html").exists());
    // Patterns of a coaxial rig are their own photos: its singular values are the magnitudes of its eigenvalues.
    let traced = ["--size", "24", "--spp", "32", "--part", "global", "--photos", "80", "--no-check"];
    let corner = scene("corner");
    let of = |more: &[&str], out: &str| {
        bench.json(
            &[&["eigs", &corner, "--count", "2"], &traced[..], more, &["-o", &bench.name(out)]].concat(),
        )
    };
    let (singular, symmetric) = (of(&["--singular"], "coaxial"), of(&[], "pairs"));
    for k in 0..2 {
        let [sigma, lambda] = [&singular["singular_values"][k], &symmetric["eigenvalues"][k]].map(number);
        // Both are rounded to their standard errors, which are some per cent at most.
        assert!((sigma - lambda.abs()).abs() < 0.05 * sigma, "{sigma} {lambda}");
    }
}

#[test]
fn planned_methods_are_compared_at_equal_frames() {
    let bench = Bench::new();
    npy::write_npy::<f32>(&bench.path("target.npy"), &[16, 16], &[0.5; 256]).expect("the folder is writable");
    let rig = root().join("assets/rigs/ideal.toml").display().to_string();
    let question = ["compensate", "--target", &bench.name("target.npy"), "--photos", "4"];
    let found = bench.json(
        &[
            &["plan", &rig, "--size", "16", "--spp", "16", "--trials", "1", "--compare-methods"],
            &question[..],
        ]
        .concat(),
    );
    let trial = &found["trials"][0];
    let methods = trial["methods"].as_array().expect("a list");
    let frames = number(&trial["frames"]);
    assert!(methods.len() > 5 && methods.iter().all(|method| number(&method["frames"]) >= frames), "{found}");
    // The method that sets the common number of frames is compared by all of its photos.
    let least = methods.iter().find(|method| number(&method["frames"]) == frames).expect("one has fewest");
    let [seen, last] = ["at_equal_frames", "residual"].map(|name| number(&least[name]));
    // Two photos of one pattern: they differ by rounding to levels and counts.
    assert!((seen - last).abs() < 0.05 * last, "{least}");
    assert!(found["figures"]["krylov-box: residual at equal frames"].is_object(), "{found}");
    bench.assert_error(
        &["plan", &rig, "--size", "16", "--compare-methods", "segment"],
        &["--compare-methods"],
    );
}
