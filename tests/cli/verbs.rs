//! The program as a user meets it: outputs, messages, exit status.

use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::scene_path;
use crate::program::{self, command, folder, inside, text};
use krylux::io::{npy, picture};
use tempfile::TempDir;

fn run(arguments: &[&str]) -> Output {
    command(arguments).output().expect("the program is built with the tests")
}

fn zigzag() -> String {
    scene_path("zigzag").display().to_string()
}

/// Asserts an error of exit status 2 whose message holds all of `parts`.
#[track_caller]
fn assert_error(arguments: &[&str], parts: &[&str]) {
    program::assert_error(&run(arguments), parts);
}

#[test]
fn segment_leaves_everything_a_reader_needs() {
    let folder = folder();
    let out = inside(&folder, "run");
    let output = run(&[
        "segment",
        &zigzag(),
        "--size",
        "32x24",
        "--spp",
        "64",
        "--photos",
        "20",
        "--groups",
        "2,4",
        "--eigenvectors",
        "5",
        "--json",
        "-o",
        &out,
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON");
    assert_eq!(summary["photos"], 20);
    assert!(output.stderr.is_empty(), "quiet in a pipe, but: {}", text(&output.stderr));

    let out = Path::new(&out);
    let shape = |name: &str| npy::read_npy(&out.join(name)).expect("it is written").shape;
    assert_eq!(shape("eigenvalues.npy"), [5]);
    assert_eq!(shape("residuals.npy"), [5]);
    assert_eq!(shape("eigenvectors.npy"), [5, 24, 32]);
    assert_eq!(shape("degree.npy"), [24, 32]);
    for groups in [2_u8, 4] {
        let labels = npy::read_npy(&out.join(format!("labels-{groups}.npy"))).expect("it is written");
        assert_eq!(labels.shape, [24, 32]);
        for group in 0..groups {
            assert!(labels.values.contains(&f64::from(group)), "group {group} of {groups} is empty");
        }
    }
    for name in [
        "white.exr",
        "eigenvectors.exr",
        "white.png",
        "labels-2.png",
        "labels-true.png",
        "eigenvector-05.png",
    ] {
        assert!(out.join(name).exists(), "{name}");
    }
    let record = std::fs::read_to_string(out.join("run.json")).expect("a run has a record");
    let record: serde_json::Value = serde_json::from_str(&record).expect("it is JSON");
    assert_eq!((&record["status"], &record["photos"]), (&"done".into(), &20.into()));
    for name in record["outputs"].as_array().expect("the files are listed") {
        assert!(out.join(name.as_str().expect("by name")).exists(), "{name}");
    }
    let page = std::fs::read_to_string(out.join("report.html")).expect("a run has a report");
    assert!(page.contains("adjusted Rand index") && page.contains("data:image/png;base64,"));
    assert!(!page.contains("http"), "the report asks for nothing from outside");
}

#[test]
fn segment_finds_the_folds_of_the_zigzag_at_50_photos() {
    for size in ["64", "100"] {
        let folder = folder();
        let arguments = ["--spp", "128", "--photos", "50", "--groups", "2", "--min-rand-index", "0.99"];
        let mut command = command(&["segment", &zigzag(), "--size", size, "-o", &inside(&folder, "run")]);
        let output = command.args(arguments).output().expect("the program is built with the tests");
        assert_eq!(
            output.status.code(),
            Some(0),
            "at {size}: {}{}",
            text(&output.stdout),
            text(&output.stderr)
        );
    }
}

#[test]
fn segment_finds_them_at_20_photos_too() {
    for seed in ["0", "1", "2"] {
        let folder = folder();
        let arguments =
            ["--spp", "256", "--photos", "20", "--groups", "2", "--min-rand-index", "0.99", "--seed", seed];
        let mut command = command(&["segment", &zigzag(), "--size", "64", "-o", &inside(&folder, "run")]);
        let output = command.args(arguments).output().expect("the program is built with the tests");
        assert_eq!(
            output.status.code(),
            Some(0),
            "seed {seed}: {}{}",
            text(&output.stdout),
            text(&output.stderr)
        );
    }
}

#[test]
fn too_low_a_score_is_exit_status_1() {
    // Ten groups cannot be two regions; the two groups of the corner are not its two walls, which exchange light.
    let folder = folder();
    let corner = scene_path("corner").display().to_string();
    let arguments = ["--size", "32", "--groups", "2", "--min-rand-index", "0.99"];
    let mut command = command(&["segment", &corner, "-o", &inside(&folder, "run")]);
    let output = command.args(arguments).output().expect("the program is built with the tests");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(said.contains("agreement     FAILS") && said.contains("at least 0.99"), "{said}");
}

#[test]
fn equal_seeds_give_equal_files() {
    let folder = folder();
    let files = ["a.npz", "b.npz", "c.npz"].map(|name| inside(&folder, name));
    for (file, seed) in files.iter().zip(["5", "5", "6"]) {
        let output = run(&["matrix", &zigzag(), "--size", "24", "--spp", "16", "--seed", seed, "-o", file]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    }
    let [a, b, c] = files.map(|file| std::fs::read(file).expect("it is written"));
    assert!(a == b, "two runs with one seed differ");
    assert!(a != c, "another seed changed nothing");
}

#[test]
fn photos_by_replay_and_by_retracing_agree() {
    let folder = folder();
    let photo = |operator: &str| {
        let file = inside(&folder, &format!("{operator}.npy"));
        let cornell = scene_path("cornell").display().to_string();
        let arguments =
            ["--size", "32", "--spp", "16", "--pattern", "checker:4", "--operator", operator, "-o", &file];
        let mut command = command(&["photo", &cornell]);
        let output = command.args(arguments).output().expect("the program is built with the tests");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        picture::read(Path::new(&file)).expect("it is written").samples().to_vec()
    };
    let (replayed, retraced) = (photo("replay"), photo("retrace"));
    let norm =
        |values: &mut dyn Iterator<Item = f32>| values.map(|v| f64::from(v).powi(2)).sum::<f64>().sqrt();
    let difference = norm(&mut replayed.iter().zip(&retraced).map(|(a, b)| a - b));
    // Weights are kept as f32 in the matrix: 6e-8 each.
    assert!(difference <= 1e-5 * norm(&mut retraced.iter().copied()), "{difference}");
}

#[test]
fn labels_are_the_regions_that_pixels_see() {
    let folder = folder();
    let file = inside(&folder, "labels.npy");
    let output = run(&["labels", &zigzag(), "--size", "16", "-o", &file]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let labels = npy::read_npy(Path::new(&file)).expect("it is written").values;
    // The left fold is region 0, the right one region 1, and they meet in the middle.
    let expected: Vec<f64> = (0..256).map(|pixel| if pixel % 16 < 8 { 0.0 } else { 1.0 }).collect();
    assert_eq!(labels, expected);
}

#[test]
fn eigenvalues_of_a_scene_are_those_of_its_exported_matrix() {
    let folder = folder();
    let (matrix, of_scene, of_matrix) =
        (inside(&folder, "matrix.npz"), inside(&folder, "scene"), inside(&folder, "matrix"));
    let traced = ["--size", "24", "--spp", "64"];
    let finds = ["--count", "3", "--photos", "300", "--tolerance", "1e-7"];
    let mut values = Vec::new();
    let run = |verb: &[&str], more: &[&[&str]]| {
        let mut command = command(verb);
        more.iter().for_each(|more| {
            command.args(*more);
        });
        let output = command.output().expect("the program is built with the tests");
        assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    };
    run(&["matrix", &zigzag(), "-o", &matrix], &[&traced]);
    run(&["eigs", &zigzag(), "-o", &of_scene], &[&traced, &finds]);
    run(&["eigs", &matrix, "-o", &of_matrix], &[&finds]);
    for (out, shape) in [(&of_scene, vec![3, 24, 24]), (&of_matrix, vec![3, 24, 24])] {
        let out = Path::new(out);
        assert_eq!(npy::read_npy(&out.join("eigenvectors.npy")).expect("it is written").shape, shape);
        assert!(out.join("report.html").exists() && out.join("run.json").exists());
        values.push(npy::read_npy(&out.join("eigenvalues.npy")).expect("it is written").values);
    }
    for (a, b) in values[0].iter().zip(&values[1]) {
        // The exported diagonal is the sum of two parts, rounded to f32.
        assert!((a - b).abs() <= 2.0 * f64::from(f32::EPSILON) * a, "{a} and {b}");
    }
}

#[test]
fn pairs_that_are_not_resolved_are_exit_status_1() {
    let folder = folder();
    let arguments = ["--size", "16", "--spp", "16", "--photos", "4", "--count", "4"];
    for (run, tolerance, status) in [("asked", &["--tolerance", "1e-6"][..], 1), ("not-asked", &[], 1)] {
        let mut command = command(&["eigs", &zigzag(), "-o", &inside(&folder, run)]);
        let output =
            command.args(arguments).args(tolerance).output().expect("the program is built with the tests");
        assert_eq!(output.status.code(), Some(status), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains("not resolved"));
    }
}

#[test]
fn a_system_from_files_is_solved() {
    let folder = folder();
    let [matrix, rhs] = ["A.npy", "b.npy"].map(|name| inside(&folder, name));
    npy::write_npy(Path::new(&matrix), &[2, 2], &[4.0, 1.0, 1.0, 3.0]).expect("the folder is writable");
    npy::write_npy(Path::new(&rhs), &[2], &[1.0, 2.0]).expect("the folder is writable");
    for method in ["minres", "gmres", "cg", "bicgstab", "lsqr", "lsmr", "krylov-box"] {
        let out = inside(&folder, method);
        let output = run(&["solve", &matrix, &rhs, "--method", method, "--rtol", "1e-9", "-o", &out]);
        let (said, noted) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(0), "{method}: {said}{noted}");
        let out = Path::new(&out);
        let found = npy::read_npy(&out.join("solution.npy")).expect("it is written").values;
        // x = (1, 7)/11; the residual is at most 1e-9 |b|, and |A⁻¹| < 0.5.
        for (found, exact) in found.iter().zip([1.0 / 11.0, 7.0 / 11.0]) {
            assert!((found - exact).abs() < 1.2e-9, "{method}: {found} for {exact}");
        }
        let history = std::fs::read_to_string(out.join("residuals.csv")).expect("it is written");
        assert!(history.starts_with("products,relative_residual\n1,"), "{history}");
        let record = std::fs::read(out.join("run.json")).expect("a run has a record");
        let record: serde_json::Value = serde_json::from_slice(&record).expect("it is JSON");
        assert_eq!(record["status"], "done");
        let rows = history.lines().count() as u64 - 1;
        assert_eq!(record["photos"].as_u64(), Some(rows), "{method}: a row for each product");
        assert!(record["scene"]["path"].as_str().expect("the matrix is named").ends_with("A.npy"));
        assert!(out.join("report.html").exists());
    }
    let out = inside(&folder, "short");
    let output = run(&["solve", &matrix, &rhs, "--method", "cg", "--photos", "1", "-o", &out]);
    assert_eq!(output.status.code(), Some(1), "one product is not enough for two eigenvalues");
    npy::write_npy(Path::new(&rhs), &[3], &[1.0; 3]).expect("the folder is writable");
    assert_error(&["solve", &matrix, &rhs], &["b.npy", "3 numbers", "2 rows"]);
    assert_error(&["solve", &matrix, &rhs, "--method", "magic"], &["--method", "minres"]);
}

/// A bright disc on a dark ground, at `side × side`.
fn write_target(folder: &TempDir, side: usize) -> String {
    let file = inside(folder, "target.npy");
    let value = |pixel: usize| {
        let offset = |at: usize| at as f32 / side as f32 - 0.5;
        if offset(pixel % side).hypot(offset(pixel / side)) < 0.3 { 0.8_f32 } else { 0.3 }
    };
    let values: Vec<f32> = (0..side * side).map(value).collect();
    npy::write_npy(Path::new(&file), &[side, side], &values).expect("the folder is writable");
    file
}

#[test]
fn compensate_leaves_everything_a_reader_needs() {
    let folder = folder();
    let out = inside(&folder, "run");
    let corner = scene_path("corner").display().to_string();
    let target = write_target(&folder, 24);
    let output = run(&["compensate", &corner, "--target", &target, "--size", "24", "--json", "-o", &out]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("--json prints nothing but JSON");
    let residual = summary["relative_residual"].as_f64().expect("it is a number");
    assert!(residual < summary["relative_residual_uncompensated"].as_f64().expect("a number, too"));
    let photos = summary["photos"].as_u64().expect("it is a number");
    let out = Path::new(&out);
    for name in ["compensation", "observed", "uncompensated", "target"] {
        for extension in ["npy", "exr", "png"] {
            let image = picture::read(&out.join(format!("{name}.{extension}"))).expect("it is written");
            assert_eq!((image.resolution().width, image.resolution().height), (24, 24), "{name}.{extension}");
        }
    }
    let image = |name: &str| picture::read(&out.join(name)).expect("it is written").plane(0);
    // The picture of the pattern is the pattern, in 8 bits of sRGB: steps of at most 1/255/(1.055/2.4) ≈ 0.009.
    for (eight, exact) in image("compensation.png").iter().zip(image("compensation.npy")) {
        assert!((0.0..=1.0).contains(&exact) && (eight - exact).abs() < 0.005, "{eight} {exact}");
    }
    // The residual is what the files say: in the dark, relative to the target.
    let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|value| value * value).sum::<f64>().sqrt();
    let (seen, wanted) = (image("observed.npy"), image("target.npy"));
    let misfit = norm(&mut seen.iter().zip(&wanted).map(|(a, b)| a - b)) / norm(&mut wanted.iter().copied());
    assert!((misfit - residual).abs() < 1e-6, "f32 in the files: {misfit} {residual}");
    let rows = std::fs::read_to_string(out.join("residuals.csv")).expect("it is written");
    assert!(rows.starts_with("photo,relative_residual\n1,"), "{rows}");
    assert_eq!(rows.lines().count() as u64, 1 + photos, "a row for each photo");
    let record = std::fs::read_to_string(out.join("run.json")).expect("a run has a record");
    let record: serde_json::Value = serde_json::from_str(&record).expect("it is JSON");
    assert_eq!((&record["status"], &record["photos"]), (&"done".into(), &(photos + 1).into()));
    for name in record["outputs"].as_array().expect("the files are listed") {
        assert!(out.join(name.as_str().expect("by name")).exists(), "{name}");
    }
    let page = std::fs::read_to_string(out.join("report.html")).expect("a run has a report");
    assert!(page.contains("projected Jacobi") && page.contains("data:image/png;base64,"));
    assert!(!page.contains("http"), "the report asks for nothing from outside");
}

#[test]
fn compensation_that_has_to_be_clipped_is_exit_status_1_and_says_so() {
    let folder = folder();
    let corner = scene_path("corner").display().to_string();
    let target = write_target(&folder, 16);
    // Twice the radiance of a white photo is beyond the projector.
    let common =
        ["compensate", &corner, "--target", &target, "--size", "16", "--peak", "0.6", "--overwrite", "-o"];
    for method in ["minres", "gmres", "fgmres", "cg", "cgs", "bicgstab", "lsqr", "lsmr", "mrnsd"] {
        let out = inside(&folder, method);
        let mut command = command(&common);
        let output = command.args([&out, "--method", method]).output().expect("the program is built");
        let (said, noted) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(1), "{method}: {said}{noted}");
        assert!(said.contains("before clipping its residual was"), "{method}: {said}");
        assert!(Path::new(&out).join("unclipped.npy").exists());
    }
    // Too few photos, in three colours.
    let out = inside(&folder, "few");
    let more = ["--photos", "1", "--rtol", "1e-9", "--channels", "rgb"];
    let mut command = command(&["compensate", &corner, "--target", &target, "--size", "16", "-o", &out]);
    let output = command.args(more).output().expect("the program is built");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(
        text(&output.stdout)
            .contains("photos    2, 1 of them before the solution: all allowed products are taken")
    );
    let shape = npy::read_npy(&Path::new(&out).join("compensation.npy")).expect("it is written").shape;
    assert_eq!(shape, [16, 16, 3]);
}

/// Each pixel of the photo is a square of the picture, and a larger exposure is brighter at every pixel that is neither black nor white.
#[test]
fn pictures_of_photos_have_an_exposure_and_a_scale() {
    let folder = folder();
    let z = zigzag();
    let picture = |name: &str, more: &[&str]| {
        let file = inside(&folder, name);
        let mut arguments =
            vec!["photo", &z, "--size", "8x6", "--spp", "4", "--channels", "luma", "-o", &file];
        arguments.extend(more);
        let output = run(&arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
        image::open(&file).expect("it was written").to_luma8()
    };
    let (plain, large) = (picture("a.png", &[]), picture("b.png", &["--scale", "5"]));
    assert_eq!((plain.dimensions(), large.dimensions()), ((8, 6), (40, 30)));
    assert!(large.enumerate_pixels().all(|(x, y, pixel)| pixel == plain.get_pixel(x / 5, y / 5)));
    let (dim, bright) = (picture("c.png", &["--exposure", "1"]), picture("d.png", &["--exposure", "1.5"]));
    assert!(dim.pixels().zip(bright.pixels()).all(|(a, b)| a.0[0] < b.0[0] || b.0[0] == 255 || a.0[0] == 0));
    assert!(dim.pixels().any(|pixel| pixel.0[0] > 0));
    for (option, wrong) in
        [("--exposure", "0"), ("--exposure", "bright"), ("--scale", "0"), ("--scale", "65")]
    {
        assert_error(&["photo", &z, option, wrong, "-o", &inside(&folder, "e.png")], &[option, wrong]);
    }
    let huge = ["photo", &z, "--size", "300", "--spp", "1", "--scale", "64", "-o", &inside(&folder, "e.png")];
    assert_error(&huge, &["--scale", "19200", "16384"]);
    assert!(!folder.path().join("e.png").exists());
}

#[test]
fn a_gray_target_may_have_three_channels() {
    let folder = folder();
    let (z, gray) = (zigzag(), inside(&folder, "gray.npy"));
    npy::write_npy(Path::new(&gray), &[8, 8, 3], &[0.5_f32; 8 * 8 * 3]).expect("the folder is writable");
    let out = inside(&folder, "run");
    let arguments =
        ["compensate", &z, "--size", "8", "--spp", "4", "--photos", "4", "--target", &gray, "-o", &out];
    let output = run(&arguments);
    assert!(output.status.code() < Some(2), "{}", text(&output.stderr));
    let target = npy::read_npy(&Path::new(&out).join("target.npy")).expect("it is written");
    assert_eq!(target.shape, [8, 8]);
}

#[test]
fn targets_that_cannot_be_used_are_named() {
    let folder = folder();
    let z = zigzag();
    let target = write_target(&folder, 8);
    let out = inside(&folder, "run");
    let of = |more: &[&str], parts: &[&str]| {
        let mut arguments = vec!["compensate", &z, "--size", "8", "--spp", "4", "-o", &out, "--target"];
        arguments.extend(more);
        assert_error(&arguments, parts);
    };
    let write = |name: &str, shape: &[usize], value: f32| {
        let file = inside(&folder, name);
        let values = vec![value; shape.iter().product()];
        npy::write_npy(Path::new(&file), shape, &values).expect("the folder is writable");
        file
    };
    of(&["nowhere.npy"], &["nowhere.npy"]);
    of(&[&write("small.npy", &[4, 4], 0.5)], &["small.npy", "4x4", "8x8"]);
    of(&[&write("bright.npy", &[8, 8], 2.0)], &["bright.npy", "from 0 to 1", "--peak"]);
    of(&[&write("nan.npy", &[8, 8], f32::NAN)], &["nan.npy", "NaN"]);
    of(&[&write("black.npy", &[8, 8], 0.0)], &["black.npy", "black"]);
    let coloured = inside(&folder, "coloured.npy");
    let colours: Vec<f32> = (0..8 * 8 * 3).map(|sample| [0.5, 0.25, 0.5][sample % 3]).collect();
    npy::write_npy(Path::new(&coloured), &[8, 8, 3], &colours).expect("the folder is writable");
    of(&[&coloured], &["coloured.npy", "--channels rgb"]);
    of(&[&target, "--floor", "1"], &["--floor"]);
    of(&[&target, "--peak", "0"], &["--peak"]);
    of(&[&target, "--photos", "0"], &["--photos"]);
    of(&[&target, "--method", "magic"], &["--method", "krylov-box"]);
    of(&[&target, "--precondition", "diagonal"], &["--precondition", "krylov-box"]);
    assert_error(&["compensate", &z], &["--target"]);
}

#[test]
fn without_a_vulkan_driver_the_package_is_named() {
    for arguments in [vec!["info"], vec!["photo", &zigzag(), "-o", "/dev/null/photo.npy"]] {
        let mut command = command(&arguments);
        command.env("VK_DRIVER_FILES", "/nonexistent").env("VK_ICD_FILENAMES", "/nonexistent");
        command.env("XDG_DATA_DIRS", "/nonexistent").env("XDG_CONFIG_DIRS", "/nonexistent");
        let output = command.output().expect("the program is built with the tests");
        assert_eq!(output.status.code(), Some(2));
        if arguments[0] == "info" {
            let message = text(&output.stderr);
            assert!(
                message.contains("no Vulkan adapter") && message.contains("mesa-vulkan-drivers"),
                "{message}"
            );
        }
    }
}

#[test]
fn errors_name_the_file_or_the_option() {
    let folder = folder();
    let text_file = inside(&folder, "scene.glb");
    std::fs::write(&text_file, "not a scene").expect("the folder is writable");
    let small = inside(&folder, "small.npy");
    npy::write_npy(Path::new(&small), &[4, 4], &[0.5_f32; 16]).expect("the folder is writable");
    let z = zigzag();

    assert_error(&["photo", "missing.glb"], &["cannot read missing.glb"]);
    let said = text(&run(&["photo", "missing.glb"]).stderr);
    assert_eq!(said.matches("os error").count(), 1, "the reason stands there once: {said}");
    assert_error(&["photo", &text_file], &["scene.glb"]);
    assert_error(&["photo", &z, "--camera", "nobody"], &["nobody", "camera"]);
    assert_error(&["photo", &z, "--pattern", "wihte"], &["--pattern", "checker:N"]);
    assert_error(&["photo", &z, "--size", "0"], &["--size"]);
    assert_error(&["photo", &z, "--spp", "0", "--size", "8"], &["--spp"]);
    assert_error(&["photo", &z, "--max-bounces", "99"], &["--max-bounces", "64"]);
    assert_error(&["photo", &z, "--size", "8", "--pattern", &small], &["small.npy", "4x4", "8x8"]);
    assert_error(&["photo", &z, "--size", "8", "--pattern", "pixel:8,0"], &["--pattern", "8,0"]);
    assert_error(&["photo", &z, "-o", "photo.bmp"], &["photo.bmp", ".exr"]);
    let missing = inside(&folder, "missing/photo.png");
    assert_error(&["photo", &z, "-o", &missing], &[&format!("cannot write {missing}")]);
    assert_error(&["photo", &z, "--adapter", "no such GPU"], &["no such GPU"]);
    assert_error(&["matrix", &z, "-o", "matrix.csv"], &["matrix.csv", ".npz"]);
    assert_error(&["segment", &z, "--photos", "2"], &["--photos"]);
    assert_error(&["segment", &z, "--groups", "1"], &["--groups"]);
}

#[test]
fn an_earlier_run_is_never_overwritten_unasked() {
    let folder = folder();
    let out = inside(&folder, "run");
    let segment = |more: &[&str]| {
        let mut command = command(&[
            "segment",
            &zigzag(),
            "--size",
            "8",
            "--spp",
            "4",
            "--photos",
            "5",
            "--groups",
            "2",
            "--no-check",
            "-o",
            &out,
        ]);
        command.args(more).output().expect("the program is built with the tests")
    };
    assert_eq!(segment(&[]).status.code(), Some(0));
    let again = segment(&[]);
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("already holds a run"));
    assert_eq!(segment(&["--overwrite"]).status.code(), Some(0));
}

#[test]
fn a_reader_who_leaves_is_no_fault() {
    let mut child = command(&["info", &zigzag()])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program is built with the tests");
    drop(child.stdout.take());
    let status = child.wait().expect("it was started");
    assert_eq!(status.code(), Some(0));
}

/// `kill -INT`, as Ctrl-C does it.
#[cfg(unix)]
#[test]
fn ctrl_c_stops_within_a_batch_and_says_so_in_the_record() {
    let folder = folder();
    let out = inside(&folder, "run");
    // Hours of work, if nobody stopped it.
    let mut command = command(&["segment", &zigzag(), "--size", "512", "--spp", "4096", "-o", &out]);
    let mut child = command.stderr(Stdio::piped()).spawn().expect("the program is built with the tests");
    let record = Path::new(&out).join("run.json");
    let start = Instant::now();
    while !record.exists() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(50));
    }
    std::thread::sleep(Duration::from_millis(1500));
    let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(signal.expect("every Unix has kill").success());
    let status = child.wait().expect("it was started");
    assert_eq!(status.code(), Some(130));
    let record: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&record).expect("the record is there")).expect("it is whole");
    assert_eq!(record["status"], "interrupted");
}
